#include <debias/recipe/model.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "statistics/posterior.hpp"

namespace debias {
namespace {

constexpr std::int64_t levels_predicted = 64;  // beyond the survey, that a prediction sums over
constexpr std::int64_t slow_levels_predicted = 4096;
constexpr double never_seen = 1e-6;          // least part of a difference that a base of zeros alone may be
constexpr double strata_share = 1.0 / 2;     // of the draws of a level that have no part in its base
constexpr std::int64_t fewest_members = 32;  // that run together and tell what strata leave

// E D_k^2 as it should be believed: the mean of the posterior, at most one standard deviation up.
std::vector<double> believed_squares(const Survey& s, const std::vector<Believed>& all) {
  const Evidence& e = s.evidence;
  const std::size_t levels = all.size();
  const double fall = std::exp2(-((e.exponential_work ? e.work.value : 0) + 1));
  double scale = 0;
  for (const SurveyRow& row : s.rows) {
    const double square = row.mean * row.mean + row.variance;
    if (std::isfinite(square)) scale = std::max(scale, square);
  }
  std::vector<double> a(levels);
  a[0] = s.rows.front().variance + s.rows.front().mean * s.rows.front().mean;
  double floor = 1e-30;
  const double most =
      std::clamp(std::log2(scale) + 600, 600.0, 1000.0);  // what levels may grow to, for all that is known
  for (std::size_t k = 1; k < levels; ++k) {
    a[k] = std::exp2(std::clamp(upper(e, all[k]), -1020.0, most));
    // Zeros get a floor, and so a mass; a trend does without: a steep one would find more in the floor than in itself.
    const bool has_trend = !e.courses.empty() && static_cast<std::int64_t>(k) >= e.first_usable;
    constexpr double least = std::numeric_limits<double>::min();
    floor *= fall;
    a[k] = std::max(a[k], has_trend && e.end != End::stated ? least : std::max(floor * scale, least));
  }
  return a;
}

}  // namespace

LevelModel model_of(const Survey& s, std::int64_t levels) {
  if (levels == 0) {
    // A slow decay matters for longer, until nothing is left of it.
    const double octaves = s.evidence.decay.value > 0 ? levels_predicted / s.evidence.decay.value : 0;
    const bool is_slow = !s.evidence.exponential_work && !s.evidence.courses.empty();
    const double slow = s.evidence.polynomial ? static_cast<double>(slow_levels_predicted) : octaves;
    const auto beyond =
        std::clamp(static_cast<std::int64_t>(is_slow ? slow : 0), levels_predicted, slow_levels_predicted);
    levels = s.rows.back().level + 1 + beyond;
  }
  const auto n = static_cast<std::size_t>(levels);
  LevelModel m;
  m.posterior = believed(s.evidence, levels - 1);
  const std::vector<double> a = believed_squares(s, m.posterior);
  double share = 1;  // of the variance in the second moment
  for (std::size_t k = 0; k < n; ++k) {
    const SurveyRow* row = s.row_at(static_cast<std::int64_t>(k));
    if (row != nullptr) {
      if (k > 0 && row->second_moment > 0 && row->usable) {
        share = std::clamp(row->difference_variance / row->second_moment, 0.0, 1.0);
      }
      m.work.push_back(k == 0 ? row->value_work : row->difference_work);
    } else {
      m.work.push_back(std::exp2(std::min(1000.0, log2_work(s.evidence, static_cast<std::int64_t>(k)))));
    }
    if (k == 0) {
      m.variance.push_back(s.rows[0].variance);
      m.mean_square.push_back(s.rows[0].mean * s.rows[0].mean);
    } else {
      m.variance.push_back(share * a[k]);
      m.mean_square.push_back((1 - share) * a[k]);
    }
  }
  return m;
}

double tail_exponent_for(const Survey& s) {
  const Evidence& e = s.evidence;
  // What falls like powers of 2 counts a power of the level for nothing.
  const bool polynomial = e.polynomial;
  MeasuredRates r;
  r.kind = polynomial ? RateKind::polynomial : RateKind::geometric;
  r.work_growth.value = e.exponential_work != polynomial ? std::max(0.0, e.work.value) : 0;
  const bool known = !e.courses.empty() && e.answer != Answer::no;
  r.variance_decay.value = known ? e.decay.value : std::numeric_limits<double>::quiet_NaN();
  // E D^4 by the trend of kappa, which the rates report.
  r.fourth_decay.value = std::isfinite(s.rates.fourth_decay.value)
                             ? std::min(s.rates.fourth_decay.value, 2 * r.variance_decay.value)
                             : 2 * r.variance_decay.value;
  if (e.end != End::none && !known) r.variance_decay.value = r.fourth_decay.value = Rates::faster_than_any;
  if (pmf_exists(rates_of(r))) return default_exponent(r);
  return finite_exponents(rates_of(r)).low + 0.1;  // not known, or too slow: finite work
}

namespace {

// What the differences above the base add up to. Their sizes are those of the model, whose squares are the variance that
// this is subtracted from: with others the rest could be negative. Beyond the survey they have the last sign.
double sum_above(std::int64_t base_level, const Survey& survey, const LevelModel& model) {
  double sum = 0;
  double sign = 1;
  for (auto k = static_cast<std::size_t>(base_level) + 1; k < model.size(); ++k) {
    const SurveyRow* row = survey.row_at(static_cast<std::int64_t>(k));
    if (row != nullptr && row->usable) sign = row->difference;
    sum += std::copysign(std::sqrt(model.mean_square[k]), sign);
  }
  return sum;
}

// Draws of a level as members that run together.
StrataMoments strata_of(const LevelRuns& runs, std::int64_t level, std::int64_t base_level, double draws,
                        const Plan& plan) {
  if (!(draws >= static_cast<double>(fewest_members))) return {};
  const auto n = static_cast<std::uint64_t>(draws);
  const auto members = std::min(StrataMoments::most_members, static_cast<std::int64_t>(std::bit_floor(n)));
  Plan part = plan;
  part.goal = {};
  part.samples = static_cast<std::int64_t>(n) / members;
  return runs.together(level, base_level, members, part);
}

}  // namespace

TermMoments term_moments(const LevelRuns& runs, const Survey& survey, const LevelModel& model,
                         const SingleTermForm& form, const Plan& plan, double share) {
  const SurveyRow& base = *survey.row_at(form.base_level);
  const auto first = static_cast<std::size_t>(form.first_level());
  const auto slice = [first](const std::vector<double>& v) {
    return std::vector<double>(v.begin() + static_cast<std::ptrdiff_t>(first), v.end());
  };
  TermMoments t;
  t.block = form.block;
  t.variance = slice(model.variance);
  t.mean_square = slice(model.mean_square);
  t.work = slice(model.work);
  const bool shared = form.base == Base::every_sample && runs.shared;
  const double above = sum_above(form.base_level, survey, model);
  if (form.base == Base::one_outcome) {
    t.variance[0] = base.variance;
    t.mean_square[0] = base.mean * base.mean;
    t.work[0] = base.value_work;
    // A base that is zero in every draw still has to be an outcome, and may be as rare as the difference above it.
    if (t.variance[0] + t.mean_square[0] == 0) {
      double part = never_seen;
      for (const LevelFacts& f : survey.evidence.facts) {
        if (f.level != form.base_level + 1) continue;
        part = std::max(part, statistics::chance_of_zeros(f, static_cast<double>(base.draws)));
      }
      t.variance[0] = part * (t.variance[1] + t.mean_square[1] + std::numeric_limits<double>::min());
    }
    if (t.block == 1) t.fixed_variance = -(base.mean + above) * (base.mean + above);
  } else {
    if (t.block == 1) t.fixed_variance = -above * above;
    if (!shared) {
      t.fixed_variance += base.variance;
      t.fixed_work = base.value_work;
    }
  }
  const auto row_of = [&](std::size_t k) { return survey.row_at(static_cast<std::int64_t>(k)); };
  const auto draws_of = [&](std::size_t k) { return std::ceil(share * static_cast<double>(row_of(k)->draws)); };
  if (shared) {
    double base_variance = base.variance;
    for (std::size_t k = first; k < model.size(); ++k) {
      t.covariance.push_back(0);
      if (row_of(k) != nullptr) {
        Plan part = plan;
        part.goal = {};
        part.samples = static_cast<std::int64_t>(draws_of(k));
        const SharedMoments s = runs.shared(static_cast<std::int64_t>(k), form.base_level, part);
        base_variance = s.base_variance;
        t.covariance.back() = s.covariance;
        t.work[k - first] = s.work;
      }
      t.base_variance.push_back(base_variance);
    }
  }
  if (!runs.together || t.block == 1) return t;
  // Of a level alone: the same for every base.
  const auto alone = [&](std::int64_t level) {
    const auto draws = static_cast<double>(survey.row_at(level)->draws);
    return strata_of(runs, level, level, strata_share * draws, plan);
  };
  for (std::size_t k = first; k < model.size(); ++k) {
    // Beyond the survey a level is like the last one.
    std::vector<double> base_left = t.base_left.empty() ? std::vector<double>() : t.base_left.back();
    std::vector<double> left = t.variance_left.empty() ? std::vector<double>() : t.variance_left.back();
    if (row_of(k) != nullptr) {
      const auto level = static_cast<std::int64_t>(k);
      const bool is_base = form.base == Base::one_outcome && k == first;
      // The base of a sequence that shares it is another one than I_m alone.
      if (is_base && runs.shared) {
        left.clear();
      } else {
        const StrataMoments s = runs.shared ? strata_of(runs, level, form.base_level, draws_of(k), plan) : alone(level);
        left = is_base ? s.base_left : s.difference_left;
        if (shared) base_left = s.base_left;
      }
    }
    t.variance_left.push_back(std::move(left));
    t.base_left.push_back(std::move(base_left));
  }
  if (form.base == Base::every_sample && !shared) {
    t.fixed_variance -= base.variance;
    t.base_variance.assign(t.work.size(), base.variance);
    t.base_left.assign(t.work.size(), alone(form.base_level).base_left);
  }
  return t;
}

VarianceAndWork predict(const TermMoments& moments, const AnyPmf& pmf) {
  std::vector<double> masses(moments.work.size());
  for (std::size_t j = 0; j < masses.size(); ++j) masses[j] = pmf.mass(static_cast<std::int64_t>(j));
  return predict(moments, masses);
}

double bound_of(const Survey& survey, const LevelModel& model, std::int64_t base_level) {
  const auto m = static_cast<std::size_t>(base_level);
  // A level between those that were drawn is like the one before.
  const SurveyRow* base = &survey.rows.front();
  for (const SurveyRow& row : survey.rows) base = row.level <= base_level ? &row : base;
  double roots = std::sqrt(base->variance * base->value_work);
  for (std::size_t k = m + 1; k < model.size(); ++k) roots += std::sqrt(model.variance[k] * model.work[k]);
  return roots * roots;
}

}  // namespace debias

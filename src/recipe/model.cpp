#include <debias/recipe/model.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace debias {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t levels_predicted = 64;  // beyond the survey, that a prediction sums over
constexpr std::int64_t slow_levels_predicted = 4096;
constexpr double never_seen = 1e-6;          // of a second moment, for the one of a base that showed nothing but zeros
constexpr double bend = 0.1;                 // octaves that a second moment may lie beside the fitted line
constexpr double strata_share = 1.0 / 2;     // of the draws of a level that have no part in its base
constexpr std::int64_t fewest_members = 32;  // that run together and tell what strata leave

double abscissa(double level, RateKind kind) { return kind == RateKind::polynomial ? std::log2(level + 1) : level; }

// The fitted line of log2 E D_k^2, with its error.
struct FittedDecay {
  RateKind kind;
  double at_centre = 0;
  double centre = 0;
  double slope = 0;
  double slope_error = 0;
  std::int64_t first = -1;  // level that was fitted

  [[nodiscard]] bool known() const { return first >= 0; }
  [[nodiscard]] double at(double level) const { return at_centre - slope * (abscissa(level, kind) - centre); }
  [[nodiscard]] double error(double level) const {
    return std::hypot(bend, slope_error * (abscissa(level, kind) - centre));
  }
};

double octaves(const SurveyRow& row) { return row.second_moment_error / row.second_moment / std::log(2.0); }

FittedDecay decay_of(const Survey& s) {
  FittedDecay d;
  d.kind = s.rates.kind;
  d.slope = s.rates.variance.value;
  d.slope_error = s.rates.variance.error;
  double weight = 0;
  for (const SurveyRow& row : s.rows) {
    if (!row.fitted) continue;
    const double w = 1 / (octaves(row) * octaves(row) + bend * bend);
    weight += w;
    d.centre += w * abscissa(static_cast<double>(row.level), d.kind);
    d.at_centre += w * std::log2(row.second_moment);
    if (d.first < 0) d.first = row.level;
  }
  d.centre /= weight;
  d.at_centre /= weight;
  return d;
}

// How much E D_k^2 falls from one level to the next where nothing was measured.
double cautious_fall(const MeasuredRates& rates) {
  const double work = std::isfinite(rates.work.value) ? rates.work.value : 1;
  return std::exp2(-(work + (rates.variance.value == infinity ? 1 : 0.2)));
}

// E D_k^2 as it should be believed: see the header.
std::vector<double> believed_squares(const Survey& s, std::size_t levels) {
  const FittedDecay line = decay_of(s);
  const double fall = cautious_fall(s.rates);
  double scale = 0;
  for (const SurveyRow& row : s.rows) scale = std::max(scale, row.mean * row.mean + row.variance);
  std::vector<double> a(levels);
  double seen = s.rows.front().variance;  // the last second moment of differences that are not zero
  for (std::size_t k = 0; k < levels; ++k) {
    const auto level = static_cast<double>(k);
    const SurveyRow* row = k < s.rows.size() ? &s.rows[k] : nullptr;
    if (k == 0) {
      a[0] = row->variance + row->mean * row->mean;
      continue;
    }
    const bool measured = row != nullptr && row->second_moment > 0 && std::isfinite(row->second_moment);
    const bool beyond = line.known() && static_cast<std::int64_t>(k) >= line.first;
    if (beyond && measured && row->fitted) {
      const double own = octaves(*row) * octaves(*row);
      const double lines = line.error(level) * line.error(level);
      a[k] = std::exp2((std::log2(row->second_moment) * lines + line.at(level) * own) / (lines + own));
    } else if (beyond) {
      // Hardly seen: what the line says, and its error; a few zeros or one outlier say nothing.
      a[k] = std::exp2(line.at(level) + line.error(level));
      // A line that may not fall at all predicts nothing; the law then bets on a decay that some law survives.
      if (s.law_exists == Answer::cannot_tell) a[k] = std::min(a[k], fall * a[k - 1]);
    } else if (measured && row->votes) {
      a[k] = row->second_moment;
    } else if (measured) {
      a[k] = std::max(row->second_moment + row->second_moment_error, fall * a[k - 1]);
    } else if (row != nullptr && row->second_moment == 0 && a[k - 1] == seen) {
      // The first level of zeros: with 95 % confidence a difference as large as before is no more frequent than that.
      a[k] = 3 / static_cast<double>(row->draws) * seen;
    } else {
      a[k] = fall * a[k - 1];
    }
    if (measured) seen = a[k];
    // Zeros get a floor, and so a mass. Not on the line: a steep law would find more in the floor than in the decay.
    constexpr double least = std::numeric_limits<double>::min();
    a[k] = std::max(a[k], beyond ? least : std::max(1e-30 * scale, least) * std::pow(fall, level));
  }
  return a;
}

}  // namespace

LevelModel model_of(const Survey& s, std::int64_t levels) {
  if (levels == 0) {
    levels = static_cast<std::int64_t>(s.rows.size()) +
             (s.rates.kind == RateKind::polynomial ? slow_levels_predicted : levels_predicted);
  }
  const auto n = static_cast<std::size_t>(levels);
  LevelModel m;
  const std::vector<double> a = believed_squares(s, n);
  double share = 1;  // of the variance in the second moment
  for (std::size_t k = 0; k < n; ++k) {
    if (k < s.rows.size()) {
      const SurveyRow& row = s.rows[k];
      if (k > 0 && row.second_moment > 0 && row.votes) {
        share = std::clamp(row.difference_variance / row.second_moment, 0.0, 1.0);
      }
      m.work.push_back(k == 0 ? row.value_work : row.difference_work);
    } else {
      const std::size_t last = s.rows.size() - 1;
      const double growth = s.rates.work.value > 0 && s.rates.kind != RateKind::polynomial
                                ? std::exp2(s.rates.work.value)
                                : std::max(1.0, m.work[k - 1] / m.work[k - 2]);
      m.work.push_back(last == 0 ? m.work[k - 1] : m.work[k - 1] * growth);
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

double tail_exponent_for(const MeasuredRates& r) {
  MeasuredRates known = r;
  if (!std::isfinite(known.work.value)) known.work.value = 1;
  if (law_exists(rates_of(known))) return default_exponent(known);
  return finite_exponents(rates_of(known)).low + 0.1;  // not known, or too slow: finite work
}

namespace {

// What the differences above the base add up to. Their sizes are those of the model, whose squares are the variance that
// this is subtracted from: with others the rest could be negative. Beyond the survey they have the last sign.
double sum_above(std::int64_t base_level, const Survey& survey, const LevelModel& model) {
  double sum = 0;
  double sign = 1;
  for (auto k = static_cast<std::size_t>(base_level) + 1; k < model.size(); ++k) {
    if (k < survey.rows.size() && survey.rows[k].votes) sign = survey.rows[k].difference;
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

TermMoments term_moments(const LevelRuns& runs, const Survey& survey, const LevelModel& model, const Setup& setup,
                         const Plan& plan, double share) {
  const SurveyRow& base = survey.rows.at(static_cast<std::size_t>(setup.base_level));
  const auto first = static_cast<std::size_t>(setup.first_level());
  const auto slice = [first](const std::vector<double>& v) {
    return std::vector<double>(v.begin() + static_cast<std::ptrdiff_t>(first), v.end());
  };
  TermMoments t;
  t.block = setup.block;
  t.variance = slice(model.variance);
  t.mean_square = slice(model.mean_square);
  t.work = slice(model.work);
  const bool shared = setup.base == Base::always && runs.shared;
  const double above = sum_above(setup.base_level, survey, model);
  if (setup.base == Base::drawn) {
    t.variance[0] = base.variance;
    t.mean_square[0] = base.mean * base.mean;
    t.work[0] = base.value_work;
    // A base that is zero in every draw still has to be an outcome.
    if (t.variance[0] + t.mean_square[0] == 0) {
      t.variance[0] = never_seen * (t.variance[1] + t.mean_square[1] + std::numeric_limits<double>::min());
    }
    if (t.block == 1) t.fixed_variance = -(base.mean + above) * (base.mean + above);
  } else {
    if (t.block == 1) t.fixed_variance = -above * above;
    if (!shared) {
      t.fixed_variance += base.variance;
      t.fixed_work = base.value_work;
    }
  }
  const auto draws_of = [&](std::size_t k) { return std::ceil(share * static_cast<double>(survey.rows[k].draws)); };
  if (shared) {
    double base_variance = base.variance;
    for (std::size_t k = first; k < model.size(); ++k) {
      t.covariance.push_back(0);
      if (k < survey.rows.size()) {
        Plan part = plan;
        part.goal = {};
        part.samples = static_cast<std::int64_t>(draws_of(k));
        const SharedMoments s = runs.shared(static_cast<std::int64_t>(k), setup.base_level, part);
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
    const auto draws = static_cast<double>(survey.rows[static_cast<std::size_t>(level)].draws);
    return strata_of(runs, level, level, strata_share * draws, plan);
  };
  for (std::size_t k = first; k < model.size(); ++k) {
    // Beyond the survey a level is like the last one.
    std::vector<double> base_left = t.base_left.empty() ? std::vector<double>() : t.base_left.back();
    std::vector<double> left = t.variance_left.empty() ? std::vector<double>() : t.variance_left.back();
    if (k < survey.rows.size()) {
      const auto level = static_cast<std::int64_t>(k);
      const bool is_base = setup.base == Base::drawn && k == first;
      // The base of a sequence that shares it is another one than I_m alone.
      if (is_base && runs.shared) {
        left.clear();
      } else {
        const StrataMoments s =
            runs.shared ? strata_of(runs, level, setup.base_level, draws_of(k), plan) : alone(level);
        left = is_base ? s.base_left : s.difference_left;
        if (shared) base_left = s.base_left;
      }
    }
    t.variance_left.push_back(std::move(left));
    t.base_left.push_back(std::move(base_left));
  }
  if (setup.base == Base::always && !shared) {
    t.fixed_variance -= base.variance;
    t.base_variance.assign(t.work.size(), base.variance);
    t.base_left.assign(t.work.size(), alone(setup.base_level).base_left);
  }
  return t;
}

VarianceAndWork predict(const TermMoments& moments, const AnyPmf& law) {
  std::vector<double> masses(moments.work.size());
  for (std::size_t j = 0; j < masses.size(); ++j) masses[j] = law.mass(static_cast<std::int64_t>(j));
  return predict(moments, masses);
}

double bound_of(const Survey& survey, const LevelModel& model, std::int64_t base_level) {
  const auto m = static_cast<std::size_t>(base_level);
  double roots = std::sqrt(survey.rows.at(m).variance * survey.rows[m].value_work);
  for (std::size_t k = m + 1; k < model.size(); ++k) roots += std::sqrt(model.variance[k] * model.work[k]);
  return roots * roots;
}

}  // namespace debias

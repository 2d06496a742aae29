#include "recipe/choice.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/reach.hpp>

#include "core/infinity.hpp"
#include "core/text.hpp"

namespace debias {
namespace {

constexpr double most_base_work = 64;  // of one base, in draws of the lowest
constexpr double worthwhile = 0.98;    // a deeper base has to bring 2 %
constexpr double fewest_blocks = 512;
constexpr double fewest_together = 512;  // blocks whose members run together: the longer they are, the quieter
constexpr std::int64_t largest_block = 4096;
constexpr double most_members_of_run = 0x1p61;
constexpr double shared_share = 1.0 / 8;  // of the draws of a level, to compare bases
constexpr std::size_t levels_beyond = 4;  // of the survey that the table of a PMF holds
constexpr double most_doubt = 4;          // variance by levels that no run draws, over that of all others
constexpr double price_of_fourth = 1.02;  // that a PMF with a finite fourth moment may cost
constexpr double spare_members = 4;       // that a goal may take beside the expected ones: its PMF can draw them, too
constexpr double steepest = 0.9;          // of the way from the best exponent to that of an infinite variance
constexpr double negligible = 1e-22;      // of a squared difference beside the squared value: no deeper base
constexpr double most_cancelled = 0.01;   // that a variance of base and difference is trusted to leave of theirs
constexpr double enough_draws = 16;       // of a level that was measured, in a run that can pay for them
constexpr double cheap = 0.002;           // of the work of a run, for those draws

double rounded(double x, int digits) {
  std::array<char, 32> out{};
  const auto end = std::to_chars(out.data(), out.data() + out.size(), x, std::chars_format::general, digits).ptr;
  std::from_chars(out.data(), end, x);
  return x;
}

// The chance that a member of a run with this PMF needs a level beyond the deepest.
double share_beyond(const AnyPmf& pmf, const SingleTermForm& form, std::int64_t deepest_level) {
  struct Levels {
    std::int64_t deepest;
    [[nodiscard]] std::int64_t deepest_level() const { return deepest; }
  };
  return detail::reach_of(Levels{deepest_level}, pmf, form.base_level, form.first_level()).beyond;
}

// Chooses among candidates, from one survey.
class Choice {
 public:
  Choice(const TermQuestion& question, Advice& advice)
      : runs_(question.runs),
        plan_(question.plan),
        options_(question.options),
        advice_(advice),
        survey_(advice.survey),
        model_(question.model),
        allowed_beyond_(
            detail::allowed_beyond(static_cast<double>(advice.members) * (question.has_goal ? spare_members : 1))) {}

  [[nodiscard]] std::optional<SingleTermForm> choose() {
    std::optional<SingleTermForm> chosen;
    double best = infinity;
    bool found = false;
    bool found_drawable = false;
    // Levels that look as if they had no second moment are the base of nothing, unless there are no others.
    std::int64_t deepest_pair = -1;
    for (const SurveyRow& r : survey_.rows) {
      if (survey_.row_at(r.level + 1) != nullptr) deepest_pair = r.level;
    }
    const std::int64_t with_moments = std::min(survey_.evidence.lowest_base, deepest_pair);
    const std::int64_t lowest = options_.base_level.value_or(std::max(options_.lowest_base, with_moments));
    const std::int64_t highest =
        std::max(lowest, options_.base_level.value_or(survey_.rows[survey_.rows.size() - 2].level));
    const auto first = std::find_if(survey_.rows.begin(), survey_.rows.end(), [&](const SurveyRow& r) {
      return r.level >= lowest && survey_.row_at(r.level + 1) != nullptr;
    });
    if (first == survey_.rows.end()) return {};
    const double unit = first->value_work;
    for (std::int64_t m = lowest; m <= highest; ++m) {
      if (survey_.row_at(m) == nullptr || survey_.row_at(m + 1) == nullptr) continue;  // not drawn
      if (m > lowest && row(m).value_work > most_base_work * unit) break;
      if (!has_moments(m)) continue;
      if (m > lowest && shows_nothing(m)) continue;
      if (m > lowest && exhausted(m) && exhausted(m - 1)) break;
      for (const Base base : {Base::every_sample, Base::one_outcome}) {
        if (options_.base && *options_.base != base) continue;
        const SingleTermForm form{m, base, advice_.block};
        const TermMoments moments = moments_of(form, shared_share);
        // A variance that was measured in n draws is not better than another one by its noise.
        const double enough = worthwhile - 2 * std::sqrt(2 / static_cast<double>(row(m).draws));
        // The best masses take most of the time of an advice.
        if (found_drawable && !(least_product(moments) < enough * best)) continue;
        const AnyPmf pmf = pmf_of(form, moments);
        const bool is_drawable = drawable(pmf, form);
        if (found_drawable && !is_drawable) continue;
        found = found && is_drawable == found_drawable;  // the first one that can be drawn beats all that cannot
        const double product = price_of(moments, pmf);
        if (found && !(product < enough * best)) continue;
        found = true;
        found_drawable = is_drawable;
        best = product;
        chosen = form;
      }
    }
    return chosen;
  }

  void take(const SingleTermForm& form, bool finally) {
    const TermMoments moments = moments_of(form, finally ? 1 : shared_share);
    advice_.base_level = form.base_level;
    advice_.base = form.base;
    advice_.shares_base = form.base == Base::every_sample && runs_.shared;
    advice_.price = 1;
    advice_.pmf = pmf_of(form, moments, &advice_.price);
    advice_.exponent = advice_.pmf.tail_exponent();
    // What a steep PMF divides the doubt of levels by that no run draws is not to be paid for.
    const VarianceAndWork drawn = predict(drawn_of(moments, advice_.pmf), advice_.pmf);
    advice_.predicted = predict(moments, advice_.pmf);
    if (drawn.variance > 0 && advice_.predicted.variance > most_doubt * drawn.variance) advice_.predicted = drawn;
    advice_.deepest_level = runs_.deepest_level;
    advice_.bound = bound_of(survey_, model_, form.base_level);
    advice_.highest_moment = highest_moment_of(survey_, advice_.exponent.exponent);
  }

 private:
  [[nodiscard]] Rates shown() const {
    const Evidence& e = survey_.evidence;
    const double work = e.exponential_work != e.polynomial ? std::max(0.0, e.work.value) : 0;
    const double beta = e.courses.empty() ? infinity : e.decay.value;
    return {beta, work, e.polynomial ? Decay::polynomial : Decay::geometric};
  }

  // The bounds of the exponent of a tail.
  [[nodiscard]] ExponentRange range() const { return finite_exponents(shown()); }

  [[nodiscard]] double tail_exponent() const {
    return right_for_declared(tail_exponent_for(survey_), advice_, shown(),
                              [](const Rates& rates) { return default_exponent(rates); });
  }

  // Variance x work over all levels: behind those of the model, powers of the level go on for long.
  [[nodiscard]] double with_rest(const TermMoments& moments, const AnyPmf& pmf) const {
    VarianceAndWork sums = predict(moments, pmf);
    if (survey_.evidence.polynomial) {
      const std::size_t last = moments.work.size() - 1;
      const double p = pmf.mass(static_cast<std::int64_t>(last));
      const double s = pmf.tail_exponent().exponent;
      const double levels = static_cast<double>(last) + 1;
      sums.variance += (moments.variance[last] + moments.mean_square[last]) / p * levels / (range().high - s);
      sums.work += moments.work[last] * p * levels / (s - range().low);
    }
    return sums.product();
  }

  [[nodiscard]] const SurveyRow& row(std::int64_t level) const {
    const SurveyRow* found = survey_.row_at(level);
    if (found == nullptr) throw std::out_of_range("recipe: level " + std::to_string(level) + " was not drawn");
    return *found;
  }

  // Variance x work. Where base and difference nearly cancel, what is left of the measured moments is their noise.
  [[nodiscard]] static double price_of(const TermMoments& moments, const AnyPmf& pmf) {
    VarianceAndWork net = predict(moments, pmf);
    if (!moments.covariance.empty()) {
      TermMoments gross = moments;
      gross.covariance.clear();
      net.variance = std::max(net.variance, most_cancelled * predict(gross, pmf).variance);
    }
    return net.product();
  }

  [[nodiscard]] bool has_moments(std::int64_t m) const {
    const SurveyRow& r = row(m);
    return std::isfinite(r.variance) && std::isfinite(r.mean) && r.variance < 1e300;
  }

  // Its few draws have not met what lower levels have: it is no better than these.
  [[nodiscard]] bool shows_nothing(std::int64_t m) const { return row(m).mean == 0 && row(m).variance == 0; }

  // The differences above m are next to nothing beside the value: rounding, or the end of the sequence, is near.
  [[nodiscard]] bool exhausted(std::int64_t m) const {
    const SurveyRow& next = row(m + 1);
    return next.second_moment < negligible * (next.mean * next.mean + next.variance);
  }

  [[nodiscard]] TermMoments moments_of(const SingleTermForm& form, double share) const {
    return term_moments(runs_, survey_, model_, form, plan_, share);
  }

  // A run of that many members is allowed to take the PMF, see core/reach.hpp.
  [[nodiscard]] bool drawable(const AnyPmf& pmf, const SingleTermForm& form) const {
    return share_beyond(pmf, form, runs_.deepest_level) <= allowed_beyond_;
  }

  // The best PMF, or the one next to it that can be drawn, if one of finite variance can.
  AnyPmf pmf_of(const SingleTermForm& form, const TermMoments& all, double* price = nullptr) const {
    const double exponent = tail_exponent();
    const auto with = pmfs_of(form, all);
    const AnyPmf best = with(exponent);
    if (drawable(best, form)) return best;
    const double bound = range().high;
    double high = std::isfinite(bound) ? exponent + steepest * (bound - exponent) : std::max(40.0, exponent);
    if (!(high > exponent) || !drawable(with(high), form)) {
      if (!survey_.evidence.polynomial || is_established()) return best;  // the run will be refused
      // A power of 2 explains the levels, too.
      const AnyPmf other = tables_of(form, all)(geometric_exponent());
      return drawable(other, form) ? other : best;
    }
    for (double low = exponent; high - low > 1e-3;) {
      const double middle = (low + high) / 2;
      (drawable(with(middle), form) ? high : low) = middle;
    }
    const AnyPmf pmf = with(high);
    if (price != nullptr) *price = with_rest(all, pmf) / with_rest(all, best);
    return pmf;
  }

  // The PMF for an exponent of its tail.
  [[nodiscard]] std::function<AnyPmf(double exponent)> pmfs_of(const SingleTermForm& form,
                                                               const TermMoments& all) const {
    if (survey_.evidence.polynomial) return [](double exponent) { return AnyPmf(Zeta(exponent)); };
    return tables_of(form, all);
  }

  // A power of the level, and nothing else.
  [[nodiscard]] bool is_established() const { return survey_.evidence.decay.value > 4 * survey_.evidence.decay.error; }

  // Half the decay that those courses have which fall like a power of 2.
  [[nodiscard]] double geometric_exponent() const {
    constexpr double least = 0.02;
    double sum = 0;
    double count = 0;
    for (const Course& c : survey_.evidence.courses) {
      if (c.polynomial) continue;
      sum += c.limit;
      ++count;
    }
    return std::max(least, count > 0 ? sum / count / 2 : least);
  }

  [[nodiscard]] std::function<AnyPmf(double exponent)> tables_of(const SingleTermForm& form,
                                                                 const TermMoments& all) const {
    TermMoments t = all;
    auto outcomes = static_cast<std::size_t>(survey_.rows.back().level + 1 - form.first_level()) + levels_beyond;
    // The table ends at the deepest level: what lies beyond is the tail's.
    const std::int64_t drawn = runs_.deepest_level - form.first_level() + 1;
    if (drawn > 0) outcomes = std::min(outcomes, static_cast<std::size_t>(drawn));
    for (std::vector<double>* v : {&t.variance, &t.mean_square, &t.work, &t.base_variance, &t.covariance}) {
      v->resize(std::min(v->size(), outcomes));
    }
    // A base that deep levels make quieter is worth its own variance at the first of them: else a PMF that draws
    // these for the sake of the base costs more than anyone asked for.
    if (!t.base_variance.empty()) {
      std::fill(t.base_variance.begin(), t.base_variance.end(), t.base_variance.front());
      if (!t.base_left.empty()) t.base_left.assign(t.base_left.size(), t.base_left.front());
    }
    std::vector<double> best = best_masses(t);
    // Levels beyond the drawn ones that may grow, for all that is known, are no reason for a work without end.
    for (std::size_t j = 1; j < best.size(); ++j) {
      if (form.first_level() + static_cast<std::int64_t>(j) > survey_.rows.back().level) {
        best[j] = std::min(best[j], best[j - 1]);
      }
    }
    return [this, &all, form, best = std::move(best)](double exponent) {
      return fair_or_fastest(all, best, exponent, form);
    };
  }

  AnyPmf fair_or_fastest(const TermMoments& all, std::vector<double> best, double exponent,
                         const SingleTermForm& form) const {
    // Falling no faster than the tail, the masses leave the fourth moment finite where that is possible.
    std::vector<double> even = best;
    const std::size_t free = form.base == Base::one_outcome ? 2 : 1;
    for (std::size_t j = free; j < even.size(); ++j) even[j] = std::max(even[j], even[j - 1] * std::exp2(-exponent));
    give_draws(all.work, free, form, best);
    give_draws(all.work, free, form, even);
    const AnyPmf fastest = tabulated(best, exponent);
    const AnyPmf fair = tabulated(even, exponent);
    return predict(all, fair).product() <= price_of_fourth * predict(all, fastest).product() ? fair : fastest;
  }

  // A level with a mass of less than one draw is missing from most runs, whose error then is its mean. So each level that
  // was measured gets some draws, as far as they cost next to nothing.
  void give_draws(const std::vector<double>& work, std::size_t free, const SingleTermForm& form,
                  std::vector<double>& masses) const {
    if (advice_.members <= 0) return;
    double total = 0;
    double work_of_member = 0;
    for (std::size_t j = 0; j < masses.size(); ++j) total += masses[j];
    for (std::size_t j = 0; j < masses.size(); ++j) work_of_member += masses[j] / total * work[j];
    for (std::size_t j = free; j < masses.size(); ++j) {
      const SurveyRow* measured = survey_.row_at(form.first_level() + static_cast<std::int64_t>(j));
      if (measured == nullptr || !(measured->second_moment > 0)) continue;
      const double least =
          std::min(enough_draws / static_cast<double>(advice_.members), cheap * work_of_member / work[j]);
      masses[j] = std::max(masses[j], least * total);
    }
  }

  static AnyPmf tabulated(std::vector<double> masses, double exponent) {
    // What no run will reach needs no entry.
    while (masses.size() > 1 && masses.back() < 1e-9) masses.pop_back();
    // Short and readable, and the PMF that the text names is the PMF of the run.
    for (double& mass : masses) mass = rounded(mass, 3);
    return AnyPmf(Tabulated(std::move(masses), rounded(std::exp2(-exponent), 4)));
  }

  // Of the levels that a run of so many members is likely to draw: deeper ones have no part in the variance that it shows.
  [[nodiscard]] TermMoments drawn_of(TermMoments moments, const AnyPmf& pmf) const {
    constexpr double likely = 1.0 / 16;  // draws
    const double members = std::max(static_cast<double>(advice_.members), fewest_blocks);
    for (std::size_t j = 0; j < moments.work.size(); ++j) {
      if (pmf.tail(static_cast<std::int64_t>(j)) * members >= likely) continue;
      moments.variance[j] = moments.mean_square[j] = 0;
    }
    return moments;
  }

  const LevelRuns& runs_;
  const Plan& plan_;
  const RecipeOptions& options_;
  Advice& advice_;
  const Survey& survey_;
  const LevelModel& model_;
  double allowed_beyond_;
};

}  // namespace

std::optional<SingleTermForm> choose_term(const TermQuestion& question, Advice& advice) {
  return Choice(question, advice).choose();
}

void take_term(const TermQuestion& question, const SingleTermForm& form, bool finally, Advice& advice) {
  Choice(question, advice).take(form, finally);
}

bool is_drawable(const Advice& advice, std::int64_t deepest_level, bool has_goal) {
  const double members = static_cast<double>(advice.members) * (has_goal ? spare_members : 1);
  return share_beyond(advice.pmf, {advice.base_level, advice.base, advice.block}, deepest_level) <=
         detail::allowed_beyond(members);
}

double highest_moment_of(const Survey& survey, double exponent) {
  const bool polynomial = survey.evidence.polynomial;
  // E |D / p|^q p is summable; where the levels end, or nothing is known, there is no figure.
  const double excess = survey.evidence.courses.empty() ? -1 : exponent - survey.evidence.decay.value / 2;
  return !(excess > 0) ? infinity : (polynomial ? exponent - 1 : exponent) / excess;
}

double right_for_declared(double exponent, const Advice& advice, const Rates& shown, double (*best)(const Rates&)) {
  const std::optional<Rates>& declared = advice.facts.declared;
  const End end = advice.survey.evidence.end;
  // Where no level speaks, the declared rates do.
  if (declared && end == End::none && advice.survey.evidence.courses.empty() && pmf_exists(*declared))
    return best(*declared);
  if (!declared || declared->decay != shown.decay || end == End::stated || end == End::rounding) return exponent;
  Rates both = shown;
  if (declared->variance_decay < shown.variance_decay) both.variance_decay = declared->variance_decay;
  if (declared->work_growth > shown.work_growth) both.work_growth = declared->work_growth;
  const bool differs = both.variance_decay < shown.variance_decay || both.work_growth > shown.work_growth;
  if (!differs || !pmf_exists(both)) return exponent;
  return exponent > finite_exponents(both).low ? std::min(exponent, best(both)) : best(both);
}

double fewest_blocks_of(const Advice& advice) { return advice.runs_together ? fewest_together : fewest_blocks; }

void set_members(Advice& advice, double members) {
  const double fewest = fewest_blocks_of(advice);
  advice.block = 1;
  while (advice.block < largest_block && members / static_cast<double>(2 * advice.block) >= fewest) {
    advice.block *= 2;
  }
  const double blocks = std::max(2.0, std::ceil(members / static_cast<double>(advice.block)));
  // A first pilot may ask for more than there is.
  advice.members = static_cast<std::int64_t>(std::min(blocks, most_members_of_run / largest_block)) * advice.block;
}

void refuse_cost(const Advice& advice, double members, const Goal& goal) {
  double seconds = 0;
  double work = 0;
  for (const SurveyRow& r : advice.survey.rows) {
    seconds += r.seconds * static_cast<double>(r.draws);
    work += std::max(r.difference_work, r.value_work) * static_cast<double>(r.draws);
  }
  throw std::invalid_argument("Goal: it takes " + format("%.3g", members) + " members (work " +
                              format("%.2g", members * advice.predicted.work) + ", about " +
                              format("%.2g", members * advice.predicted.work * seconds / work) + " seconds); ask for " +
                              (goal.seconds > 0 ? "fewer seconds" : "a larger error"));
}

namespace {

// |E I|, but no less than its error: by the values of the level which, with the differences above it, tells it best. Those of
// the deepest level alone are few.
double size_of(const Survey& s) {
  double size = std::abs(s.rows.back().mean);
  double least = infinity;
  double of_above = 0;  // variance of what the differences above add
  std::vector<double> above(s.rows.back().values.size());
  for (auto row = s.rows.rbegin(); row != s.rows.rend() && row->level >= s.evidence.lowest_base; ++row) {
    const auto draws = static_cast<double>(row->draws);
    const double variance = row->variance / draws + of_above;
    if (row->values.size() != above.size()) break;
    if (variance < least) {
      least = variance;
      size = 0;
      for (std::size_t c = 0; c < above.size(); ++c) size = std::hypot(size, row->values[c].mean + above[c]);
    }
    if (row->coarse.size() != above.size()) break;
    for (std::size_t c = 0; c < above.size(); ++c) above[c] += row->values[c].mean - row->coarse[c].mean;
    of_above += row->difference_variance / draws;
  }
  return least < infinity ? std::max(size, std::sqrt(least)) : size;
}

}  // namespace

double wanted_members(const Advice& advice, const Plan& plan) {
  const Goal& goal = plan.goal;
  if (!goal.asked()) return static_cast<double>(plan.samples);
  if (goal.seconds > 0) {
    double seconds = 0;
    double work = 0;
    for (const SurveyRow& r : advice.survey.rows) {
      seconds += r.seconds * static_cast<double>(r.draws);
      work += r.difference_work * static_cast<double>(r.draws);
    }
    return (Goal::aim * goal.seconds - advice.pilot_seconds) / (advice.predicted.work * seconds / work);
  }
  const double error = Goal::aim * (goal.error > 0 ? goal.error : goal.relative_error * size_of(advice.survey));
  const double members = std::max(fewest_blocks, advice.predicted.variance / (error * error));  // fewer have no error
  // What is not shown may ask for less when the pilot has seen more.
  const bool shown = advice.survey.pmf_exists == Answer::yes && advice.survey.grade == Grade::shown;
  if (members > most_affordable && shown) refuse_cost(advice, members, plan.goal);
  return members;
}

}  // namespace debias

#include <debias/recipe.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <functional>
#include <limits>
#include <map>
#include <ostream>
#include <stdexcept>
#include <utility>

#include "core/communicator.hpp"
#include "core/text.hpp"
#include "core/words.hpp"
#include "survey/pilot.hpp"

namespace debias {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double first_pilot_draws = 1 << 14;  // of the lowest level, in work
constexpr double fewest_pilot_draws = 1 << 11;
constexpr double most_pilot_draws = 1 << 26;  // in work of the lowest level, whatever a goal costs
constexpr std::int64_t first_deepest = 12;    // level, of the first stage
constexpr double open_growth = 4;             // while nothing is shown
constexpr double most_open_work = 32;         // of the pilot, for a sample of the run, in draws of the lowest level
constexpr double likely_share = 1.0 / 10;     // of the run's work, for an answer that is only likely
constexpr double most_growth = 16;            // of a pilot over the one before
constexpr int most_stages = 12;
constexpr double pilot_share = 1.0 / 32;  // of the work of the run
constexpr double most_base_work = 64;     // of one base, in draws of the lowest
constexpr double worthwhile = 0.98;       // a deeper base has to bring 2 %
constexpr double fewest_blocks = 512;
constexpr double fewest_together = 512;  // blocks whose members run together: the longer they are, the quieter
constexpr std::int64_t largest_block = 4096;
constexpr double most_members = 0x1p61;
constexpr double most_affordable = 0x1p46;  // of a goal
constexpr double shared_share = 1.0 / 8;    // of the draws of a level, to compare bases
constexpr std::size_t levels_beyond = 4;    // of the survey that the table of a PMF holds
constexpr double narrow = 0.05;             // of the work's exponent, for the PMF with finite work where none has both
constexpr double price_of_fourth = 1.02;    // that a PMF with a finite fourth moment may cost
constexpr double spare_members = 4;         // that a goal may take beside the expected ones: its PMF can draw them, too
constexpr double steepest = 0.9;            // of the way from the best exponent to that of an infinite variance
constexpr double negligible = 1e-22;        // of a squared difference beside the squared value: no deeper base
constexpr double most_cancelled = 0.01;     // that a variance of base and difference is trusted to leave of theirs
constexpr double enough_draws = 16;         // of a level that was measured, in a run that can pay for them
constexpr double cheap = 0.002;             // of the work of a run, for those draws

double rounded(double x, int digits) {
  std::array<char, 32> out{};
  const auto end = std::to_chars(out.data(), out.data() + out.size(), x, std::chars_format::general, digits).ptr;
  std::from_chars(out.data(), end, x);
  return x;
}

}  // namespace

bool Advice::usable() const { return survey.pmf_exists != Answer::no; }

namespace {

// Chooses among candidates, from one survey.
class Choice {
 public:
  Choice(const LevelRuns& runs, const Plan& plan, const RecipeOptions& options, bool has_goal, Advice& advice)
      : runs_(runs),
        plan_(plan),
        options_(options),
        advice_(advice),
        survey_(advice.survey),
        allowed_beyond_(detail::allowed_beyond(static_cast<double>(advice.members) * (has_goal ? spare_members : 1))) {
    model_ = model_of(survey_);
  }

  /// `finally` draws all that it can to compare what it chose. False: no level has values that are finite numbers, of
  /// finite variance.
  [[nodiscard]] bool choose(bool finally) {
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
    if (first == survey_.rows.end()) return false;
    const double unit = first->value_work;
    for (std::int64_t m = lowest; m <= highest; ++m) {
      if (survey_.row_at(m) == nullptr || survey_.row_at(m + 1) == nullptr) continue;  // not drawn
      if (m > lowest && row(m).value_work > most_base_work * unit) break;
      if (!has_moments(m)) continue;
      if (m > lowest && exhausted(m) && exhausted(m - 1)) break;
      for (const Base base : {Base::every_sample, Base::one_outcome}) {
        if (options_.base && *options_.base != base) continue;
        const SingleTermForm form{m, base, advice_.block};
        const TermMoments moments = moments_of(form, shared_share);
        const AnyPmf pmf = pmf_of(form, moments);
        const bool is_drawable = drawable(pmf, form);
        if (found_drawable && !is_drawable) continue;
        found = found && is_drawable == found_drawable;  // the first one that can be drawn beats all that cannot
        const double product = price_of(moments, pmf);
        // A variance that was measured in n draws is not better than another one by its noise.
        const double noise = 2 * std::sqrt(2 / static_cast<double>(row(m).draws));
        if (found && !(product < (worthwhile - noise) * best)) continue;
        found = true;
        found_drawable = is_drawable;
        best = product;
        chosen_ = form;
      }
    }
    if (found) conclude(finally ? 1 : shared_share);
    return found;
  }

 private:
  // The bounds of the exponent of a tail.
  [[nodiscard]] ExponentRange range() const {
    const Evidence& e = survey_.evidence;
    const double work = e.exponential_work != e.polynomial ? std::max(0.0, e.work.value) : 0;
    const double beta = e.courses.empty() ? infinity : e.decay.value;
    return finite_exponents({beta, work, e.polynomial ? Decay::polynomial : Decay::geometric});
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
    struct Levels {
      std::int64_t deepest;
      [[nodiscard]] std::int64_t deepest_level() const { return deepest; }
    };
    const Reach reach = detail::reach_of(Levels{runs_.deepest_level}, pmf, form.base_level, form.first_level());
    return reach.beyond <= allowed_beyond_;
  }

  // The best PMF, or the one next to it that can be drawn, if one of finite variance can.
  AnyPmf pmf_of(const SingleTermForm& form, const TermMoments& all, double* price = nullptr) const {
    const double exponent = tail_exponent_for(survey_);
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
    return [this, &all, form, best = best_masses(t)](double exponent) {
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

  void conclude(double share) {
    const TermMoments moments = moments_of(chosen_, share);
    advice_.base_level = chosen_.base_level;
    advice_.base = chosen_.base;
    advice_.shares_base = chosen_.base == Base::every_sample && runs_.shared;
    advice_.price = 1;
    advice_.pmf = pmf_of(chosen_, moments, &advice_.price);
    advice_.exponent = advice_.pmf.tail_exponent();
    advice_.predicted = predict(moments, advice_.pmf);
    advice_.deepest_level = runs_.deepest_level;
    advice_.bound = bound_of(survey_, model_, chosen_.base_level);
    const double rho = advice_.exponent.exponent;
    const bool polynomial = survey_.evidence.polynomial;
    // E |D / p|^q p is summable; where the levels end, or nothing is known, there is no figure.
    const double excess = survey_.evidence.courses.empty() ? -1 : rho - survey_.evidence.decay.value / 2;
    advice_.highest_moment = !(excess > 0) ? infinity : (polynomial ? (rho - 1) / excess : rho / excess);
  }

  const LevelRuns& runs_;
  const Plan& plan_;
  const RecipeOptions& options_;
  Advice& advice_;
  const Survey& survey_;
  LevelModel model_;
  double allowed_beyond_;
  SingleTermForm chosen_;
};

double fewest_blocks_of(const Advice& advice) { return advice.runs_together ? fewest_together : fewest_blocks; }

// A block for that many members, and the members in whole blocks.
void set_members(Advice& advice, double members) {
  const double fewest = fewest_blocks_of(advice);
  advice.block = 1;
  while (advice.block < largest_block && members / static_cast<double>(2 * advice.block) >= fewest) {
    advice.block *= 2;
  }
  const double blocks = std::max(2.0, std::ceil(members / static_cast<double>(advice.block)));
  // A first pilot may ask for more than there is.
  advice.members = static_cast<std::int64_t>(std::min(blocks, most_members / largest_block)) * advice.block;
}

// A goal that nobody will pay for.
void refuse_cost(const Advice& advice, double members) {
  double seconds = 0;
  double work = 0;
  for (const SurveyRow& r : advice.survey.rows) {
    seconds += r.seconds * static_cast<double>(r.draws);
    work += std::max(r.difference_work, r.value_work) * static_cast<double>(r.draws);
  }
  throw std::invalid_argument("Goal: it takes " + format("%.3g", members) + " members (work " +
                              format("%.2g", members * advice.predicted.work) + ", about " +
                              format("%.2g", members * advice.predicted.work * seconds / work) +
                              " seconds); ask for a larger error");
}

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
  double size = std::abs(advice.survey.rows.back().mean);
  const double error = Goal::aim * (goal.error > 0 ? goal.error : goal.relative_error * size);
  const double members = std::max(fewest_blocks, advice.predicted.variance / (error * error));  // fewer have no error
  // What is open may ask for less when the pilot has seen more.
  if (members > most_affordable && advice.survey.pmf_exists == Answer::yes) refuse_cost(advice, members);
  return members;
}

std::string levels_text(const Evidence& e) {
  return e.first_usable < 0 ? "no level" : levels_words(e.first_usable, e.last_usable);
}

Decay unit_of(const Evidence& e) { return e.polynomial ? Decay::polynomial : Decay::geometric; }

// In the unit of the decay; of an exponent of the other kind nothing is left.
FittedRate growth_of_work(const Evidence& e) { return e.exponential_work != e.polynomial ? e.work : FittedRate{}; }

// What the levels show of the decay.
std::string rate_text(const Survey& s) {
  const Evidence& e = s.evidence;
  if (e.end == End::aliased) return "the differences vanish but the value still varies";
  if (e.end == End::zeros || e.end == End::stated) return "the differences are zero beyond the first levels";
  if (e.courses.empty()) return "too few levels show their second moment";
  if (s.rates.kind == RateKind::super_exponential) return "the differences fall faster than any power";
  return decay_words("E D_k^2", e.decay, unit_of(e), levels_text(e)) + ", " +
         growth_words("work", growth_of_work(e), unit_of(e));
}

constexpr const char* what_helps =
    "a better coupling or a smoother integrand (beta up), extrapolation (alpha up), or multilevel, whose bias is "
    "stated";

void describe_none(Advice& a) {
  const Evidence& e = a.survey.evidence;
  const bool polynomial = e.polynomial;
  const double work = e.exponential_work != polynomial ? std::max(0.0, e.work.value) : 0;
  const double beta = e.decay.value;
  const double rho = work + narrow + (polynomial ? 1 : 0);
  a.pmf = polynomial ? AnyPmf(Zeta(rho)) : AnyPmf(Geometric::with_exponent(std::max(rho, narrow)));
  a.exponent = a.pmf.tail_exponent();
  const double excess = rho - beta / 2;
  a.highest_moment = !(excess > 0) ? infinity : (rho - (polynomial ? 1 : 0)) / excess;
  a.sentences.push_back("no PMF has finite variance and finite work (" + std::string(name_of(a.survey.grade)) +
                        "): " + rate_text(a.survey));
  const bool falls = beta > 0 && !is_flat(e.decay);
  std::string best = "the best with finite work is " + a.pmf.spec();
  if (std::isfinite(a.highest_moment)) {
    best += ": " + (falls || a.highest_moment <= 1 ? moments_words(a.highest_moment)
                                                   : std::string("it is open whether even the mean is finite"));
  }
  if (!polynomial && falls && work > 0) {
    best += " (stable index " + format("%.3g", std::min(2.0, 2 * work / (2 * work - beta))) +
            " in the limit), the error falls like work^-" + format("%.2g", std::min(0.5, beta / (2 * work)));
  }
  a.sentences.push_back(best);
  a.sentences.push_back(std::string("what helps: ") + what_helps);
}

void describe(Advice& a) {
  const Survey& s = a.survey;
  const double work = s.evidence.exponential_work != s.evidence.polynomial ? s.evidence.work.value : 0;
  if (s.pmf_exists == Answer::yes) {
    a.sentences.push_back("a PMF with finite variance and finite work exists (" + std::string(name_of(s.grade)) +
                          "): " + rate_text(s));
  } else {
    a.sentences.push_back("open whether a PMF has finite variance and finite work: " + rate_text(s) +
                          "; the interval allows for levels that were not seen, more samples tell more");
  }
  const char* form = a.shares_base
                         ? ", made of the draws of the difference"
                         : (a.base == Base::one_outcome ? ", one outcome of the PMF" : ", evaluated in every sample");
  a.sentences.push_back("base level " + std::to_string(a.base_level) + form + "; " +
                        (a.block > 1 ? "systematic strata in blocks of " + std::to_string(a.block)
                                     : std::string("independent samples, too few for strata")));
  const bool together = a.runs_together && a.block > 1;
  std::string efficiency = "variance " + format("%.3g", a.predicted.variance) + " x work " +
                           format("%.4g", a.predicted.work) +
                           " predicted for a member: " + format("%.3g", a.predicted.product());
  if (a.bound > 0) {
    efficiency += ", " + format("%.3g", a.predicted.product() / a.bound) +
                  " times the bound (sum of sqrt(Var D work))^2 = " + format("%.3g", a.bound) +
                  (a.shares_base || together ? " of draws that share nothing" : "");
  }
  if (together) efficiency += " and are not stratified by their first uniform";
  a.sentences.push_back(efficiency);
  const double rho = a.exponent.exponent;
  std::string moments = decay_words("the tail of the PMF", {rho, 0}, a.exponent.decay);
  if (std::isfinite(a.highest_moment)) moments += ": " + moments_words(a.highest_moment);
  if (a.price != 1) {
    a.warnings.push_back({WarningCode::deepest_level,
                          (a.deepest_level == deepest_of_all
                               ? std::string("no level of 2^62 or more can be drawn (it does not fit 64 bits)")
                               : "no level beyond " + std::to_string(a.deepest_level) + " can be drawn") +
                              ": so that it hardly comes up, the PMF falls faster than the best one, at " +
                              format("%.3g", a.price) + " times its variance x work"});
  }
  if (work > 0 && a.exponent.decay == Decay::geometric) {
    moments += std::string("; the variance of the work is ") + (rho > 2 * work ? "finite" : "infinite");
  }
  a.sentences.push_back(moments);
}

// The same levels, which draw nothing twice that a choice asks for again; what they draw for it is added to the work.
LevelRuns remembering(const LevelRuns& runs, double& work) {
  using Key = std::array<std::int64_t, 4>;
  LevelRuns once = runs;
  once.work = [&, known = std::map<std::int64_t, std::pair<double, double>>()](std::int64_t level,
                                                                               const Plan& plan) mutable {
    const auto at = known.find(level);
    if (at != known.end()) return at->second;
    const std::pair<double, double> each = runs.work(level, plan);
    known.emplace(level, each);
    work += (each.first + each.second) * static_cast<double>(detail::draws_for_work);
    return each;
  };
  if (runs.shared) {
    once.shared = [&, known = std::map<Key, SharedMoments>()](std::int64_t level, std::int64_t base_level,
                                                              const Plan& plan) mutable {
      const auto [at, is_new] = known.try_emplace({level, base_level, 1, plan.samples});
      if (is_new) {
        at->second = runs.shared(level, base_level, plan);
        work += at->second.work * static_cast<double>(plan.samples);
      }
      return at->second;
    };
  }
  if (runs.together) {
    once.together = [&, known = std::map<Key, StrataMoments>()](std::int64_t level, std::int64_t base_level,
                                                                std::int64_t members, const Plan& plan) mutable {
      const auto [at, is_new] = known.try_emplace({level, base_level, members, plan.samples});
      if (is_new) {
        at->second = runs.together(level, base_level, members, plan);
        work += at->second.work;
      }
      return at->second;
    };
  }
  return once;
}

}  // namespace

Advice advise(const LevelRuns& levels, const Plan& plan, const RecipeOptions& options) {
  detail::check_goal(plan.goal);
  const std::int64_t lowest = options.base_level.value_or(options.lowest_base);
  detail::check_base_level("recipe", lowest);
  if (options.budget && !(*options.budget > 0 && std::isfinite(*options.budget))) {
    throw std::invalid_argument("recipe: budget = " + format("%g", *options.budget) +
                                " (the work of the pilot must be positive and finite)");
  }
  Plan pilot_plan = plan;
  pilot_plan.first = 0;
  pilot_plan.goal = {};
  pilot_plan.save = {};
  pilot_plan.earlier = {};
  pilot_plan.pilot = {};
  pilot_plan.whole = 0;
  const auto start = std::chrono::steady_clock::now();
  const auto seconds_so_far = [&] {
    return detail::share<double>(pilot_plan.ranks, [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    });
  };
  double extra = 0;  // work of what a choice draws for itself
  LevelRuns runs = remembering(levels, extra);
  if (options.rates) runs.facts.declared = options.rates;
  const double unit = std::max(runs.work(lowest, pilot_plan).first, std::numeric_limits<double>::min());
  // Of a goal nobody knows yet how long a run it takes.
  const double first_draws = plan.goal.asked() ? fewest_pilot_draws : static_cast<double>(plan.samples) / 2;
  double budget = unit * std::clamp(first_draws, fewest_pilot_draws, first_pilot_draws);
  if (options.budget) budget = std::min(budget, *options.budget);
  Pilot pilot(runs, pilot_plan);
  Advice advice;
  std::int64_t deepest = std::max<std::int64_t>(first_deepest, lowest + 4);
  bool has_base = true;
  for (int stage = 0;; ++stage) {
    pilot.grow(budget, deepest);
    const auto choose = [&](bool budget_spent, bool finally) {
      Advice next;
      next.survey = pilot.survey(budget_spent);
      next.facts = runs.facts;
      if (next.survey.rows.back().level < lowest + 2) {
        throw std::invalid_argument("recipe: base level " + std::to_string(lowest) + " (the pilot reached only level " +
                                    std::to_string(next.survey.rows.back().level) +
                                    ", and a PMF needs two differences above the base); take a lower one");
      }
      if (next.usable()) {
        next.runs_together = static_cast<bool>(runs.together);
        next.block = std::max<std::int64_t>(advice.block, 64);
        set_members(next, plan.goal.asked() ? fewest_blocks_of(next) * static_cast<double>(next.block)
                                            : static_cast<double>(plan.samples));
        const bool asked = plan.goal.asked();
        has_base = Choice(runs, pilot_plan, options, asked, next).choose(finally && !asked);
        if (!has_base) {
          next.survey.pmf_exists = Answer::open;
          next.survey.grade = Grade::open;
        } else if (asked) {
          set_members(next, wanted_members(next, plan));
          // With the block of that many members.
          has_base = Choice(runs, pilot_plan, options, asked, next).choose(finally);
          set_members(next, wanted_members(next, plan));
        }
      }
      next.pilot_work = pilot.work() + extra;
      next.pilot_seconds = seconds_so_far();
      return next;
    };
    advice = choose(false, false);
    // Without a base, that of a run whose base is the deepest level.
    const double of_member = has_base ? advice.predicted.work : advice.survey.rows.back().value_work;
    double run_work = std::min(of_member * static_cast<double>(advice.members), most_pilot_draws * unit);
    // What is open may have no PMF, and then a work that is next to endless.
    if (advice.survey.pmf_exists != Answer::yes && !plan.goal.asked()) {
      run_work = std::min(run_work, most_open_work * unit * static_cast<double>(advice.members));
    }
    const double limit = options.budget.value_or(std::max(run_work, 0.0));
    double wanted = 0;
    if (advice.survey.pmf_exists != Answer::yes) {
      wanted = open_growth * budget;
    } else {
      // A long run deserves a pilot that has seen more, for the sake of its PMF.
      wanted = std::min(pilot_share * run_work / (runs.shared ? 3 : 1), most_growth * budget);
      if (advice.survey.grade != Grade::shown) {
        wanted = std::max(wanted, std::min(open_growth * budget, likely_share * run_work));
      }
    }
    // What a choice draws for itself counts, too.
    wanted = std::min(wanted, limit * pilot.work() / (pilot.work() + extra));
    if (plan.goal.seconds > 0) {
      wanted = std::min(wanted, budget * plan.goal.seconds / 4 / std::max(advice.pilot_seconds, 1e-9));
    }
    const bool late = plan.goal.seconds > 0 && advice.pilot_seconds > plan.goal.seconds / 4;
    if (stage == most_stages || late || !(wanted > 1.5 * budget)) {
      if (!has_base) {
        throw std::invalid_argument(
            "recipe: no level up to " + std::to_string(advice.survey.rows.back().level) +
            " can be the base (values, or their squares, are not finite numbers in these draws); take draws whose "
            "weights vary less, or a larger budget for deeper levels");
      }
      advice = choose(advice.survey.pmf_exists == Answer::open, true);
      break;
    }
    if (advice.survey.pmf_exists != Answer::yes) deepest *= 4;
    budget = wanted;
  }
  advice.pilot_work = pilot.work() + extra;  // what was drawn for the choice, too
  advice.pilot_seconds = seconds_so_far();
  if (advice.usable() && plan.goal.asked() && static_cast<double>(advice.members) > most_affordable) {
    refuse_cost(advice, wanted_members(advice, plan));
  }
  for (const Warning& remark : advice.survey.remarks) {
    if (!is_note(remark.code)) advice.warnings.push_back(remark);
  }
  advice.usable() ? describe(advice) : describe_none(advice);
  return advice;
}

namespace {

void print_line(std::ostream& out, const char* name, const std::string& text) {
  out << name << std::string(14 - std::char_traits<char>::length(name), ' ') << text << '\n';
}

std::string pilot_text(const Advice& advice) {
  return "work " + format("%.4g", advice.pilot_work) + ", " + std::to_string(advice.survey.rows.size()) + " levels";
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const Advice& advice) {
  if (!advice.sentences.empty()) print_line(out, "recipe", advice.sentences.front());
  if (advice.usable()) {
    print_line(out, "pmf", advice.pmf.spec());
    print_line(out, "base",
               "level " + std::to_string(advice.base_level) +
                   (advice.base == Base::one_outcome ? ", one outcome of the PMF" : ", in every sample") +
                   "; blocks of " + std::to_string(advice.block));
    print_line(out, "predicted",
               "variance " + format("%.3g", advice.predicted.variance) + " x work " +
                   format("%.4g", advice.predicted.work) +
                   " of a member = " + format("%.3g", advice.predicted.product()));
  }
  print_line(out, "pilot", pilot_text(advice));
  for (const Warning& warning : advice.warnings) print_line(out, "warning", warning.text);
  return out;
}

void print_full(std::ostream& out, const Advice& advice) {
  const char* name = "recipe";
  for (const std::string& sentence : advice.sentences) {
    print_line(out, name, sentence);
    name = "";
  }
  if (advice.usable()) print_line(out, "pmf", advice.pmf.spec());
  print_line(out, "pilot", pilot_text(advice));
  for (const Warning& remark : advice.survey.remarks) {
    if (is_note(remark.code)) print_line(out, "remark", remark.text);
  }
  for (const Warning& warning : advice.warnings) print_line(out, "warning", warning.text);
}

void detail::print_doubts(std::ostream& out, const Advice& advice, const Statistics& result) {
  for (const Warning& doubt : advice.warnings) {
    const auto same = [&doubt](const Warning& w) { return w.code == doubt.code; };
    if (std::none_of(result.warnings.begin(), result.warnings.end(), same)) print_line(out, "warning", doubt.text);
  }
}

namespace {

// What an advice without a PMF has to say to who wanted one.
NoPmfError refusal_of(const Advice& advice) {
  const Evidence& e = advice.survey.evidence;
  constexpr double unknown = NoPmfError::unknown;
  NoPmfError::Facts facts;
  facts.variance_decay = e.courses.empty() ? FittedRate{unknown, unknown} : e.decay;
  facts.work_growth = {growth_of_work(e).value, unknown};
  facts.decay = unit_of(e);
  facts.grade = advice.survey.grade == Grade::shown ? NoPmfError::Grade::shown : NoPmfError::Grade::likely;
  facts.reason = rate_text(advice.survey);
  facts.help = what_helps;
  std::string what = "recipe: ";
  for (const std::string& sentence : advice.sentences) {
    what += (&sentence == &advice.sentences.front() ? "" : "; ") + sentence;
  }
  return {what, std::move(facts)};
}

}  // namespace

Plan detail::plan_of(const Plan& plan, const Advice& advice) {
  if (!advice.usable()) throw refusal_of(advice);
  Plan run = plan;
  run.samples = advice.members;
  run.pilot += {advice.pilot_work, advice.pilot_seconds, advice.survey.evidence.facts, advice.facts};
  // How long a block takes and what it varies by is known only from blocks: the goal gets a pilot of its own. The chosen
  // prediction is the best of some, and the luckiest.
  if (plan.goal.seconds > 0) run.goal.seconds = std::max(1e-9, plan.goal.seconds - advice.pilot_seconds);
  return run;
}

void detail::follow(Statistics& statistics, const Advice& advice, const Goal& goal) {
  statistics.goal = goal;
  for (const Warning& remark : advice.survey.remarks) {
    if (remark.code == WarningCode::coupling) statistics.warnings.push_back({remark.code, remark.text + "."});
  }
}

}  // namespace debias

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

#include "core/ranks.hpp"
#include "core/text.hpp"

namespace debias {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double first_pilot_draws = 1 << 14;  // of the lowest level, in work
constexpr double open_pilot_draws = 1 << 20;   // that a no, or a doubt, has to survive
constexpr double most_growth = 16;             // of a pilot over the one before
constexpr int most_stages = 4;
constexpr double pilot_share = 1.0 / 32;  // of the work of the run
constexpr double most_base_work = 64;     // of one base, in draws of the lowest
constexpr double worthwhile = 0.98;       // a deeper base has to bring 2 %
constexpr double fewest_blocks = 2048;
constexpr double fewest_together = 1024;  // blocks whose members run together: the longer they are, the quieter
constexpr std::int64_t largest_block = 4096;
constexpr double shared_share = 1.0 / 8;  // of the draws of a level, to compare bases
constexpr std::size_t levels_beyond = 4;  // of the survey that the table of a law holds
constexpr double narrow = 0.05;           // of the work's exponent, for the law with finite work where none has both
constexpr double price_of_fourth = 1.02;  // that a law with a finite fourth moment may cost
constexpr double spare_members = 4;       // that a goal may take beside the expected ones: its law can draw them, too
constexpr double steepest = 0.9;          // of the way from the best exponent to that of an infinite variance
constexpr double negligible = 1e-10;      // of a squared difference beside the squared value: no deeper base

double rounded(double x, int digits) {
  std::array<char, 32> out{};
  const auto end = std::to_chars(out.data(), out.data() + out.size(), x, std::chars_format::general, digits).ptr;
  std::from_chars(out.data(), end, x);
  return x;
}

}  // namespace

bool Advice::usable() const {
  if (survey.law_exists != Answer::cannot_tell) return survey.law_exists == Answer::yes;
  return debias::law_exists(rates_of(survey.rates));  // false for rates that are not known
}

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

  void choose() {
    double best = infinity;
    bool found = false;
    bool found_drawable = false;
    const std::int64_t lowest = options_.base_level.value_or(options_.lowest_base);
    const std::int64_t highest = options_.base_level.value_or(static_cast<std::int64_t>(survey_.rows.size()) - 2);
    const double unit = row(lowest).value_work;
    for (std::int64_t m = lowest; m <= highest; ++m) {
      if (m > lowest && row(m).value_work > most_base_work * unit) break;
      if (m < highest && !settled(m)) continue;
      if (m > lowest && exhausted(m)) break;
      for (const Base base : {Base::always, Base::drawn}) {
        if (options_.base && *options_.base != base) continue;
        const Setup setup{m, base, advice_.block};
        const TermMoments moments = moments_of(setup, shared_share);
        const AnyPmf law = law_of(setup, moments);
        const bool is_drawable = drawable(law, setup);
        if (found_drawable && !is_drawable) continue;
        found = found && is_drawable == found_drawable;  // the first one that can be drawn beats all that cannot
        const double product = predict(moments, law).product();
        // A variance that was measured in n draws is not better than another one by its noise.
        const double noise = 2 * std::sqrt(2 / static_cast<double>(row(m).draws));
        if (found && !(product < (worthwhile - noise) * best)) continue;
        found = true;
        found_drawable = is_drawable;
        best = product;
        chosen_ = setup;
      }
    }
    conclude();
  }

 private:
  // Variance x work over all levels: behind those of the model, powers of the level go on for long.
  [[nodiscard]] double with_rest(const TermMoments& moments, const AnyPmf& law) const {
    VarianceAndWork sums = predict(moments, law);
    if (survey_.rates.kind == RateKind::polynomial) {
      const std::size_t last = moments.work.size() - 1;
      const double p = law.mass(static_cast<std::int64_t>(last));
      const ExponentRange range = finite_exponents(rates_of(survey_.rates));
      const double s = law.tail_exponent().exponent;
      const double levels = static_cast<double>(last) + 1;
      sums.variance += (moments.variance[last] + moments.mean_square[last]) / p * levels / (range.high - s);
      sums.work += moments.work[last] * p * levels / (s - range.low);
    }
    return sums.product();
  }

  [[nodiscard]] const SurveyRow& row(std::int64_t level) const {
    return survey_.rows.at(static_cast<std::size_t>(level));
  }

  // No level above m is wild: the first ones may lack moments, which a kurtosis beyond the draws shows.
  [[nodiscard]] bool settled(std::int64_t m) const {
    for (const SurveyRow& r : survey_.rows) {
      if (r.level <= m) continue;
      if (!std::isfinite(r.second_moment)) return false;
      if (r.votes || r.fitted) return true;
      if (r.second_moment > 0) return false;
    }
    return true;
  }

  // The differences above m are next to nothing beside the value: rounding, or the end of the sequence, is near.
  [[nodiscard]] bool exhausted(std::int64_t m) const {
    const SurveyRow& next = row(m + 1);
    return next.second_moment < negligible * (next.mean * next.mean + next.variance);
  }

  [[nodiscard]] TermMoments moments_of(const Setup& setup, double share) const {
    return term_moments(runs_, survey_, model_, setup, plan_, share);
  }

  // A run of that many members is allowed to take the law, see core/reach.hpp.
  [[nodiscard]] bool drawable(const AnyPmf& law, const Setup& setup) const {
    struct Levels {
      std::int64_t deepest;
      [[nodiscard]] std::int64_t deepest_level() const { return deepest; }
    };
    const Reach reach = detail::reach_of(Levels{runs_.deepest_level}, law, setup.base_level, setup.first_level());
    return reach.beyond <= allowed_beyond_;
  }

  // The best law, or the one next to it that can be drawn, if one of finite variance can.
  AnyPmf law_of(const Setup& setup, const TermMoments& all, double* price = nullptr) const {
    const double exponent = tail_exponent_for(survey_.rates);
    const auto with = laws_of(setup, all);
    const AnyPmf best = with(exponent);
    if (drawable(best, setup)) return best;
    const double bound = finite_exponents(rates_of(survey_.rates)).high;
    double high = std::isfinite(bound) ? exponent + steepest * (bound - exponent) : std::max(40.0, exponent);
    if (!(high > exponent) || !drawable(with(high), setup)) return best;  // the run will be refused
    for (double low = exponent; high - low > 1e-3;) {
      const double middle = (low + high) / 2;
      (drawable(with(middle), setup) ? high : low) = middle;
    }
    const AnyPmf law = with(high);
    if (price != nullptr) *price = with_rest(all, law) / with_rest(all, best);
    return law;
  }

  // The law for an exponent of its tail.
  [[nodiscard]] std::function<AnyPmf(double exponent)> laws_of(const Setup& setup, const TermMoments& all) const {
    if (survey_.rates.kind == RateKind::polynomial) return [](double exponent) { return AnyPmf(Zeta(exponent)); };
    TermMoments t = all;
    std::size_t outcomes = survey_.rows.size() + levels_beyond - static_cast<std::size_t>(setup.first_level());
    // The table ends at the deepest level: what lies beyond is the tail's.
    const std::int64_t drawn = runs_.deepest_level - setup.first_level() + 1;
    if (drawn > 0) outcomes = std::min(outcomes, static_cast<std::size_t>(drawn));
    for (std::vector<double>* v : {&t.variance, &t.mean_square, &t.work, &t.base_variance, &t.covariance}) {
      v->resize(std::min(v->size(), outcomes));
    }
    // A base that deep levels make quieter is worth its own variance at the first of them: else a law that draws
    // these for the sake of the base costs more than anyone asked for.
    if (!t.base_variance.empty()) {
      std::fill(t.base_variance.begin(), t.base_variance.end(), t.base_variance.front());
      if (!t.base_left.empty()) t.base_left.assign(t.base_left.size(), t.base_left.front());
    }
    return [&all, best = best_masses(t), is_drawn = setup.base == Base::drawn](double exponent) {
      return fair_or_fastest(all, best, exponent, is_drawn);
    };
  }

  static AnyPmf fair_or_fastest(const TermMoments& all, const std::vector<double>& best, double exponent,
                                bool base_is_drawn) {
    // Falling no faster than the tail, the masses leave the fourth moment finite where that is possible.
    std::vector<double> even = best;
    const std::size_t free = base_is_drawn ? 2 : 1;
    for (std::size_t j = free; j < even.size(); ++j) even[j] = std::max(even[j], even[j - 1] * std::exp2(-exponent));
    const AnyPmf fastest = tabulated(best, exponent);
    const AnyPmf fair = tabulated(even, exponent);
    return predict(all, fair).product() <= price_of_fourth * predict(all, fastest).product() ? fair : fastest;
  }

  static AnyPmf tabulated(std::vector<double> masses, double exponent) {
    // What no run will reach needs no entry.
    while (masses.size() > 1 && masses.back() < 1e-9) masses.pop_back();
    // Short and readable, and the law that the text names is the law of the run.
    for (double& mass : masses) mass = rounded(mass, 3);
    return AnyPmf(Tabulated(std::move(masses), rounded(std::exp2(-exponent), 4)));
  }

  void conclude() {
    const TermMoments moments = moments_of(chosen_, 1);
    advice_.base_level = chosen_.base_level;
    advice_.base = chosen_.base;
    advice_.shares_base = chosen_.base == Base::always && runs_.shared;
    advice_.price = 1;
    advice_.law = law_of(chosen_, moments, &advice_.price);
    advice_.exponent = advice_.law.tail_exponent();
    advice_.predicted = predict(moments, advice_.law);
    advice_.deepest_level = runs_.deepest_level;
    advice_.bound = bound_of(survey_, model_, chosen_.base_level);
    const double rho = advice_.exponent.exponent;
    const double beta = survey_.rates.variance.value;
    const bool polynomial = survey_.rates.kind == RateKind::polynomial;
    // E |D / p|^q p is summable.
    const double excess = rho - beta / 2;
    advice_.highest_moment = !(excess > 0) ? infinity : (polynomial ? (rho - 1) / excess : rho / excess);
  }

  const LevelRuns& runs_;
  const Plan& plan_;
  const RecipeOptions& options_;
  Advice& advice_;
  const Survey& survey_;
  LevelModel model_;
  double allowed_beyond_;
  Setup chosen_;
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
  if (!(blocks * static_cast<double>(advice.block) < 0x1p62)) {
    throw std::invalid_argument("recipe: the goal takes " + format("%.3g", members) +
                                " members (does not fit 64 bits)");
  }
  advice.members = static_cast<std::int64_t>(blocks) * advice.block;
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
  return std::max(fewest_blocks, advice.predicted.variance / (error * error));  // fewer have no standard error
}

std::string rate_text(const MeasuredRates& r) {
  if (r.kind == RateKind::exact_zero) return "the differences are zero beyond the first levels";
  if (std::isnan(r.variance.value)) return "too few levels have enough draws for their kurtosis to show a decay";
  if (r.kind == RateKind::super_exponential) return "the differences fall faster than any power";
  const char* unit = r.kind == RateKind::polynomial ? "k^" : "2^(k x ";
  const char* end = r.kind == RateKind::polynomial ? "" : ")";
  return "E D_k^2 falls like " + std::string(unit) + format("%.2f", -r.variance.value) + end + " (+- " +
         format("%.2f", r.variance.error) + "), work grows like " + unit + format("%.2f", r.work.value) + end;
}

void describe_none(Advice& a) {
  const MeasuredRates& r = a.survey.rates;
  const bool polynomial = r.kind == RateKind::polynomial;
  const double work = std::isfinite(r.work.value) ? r.work.value : 1;
  const double rho = work + narrow + (polynomial ? 1 : 0);
  a.law = polynomial ? AnyPmf(Zeta(rho)) : AnyPmf(Geometric::with_exponent(std::max(rho, narrow)));
  a.exponent = a.law.tail_exponent();
  const double excess = rho - r.variance.value / 2;
  a.highest_moment = !(excess > 0) ? infinity : (rho - (polynomial ? 1 : 0)) / excess;
  a.sentences.push_back(
      (a.survey.law_exists == Answer::no
           ? "no law has finite variance and finite work: "
           : "cannot tell yet whether a law has finite variance and finite work, and as measured in " +
                 format("%.3g", a.pilot_work) + " of work, none has (ask for more samples): ") +
      rate_text(r));
  std::string best = "the best with finite work is " + a.law.spec();
  if (std::isfinite(a.highest_moment)) best += ": moments are finite below " + format("%.3g", a.highest_moment);
  if (!polynomial && r.variance.value > 0 && work > 0) {
    best += " (stable index " + format("%.3g", std::min(2.0, 2 * work / (2 * work - r.variance.value))) +
            " in the limit), the error falls like work^-" +
            format("%.2g", std::min(0.5, r.variance.value / (2 * work)));
  }
  a.sentences.push_back(best);
  a.sentences.emplace_back(
      "what helps: a better coupling or a smoother integrand (beta up), extrapolation (alpha up), or "
      "multilevel, whose "
      "bias is stated");
}

void describe(Advice& a) {
  const MeasuredRates& r = a.survey.rates;
  const char* form = a.shares_base
                         ? ", made of the draws of the difference"
                         : (a.base == Base::drawn ? ", one outcome of the law" : ", evaluated in every sample");
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
  if (together) efficiency += " and are not stratified by their first number";
  a.sentences.push_back(efficiency);
  const double rho = a.exponent.exponent;
  std::string moments =
      rate_text(r) + ", the tail of the law like " +
      (a.exponent.decay == Decay::polynomial ? "k^" + format("%.2f", -rho) : "2^(k x " + format("%.2f", -rho) + ")");
  if (std::isfinite(a.highest_moment)) moments += ": moments below " + format("%.3g", a.highest_moment) + " are finite";
  if (a.price != 1) {
    a.sentences.push_back((a.deepest_level == deepest_of_all
                               ? "no level of 2^62 or more can be drawn (it does not fit 64 bits)"
                               : "no level beyond " + std::to_string(a.deepest_level) + " can be drawn") +
                          std::string(": so that it hardly comes up, the law falls faster than the best one, at ") +
                          format("%.3g", a.price) + " times its variance x work");
  }
  if (r.work.value > 0 && a.exponent.decay == Decay::geometric) {
    moments += std::string("; the variance of the work is ") + (rho > 2 * r.work.value ? "finite" : "infinite");
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
  Plan pilot = plan;
  pilot.samples = std::int64_t{1} << 16;
  pilot.first = 0;
  pilot.goal = {};
  pilot.save = {};
  pilot.earlier = {};
  pilot.pilot = {};
  pilot.whole = 0;
  const auto start = std::chrono::steady_clock::now();
  const auto seconds_so_far = [&] {
    return detail::share<double>(
        pilot.ranks, [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); });
  };
  double work = 0;
  const LevelRuns runs = remembering(levels, work);
  const double unit = runs.work(lowest, pilot).first;
  double budget = first_pilot_draws * unit;
  Advice advice;
  for (int stage = 0;; ++stage) {
    Advice next;
    next.survey = survey_within(runs, budget, pilot);
    work += next.survey.work;
    next.pilot_seconds = seconds_so_far();
    if (static_cast<std::int64_t>(next.survey.rows.size()) < lowest + 3) {
      throw std::invalid_argument("recipe: base level " + std::to_string(lowest) + " (the pilot reached only level " +
                                  std::to_string(next.survey.rows.size() - 1) +
                                  ", and a law needs two differences above the base); take a lower one");
    }
    if (next.usable()) {
      next.runs_together = static_cast<bool>(runs.together);
      next.block = std::max<std::int64_t>(advice.block, 64);
      set_members(next, plan.goal.asked() ? fewest_blocks_of(next) * static_cast<double>(next.block)
                                          : static_cast<double>(plan.samples));
      Choice(runs, pilot, options, plan.goal.asked(), next).choose();
      if (plan.goal.asked()) {
        set_members(next, wanted_members(next, plan));
        Choice(runs, pilot, options, plan.goal.asked(), next).choose();  // with the block of that many members
        set_members(next, wanted_members(next, plan));
      }
    }
    advice = std::move(next);
    const bool open = advice.survey.law_exists != Answer::yes;
    advice.pilot_work = work;
    const double open_limit =
        unit * std::max(open_pilot_draws, 4 * (plan.goal.asked() ? 0 : static_cast<double>(plan.samples)));
    if (stage == most_stages || (open && budget >= open_limit)) break;
    // A long run deserves a pilot that has seen more, and so does a doubt or a no, whose price is not known yet.
    const double run_work = advice.predicted.work * static_cast<double>(advice.members);
    double wanted = std::min(pilot_share * run_work / (runs.shared ? 3 : 1), most_growth * budget);
    if (open) {
      wanted = std::clamp(8 * budget, wanted, std::max(wanted, open_limit));
      pilot.samples *= 4;  // in fewer levels: rare events ask for draws, not for depth
    }
    if (!(wanted > 1.5 * budget)) break;
    budget = wanted;
  }
  advice.pilot_seconds = seconds_so_far();  // what was drawn for the choice, too
  advice.usable() ? describe(advice) : describe_none(advice);
  return advice;
}

std::ostream& operator<<(std::ostream& out, const Advice& advice) {
  const char* name = "recipe";
  for (const std::string& sentence : advice.sentences) {
    out << name << std::string(14 - std::char_traits<char>::length(name), ' ') << sentence << '\n';
    name = "";
  }
  out << "pilot         work " << format("%.4g", advice.pilot_work) << ", " << std::to_string(advice.survey.rows.size())
      << " levels";
  for (const std::string& remark : advice.survey.remarks) out << "; " << remark;
  return out << '\n';
}

Plan detail::plan_of(const Plan& plan, const Advice& advice) {
  if (!advice.usable()) {
    std::string reasons = "recipe: ";
    for (const std::string& sentence : advice.sentences)
      reasons += (&sentence == &advice.sentences.front() ? "" : "; ") + sentence;
    throw std::invalid_argument(reasons);
  }
  Plan run = plan;
  run.samples = advice.members / advice.block;
  run.pilot += {advice.pilot_work, advice.pilot_seconds};
  // How long a block takes and what it varies by is known only from blocks: the goal gets a pilot of its own. The chosen
  // prediction is the best of some, and the luckiest.
  if (plan.goal.seconds > 0) run.goal.seconds = std::max(1e-9, plan.goal.seconds - advice.pilot_seconds);
  return run;
}

void detail::follow(Statistics& statistics, const Advice& advice, const Goal& goal) {
  statistics.goal = goal;
  if (advice.survey.law_exists == Answer::cannot_tell) {
    statistics.warnings.emplace_back(
        "the pilot cannot tell yet whether any law has finite variance and finite work; its law has finite "
        "work.");
  }
  for (const std::string& remark : advice.survey.remarks) {
    if (remark.find("every estimate from it is biased") != remark.npos) statistics.warnings.push_back(remark + ".");
  }
}

}  // namespace debias

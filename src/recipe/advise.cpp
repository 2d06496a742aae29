#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/communicator.hpp"
#include "core/text.hpp"
#include "recipe/choice.hpp"
#include "recipe/net_pilot.hpp"
#include "recipe/prose.hpp"
#include "survey/pilot.hpp"
#include "survey/resonance.hpp"

namespace debias {
namespace {

constexpr double first_pilot_draws = 1 << 14;  // of the lowest level, in work
constexpr double fewest_pilot_draws = 1 << 11;
constexpr double most_pilot_draws = 1 << 26;  // in work of the lowest level, whatever a goal costs
constexpr std::int64_t first_deepest = 12;    // level, of the first stage
constexpr double open_growth = 4;             // while nothing is shown
constexpr double most_open_work = 32;         // of the pilot, for a sample of the run, in draws of the lowest level
constexpr double likely_share = 1.0 / 10;     // of the run's work, for an answer that is only likely
constexpr double most_growth = 16;            // of a pilot over the one before
constexpr int most_stages = 12;
constexpr double pilot_share = 1.0 / 32;       // of the work of the run
constexpr double final_share = 1.0 / 8;        // of that, at most, for drawing again what the choice is made of
constexpr double worthwhile_share = 0.75;      // of the work of plain numbers: less may be the noise of the pilot
constexpr double first_nets_draws = 1 << 13;   // of the lowest level, in work
constexpr double first_nets_share = 1.0 / 20;  // at most, of the run of plain numbers: so much they may cost in vain
constexpr double short_pilot_draws = 2e4;      // of both kinds, in work of the lowest level,
constexpr double short_pilot_share = 1.0 / 4;  // or this part of the run, if that is less
constexpr double net_pilot_share = 1.0 / 10;   // of both kinds, of a longer run
constexpr double level_share = 1.0 / 3;        // of that for the levels alone
constexpr double net_growth = 4;

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

/// One recipe's pilot: stages of plain draws, each with the choice that its levels allow, then nets, if they promise less work.
class Adviser {
 public:
  Adviser(const LevelRuns& levels, const Plan& plan, const RecipeOptions& options);

  Advice advise();

 private:
  /// Levels as some stage knows them. Weighing them takes longer than a choice.
  struct Known {
    double pilot_work = -1;
    bool budget_spent = false;
    Survey survey;
    LevelModel model;                                                                      ///< of a usable one
    std::map<std::pair<std::int64_t, std::int64_t>, std::optional<SingleTermForm>> forms;  ///< by members and block
  };

  [[nodiscard]] double seconds_so_far() const;
  [[nodiscard]] double spent() const { return pilot_.work() + extra_ + nets_.work(); }
  const Known& known(bool budget_spent);
  /// The choice for plain numbers. `finally` draws all that it can to compare what it chose.
  Advice choose(bool budget_spent, bool finally);
  bool choose_base(bool finally, Advice& next);
  [[nodiscard]] double expected_work() const;

  void measure_first_nets();
  void measure_nets(double work);
  void measure_more_nets();
  /// Nets promise less, or were asked for.
  [[nodiscard]] bool by_nets() const { return found_ && (asks_nets_ || found_->share <= worthwhile_share); }
  /// What pilots of both kinds may cost beside a run of nets.
  [[nodiscard]] double most_pilots() const;
  /// The advice for blocks of nets in place of plain numbers, if a run may take it.
  bool take_nets();

  /// The budget of the next stage, if there were one.
  [[nodiscard]] double wanted_work() const;
  [[nodiscard]] bool is_last(int stage) const;
  void conclude();
  void finish();
  [[nodiscard]] std::string why_points() const;

  [[nodiscard]] bool is_known_to_exist() const { return advice_.survey.pmf_exists == Answer::yes; }

  const Plan& plan_;
  const RecipeOptions& options_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  Plan pilot_plan_;
  double extra_ = 0;  // work of what a choice draws for itself
  LevelRuns runs_;
  std::int64_t lowest_;
  double unit_;  // work of a draw of the lowest level
  double budget_;
  std::int64_t deepest_;
  Pilot pilot_;
  bool asks_nets_;
  NetPilot nets_;
  std::optional<NetPilot::Found> found_;  // blocks of nets
  double nets_budget_ = 0;                // of what they were measured with
  std::string why_plain_;
  Known known_;
  Advice advice_;
  bool has_base_ = true;
  double run_work_ = 0;  // that the plain choice expects
};

void check(const LevelRuns& levels, const Plan& plan, const RecipeOptions& options) {
  detail::check_plan(plan);
  detail::check_goal(plan.goal);
  if (options.lowest_base < 0) {
    throw std::invalid_argument("recipe: lowest_base = " + std::to_string(options.lowest_base) +
                                " (levels start at 0)");
  }
  if (options.base_level) detail::check_base_level("recipe", *options.base_level);
  if (options.base_level && *options.base_level > levels.deepest_level) {
    throw std::invalid_argument("recipe: base_level = " + std::to_string(*options.base_level) +
                                " (the deepest level that can be drawn is " + std::to_string(levels.deepest_level) +
                                "); take a lower one");
  }
  if (options.base_level && *options.base_level < options.lowest_base) {
    throw std::invalid_argument("recipe: base_level = " + std::to_string(*options.base_level) +
                                " is below lowest_base = " + std::to_string(options.lowest_base) + "; state one");
  }
  if (options.rates && (std::isnan(options.rates->variance_decay) || std::isnan(options.rates->work_growth))) {
    throw std::invalid_argument("recipe: rates that are not numbers; leave them out where they are not known");
  }
  if (options.budget && !(*options.budget > 0 && std::isfinite(*options.budget))) {
    throw std::invalid_argument("recipe: budget = " + format("%g", *options.budget) +
                                " (the work of the pilot must be positive and finite)");
  }
  if (options.points == Points::nets && options.base == Base::every_sample) {
    throw std::invalid_argument(
        "recipe: nets with Base::every_sample (base and difference take two streams, and a point is one); take "
        "Base::one_outcome, or leave one of them out");
  }
}

Plan plan_of_pilot(Plan plan) {
  plan.first = 0;
  plan.goal = {};
  plan.save = {};
  plan.earlier = {};
  plan.pilot = {};
  plan.whole = 0;
  return plan;
}

Adviser::Adviser(const LevelRuns& levels, const Plan& plan, const RecipeOptions& options)
    : plan_(plan),
      options_(options),
      pilot_plan_(plan_of_pilot(plan)),
      runs_(remembering(levels, extra_)),
      lowest_(options.base_level.value_or(options.lowest_base)),
      unit_(std::max(runs_.work(lowest_, pilot_plan_).first, std::numeric_limits<double>::min())),
      deepest_(std::max<std::int64_t>(first_deepest, lowest_ + 4)),
      pilot_(runs_, pilot_plan_),
      asks_nets_(options.points == Points::nets),
      nets_(runs_, pilot_plan_, options, unit_),
      why_plain_(options.points == Points::plain ? "as asked" : "") {
  if (options.rates) runs_.facts.declared = options.rates;
  // Of a goal nobody knows yet how long a run it takes.
  const double first_draws = plan.goal.asked() ? fewest_pilot_draws : static_cast<double>(plan.samples) / 2;
  budget_ = unit_ * std::clamp(first_draws, fewest_pilot_draws, first_pilot_draws);
  if (options.budget) budget_ = std::min(budget_, *options.budget);
  if (why_plain_.empty() && options.base == Base::every_sample) why_plain_ = "the base in every sample was asked for";
}

double Adviser::seconds_so_far() const {
  return detail::share<double>(pilot_plan_.ranks, [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  });
}

// ---- stages

Advice Adviser::advise() {
  for (int stage = 0;; ++stage) {
    pilot_.grow(budget_, deepest_);
    advice_ = choose(false, false);
    run_work_ = expected_work();
    measure_first_nets();
    if (by_nets() && is_last(stage)) measure_more_nets();  // levels are known: what is left of the pilot goes to nets
    if (is_last(stage)) break;
    budget_ = wanted_work();
    if (!is_known_to_exist()) deepest_ *= 4;
  }
  conclude();
  finish();
  return std::move(advice_);
}

double Adviser::wanted_work() const {
  double wanted = 0;
  if (!is_known_to_exist()) {
    wanted = open_growth * budget_;
  } else if (by_nets()) {
    wanted = std::min({first_pilot_draws * unit_, level_share * most_pilots(), most_growth * budget_});
  } else {
    // A long run deserves a pilot that has seen more, for the sake of its PMF.
    wanted = std::min(pilot_share * run_work_ / (runs_.shared ? 3 : 1), most_growth * budget_);
    if (advice_.survey.grade != Grade::shown) {
      wanted = std::max(wanted, std::min(open_growth * budget_, likely_share * run_work_));
    }
  }
  // What a choice draws for itself counts, too, but not what is looked at once.
  const double limit = options_.budget.value_or(std::max(run_work_, 0.0));
  wanted = std::min(wanted, limit * pilot_.work() / (pilot_.work() + extra_ - pilot_.looked_ahead()));
  if (plan_.goal.seconds > 0) {
    wanted = std::min(wanted, budget_ * plan_.goal.seconds / 4 / std::max(advice_.pilot_seconds, 1e-9));
  }
  return wanted;
}

bool Adviser::is_last(int stage) const {
  const bool late = plan_.goal.seconds > 0 && advice_.pilot_seconds > plan_.goal.seconds / 4;
  return stage == most_stages || late || !(wanted_work() > 1.5 * budget_);
}

// ---- the choice for plain numbers

const Adviser::Known& Adviser::known(bool budget_spent) {
  const double seen = pilot_.work() + pilot_.looked_ahead();
  if (known_.pilot_work != seen || known_.budget_spent != budget_spent) {
    known_ = {seen, budget_spent, pilot_.survey(budget_spent), {}, {}};
  }
  return known_;
}

Advice Adviser::choose(bool budget_spent, bool finally) {
  Advice next;
  next.survey = known(budget_spent).survey;
  next.facts = runs_.facts;
  if (next.survey.rows.back().level < lowest_ + 2) {
    throw std::invalid_argument("recipe: base level " + std::to_string(lowest_) + " (the pilot reached only level " +
                                std::to_string(next.survey.rows.back().level) +
                                ", and a PMF needs two differences above the base); take a lower one");
  }
  if (next.usable()) {
    const bool asked = plan_.goal.asked();
    next.runs_together = static_cast<bool>(runs_.together);
    next.block = std::max<std::int64_t>(advice_.block, 64);
    set_members(next,
                asked ? fewest_blocks_of(next) * static_cast<double>(next.block) : static_cast<double>(plan_.samples));
    has_base_ = choose_base(finally && !asked, next);
    if (!has_base_) {
      next.survey.pmf_exists = Answer::open;
      next.survey.grade = Grade::open;
    } else if (asked) {
      set_members(next, wanted_members(next, plan_));
      // With the block of that many members.
      has_base_ = choose_base(finally, next);
      set_members(next, wanted_members(next, plan_));
    }
  }
  next.pilot_work = spent();
  next.pilot_seconds = seconds_so_far();
  return next;
}

bool Adviser::choose_base(bool finally, Advice& next) {
  if (known_.model.size() == 0) known_.model = model_of(known_.survey);
  const TermQuestion question{runs_, known_.model, pilot_plan_, options_, plan_.goal.asked()};
  const auto [form, is_new] = known_.forms.try_emplace({next.members, next.block});
  if (is_new) form->second = choose_term(question, next);
  if (form->second) take_term(question, *form->second, finally, next);
  return form->second.has_value();
}

double Adviser::expected_work() const {
  // Without a base, that of a run whose base is the deepest level.
  const double of_member = has_base_ ? advice_.predicted.work : advice_.survey.rows.back().value_work;
  const double work = std::min(of_member * static_cast<double>(advice_.members), most_pilot_draws * unit_);
  // What is open may have no PMF, and then a work that is next to endless.
  if (is_known_to_exist() || plan_.goal.asked()) return work;
  return std::min(work, most_open_work * unit_ * static_cast<double>(advice_.members));
}

// ---- nets

void Adviser::measure_first_nets() {
  if (!why_plain_.empty() || !has_base_ || !advice_.usable() || !(is_known_to_exist() || asks_nets_)) return;
  const double least = nets_.least_work(lowest_);
  double first = std::min(first_nets_draws * unit_, first_nets_share * run_work_);
  if (options_.budget) first = std::min(first, *options_.budget - spent());
  if (asks_nets_) first = std::max(first, least);
  if (nets_budget_ > 0 || first >= least) measure_nets(std::max(nets_budget_, first));
}

void Adviser::measure_nets(double work) {
  const double seconds_left = plan_.goal.seconds > 0 ? Goal::aim * plan_.goal.seconds - seconds_so_far() : 0;
  found_ = nets_.choose(work, plan_, advice_, known_.model, seconds_left);
  nets_budget_ = work;
}

void Adviser::measure_more_nets() {
  while (by_nets()) {
    double next = std::min(net_growth * nets_budget_, most_pilots() - spent());
    if (plan_.goal.seconds > 0) {
      next = std::min(next, nets_budget_ * plan_.goal.seconds / 8 / std::max(seconds_so_far(), 1e-9));
    }
    if (!(next >= 2 * nets_budget_)) break;
    measure_nets(next);
  }
}

double Adviser::most_pilots() const {
  const double of_short = std::min(short_pilot_draws * unit_, short_pilot_share * found_->run_work);
  const double most = std::max(of_short, net_pilot_share * found_->run_work);
  return std::min(most, options_.budget.value_or(most));
}

bool Adviser::take_nets() {
  Advice advice = advice_;
  const NetPilot::Found& found = *found_;
  advice.points = Points::nets;
  advice.base_level = found.base_level;
  advice.base = Base::one_outcome;
  advice.shares_base = false;
  advice.pmf = AnyPmf(Dyadic(found.block.log2_counts, found.theta));
  advice.exponent = advice.pmf.tail_exponent();
  advice.block = advice.pmf.block();
  advice.members = static_cast<std::int64_t>(found.blocks) * advice.block;
  const double n = found.block.members();
  advice.predicted = {found.block.variance * n, found.block.work / n};
  advice.bound = bound_of(advice.survey, known_.model, advice.base_level);
  advice.highest_moment = highest_moment_of(advice.survey, found.theta);
  advice.price = 1;
  if (!is_drawable(advice, runs_.deepest_level, false)) return false;
  advice_ = std::move(advice);
  return true;
}

// ---- the end

void Adviser::conclude() {
  if (!has_base_) {
    throw std::invalid_argument(
        "recipe: no level up to " + std::to_string(advice_.survey.rows.back().level) +
        " can be the base (values, or their squares, are not finite numbers in these draws); take draws whose "
        "weights vary less, or a larger budget for deeper levels");
  }
  if (by_nets()) {
    if (take_nets()) return;
    why_plain_ = "the tail of nets reaches levels that cannot be drawn";
  }
  if (asks_nets_ && advice_.usable()) {
    throw std::invalid_argument("recipe: nets (" + (why_plain_.empty() ? nets_.why() : why_plain_) +
                                "); take plain numbers, or leave the choice to the pilot");
  }
  advice_ = choose(advice_.survey.pmf_exists == Answer::open, pilot_.work() <= final_share * run_work_);
}

void Adviser::finish() {
  advice_.pilot_work = spent();  // what was drawn for the choice, too
  advice_.pilot_seconds = seconds_so_far();
  if (advice_.usable() && plan_.goal.asked() && static_cast<double>(advice_.members) > most_affordable) {
    refuse_cost(advice_, wanted_members(advice_, plan_), plan_.goal);
  }
  judge_points(advice_.survey, runs_);
  for (const Warning& remark : advice_.survey.remarks) {
    if (!is_note(remark.code)) advice_.warnings.push_back(remark);
  }
  advice_.why_points = why_points();
  advice_.usable() ? describe(advice_) : describe_none(advice_);
}

std::string Adviser::why_points() const {
  if (advice_.points == Points::nets) {
    return (asks_nets_ ? "as asked" : format("%.2g", found_->share) + " of the work of plain numbers predicted") +
           ", from " + std::to_string(NetPilot::nets) + " nets of each level up to " +
           std::to_string(nets_.last_level());
  }
  if (!why_plain_.empty()) return why_plain_;
  if (found_) {
    return "nets would take " + format("%.2g", found_->share) + " of the work, a quarter less is the least gain";
  }
  return nets_budget_ > 0 ? nets_.why() : "no nets were measured: the run is short, or its levels are not known";
}

}  // namespace

bool Advice::usable() const { return survey.pmf_exists != Answer::no; }

Advice advise(const LevelRuns& levels, const Plan& plan, const RecipeOptions& options) {
  check(levels, plan, options);
  return Adviser(levels, plan, options).advise();
}

}  // namespace debias

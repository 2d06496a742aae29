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
constexpr double short_pilot_draws = 2e4;      // of both kinds, in work of the lowest level
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

// The advice for blocks of nets in place of plain numbers.
void take_nets(const NetPilot::Found& found, Advice& advice) {
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
  advice.bound = bound_of(advice.survey, model_of(advice.survey), advice.base_level);
  advice.highest_moment = highest_moment_of(advice.survey, found.theta);
  advice.price = 1;
}

}  // namespace

bool Advice::usable() const { return survey.pmf_exists != Answer::no; }

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
  const bool asks_nets = options.points == Points::nets;
  if (asks_nets && options.base == Base::every_sample) {
    throw std::invalid_argument(
        "recipe: nets with Base::every_sample (base and difference take two streams, and a point is one); take "
        "Base::one_outcome, or leave one of them out");
  }
  NetPilot nets(runs, pilot_plan, options, unit);
  std::optional<NetPilot::Found> found;  // blocks of nets
  double nets_budget = 0;                // of what they were measured with
  std::string why_plain = options.points == Points::plain ? "as asked" : "";
  if (why_plain.empty() && options.base == Base::every_sample) why_plain = "the base in every sample was asked for";
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
        has_base = choose_term(runs, pilot_plan, options, asked, finally && !asked, next);
        if (!has_base) {
          next.survey.pmf_exists = Answer::open;
          next.survey.grade = Grade::open;
        } else if (asked) {
          set_members(next, wanted_members(next, plan));
          // With the block of that many members.
          has_base = choose_term(runs, pilot_plan, options, asked, finally, next);
          set_members(next, wanted_members(next, plan));
        }
      }
      next.pilot_work = pilot.work() + extra + nets.work();
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
    const bool yes = advice.survey.pmf_exists == Answer::yes;
    const auto seconds_left = [&] {
      return plan.goal.seconds > 0 ? Goal::aim * plan.goal.seconds - seconds_so_far() : 0;
    };
    const auto measure_nets = [&](double work) {
      found = nets.choose(work, plan, advice, seconds_left());
      nets_budget = work;
    };
    const auto by_nets = [&] { return found && (asks_nets || found->share <= worthwhile_share); };
    const auto spent = [&] { return pilot.work() + extra + nets.work(); };
    // What pilots of both kinds may cost beside a run of nets.
    const auto most_pilots = [&] {
      const double most = std::max(short_pilot_draws * unit, net_pilot_share * found->run_work);
      return std::min(most, options.budget.value_or(most));
    };
    if (why_plain.empty() && has_base && advice.usable() && (yes || asks_nets)) {
      const double least = nets.least_work(lowest);
      double first = std::min(first_nets_draws * unit, first_nets_share * run_work);
      if (options.budget) first = std::min(first, *options.budget - spent());
      if (asks_nets) first = std::max(first, least);
      if (nets_budget > 0 || first >= least) measure_nets(std::max(nets_budget, first));
    }
    const auto wanted_work = [&] {
      const double limit = options.budget.value_or(std::max(run_work, 0.0));
      double wanted = 0;
      if (!yes) {
        wanted = open_growth * budget;
      } else if (by_nets()) {
        wanted = std::min({first_pilot_draws * unit, level_share * most_pilots(), most_growth * budget});
      } else {
        // A long run deserves a pilot that has seen more, for the sake of its PMF.
        wanted = std::min(pilot_share * run_work / (runs.shared ? 3 : 1), most_growth * budget);
        if (advice.survey.grade != Grade::shown) {
          wanted = std::max(wanted, std::min(open_growth * budget, likely_share * run_work));
        }
      }
      // What a choice draws for itself counts, too, but not what is looked at once.
      wanted = std::min(wanted, limit * pilot.work() / (pilot.work() + extra - pilot.looked_ahead()));
      if (plan.goal.seconds > 0) {
        wanted = std::min(wanted, budget * plan.goal.seconds / 4 / std::max(advice.pilot_seconds, 1e-9));
      }
      return wanted;
    };
    const bool late = plan.goal.seconds > 0 && advice.pilot_seconds > plan.goal.seconds / 4;
    const auto is_last = [&] { return stage == most_stages || late || !(wanted_work() > 1.5 * budget); };
    if (by_nets() && is_last()) {
      // Levels are known: what is left of the pilot goes to nets.
      while (by_nets()) {
        double next = std::min(net_growth * nets_budget, most_pilots() - spent());
        if (plan.goal.seconds > 0) {
          next = std::min(next, nets_budget * plan.goal.seconds / 8 / std::max(seconds_so_far(), 1e-9));
        }
        if (!(next >= 2 * nets_budget)) break;
        measure_nets(next);
      }
    }
    if (is_last()) {
      if (!has_base) {
        throw std::invalid_argument(
            "recipe: no level up to " + std::to_string(advice.survey.rows.back().level) +
            " can be the base (values, or their squares, are not finite numbers in these draws); take draws whose "
            "weights vary less, or a larger budget for deeper levels");
      }
      if (by_nets()) {
        Advice with_nets = advice;
        take_nets(*found, with_nets);
        if (is_drawable(with_nets, runs.deepest_level, false)) {
          advice = std::move(with_nets);
          break;
        }
        why_plain = "the tail of nets reaches levels that cannot be drawn";
      }
      if (asks_nets && advice.usable()) {
        throw std::invalid_argument("recipe: nets (" + (why_plain.empty() ? nets.why() : why_plain) +
                                    "); take plain numbers, or leave the choice to the pilot");
      }
      advice = choose(advice.survey.pmf_exists == Answer::open, pilot.work() <= final_share * run_work);
      break;
    }
    const double wanted = wanted_work();
    if (advice.survey.pmf_exists != Answer::yes) deepest *= 4;
    budget = wanted;
  }
  advice.pilot_work = pilot.work() + extra + nets.work();  // what was drawn for the choice, too
  advice.pilot_seconds = seconds_so_far();
  if (advice.usable() && plan.goal.asked() && static_cast<double>(advice.members) > most_affordable) {
    refuse_cost(advice, wanted_members(advice, plan));
  }
  judge_points(advice.survey, runs);
  for (const Warning& remark : advice.survey.remarks) {
    if (!is_note(remark.code)) advice.warnings.push_back(remark);
  }
  if (advice.points == Points::nets) {
    advice.why_points =
        asks_nets ? "as asked" : format("%.2g", found->share) + " of the work of plain numbers predicted";
    advice.why_points +=
        ", from " + std::to_string(NetPilot::nets) + " nets of each level up to " + std::to_string(nets.last_level());
  } else if (!why_plain.empty()) {
    advice.why_points = why_plain;
  } else if (found) {
    advice.why_points =
        "nets would take " + format("%.2g", found->share) + " of the work, a quarter less is the least gain";
  } else {
    advice.why_points =
        nets_budget > 0 ? nets.why() : "no nets were measured: the run is short, or its levels are not known";
  }
  advice.usable() ? describe(advice) : describe_none(advice);
  return advice;
}

}  // namespace debias

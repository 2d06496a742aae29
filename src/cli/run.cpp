#include <cmath>
#include <ostream>
#include <stdexcept>
#include <string>
#include <utility>

#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

Verdict verdict_of(const catalog::Problem& problem, const catalog::Choice& choice) {
  if (const catalog::Special* special = catalog::find_special(problem, choice.special)) {
    Verdict v;
    v.finite_variance = true;
    v.finite_work = true;
    v.sentence = special->description;
    if (!special->reason.empty()) v.sentence += "; " + special->reason;
    if (special->kurtosis > 0 && std::isfinite(special->kurtosis)) {
      v.sentence += " a kurtosis of " + rounded(special->kurtosis, 3);
    }
    return v;
  }
  if (std::isnan(problem.rates.variance)) {  // nothing is declared
    Verdict v;
    v.finite_variance = true;
    v.finite_work = true;
    return v;
  }
  if (choice.method != catalog::Method::truncated) {
    return judge(rates_of(problem, choice.method), choice.law.tail_exponent());
  }
  Verdict v;
  v.finite_variance = true;
  v.finite_work = true;
  v.sentence = "one level only: its bias is no part of the standard error";
  return v;
}

}  // namespace

std::string title(const catalog::Problem& p) {
  return (p.id.empty() ? "" : p.id + " ") + p.name + (p.formula.empty() ? "" : ": " + p.formula);
}

std::string law_text(const catalog::Choice& choice) {
  return choice.method == catalog::Method::truncated || !choice.special.empty() ? "" : choice.law.spec();
}

void print(std::ostream& out, const Run& run) {
  const Statistics& s = run.statistics;
  print_line(out, "problem", title(*run.problem));
  out << s;
  if (run.interval.confidence != 0.95) {
    print_line(out, "interval",
               rounded(100 * run.interval.confidence, 10) + " % [" + rounded(run.interval.low, 8) + ", " +
                   rounded(run.interval.high, 8) + "]");
  }
  if (!s.largest.empty()) {
    const LargeSample& l = s.largest.front();
    print_line(
        out, "largest",
        rounded(l.value, 6) + " (sample " + std::to_string(l.index) + ", level " + std::to_string(l.level) + ")");
  }
  if (!std::isnan(run.z)) {
    print_line(out, "truth", rounded(run.problem->truth, 15) + ", z = " + rounded(run.z, 3));
  }
  if (!run.verdict.sentence.empty()) print_line(out, "declared", run.verdict.sentence);
  if (!run.advice) return;
  out << *run.advice;
  if (run.problem->id.empty()) return;
  const catalog::Choice& c = run.choice;
  print_line(out, "replay",
             "debias replay " + run.problem->id + " --estimator " + std::string(name_of(c)) + " --law '" +
                 c.law.spec() + "' --base-level " + std::to_string(c.base_level) + " --block " +
                 std::to_string(c.block) + " --seed " + std::to_string(s.seed) + " --sample I");
}

MultilevelRun multilevel_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch) {
  return prepared_multilevel_of(problem, arguments, watch, [](std::int64_t, Plan&) {});
}

// The biased baseline with a driver of its own: a target error instead of samples.
MultilevelRun prepared_multilevel_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch,
                                     const std::function<void(std::int64_t level, Plan&)>& prepare) {
  Plan plan = read_plan(arguments);
  if (!(plan.goal.error > 0)) {
    throw std::invalid_argument("--estimator multilevel (takes its draws from --error); write --error 0.01");
  }
  if (arguments.law != "declared" || arguments.base_level != "auto" || arguments.block != "1") {
    throw std::invalid_argument("--estimator multilevel (has no law, base level or block to choose); leave them out");
  }
  plan.progress = [&](std::int64_t finished) {
    return watch(problem.id + ": level by level", static_cast<double>(finished), 0);
  };
  LevelRuns levels = problem.levels;
  levels.draw = [&](std::int64_t level, Plan part) {
    prepare(level, part);
    return problem.levels.draw(level, part);
  };
  return {&problem, multilevel(levels, plan.goal.error, plan)};
}

void print(std::ostream& out, const MultilevelRun& run) {
  print_line(out, "problem", title(*run.problem));
  out << run.statistics;
  const double distance = (run.statistics.components.front().mean - run.problem->truth) / run.statistics.goal;
  if (std::isnan(distance)) return;
  print_line(out, "truth", rounded(run.problem->truth, 15) + ", " + rounded(distance, 3) + " goals away");
}

AdviceOn advice_on(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch) {
  Plan plan = read_plan(arguments);
  plan.progress = [&](std::int64_t finished) {
    return watch(problem.id + ": pilot", static_cast<double>(finished), 0);
  };
  return {&problem, advise(problem.levels, plan, read_recipe(arguments, problem))};
}

void print(std::ostream& out, const AdviceOn& a) {
  print_line(out, "problem", title(*a.problem));
  out << a.advice;
}

Run run_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch) {
  return prepared_run_of(problem, arguments, watch, [](const catalog::Choice&, const Advice*, Plan&) {});
}

Run prepared_run_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch,
                    const std::function<void(const catalog::Choice&, const Advice*, Plan&)>& prepare) {
  const bool by_recipe = wants_recipe(arguments);
  catalog::Choice choice;
  RecipeOptions options;
  by_recipe ? void(options = read_recipe(arguments, problem)) : void(choice = read_choice(arguments, problem));
  const double confidence = read_confidence(arguments.confidence);
  Plan plan = read_plan(arguments);
  double total = 0;
  plan.progress = [&](std::int64_t finished) { return watch(problem.id, static_cast<double>(finished), total); };
  std::optional<Advice> advice;
  const Goal goal = plan.goal;
  if (by_recipe) {
    advice = advise(problem.levels, plan, options);
    choice = {advice->base == Base::always ? catalog::Method::single_term : catalog::Method::single_term_drawn,
              advice->law, advice->base_level, "", advice->block};
    plan = detail::plan_of(plan, *advice);
  }
  prepare(choice, advice ? &*advice : nullptr, plan);
  total = plan.goal.asked() ? 0 : static_cast<double>(plan.samples);
  const Verdict verdict = verdict_of(problem, choice);
  Statistics statistics = problem.run(choice, plan);
  if (advice) detail::follow(statistics, *advice, goal);
  if (choice.base_level < problem.lowest_base) {
    statistics.warnings.push_back(
        "the base level lies below " + std::to_string(problem.lowest_base) +
        ", where the fourth moment of a level is infinite and the standard error is not to be trusted.");
  }
  const Interval interval = statistics.interval(confidence);
  const double z =
      (statistics.components.front().mean - problem.truth) / catalog::believed_error(statistics, problem.truth);
  return {&problem, choice, std::move(advice), std::move(statistics), interval, verdict, z};
}

int run_multilevel(const Arguments& arguments) {
  if (!arguments.shard.empty()) {
    throw std::invalid_argument("--shard (multilevel decides after each level, from all draws); leave it out");
  }
  if (arguments.ranks != nullptr && !arguments.checkpoint.empty()) {
    throw std::invalid_argument(
        "--checkpoint (ranks keep the run of one estimator, not the levels of multilevel); start it without mpirun");
  }
  const catalog::Problem& problem = catalog::find(arguments.problem);
  Arguments words = arguments;
  words.problem = problem.id;
  words.seed = std::to_string(read_plan(arguments).seed);
  Session session("run", words);
  Output out(arguments.output);
  Progress progress(arguments.quiet);
  const auto prepare = [&](std::int64_t level, Plan& plan) {
    session.attach(plan, "level " + std::to_string(level) + " from " + std::to_string(plan.first));
  };
  const MultilevelRun result =
      session.guard([&] { return prepared_multilevel_of(problem, words, watch_on(progress), prepare); });
  progress.erase();
  session.flush();
  if (arguments.json) {
    out.stream() << multilevel_json(result) << '\n';
  } else {
    print(out.stream(), result);
  }
  out.flush();
  if (result.statistics.goal_met()) return done;
  complain(result.statistics.converged ? "the goal is missed: the error as measured is larger"
                                       : "the goal is missed: the levels are not enough");
  return goal_missed;
}

int run_at_once(const Arguments& arguments) {
  const catalog::Problem& problem = catalog::find(arguments.problem);
  Output out(arguments.output);
  Progress progress(arguments.quiet);
  const Run result = run_of(problem, arguments, watch_on(progress));
  progress.erase();
  return finish(result, arguments, out);
}

int finish(const Run& result, const Arguments& arguments, Output& out) {
  if (!result.verdict.finite_work && !arguments.quiet) complain("warning: " + result.verdict.sentence);

  if (arguments.json) {
    out.stream() << run_json(result) << '\n';
  } else {
    print(out.stream(), result);
  }
  out.flush();
  const Statistics& s = result.statistics;
  if (out.is_file() && !arguments.quiet) {
    Output summary;
    const ComponentEstimate& c = s.components.front();
    summary.stream() << result.problem->id << ' ' << result.problem->name << ": "
                     << with_error(c.mean, c.standard_error) << ", z = " << rounded(result.z, 3) << ", "
                     << std::to_string(s.samples) << " samples, seed " << std::to_string(s.seed) << '\n';
    summary.flush();
  }
  if (s.nonfinite == 0 && s.goal_met()) return done;
  if (s.nonfinite == 0) {
    complain(s.goal.seconds == 0 && s.total_error() <= s.goal_error() / 2
                 ? "the goal is missed: the stated bias is most of the error, and more samples do not change it"
                 : "the goal is missed: the pilot saw less variance, or faster samples, than the run");
    return goal_missed;
  }
  complain(std::to_string(s.nonfinite) + " of " + std::to_string(s.samples) +
           " samples are not finite; replay the first with --seed " + std::to_string(s.seed) + " --sample " +
           std::to_string(s.first_nonfinite));
  return nonfinite_samples;
}

}  // namespace debias::cli

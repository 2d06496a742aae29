#include "multilevel.hpp"

#include <cmath>
#include <ostream>
#include <string>
#include <variant>

#include "describe.hpp"
#include "text.hpp"

namespace debias::commands {

MultilevelRequest multilevel_of(const RunRequest& request) {
  const Field estimator{"estimator"};
  const Field error{"error"};
  if (request.shard) {
    throw BadRequest({Field{"shard"}, " (multilevel decides after each level, from all draws); leave it out"});
  }
  if (request.confidence != RunRequest{}.confidence) {
    throw BadRequest({Field{"confidence"}, " = '" + rounded(request.confidence, 15) +
                                               "' (multilevel has no interval, its error holds a bias); leave it out"});
  }
  const Plan plan = plan_of(request.sampling);
  if (!(plan.goal.error > 0)) {
    throw BadRequest({estimator, " multilevel (takes its draws from ", error, "); write ", error, " 0.01"});
  }
  const Shape& shape = request.shape;
  if (!std::holds_alternative<Declared>(shape.pmf) || shape.base_level || shape.block != 1 ||
      shape.points == Points::nets) {
    throw BadRequest(
        {estimator, " multilevel (has no PMF, base level or block to choose, and no points); leave them out"});
  }
  return {request.problem, plan.goal.error, plan.seed, plan.threads, plan.ranks};
}

MultilevelReport multilevel(const MultilevelRequest& request, const Caller& caller) {
  const catalog::Problem& problem = *request.problem;
  Plan plan{.seed = request.seed, .threads = request.threads, .ranks = request.ranks};
  plan.progress = [&](std::int64_t done) {
    return caller.goes_on(problem.id + ": level by level", static_cast<double>(done), 0);
  };
  LevelRuns levels = levels_of(problem);
  levels.draw = [&](std::int64_t level, Plan part) {
    caller.attach(part, "level " + std::to_string(level) + " from " + std::to_string(part.first));
    return problem.levels.draw(level, part);
  };
  return {&problem, debias::multilevel(levels, request.error, plan)};
}

void print(std::ostream& out, const MultilevelReport& run, bool full) {
  print_line(out, "problem", title(*run.problem));
  full ? print_full(out, run.statistics) : void(out << run.statistics);
  const double distance = (run.statistics.components.front().mean - run.problem->truth) / run.statistics.goal;
  if (std::isnan(distance)) return;
  print_line(out, "truth", rounded(run.problem->truth, 15) + ", " + rounded(distance, 3) + " goals away");
}

Fields fields(const MultilevelReport& run) {
  const MultilevelStatistics& s = run.statistics;
  Fields f = describe(*run.problem);
  append(f, {{"estimator", "multilevel"},
             {"mean", s.components.front().mean},
             {"standard_error", s.components.front().standard_error},
             {"bias", s.bias},
             {"goal", Fields{{"error", s.goal}, {"met", s.goal_met()}}},
             {"alpha", s.alpha},
             {"beta", s.beta},
             {"work", s.work},
             {"seconds", s.seconds},
             {"pilot_work", s.pilot_work},
             {"pilot_seconds", s.pilot_seconds},
             {"warnings", s.warnings},
             {"seed", s.seed},
             {"truth", run.problem->truth},
             {"levels", list_of(s.rows, [](const MultilevelRow& r) {
                return Fields{{"level", r.level},
                              {"count", r.draws},
                              {"mean", r.difference},
                              {"variance", r.variance},
                              {"work", r.work}};
              })}});
  append(f, versions());
  return f;
}

}  // namespace debias::commands

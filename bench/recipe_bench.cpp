// Options to a standard error by recipe, pilot included, and by multilevel on the same draws: time and work.
// european-call/recipe_vs_multilevel: counters ratio (of the times), work_ratio, both at the error that was reached.

#include <cstdint>

#include <benchmark/benchmark.h>

#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>

#include "catalog.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

void recipe_against_multilevel(benchmark::State& state, const char* id, double error) {
  const catalog::Problem& problem = catalog::find(id);
  double ours = 0;
  double theirs = 0;
  std::uint64_t seed = 0;
  const auto by_recipe = [&] {
    const Plan plan{.seed = ++seed, .threads = 1, .goal = {.error = error}};
    const Advice advice = advise(problem.levels, plan, {.lowest_base = problem.lowest_base});
    const catalog::Method method =
        advice.base == Base::every_sample ? catalog::Method::single_term : catalog::Method::single_term_outcome;
    const Statistics s = problem.run(
        {method, advice.pmf, advice.base_level, "", advice.block, advice.points},
        {.samples = advice.members, .seed = seed, .threads = 1, .pilot = {advice.pilot_work, advice.pilot_seconds}});
    const double reached = s.total_error() / error;
    ours += s.work * reached * reached;
  };
  const auto by_multilevel = [&] { theirs += multilevel(problem.levels, error, {.seed = seed, .threads = 1}).work; };
  Ratio r;
  for (auto _ : state) r = paired_ratio(by_recipe, by_multilevel, 16);
  state.counters["ratio"] = r.ratio;
  state.counters["recipe_ms"] = 1e3 * r.ours;
  state.counters["multilevel_ms"] = 1e3 * r.theirs;
  state.counters["work_ratio"] = ours / theirs;
}

BENCHMARK_CAPTURE(recipe_against_multilevel, european_call, "E02", 0.01)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(recipe_against_multilevel, square_of_mean, "A10", 0.002)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(recipe_against_multilevel, nested_square, "F02", 0.005)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace debias::bench

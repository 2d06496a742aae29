// Error against work for goals over decades: goals/ID/METHOD, by independent runs, one thread, pilots counted.
//
//   recipe           what it finds better, nets or plain numbers; 64 runs, which know an error to 9 %
//   plain            the recipe without nets; 32 runs, which know it to 12 %, up to a work of 5e8 a run, the last goal left out
//   multilevel       the library's, biased; likewise
//   multilevel_nets  with nets, written by hand, biased; 32 runs
//
//   work_i, error_i  mean work and root mean square of the true error at goal i
//   slope            of log error over log work, by least squares
//
// bench/goals.sh runs them one by one into files of a folder, goes on where it was stopped, and notebooks/pictures/draw.py draws these.

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>

#include "baseline_multilevel_nets.hpp"
#include "catalog.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

struct Answer {
  double value = 0;
  double work = 0;
};

Answer by_recipe(const catalog::Problem& p, const Plan& plan, std::optional<Points> points) {
  RecipeOptions options{.lowest_base = p.lowest_base};
  options.points = points;
  const Advice a = advise(p.levels, plan, options);
  const auto method =
      a.base == Base::every_sample ? catalog::Method::single_term : catalog::Method::single_term_outcome;
  const Statistics s = p.run({method, a.pmf, a.base_level, "", a.block, a.points}, detail::plan_of(plan, a));
  return {s.components.front().mean, s.work};
}

Answer by(const std::string& method, const catalog::Problem& p, double error, std::uint64_t seed) {
  const Plan plan{.seed = seed, .threads = 1, .goal = {.error = error}};
  if (method == "recipe") return by_recipe(p, plan, {});
  if (method == "plain") return by_recipe(p, plan, Points::plain);
  if (method == "multilevel") {
    const MultilevelStatistics s = multilevel(p.levels, error, {.seed = seed, .threads = 1});
    return {s.components.front().mean, s.work};
  }
  const double alpha = p.rates.variance_decay / 2;
  const plain::NetsAnswer s = plain::multilevel_nets(p.levels, p.lowest_base, error, alpha, seed);
  return {s.value, s.work};
}

void goals(benchmark::State& state, const std::string& method, const char* id, double first, double ratio, int count) {
  constexpr double most_work = 5e8;
  const int runs = method == "recipe" ? 64 : 32;
  const bool falls_slowly = method == "plain" || method == "multilevel";
  if (falls_slowly) --count;
  const catalog::Problem& p = catalog::find(id);
  std::vector<double> x;
  std::vector<double> y;
  for (auto _ : state) {
    double goal = first;
    for (int g = 0; g < count; ++g, goal /= ratio) {
      double work = 0;
      double squares = 0;
      for (int run = 1; run <= runs; ++run) {
        const Answer a = by(method, p, goal, static_cast<std::uint64_t>(1000 * (g + 1) + run));
        work += a.work / runs;
        squares += (a.value - p.truth) * (a.value - p.truth) / runs;
      }
      state.counters["work_" + std::to_string(g)] = work;
      state.counters["error_" + std::to_string(g)] = std::sqrt(squares);
      x.push_back(std::log(work));
      y.push_back(std::log(std::sqrt(squares)));
      if (falls_slowly && work * ratio * ratio > most_work) break;
    }
  }
  state.counters["slope"] = slope_of(x, y);
}

struct Case {
  const char* id;
  double first;  ///< goal
  double ratio;  ///< of goals in a row
  int count;
};
// Goals that take 1e4 to 1e8 of work or so by the recipe.
constexpr Case cases[] = {{"E02", 0.08, 4, 5},   {"E03", 0.04, 4, 5},  {"E04", 0.16, 3, 5}, {"F01", 0.032, 2.5, 5},
                          {"H01", 0.04, 4, 5},   {"B28", 4e-4, 16, 5}, {"A10", 0.01, 3, 5}, {"E07", 0.04, 4, 5},
                          {"F02", 0.02, 2.5, 5}, {"A06", 0.01, 3, 5}};

const bool registered = [] {
  for (const Case& c : cases) {
    for (const std::string method : {"recipe", "plain", "multilevel", "multilevel_nets"}) {
      benchmark::RegisterBenchmark(
          ("goals/" + std::string(c.id) + "/" + method).c_str(),
          [=](benchmark::State& state) { goals(state, method, c.id, c.first, c.ratio, c.count); })
          ->Iterations(1)
          ->Unit(benchmark::kSecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench

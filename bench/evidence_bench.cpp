// What the evidence of a recipe costs beside its draws: processor time of the advice less that of its draws, and of the verdict of
// the run, for every problem of the catalogue that has a PMF (debias_bench --benchmark_filter=evidence; median and largest).

#include <ctime>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/core/estimate.hpp>
#include <debias/recipe.hpp>

#include "catalog.hpp"

namespace debias::bench {
namespace {

double processor_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// The same levels, which add to `seconds` what a draw takes.
LevelRuns timed(const LevelRuns& levels, double& seconds) {
  const auto with_time = [&seconds](auto& draw) {
    if (!draw) return;
    draw = [&seconds, inner = draw](auto&&... words) {
      const double start = processor_seconds();
      auto result = inner(std::forward<decltype(words)>(words)...);
      seconds += processor_seconds() - start;
      return result;
    };
  };
  LevelRuns runs = levels;
  with_time(runs.draw);
  with_time(runs.work);
  with_time(runs.shared);
  with_time(runs.together);
  with_time(runs.nets);
  with_time(runs.missed);
  return runs;
}

// Milliseconds for one problem: advice, verdict.
std::pair<double, double> cost_of(const catalog::Problem& p, const Plan& plan) {
  double draws = 0;
  const LevelRuns runs = timed(p.levels, draws);
  const double start = processor_seconds();
  const Advice a = advise(runs, plan, {.lowest_base = p.lowest_base});
  const double advised = processor_seconds() - start - draws;
  const auto method =
      a.base == Base::every_sample ? catalog::Method::single_term : catalog::Method::single_term_outcome;
  const Statistics s = p.run({method, a.pmf, a.base_level, "", a.block, a.points}, detail::plan_of(plan, a));
  const double ran = processor_seconds();
  benchmark::DoNotOptimize(s.verdict());
  return {1e3 * advised, 1e3 * (processor_seconds() - ran)};
}

void evidence(benchmark::State& state) {
  std::vector<double> advices;
  std::vector<double> verdicts;
  std::vector<double> both;
  std::string worst;
  for (auto _ : state) {
    for (const catalog::Problem& p : catalog::problems()) {
      if (!pmf_exists(p.rates)) continue;
      for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        try {
          const auto [advice, verdict] = cost_of(p, {.samples = state.range(0), .seed = seed, .threads = 1});
          advices.push_back(advice);
          verdicts.push_back(verdict);
          if (both.empty() || advice + verdict > *std::max_element(both.begin(), both.end())) worst = p.id;
          both.push_back(advice + verdict);
        } catch (const std::invalid_argument&) {  // refused
        }
      }
    }
  }
  const auto median = [](std::vector<double> all) {
    std::sort(all.begin(), all.end());
    return all[all.size() / 2];
  };
  state.counters["advice_ms"] = median(advices);
  state.counters["verdict_ms"] = median(verdicts);
  state.counters["both_ms"] = median(both);
  state.counters["largest_ms"] = *std::max_element(both.begin(), both.end());
  state.SetLabel("largest: " + worst);
}
BENCHMARK(evidence)->Arg(1 << 13)->Arg(1 << 16)->Iterations(1)->Unit(benchmark::kSecond);

}  // namespace
}  // namespace debias::bench

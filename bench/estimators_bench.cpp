// Every estimator on every problem of the catalogue: reciprocal-of-mean/single_term/base_0, ...
// Counters: work per sample, and efficiency = 1 / (variance x seconds per sample), on one thread. Time alone
// ranks estimators wrongly. Choose with --benchmark_filter.

#include <string>

#include <benchmark/benchmark.h>

#include "validation/validation.hpp"

namespace debias::bench {
namespace {

void run(benchmark::State& state, const catalog::Problem& problem, const catalog::Choice& choice) {
  Statistics statistics;
  for (auto _ : state) statistics = problem.run(choice, {.samples = 1 << 15, .threads = 1});
  state.counters["work"] = statistics.work_per_sample();
  state.counters["efficiency"] = statistics.efficiency();
  state.counters["ns_per_sample"] = 1e9 * statistics.seconds / static_cast<double>(statistics.samples);
}

const bool registered = [] {
  for (const catalog::Problem& problem : catalog::problems()) {
    for (const catalog::Choice& choice : validation::choices(problem)) {
      if (choice.special.empty() && !pmf_exists(problem.rates)) continue;
      const std::string name =
          problem.name + "/" + std::string(catalog::name_of(choice)) + "/base_" + std::to_string(choice.base_level);
      benchmark::RegisterBenchmark(name.c_str(), [&problem, choice](benchmark::State& state) {
        run(state, problem, choice);
      })->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench

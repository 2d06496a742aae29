// Every estimator of the catalogue on every problem, ranked by efficiency = 1 / (variance x seconds a sample):
// catalog/A10/single_term, ... and catalog/A10/blocks of 64. One thread, 2^17 samples, the default PMF.

#include <cmath>
#include <stdexcept>
#include <string>

#include <benchmark/benchmark.h>

#include "catalog.hpp"

namespace debias::bench {
namespace {

void measure(benchmark::State& state, const catalog::Problem& problem, const catalog::Choice& choice) {
  const Plan plan{.samples = 1 << 17, .threads = 1};
  Statistics s;
  for (auto _ : state) s = problem.run(choice, plan);
  state.counters["variance"] = s.components.front().variance;
  state.counters["work"] = s.work_per_sample();
  state.counters["ns_per_sample"] = 1e9 * s.seconds / static_cast<double>(s.samples);
  state.counters["efficiency"] = s.efficiency();
  if (s.verdict().variance != Finiteness::finite) state.SetLabel("variance not known to be finite");
}

void add(const catalog::Problem& problem, const std::string& name, const catalog::Choice& choice) {
  benchmark::RegisterBenchmark(("catalog/" + problem.id + "/" + name).c_str(),
                               [&problem, choice](benchmark::State& state) { measure(state, problem, choice); })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

const bool registered = [] {
  for (const catalog::Problem& problem : catalog::problems()) {
    for (const catalog::Method method : problem.methods) {
      if (method == catalog::Method::truncated) continue;  // biased: variance alone ranks it wrongly
      try {
        const catalog::Choice choice{method, default_pmf(problem, method), problem.lowest_base};
        add(problem, std::string(name_of(method)), choice);
        if (method != catalog::Method::single_term) continue;
        catalog::Choice blocks = choice;
        blocks.block = 64;
        add(problem, "blocks of 64", blocks);
      } catch (const std::invalid_argument&) {  // no PMF has finite variance and finite work
      }
    }
    for (const catalog::Special& special : problem.specials) add(problem, special.name, {.special = special.name});
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench

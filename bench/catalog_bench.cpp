// Every estimator of the catalogue on every problem, ranked by efficiency = 1 / (variance x seconds a sample):
// catalog/A10/single_term, ... and catalog/A10/blocks of 64. One thread, 2^17 samples, the default PMF.
// And what the one type of all levels costs: plain/catalog/..., time of a run by the catalogue over that of the estimator of the
// sequence itself, alternating in one run.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include <benchmark/benchmark.h>

#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/sde.hpp>
#include <debias/series.hpp>

#include "catalog.hpp"
#include "paired.hpp"

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

template <class S>
void beside(benchmark::State& state, const char* id, const S& sequence) {
  const catalog::Problem& problem = catalog::find(id);
  const AnyPmf pmf = default_pmf(problem);
  const auto estimator = single_term(sequence, pmf);
  const Plan plan{.samples = 1 << 14, .threads = 1};
  for (auto _ : state) {
    const Ratio r = paired_ratio([&] { benchmark::DoNotOptimize(problem.run({.pmf = pmf}, plan)); },
                                 [&] { benchmark::DoNotOptimize(estimate(estimator, plan)); }, 31);
    report(state, r, static_cast<double>(plan.samples));
  }
}
void one_type(benchmark::State& state) {
  switch (state.range(0)) {
    case 0:
      return beside(state, "D01",
                    series([](std::int64_t k) { return std::ldexp(1.0, -static_cast<int>(k)); }, geometric_terms(0.5)));
    case 1:
      return beside(state, "A01",
                    function_of_mean([](Stream& rng) { return 2 * rng.uniform(); }, functions::ExpMinus{}));
    default:
      return beside(state, "E02",
                    milstein(GeometricBrownianMotion{.start = 100, .growth = 0.05, .volatility = 0.2},
                             [](double s) { return std::max(s - 100, 0.0) * std::exp(-0.05); }));
  }
}
BENCHMARK(one_type)->Name("plain/catalog/D01_A01_E02")->DenseRange(0, 2)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace debias::bench

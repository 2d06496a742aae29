// Error against samples and time over four decades, on ten problems: slope/..., and the memory of 10^9 samples.
//
//   slope          of log |error| over log N, fitted to N = 10^2 ... 10^6, one thread
//   slope_of_time  over log seconds: steeper, since a run has a fixed cost, that of `fixed_us` microseconds
//   predicted      -1/2; for a PMF whose samples have tail index alpha < 2: -(1 - 1 / alpha)   [stable laws, Feller 1971]
//
// The error is a root mean square over seeds where the variance is finite, a median of |error| where it is not.

#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/pmf/geometric.hpp>

#include "catalog.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

/// `alpha` is the tail index of a sample: infinity stands for a finite variance.
void slope(benchmark::State& state, const char* id, const AnyPmf& pmf, double alpha) {
  const catalog::Problem& problem = catalog::find(id);
  const bool finite = std::isinf(alpha);
  std::vector<double> log_samples;
  std::vector<double> x;
  std::vector<double> y;
  for (auto _ : state) {
    std::int64_t samples = 100;
    for (const int seeds : {1024, 1024, 512, 512, 192}) {
      std::vector<double> errors;
      double seconds = 0;
      double squares = 0;
      for (int seed = 1; seed <= seeds; ++seed) {
        const Statistics s = problem.run({.pmf = pmf, .base_level = problem.lowest_base},
                                         {.samples = samples, .seed = static_cast<std::uint64_t>(seed), .threads = 1});
        const double error = s.components.front().mean - problem.truth;
        errors.push_back(std::abs(error));
        squares += error * error / seeds;
        seconds += s.seconds / seeds;
      }
      log_samples.push_back(std::log(static_cast<double>(samples)));
      x.push_back(std::log(seconds));
      y.push_back(std::log(finite ? std::sqrt(squares) : median(errors)));
      samples *= 10;
    }
  }
  state.counters["slope"] = slope_of(log_samples, y);
  state.counters["slope_of_time"] = slope_of(x, y);
  // Two equations in the fixed cost and the cost of a sample, from 10^2 and 10^6 samples.
  const double few = std::exp(x.front());
  state.counters["fixed_us"] = 1e6 * (few - std::exp(x.back()) / 1e4) / (1 - 1e-4);
  state.counters["predicted"] = finite ? -0.5 : -(1 - 1 / alpha);
}

void add(const char* id, const AnyPmf& pmf, double alpha = std::numeric_limits<double>::infinity()) {
  benchmark::RegisterBenchmark((std::string("slope/") + id).c_str(),
                               [=](benchmark::State& state) { slope(state, id, pmf, alpha); })
      ->Iterations(1)
      ->Unit(benchmark::kSecond);
}
void add(const char* id) { add(id, default_pmf(catalog::find(id))); }

/// The most memory that this process has had, in MB.
double peak_memory() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word != "VmHWM:") continue;
    double kilobytes = 0;
    status >> kilobytes;
    return kilobytes / 1024;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

void memory(benchmark::State& state) {
  const catalog::Problem& problem = catalog::find("D01");
  const catalog::Choice choice{.pmf = default_pmf(problem)};
  for (auto _ : state) {
    problem.run(choice, {.samples = 1'000'000});
    state.counters["MB_after_1e6"] = peak_memory();
    problem.run(choice, {.samples = 1'000'000'000});
    state.counters["MB_after_1e9"] = peak_memory();
  }
}
BENCHMARK(memory)->Name("slope/memory")->Iterations(1)->Unit(benchmark::kSecond);

const bool registered = [] {
  for (const char* id : {"A10", "A13", "B02", "C01", "H04", "E02", "F02", "H01"}) add(id);
  // Terms q^k under tails (1 - r)^k: a sample of level k has size (q / (1 - r))^k, alpha = log(1 - r) / log((1 - r) / q).
  for (const double alpha : {1.25, 1.6}) {
    const double q = 0.5;  // D01
    const double tail = std::pow(q, alpha / (alpha - 1));
    add("D01", AnyPmf(Geometric(1 - tail)), alpha);
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench

// Two threads against one: problems whose samples all cost the same, and problems where a single sample may cost as
// much as all others together.
//
// Counters: speedup (time with one thread / time with two, median of 15 alternating rounds), speedup_of_least, ms of
// both, tail_of_work (P(work > w) ~ w^-tail; below 2 its variance is infinite), chunks. On a machine with other guests
// the second core comes and goes: speedup_by_chunks hands the chunks, as long as each took on one thread, to two that
// are always there, and cpu is the processor time of two threads / that of one.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <limits>
#include <vector>

#include <debias/core/estimate.hpp>

#include "catalog.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

using Clock = std::chrono::steady_clock;

// The seconds of each chunk on one thread.
std::vector<double> chunk_seconds(const catalog::Problem& p, const catalog::Choice& choice, std::int64_t samples) {
  std::vector<double> seconds;
  Clock::time_point last = Clock::now();
  Plan plan{.samples = samples, .seed = 7, .threads = 1};
  plan.progress = [&](std::int64_t) {
    const Clock::time_point now = Clock::now();
    seconds.push_back(std::chrono::duration<double>(now - last).count());
    last = now;
    return true;
  };
  p.run(choice, plan);
  return seconds;
}

// What so many threads gain when whoever is free takes the next chunk.
double speedup_by(const std::vector<double>& chunks, std::size_t threads) {
  std::vector<double> busy(threads);
  double total = 0;
  for (const double seconds : chunks) {
    *std::min_element(busy.begin(), busy.end()) += seconds;
    total += seconds;
  }
  return total / *std::max_element(busy.begin(), busy.end());
}

void threads(benchmark::State& state, const char* problem, catalog::Choice choice, std::int64_t samples) {
  const catalog::Problem& p = catalog::find(problem);
  const bool even = choice.method == catalog::Method::truncated;
  if (!even) choice.pmf = catalog::default_pmf(p);
  Statistics one;
  Statistics two;
  double one_cpu = 0;
  double two_cpu = 0;
  const auto run_on = [&](int count, Statistics& s, double& cpu) {
    const std::clock_t start = std::clock();
    s = p.run(choice, {.samples = samples, .seed = 7, .threads = count});
    cpu += static_cast<double>(std::clock() - start);
  };
  for (auto _ : state) {
    const Ratio r = paired_ratio([&] { run_on(1, one, one_cpu); }, [&] { run_on(2, two, two_cpu); });
    state.counters["speedup"] = r.ratio;
    state.counters["speedup_of_least"] = r.least;
    state.counters["one_ms"] = 1e3 * r.ours;
    state.counters["two_ms"] = 1e3 * r.theirs;
  }
  if (one.components[0].mean != two.components[0].mean) state.SkipWithError("other bits on two threads");
  state.counters["tail_of_work"] =
      even ? std::numeric_limits<double>::infinity() : choice.pmf.tail_exponent().exponent / p.rates.work_growth;
  const std::vector<double> chunks = chunk_seconds(p, choice, samples);
  state.counters["chunks"] = static_cast<double>(chunks.size());
  state.counters["speedup_by_chunks"] = speedup_by(chunks, 2);
  state.counters["cpu"] = two_cpu / one_cpu;
}

using catalog::Method;
constexpr auto ms = benchmark::kMillisecond;
BENCHMARK_CAPTURE(threads, even / european_call, "E02", {Method::truncated, AnyPmf(Geometric(0.5)), 8}, 20'000)
    ->Iterations(1)
    ->Unit(ms);
BENCHMARK_CAPTURE(threads, even / nested_max, "F01", {Method::truncated, AnyPmf(Geometric(0.5)), 8}, 20'000)
    ->Iterations(1)
    ->Unit(ms);
BENCHMARK_CAPTURE(threads, heavy / reciprocal_in_8_ms, "A03", {}, 100'000)->Iterations(1)->Unit(ms);
BENCHMARK_CAPTURE(threads, heavy / reciprocal, "A03", {}, 1'000'000)->Iterations(1)->Unit(ms);
BENCHMARK_CAPTURE(threads, heavy / nested_max, "F01", {}, 500'000)->Iterations(1)->Unit(ms);
BENCHMARK_CAPTURE(threads, heavy / european_call, "E02", {}, 500'000)->Iterations(1)->Unit(ms);
BENCHMARK_CAPTURE(threads, heavy / european_call_in_300_blocks, "E02",
                  {Method::single_term, AnyPmf(Geometric(0.5)), 0, "", 4096}, 300)
    ->Iterations(1)
    ->Unit(ms);

}  // namespace
}  // namespace debias::bench

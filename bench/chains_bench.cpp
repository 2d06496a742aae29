// Coupled chains against hand-written coupled loops of the same algorithm: plain/chains/..., ratio of times of equal samples,
// alternating in one run.

#include <cmath>
#include <cstdint>

#include <benchmark/benchmark.h>

#include <debias/chains/coupled_chain.hpp>
#include <debias/chains/metropolis.hpp>

#include "against_loops.hpp"

namespace debias::bench {
namespace {

double density(double x) { return -0.5 * x * x; }

/// A random walk on the line: H of a pair of chains, densities kept.
double plain_walk(std::int64_t k, std::int64_t m, std::int64_t lag, double h, Stream& rng) {
  double x = 3 * rng.normal();
  double at_x = density(x);
  double sum = k == 0 ? x * x : 0;
  double correction = 0;
  std::int64_t t = 0;
  const auto step = [&] {
    const double to = x + h * rng.normal();
    const double at = density(to);
    if (std::log(rng.uniform()) <= at - at_x) {
      x = to;
      at_x = at;
    }
    ++t;
    if (t >= k && t <= m) sum += x * x;
  };
  while (t < lag) step();
  double y = 3 * rng.normal();
  double at_y = density(y);
  while (x != y) {
    if (t >= k + lag) {
      const std::int64_t late = t - m > lag ? t - m : lag;
      const std::int64_t weight = (t - k) / lag - (late + lag - 1) / lag + 1;
      correction += static_cast<double>(weight) * (x * x - y * y);
    }
    const double z = (x - y) / h;
    const double w = rng.normal();
    const double to_x = x + h * w;
    const bool same = std::log(rng.uniform()) <= -w * z - 0.5 * z * z;
    const double to_y = same ? to_x : y - h * w;
    const double log_u = std::log(rng.uniform());
    const double new_x = density(to_x);
    const double new_y = same ? new_x : density(to_y);
    if (log_u <= new_x - at_x) {
      x = to_x;
      at_x = new_x;
    }
    if (log_u <= new_y - at_y) {
      y = to_y;
      at_y = new_y;
    }
    ++t;
    if (t >= k && t <= m) sum += x * x;
  }
  while (t < m) step();
  return (sum + correction) / static_cast<double>(m - k + 1);
}

void walk(benchmark::State& state) {
  const std::int64_t k = state.range(0);
  const std::int64_t m = state.range(1);
  const std::int64_t lag = state.range(2);
  const auto chain = coupled_chain(
      random_walk(density, 2.4), [](Stream& rng) { return 3 * rng.normal(); }, [](double x) { return x * x; },
      {.burn_in = k, .length = m, .lag = lag});
  const auto ours = values_of(chain);
  const auto theirs = [=](Stream& rng) { return plain_walk(k, m, lag, 2.4, rng); };
  double steps = 0;
  for (std::uint64_t i = 0; i < round_samples; ++i) {
    Stream rng(1, i);
    NullRecord none;
    steps += chain(rng, none).work;
  }
  for (auto _ : state) {
    const Ratio r = paired_ratio(loop(ours), loop(theirs), 31);
    report(state, r, static_cast<double>(round_samples));
    state.counters["steps_a_second"] = steps / r.ours;
  }
}
// The advised length, and one that is all coupled steps.
BENCHMARK(walk)
    ->Name("plain/chains/random_walk")
    ->Args({20, 400, 20})
    ->Args({0, 0, 1})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace debias::bench

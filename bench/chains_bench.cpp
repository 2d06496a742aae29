// Coupled chains against hand-written coupled loops of the same algorithm: plain/chains/..., ratio of times of equal samples,
// alternating in one run. And what being unbiased costs:
//
//   chains/inefficiency/...   variance x work of a run of the advised burn_in, length and lag, over the asymptotic variance of one
//                             long plain chain of the same kernel: `measured` beside `advised`, what the pilot says

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/chains.hpp>
#include <debias/core/estimate.hpp>

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

// n Var of the mean of one long plain chain, by means of batches; its error is 4.5 %.
template <class K, class Start, class F>
double asymptotic_variance(const K& kernel, const Start& start, const F& f, std::int64_t steps) {
  constexpr std::int64_t batches = 1000;
  Stream rng(31, 0);
  auto x = debias::detail::begin_state(kernel, start(rng));
  std::vector<double> means;
  for (std::int64_t t = 0; t < 1000; ++t) kernel.step(x, rng);
  for (std::int64_t b = 0; b < batches; ++b) {
    double sum = 0;
    for (std::int64_t t = 0; t < steps / batches; ++t) {
      kernel.step(x, rng);
      sum += f(debias::detail::point_of(kernel, x));
    }
    means.push_back(sum * static_cast<double>(batches) / static_cast<double>(steps));
  }
  return Moments::of(means).variance() * static_cast<double>(steps / batches);
}

template <class K, class Start, class F>
void inefficiency(const std::string& name, const K& kernel, const Start& start, const F& f) {
  const auto run = [=](benchmark::State& state) {
    for (auto _ : state) {
      const auto chain = coupled_chain(kernel, start, f);
      const ChainAdvice advice = advise(chain);
      const auto r = estimate(chain.with(advice.options), {.samples = 20000, .seed = 3});
      const double plain = asymptotic_variance(kernel, start, f, 10'000'000);
      state.counters["burn_in"] = static_cast<double>(advice.options.burn_in);
      state.counters["lag"] = static_cast<double>(advice.options.lag);
      state.counters["length"] = static_cast<double>(advice.options.length);
      state.counters["advised"] = advice.inefficiency;
      state.counters["measured"] = r.components[0].variance * r.work_per_sample() / plain;
      state.counters["plain_variance"] = plain;
    }
  };
  benchmark::RegisterBenchmark(("chains/inefficiency/" + name).c_str(), run)->Iterations(1)->Unit(benchmark::kSecond);
}

const bool registered = [] {
  using Pair = std::array<double, 2>;
  const auto wide = [](Stream& rng) { return 3 * rng.normal(); };
  const auto square = [](double x) { return x * x; };
  const auto slope = [](double x) { return -x; };
  inefficiency("K01", random_walk(density, 2.4), wide, square);
  const auto given = [](std::size_t i, const Pair& x) { return NormalLaw{0.9 * x[1 - i], std::sqrt(1 - 0.81)}; };
  const auto wide_pair = [](Stream& rng) {
    const double a = 3 * rng.normal();
    return Pair{a, 3 * rng.normal()};
  };
  inefficiency("K02", gibbs(given), wide_pair, [](const Pair& x) { return x[0] * x[1]; });
  const auto modes = [](double x) {
    const double near = std::abs(x) - 3;
    return -0.5 * near * near + std::log1p(std::exp(-6 * std::abs(x)));
  };
  inefficiency(
      "K03", random_walk(modes, 4), [](Stream& rng) { return 4 * rng.normal(); }, [](double x) { return std::abs(x); });
  inefficiency("K01_langevin", mala(density, slope, 1.4), wide, square);
  inefficiency("K01_hamiltonian", mixture({0.9, 0.1}, hamiltonian(density, slope, 0.4, 3), random_walk(density, 0.5)),
               wide, square);
  return true;
}();

}  // namespace
}  // namespace debias::bench

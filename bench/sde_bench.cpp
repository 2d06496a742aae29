// Milstein paths of geometric Brownian motion against plain loops: plain/..., ratio of times, alternating in
// one run; and a call to a standard error of 0.01 by recipe against multilevel Monte Carlo (call/...).

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <benchmark/benchmark.h>

#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>
#include <debias/sde.hpp>

#include "against_loops.hpp"
#include "baseline_multilevel.hpp"

namespace debias::bench {
namespace {

constexpr double r = 0.05;
constexpr double sigma = 0.2;
const GeometricBrownianMotion stock{.start = 100, .growth = r, .volatility = sigma, .horizon = 1};

double step(double s, double h, double dw) { return s * (1 + r * h + sigma * dw + sigma * sigma / 2 * (dw * dw - h)); }
double call(double s) { return std::exp(-r) * std::max(s - 100, 0.0); }

/// One draw of D_level.
double difference(int level, Stream& rng) {
  if (level == 0) return call(step(100, 1, rng.normal()));
  const int n = 1 << level;
  const double h = 1.0 / n;
  const double root = std::sqrt(h);
  double fine = 100;
  double coarse = 100;
  for (int i = 0; i < n; i += 2) {
    const double dw1 = root * rng.normal();
    const double dw2 = root * rng.normal();
    fine = step(step(fine, h, dw1), h, dw2);
    coarse = step(coarse, 2 * h, dw1 + dw2);
  }
  return call(fine) - call(coarse);
}

int plain_level(Stream& rng, double log_q) { return static_cast<int>(std::log(rng.uniform()) / log_q) + 1; }

void plain_european() {
  const Geometric pmf = Geometric::with_exponent(1.3);
  const auto plain = [p = pmf.mass(0)](Stream& order, Stream& rng) {
    const int level = plain_level(order, std::log1p(-p));
    const double base = call(step(100, 1, rng.normal()));
    return base + difference(level, rng) / (p * std::pow(1 - p, level - 1));
  };
  register_comparison("milstein/european", single_term(milstein(stock, call), pmf), plain);
}
void plain_lookback() {
  const Geometric pmf = Geometric::with_exponent(1.3);
  const auto bridge = [](double low, double from, double to, double b, double h, double u) {
    const double rise = to - from;
    return std::min(low, (from + to - std::sqrt(rise * rise - 2 * b * b * h * std::log(u))) / 2);
  };
  const auto pay = [](double end, double low) { return std::exp(-r) * (end - low); };
  const auto plain = [p = pmf.mass(0), bridge, pay](Stream& order, Stream& rng) {
    const int level = plain_level(order, std::log1p(-p));
    const double end = step(100, 1, rng.normal());
    const double base = pay(end, bridge(1e300, 100, end, sigma * 100, 1, rng.uniform()));
    const int n = 1 << level;
    const double h = 1.0 / n;
    const double root = std::sqrt(h);
    double fine = 100;
    double coarse = 100;
    double fine_low = 1e300;
    double coarse_low = 1e300;
    for (int i = 0; i < n; i += 2) {
      const double dw1 = root * rng.normal();
      const double u1 = rng.uniform();
      const double dw2 = root * rng.normal();
      const double u2 = rng.uniform();
      const double middle = step(fine, h, dw1);
      fine_low = bridge(fine_low, fine, middle, sigma * fine, h, u1);
      fine = step(middle, h, dw2);
      fine_low = bridge(fine_low, middle, fine, sigma * middle, h, u2);
      const double b = sigma * coarse;
      const double next = step(coarse, 2 * h, dw1 + dw2);
      const double half = (coarse + next + b * (dw1 - dw2)) / 2;
      coarse_low = bridge(bridge(coarse_low, coarse, half, b, h, u1), half, next, b, h, u2);
      coarse = next;
    }
    return base + (pay(fine, fine_low) - pay(coarse, coarse_low)) / (p * std::pow(1 - p, level - 1));
  };
  const auto payoff = [](const Minimum& path) { return std::exp(-r) * (path.terminal - path.minimum); };
  register_comparison("milstein/lookback", single_term(milstein(stock, Minimum{}, payoff), pmf), plain);
}

// ---- to a standard error, pilot included

/// ratio of the times, steps_ratio; ours scaled to the very error that was asked for, and *_rms the true errors.
void to_an_error(benchmark::State& state) {
  constexpr double error = 0.01;
  constexpr double truth = 10.450583572185565;
  std::uint64_t seed = 0;
  int runs = 0;
  double our_steps = 0;
  double their_steps = 0;
  double our_squares = 0;
  double their_squares = 0;
  const auto ours = [&] {
    const auto result =
        estimate(recipe(milstein(stock, call)), {.seed = ++seed, .threads = 1, .goal = {.error = error}});
    our_steps += result.work;
    our_squares += (result.mean - truth) * (result.mean - truth);
    ++runs;
  };
  const auto theirs = [&] {
    const auto answer = plain::multilevel(
        difference, [](int level) { return level == 0 ? 1 : 1.5 * (1 << level); }, error, 1, 2, Stream(seed, 0));
    their_steps += answer.work;
    their_squares += (answer.value - truth) * (answer.value - truth);
  };
  for (auto _ : state) report(state, paired_ratio(ours, theirs, 31), 1);
  state.counters["steps_ratio"] = our_steps / their_steps;
  state.counters["ours_rms"] = std::sqrt(our_squares / runs);
  state.counters["theirs_rms"] = std::sqrt(their_squares / runs);
}
BENCHMARK(to_an_error)->Name("call/recipe_against_multilevel")->Iterations(1)->Unit(benchmark::kMillisecond);

const bool registered = [] {
  plain_european();
  plain_lookback();
  return true;
}();

}  // namespace
}  // namespace debias::bench

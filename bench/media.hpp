#pragma once

// Media of optical depth tau on [0, 1] with the least bound, and our estimators timed against plain loops on them.

#include <cmath>
#include <cstdint>
#include <numbers>

#include <benchmark/benchmark.h>

#include <debias/core/estimator.hpp>
#include <debias/core/stream.hpp>

#include "paired.hpp"

namespace debias::bench {

inline constexpr double two_pi = 2 * std::numbers::pi;

struct Sinusoid {
  static constexpr const char* name = "sinusoid";
  explicit Sinusoid(double tau)
      : a(tau / (1 + 0.37 / two_pi * (std::cos(1.0) - std::cos(two_pi / 0.37 + 1)))), bound(2 * a) {}
  double operator()(double x) const { return a * (1 + std::sin(two_pi / 0.37 * x + 1)); }
  double a;
  double bound;
};
struct Step {
  static constexpr const char* name = "step";
  static constexpr double edge = 0.35355339059327373;  // 1 / sqrt 8: on no comb
  explicit Step(double tau) : a(tau / (8 * edge + 1 - edge)), bound(8 * a) {}
  double operator()(double x) const { return x < edge ? bound : a; }
  double a;
  double bound;
};
struct Linear {
  static constexpr const char* name = "linear";
  explicit Linear(double tau) : bound(2 * tau) {}
  double operator()(double x) const { return bound * x; }
  double bound;
};

/// The mean of f over n parts, so that a comb of 2^k points of it is one of n 2^k points of f.
template <class F>
struct Folded {
  F f;
  int n;
  double operator()(double x) const {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += f((i + x) / n);
    return sum / n;
  }
};

inline constexpr std::int64_t round_samples = 1 << 14;

template <class Sample>
auto loop(const Sample& sample) {
  return [&sample] {
    double sum = 0;
    double squares = 0;
    for (std::int64_t i = 0; i < round_samples; ++i) {
      Stream rng(1, static_cast<std::uint64_t>(i));
      const double z = sample(rng);
      sum += z;
      squares += z * z;
    }
    benchmark::DoNotOptimize(sum);
    benchmark::DoNotOptimize(squares);
  };
}

template <Estimator E, class Plain>
void compare(benchmark::State& state, const E& e, const Plain& plain) {
  const auto ours = [&e](Stream& rng) {
    NullRecord none;
    return draw_sample(e, rng, none).value;
  };
  for (auto _ : state) {
    report(state, paired_ratio(loop(ours), loop(plain), 41), static_cast<double>(round_samples));
  }
}

}  // namespace debias::bench

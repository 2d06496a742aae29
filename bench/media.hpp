#pragma once

// Media of optical depth tau on [0, 1] with the least bound, and means of several look-ups as one.

#include <cmath>
#include <numbers>

#include <debias/core/stream.hpp>

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

/// The mean of n draws of X.
template <class X>
struct MeanOf {
  X x;
  int n;
  double operator()(Stream& rng) const {
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += x(rng);
    return sum / n;
  }
};

}  // namespace debias::bench

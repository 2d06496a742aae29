#pragma once

// What a path leaves behind beside its end: an average, an extreme, the probability to stay off a barrier.
//
//   bridge from x to y in time h under a constant diffusion b:                              [Giles 2008b]
//   minimum   (x + y - sqrt((y - x)^2 - 2 b^2 h log u)) / 2                      u uniform
//   integral  h (x + y) / 2 + b sqrt(h^3 / 12) z                                 z normal
//   stays above B with probability 1 - exp(-2 (x - B)^+ (y - B)^+ / (b^2 h))
//
// A summary is copied once a path and sees its steps in order. One that takes bridges sees the coarse path
// with the middle of each step filled in, and the numbers u of the fine one: then D_k is small, and E I_k the
// same. Fails where the diffusion vanishes inside the path: b = 0 is no bridge but a line. A NaN stays one, here and in
// the payoff of a path (sde.hpp).
// Source: Giles, Improved multilevel Monte Carlo convergence using the Milstein scheme, MCQMC 2006 (2008).

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include <debias/core/stream.hpp>

namespace debias {

/// A step of a path, or half a step: the ends, the time between them and the diffusion along it.
struct Bridge {
  double from;
  double to;
  double diffusion;
  double length;

  /// Quantiles of the extremes, u in (0, 1).
  [[nodiscard]] double minimum(double u) const { return (from + to - reach(u)) / 2; }
  [[nodiscard]] double maximum(double u) const { return (from + to + reach(u)) / 2; }
  /// Quantile of the integral over the time.
  [[nodiscard]] double integral(double u) const {
    return length * (from + to) / 2 + diffusion * std::sqrt(length * length * length / 12) * normal_quantile(u);
  }
  /// The probability to have crossed, from ends that lie `a` and `b` on the good side.
  [[nodiscard]] double crossing(double a, double b) const {
    const double gap = std::max(a, 0.0) * std::max(b, 0.0);  // in this order a NaN stays
    if (gap > 0) return std::exp(-2 * gap / (diffusion * diffusion * length));
    return std::isnan(gap) || std::isnan(diffusion) ? std::numeric_limits<double>::quiet_NaN() : 1;
  }

 private:
  [[nodiscard]] double reach(double u) const {
    const double rise = to - from;
    return std::sqrt(rise * rise - 2 * diffusion * diffusion * length * std::log(u));
  }
};

/// Takes the bridges of a scalar path, each with a uniform number if `uses_number`.
template <class S>
concept BridgeSummary = std::copyable<S> && requires(S& s, const Bridge& bridge, double u) {
  s.add(bridge, u);
  { S::uses_number } -> std::convertible_to<bool>;
};
/// Takes the steps of a path of any state as they are: from, to, length.
template <class S, class State>
concept StepSummary = std::copyable<S> && requires(S& s, const State& from, const State& to, double length) {
  s.add(from, to, length);
};
template <class S, class State>
concept PathSummary = StepSummary<S, State> ||(std::same_as<State, double>&& BridgeSummary<S>);

/// The least value of the path.
struct Minimum {
  static constexpr bool uses_number = true;
  double terminal = 0;
  double minimum = std::numeric_limits<double>::infinity();

  void add(const Bridge& bridge, double u) {
    terminal = bridge.to;
    const double least = bridge.minimum(u);
    minimum = std::min(minimum, least);
    if (std::isnan(least)) [[unlikely]]
      minimum = least;
  }
};

/// The greatest value of the path.
struct Maximum {
  static constexpr bool uses_number = true;
  double terminal = 0;
  double maximum = -std::numeric_limits<double>::infinity();

  void add(const Bridge& bridge, double u) {
    terminal = bridge.to;
    const double greatest = bridge.maximum(u);
    maximum = std::max(maximum, greatest);
    if (std::isnan(greatest)) [[unlikely]]
      maximum = greatest;
  }
};

/// The mean over the time.
struct Average {
  static constexpr bool uses_number = true;
  double terminal = 0;
  double integral = 0;
  double length = 0;

  [[nodiscard]] double average() const { return integral / length; }
  void add(const Bridge& bridge, double u) {
    terminal = bridge.to;
    integral += bridge.integral(u);
    length += bridge.length;
  }
};

/// The probability, given the ends of the steps, that the path never falls to the barrier.
struct StaysAbove {
  static constexpr bool uses_number = false;
  double barrier;
  double terminal = 0;
  double probability = 1;

  void add(const Bridge& bridge, double /*u*/) {
    terminal = bridge.to;
    probability *= 1 - bridge.crossing(bridge.from - barrier, bridge.to - barrier);
  }
};

/// The probability, given the ends of the steps, that the path never rises to the barrier.
struct StaysBelow {
  static constexpr bool uses_number = false;
  double barrier;
  double terminal = 0;
  double probability = 1;

  void add(const Bridge& bridge, double /*u*/) {
    terminal = bridge.to;
    probability *= 1 - bridge.crossing(barrier - bridge.from, barrier - bridge.to);
  }
};

/// The mean over the time of a function of the state, by the trapezoidal rule on the steps: AverageOf{log}.
template <class G>
struct AverageOf {
  G function;
  double integral = 0;
  double length = 0;

  [[nodiscard]] double average() const { return integral / length; }
  /// False once the function has returned a number that is not finite, or the integral has overflowed.
  [[nodiscard]] bool finite() const { return std::isfinite(integral); }
  template <class State>
  void add(const State& from, const State& to, double step) {
    integral += step * (function(from) + function(to)) / 2;
    length += step;
  }
};
template <class G>
AverageOf(G) -> AverageOf<G>;

namespace detail {

/// Nothing but the end, which the payoff gets as it is.
struct EndOnly {
  template <class State, class Length>
  void add(const State& /*from*/, const State& /*to*/, const Length& /*length*/) {}
};

}  // namespace detail

}  // namespace debias

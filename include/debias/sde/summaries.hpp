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
#include <debias/core/value.hpp>
#include <debias/sde/dual.hpp>

namespace debias {

/// A step of a path, or half a step: the ends, the time between them and the diffusion along it; of any number type.
template <class X, class Time = double>
struct BridgeOf {
  X from;
  X to;
  X diffusion;
  Time length;

  /// Quantiles of the extremes, u in (0, 1).
  [[nodiscard]] X minimum(double u) const { return (from + to - reach(u)) / 2; }
  [[nodiscard]] X maximum(double u) const { return (from + to + reach(u)) / 2; }
  /// Quantile of the integral over the time.
  [[nodiscard]] X integral(double u) const {
    using std::sqrt;
    return length * (from + to) / 2 + diffusion * sqrt(Time(length * length * length / 12)) * normal_quantile(u);
  }
  /// The probability to have crossed, from ends that lie `a` and `b` on the good side.
  [[nodiscard]] X crossing(const X& a, const X& b) const {
    using std::exp;
    const X gap = positive_part(a) * positive_part(b);  // a NaN stays
    if (static_cast<double>(gap) > 0) return exp(X(-2 * gap / (diffusion * diffusion * length)));
    return std::isnan(static_cast<double>(gap)) || std::isnan(static_cast<double>(diffusion))
               ? X(std::numeric_limits<double>::quiet_NaN())
               : X(1);
  }

 private:
  [[nodiscard]] X reach(double u) const {
    using std::sqrt;
    const X rise = to - from;
    return sqrt(X(rise * rise - 2 * diffusion * diffusion * length * std::log(u)));
  }
};
using Bridge = BridgeOf<double>;

/// Takes the bridges of a scalar path, each with a uniform number if `uses_number`.
template <class S, class B = Bridge>
concept BridgeSummary = std::copyable<S> && requires(S& s, const B& bridge, double u) {
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

// Summaries of bridges, with numbers of type X; `as<X>()` is the same of another type, which sensitivities
// (sde/sensitivities.hpp) ask for.

/// The least value of the path.
template <class X>
struct MinimumOf {
  static constexpr bool uses_number = true;
  X terminal = X(0);
  X minimum = X(std::numeric_limits<double>::infinity());

  template <class Y>
  [[nodiscard]] MinimumOf<Y> as() const {
    return {};
  }
  template <class Time>
  void add(const BridgeOf<X, Time>& bridge, double u) {
    terminal = bridge.to;
    const X least = bridge.minimum(u);
    const auto value = static_cast<double>(least);
    if (value < static_cast<double>(minimum) || std::isnan(value)) minimum = least;  // a NaN stays
  }
};
using Minimum = MinimumOf<double>;

/// The greatest value of the path.
template <class X>
struct MaximumOf {
  static constexpr bool uses_number = true;
  X terminal = X(0);
  X maximum = X(-std::numeric_limits<double>::infinity());

  template <class Y>
  [[nodiscard]] MaximumOf<Y> as() const {
    return {};
  }
  template <class Time>
  void add(const BridgeOf<X, Time>& bridge, double u) {
    terminal = bridge.to;
    const X greatest = bridge.maximum(u);
    const auto value = static_cast<double>(greatest);
    if (value > static_cast<double>(maximum) || std::isnan(value)) maximum = greatest;  // a NaN stays
  }
};
using Maximum = MaximumOf<double>;

/// The mean over the time.
template <class X>
struct IntegralOf {
  static constexpr bool uses_number = true;
  X terminal = X(0);
  X integral = X(0);
  X length = X(0);

  [[nodiscard]] X average() const { return integral / length; }
  template <class Y>
  [[nodiscard]] IntegralOf<Y> as() const {
    return {};
  }
  template <class Time>
  void add(const BridgeOf<X, Time>& bridge, double u) {
    terminal = bridge.to;
    integral += bridge.integral(u);
    length += bridge.length;
  }
};
using Average = IntegralOf<double>;

/// The probability, given the ends of the steps, that the path never falls to the barrier.
template <class X>
struct StaysAboveOf {
  static constexpr bool uses_number = false;
  double barrier;
  X terminal = X(0);
  X probability = X(1);

  template <class Y>
  [[nodiscard]] StaysAboveOf<Y> as() const {
    return {.barrier = barrier};
  }
  template <class Time>
  void add(const BridgeOf<X, Time>& bridge, double /*u*/) {
    terminal = bridge.to;
    probability *= 1 - bridge.crossing(X(bridge.from - barrier), X(bridge.to - barrier));
  }
};
using StaysAbove = StaysAboveOf<double>;

/// The probability, given the ends of the steps, that the path never rises to the barrier.
template <class X>
struct StaysBelowOf {
  static constexpr bool uses_number = false;
  double barrier;
  X terminal = X(0);
  X probability = X(1);

  template <class Y>
  [[nodiscard]] StaysBelowOf<Y> as() const {
    return {.barrier = barrier};
  }
  template <class Time>
  void add(const BridgeOf<X, Time>& bridge, double /*u*/) {
    terminal = bridge.to;
    probability *= 1 - bridge.crossing(X(barrier - bridge.from), X(barrier - bridge.to));
  }
};
using StaysBelow = StaysBelowOf<double>;

/// The mean over the time of a function of the state, by the trapezoidal rule on the steps: AverageOf{log}.
template <class G, class X = double>
struct AverageOf {
  G function;
  X integral = X(0);
  X length = X(0);

  [[nodiscard]] X average() const { return integral / length; }
  template <class Y>
  [[nodiscard]] AverageOf<G, Y> as() const {
    return {function, Y(0), Y(0)};
  }
  /// False once the function has returned a number that is not finite, or the integral has overflowed.
  [[nodiscard]] bool finite() const { return debias::is_finite(integral); }
  template <class State, class Length>
  void add(const State& from, const State& to, const Length& step) {
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

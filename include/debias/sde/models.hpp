#pragma once

// What a scalar stochastic differential equation is made of, and some that are known; more in sde/market.hpp.
//
//   dX = a(X, t) dt + b(X, t) dW on [0, T], X_0 = start
//
// A model may have `check()`, which throws std::invalid_argument where it is not defined.
// Notation: a = drift, b = diffusion, b_x = diffusion_derivative, T = horizon. Coefficients must be smooth and of linear
// growth: the schemes of sde.hpp fail where they are not. Source: Kloeden & Platen, 1992.

#include <cmath>
#include <concepts>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/text.hpp>

namespace debias {

namespace detail {
template <class T>
using number_t = std::conditional_t<std::is_arithmetic_v<T>, double, T>;
template <class M>
using state_of = number_t<std::remove_cvref_t<decltype(std::declval<const M&>().start)>>;
template <class M>
using time_of = number_t<std::remove_cvref_t<decltype(std::declval<const M&>().horizon)>>;

/// A number that is followed along a path: double, or one of those that say so, like Dual (sde/dual.hpp).
template <class T>
inline constexpr bool is_number = std::convertible_to<T, double>;

/// Throw std::invalid_argument; a NaN does not pass.
inline void require_finite(const char* what, double x) {
  if (!std::isfinite(x))
    throw std::invalid_argument(std::string(what) + " = " + detail::format("%g", x) + " (must be finite)");
}
inline void require_positive(const char* what, double x) {
  if (!(x > 0) || !std::isfinite(x)) {
    throw std::invalid_argument(std::string(what) + " = " + detail::format("%g", x) + " (must be positive and finite)");
  }
}
}  // namespace detail

/// What is to be solved: any struct with `start`, `horizon`, `drift(x, t)` and `diffusion(x, t)`.
template <class M>
concept ScalarSde = requires(const M& m, const detail::state_of<M>& x, double t) {
  requires detail::is_number<detail::state_of<M>>;
  requires detail::is_number<detail::time_of<M>>;
  { m.drift(x, t) } -> std::convertible_to<detail::state_of<M>>;
  { m.diffusion(x, t) } -> std::convertible_to<detail::state_of<M>>;
};

/// The same with `diffusion_derivative(x, t)`, the derivative of the diffusion in x.
template <class M>
concept DifferentiableSde = ScalarSde<M> && requires(const M& m, const detail::state_of<M>& x, double t) {
  { m.diffusion_derivative(x, t) } -> std::convertible_to<detail::state_of<M>>;
};

/// dX = growth X dt + volatility X dW.
struct GeometricBrownianMotion {
  double start = 1;
  double growth = 0;
  double volatility = 1;
  double horizon = 1;

  [[nodiscard]] double drift(double x, double /*t*/) const { return growth * x; }
  [[nodiscard]] double diffusion(double x, double /*t*/) const { return volatility * x; }
  [[nodiscard]] double diffusion_derivative(double /*x*/, double /*t*/) const { return volatility; }
};

/// dX = reversion (mean - X) dt + volatility dW.
struct OrnsteinUhlenbeck {
  double start = 0;
  double reversion = 1;
  double mean = 0;
  double volatility = 1;
  double horizon = 1;

  [[nodiscard]] double drift(double x, double /*t*/) const { return reversion * (mean - x); }
  [[nodiscard]] double diffusion(double /*x*/, double /*t*/) const { return volatility; }
  [[nodiscard]] double diffusion_derivative(double /*x*/, double /*t*/) const { return 0; }
};

/// dX = rate X dt + volatility X dW, of any number: those of sensitivities. Only a horizon that is a parameter needs its type.
template <class X = double, class Time = double>
struct BlackScholes {
  X start = X(1);
  X rate = X(0);
  X volatility = X(1);
  Time horizon = Time(1);

  template <class T>
  [[nodiscard]] X drift(const X& x, const T& /*t*/) const {
    return rate * x;
  }
  template <class T>
  [[nodiscard]] X diffusion(const X& x, const T& /*t*/) const {
    return volatility * x;
  }
  template <class T>
  [[nodiscard]] X diffusion_derivative(const X& /*x*/, const T& /*t*/) const {
    return volatility;
  }
  /// Throws std::invalid_argument unless start and volatility are positive, and all is finite.
  void check() const {
    detail::require_positive("BlackScholes: start", static_cast<double>(start));
    detail::require_positive("BlackScholes: volatility", static_cast<double>(volatility));
    detail::require_finite("BlackScholes: rate", static_cast<double>(rate));
  }
};

}  // namespace debias

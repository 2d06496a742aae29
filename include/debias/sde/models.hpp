#pragma once

// What a scalar stochastic differential equation is made of, and two that are known.
//
//   dX = a(X, t) dt + b(X, t) dW on [0, T], X_0 = start
//
// Notation: a = drift, b = diffusion, b_x = diffusion_derivative, T = horizon. Coefficients must be smooth and of linear
// growth: the schemes of sde.hpp fail where they are not. Source: Kloeden & Platen, 1992.

#include <concepts>

namespace debias {

/// What is to be solved: any struct with `start`, `horizon`, `drift(x, t)` and `diffusion(x, t)`.
template <class M>
concept ScalarSde = requires(const M& m, double x, double t) {
  { m.start } -> std::convertible_to<double>;
  { m.horizon } -> std::convertible_to<double>;
  { m.drift(x, t) } -> std::convertible_to<double>;
  { m.diffusion(x, t) } -> std::convertible_to<double>;
};

/// The same with `diffusion_derivative(x, t)`, the derivative of the diffusion in x.
template <class M>
concept DifferentiableSde = ScalarSde<M> && requires(const M& m, double x, double t) {
  { m.diffusion_derivative(x, t) } -> std::convertible_to<double>;
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

}  // namespace debias

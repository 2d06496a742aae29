#pragma once

// A stochastic differential equation dX = a(X, t) dt + b(X, t) dW on [0, T], in 2^k steps at level k.
//
//   euler      X <- X + a h + b dW                                                    [Maruyama 1955]
//   milstein   X <- X + a h + b dW + b b_x (dW^2 - h) / 2                             [Milstein 1974]
//   I_k = payoff(X_T); the coarse path takes each pair of fine increments as one      [Giles 2008]
//
//   Notation: a = drift, b = diffusion, b_x = diffusion_derivative, T = horizon, h = T 2^-k.
// Lipschitz payoffs: E D_k^2 ~ 2^(-2 k) under milstein, 2^-k under euler, where no law has finite variance
// and finite work. With additive noise, b_x = 0, the schemes are one: declare {2, 1} for euler. Payoffs that
// jump: 2^-k and 2^(-k/2). Coefficients have to be smooth and of linear growth. While a_x h < -2 the path is
// unstable and the first levels are wild: put the base level above them.
// Sources: Giles, Oper. Res. 56 (2008); Rhee & Glynn, Oper. Res. 63 (2015).

#include <cmath>
#include <concepts>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

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

/// One step of Euler's scheme.
struct EulerStep {
  template <ScalarSde M>
  static double advance(const M& model, double x, double t, double h, double dw) {
    return x + model.drift(x, t) * h + model.diffusion(x, t) * dw;
  }
};

/// One step of Milstein's scheme.
struct MilsteinStep {
  template <DifferentiableSde M>
  static double advance(const M& model, double x, double t, double h, double dw) {
    const double b = model.diffusion(x, t);
    return x + model.drift(x, t) * h + b * dw + b * model.diffusion_derivative(x, t) * (dw * dw - h) / 2;
  }
};

/// What is wanted of the path: a Value computed from X_T.
template <class F>
concept TerminalPayoff = requires(const F& f, double x) {
  requires Value<std::remove_cvref_t<decltype(f(x))>>;
};

/// A BiasedSequence; the work is the number of steps, fine and coarse alike. One normal a fine step.
template <class Step, ScalarSde M, TerminalPayoff F>
class SdeLevels {
 public:
  using value_type = std::remove_cvref_t<std::invoke_result_t<const F&, double>>;
  static constexpr std::int64_t last_level = 62;

  SdeLevels(M model, F payoff, const Rates& declared)
      : rates(declared), model_(std::move(model)), payoff_(std::move(payoff)) {
    if (!(model_.horizon > 0) || !std::isfinite(static_cast<double>(model_.horizon))) {
      std::ostringstream text;
      text << "sde: horizon = " << model_.horizon << " (must be positive and finite)";
      throw std::invalid_argument(text.str());
    }
  }

  /// Throws std::length_error above last_level.
  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    if (level == 0) {
      const Term<value_type> one = value_at(0, rng);
      return base(one.value, one.work);
    }
    const std::int64_t steps = steps_of(level);
    const double h = model_.horizon / static_cast<double>(steps);
    const double sqrt_h = std::sqrt(h);
    double fine = model_.start;
    double coarse = model_.start;
    for (std::int64_t i = 0; i < steps; i += 2) {
      const double t = static_cast<double>(i) * h;
      const double dw1 = sqrt_h * rng.normal();
      const double dw2 = sqrt_h * rng.normal();
      fine = Step::advance(model_, fine, t, h, dw1);
      fine = Step::advance(model_, fine, static_cast<double>(i + 1) * h, h, dw2);
      coarse = Step::advance(model_, coarse, t, 2 * h, dw1 + dw2);
    }
    return coupled<value_type>(payoff_(fine), payoff_(coarse), 1.5 * static_cast<double>(steps));
  }

  /// I_level without its coarse partner, same bits as in a draw. Throws std::length_error above last_level.
  Term<value_type> value_at(std::int64_t level, Stream& rng) const {
    const std::int64_t steps = steps_of(level);
    const double h = model_.horizon / static_cast<double>(steps);
    const double sqrt_h = std::sqrt(h);
    double x = model_.start;
    for (std::int64_t i = 0; i < steps; ++i) {
      const double dw = sqrt_h * rng.normal();
      x = Step::advance(model_, x, static_cast<double>(i) * h, h, dw);
    }
    return {payoff_(x), static_cast<double>(steps)};
  }

  Rates rates;

 private:
  static std::int64_t steps_of(std::int64_t level) {
    if (level > last_level) {
      throw std::length_error("sde: level " + std::to_string(level) + " has 2^" + std::to_string(level) +
                              " steps, more than can be counted; take a law that falls faster");
    }
    return std::int64_t{1} << level;
  }

  M model_;
  F payoff_;
};

/// E payoff(X_T) by Euler's scheme: `euler(OrnsteinUhlenbeck{.reversion = 2}, payoff, {2, 1})`.
/// Throws std::invalid_argument for a horizon that is not positive and finite.
template <ScalarSde M, TerminalPayoff F>
SdeLevels<EulerStep, M, F> euler(M model, F payoff, const Rates& rates = {1, 1}) {
  return {std::move(model), std::move(payoff), rates};
}

/// E payoff(X_T) by Milstein's scheme: `milstein(GeometricBrownianMotion{.start = 100}, payoff)`.
/// Throws std::invalid_argument for a horizon that is not positive and finite.
template <DifferentiableSde M, TerminalPayoff F>
SdeLevels<MilsteinStep, M, F> milstein(M model, F payoff, const Rates& rates = {2, 1}) {
  return {std::move(model), std::move(payoff), rates};
}

}  // namespace debias

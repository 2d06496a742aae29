#pragma once

// The delta of a payoff that nothing is known of: a weight on the path in place of a derivative.
//
//   d/dX_0 E payoff(X_T) = E[payoff(X_T) W],   W = (1/T) integral of Y_t / b(X_t, t) dW_t,  Y = dX_t / dX_0
//
// Notation: b = diffusion, Y is followed by a dual number. For geometric Brownian motion W = W_T / (X_0 volatility T), the score of
// its law. The fallback that it is: the variance grows like 1 / T and with the square of the payoff, also of a part that does not
// depend on X_0; a payoff with a slope (sde/sensitivities.hpp) is quieter pathwise. Other parameters than the start of any model have
// scores whose variance grows with the steps: there is no PMF for them here. Under Black and Scholes X_T has a law with scores of its
// own, d = (log(X_T / X_0) - (r - volatility^2 / 2) T) / (volatility sqrt T):
//
//   delta d / (X_0 volatility sqrt T),   vega (d^2 - 1) / volatility - d sqrt T,
//   gamma (d^2 - d volatility sqrt T - 1) / (X_0^2 volatility^2 T),
//
// also where no PMF exists pathwise: gamma of a digital.
// Rates are those of the payoff itself, where b does not depend on the time: Y / b has no noise of its own, so that the sum over
// the steps is as exact as Milstein's scheme. Assumes b > 0 along the path; where it vanishes W is not finite, and the sample says so.
// Sources: Elworthy & Li, J. Funct. Anal. 125 (1994); Glasserman 2003, section 7.3.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include <debias/core/rates.hpp>
#include <debias/sde/levels.hpp>
#include <debias/sde/sensitivities.hpp>

namespace debias {

namespace detail {

/// The state of a path, dual in its start, and the integral of its weight.
struct WeightedState {
  Dual<1> x;
  double weight = 0;

  [[nodiscard]] bool allFinite() const { return debias::is_finite(x) && std::isfinite(weight); }
};

template <class M>
struct WeightedModel {
  M model;
  WeightedState start{model.start};
  double horizon = model.horizon;
};

template <class Step>
struct WeightedStep : Step {
  template <class M>
  static std::int64_t noises(const M& /*model*/) {
    return 1;
  }
  template <class M>
  static double increment(std::int64_t /*noises*/, double sqrt_h, Stream& rng) {
    return sqrt_h * rng.normal();
  }
  template <class M>
  static Dual<1> diffusion(const M& m, const WeightedState& x, double t) {
    return Step::diffusion(m.model, x.x, t);
  }
  template <class M>
  static WeightedState advance(const M& m, const WeightedState& x, double t, double h, const Dual<1>& b, double dw) {
    return {Step::advance(m.model, x.x, t, h, b, dw), x.weight + x.x.slopes[0] / b.value * dw};
  }
};

}  // namespace detail

/// Value, delta, vega and gamma, a Value (core/value.hpp) of four components.
struct ScoredGreeks {
  double value = 0;
  double delta = 0;
  double vega = 0;
  double gamma = 0;

  friend std::size_t component_count(const ScoredGreeks&) { return 4; }
  friend double component(const ScoredGreeks& g, std::size_t i) { return g.*members[i]; }
  friend void set_component(ScoredGreeks& g, std::size_t i, double x) { g.*members[i] = x; }
  friend ScoredGreeks operator+(const ScoredGreeks& a, const ScoredGreeks& b) {
    return {a.value + b.value, a.delta + b.delta, a.vega + b.vega, a.gamma + b.gamma};
  }
  friend ScoredGreeks operator-(const ScoredGreeks& a, const ScoredGreeks& b) {
    return {a.value - b.value, a.delta - b.delta, a.vega - b.vega, a.gamma - b.gamma};
  }

 private:
  static double ScoredGreeks::*const members[4];
};
inline double ScoredGreeks::*const ScoredGreeks::members[4] = {&ScoredGreeks::value, &ScoredGreeks::delta,
                                                               &ScoredGreeks::vega, &ScoredGreeks::gamma};

/// Of any discounted `payoff(x)` of X_T, by the scores of its law: `likelihood_ratio(Branched<MilsteinStep>{}, market, payoff)`. Throws
/// std::invalid_argument as the market does.
template <class Step, class F>
requires(!Step::is_smoothed) auto likelihood_ratio(
    Step /*scheme*/, const BlackScholes<>& market, F payoff,
    const Rates& rates = detail::sensitivity_rates<Step>(Step::is_branched ? 0 : 1)) {
  auto scored = [payoff = std::move(payoff), market](double x) {
    const double paid = payoff(x);
    const double deviation = market.volatility * std::sqrt(market.horizon);
    const double drift = (market.rate - market.volatility * market.volatility / 2) * market.horizon;
    const double d = (std::log(x / market.start) - drift) / deviation;
    return ScoredGreeks{paid, paid * d / (market.start * deviation),
                        paid * ((d * d - 1) / market.volatility - d * std::sqrt(market.horizon)),
                        paid * (d * d - d * deviation - 1) / (market.start * market.start * deviation * deviation)};
  };
  return SdeLevels<Step, BlackScholes<>, detail::EndOnly, decltype(scored)>(market, {}, std::move(scored), rates);
}

/// Value and derivative in the start of E payoff(X_T), a Dual<1>, for any `payoff(x)` of plain numbers; `model(spot)` as of
/// sensitivities, with the start as its only parameter. A payoff that jumps needs a tree:
/// `likelihood_ratio(Branched<MilsteinStep>{}, model, payoff, 100.0)`; without one declare {1, 1}, and no PMF exists.
template <class Step, class Model, class F>
requires(!Step::is_smoothed) auto likelihood_ratio(
    Step /*scheme*/, const Model& model, F payoff, double start,
    const Rates& rates = detail::sensitivity_rates<Step>(Step::is_branched ? 0 : 1)) {
  const auto m = model(Dual<1>::parameter(0, start));
  const double horizon = m.horizon;
  auto weighted = [payoff = std::move(payoff), horizon](const detail::WeightedState& end) {
    const double paid = payoff(end.x.value);
    return Dual<1>(paid, {paid * end.weight / horizon});
  };
  using M = detail::WeightedModel<std::remove_cv_t<decltype(m)>>;
  return SdeLevels<detail::WeightedStep<Step>, M, detail::EndOnly, decltype(weighted)>(M{m}, {}, std::move(weighted),
                                                                                       rates);
}

}  // namespace debias

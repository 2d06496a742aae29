#pragma once

// The delta of a payoff that nothing is known of: a weight on the path in place of a derivative.
//
//   d/dX_0 E payoff(X_T) = E[payoff(X_T) W],   W = (1/T) integral of Y_t / b(X_t, t) dW_t,  Y = dX_t / dX_0
//
// Notation: b = diffusion, Y is followed by a dual number. For geometric Brownian motion W = W_T / (X_0 volatility T), the score of
// its law. The fallback that it is: the variance grows like 1 / T and with the square of the payoff, also of a part that does not
// depend on X_0; a payoff with a slope (sde/sensitivities.hpp) is quieter pathwise. Other parameters than the start have scores
// whose variance grows with the steps: there is no PMF for them here.
// Rates are those of the payoff itself, where b does not depend on the time: Y / b has no noise of its own, so that the sum over
// the steps is as exact as Milstein's scheme. Assumes b > 0 along the path; where it vanishes W is not finite, and the sample says so.
// Sources: Elworthy & Li, J. Funct. Anal. 125 (1994); Glasserman 2003, section 7.3.

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

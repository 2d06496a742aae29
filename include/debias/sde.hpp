#pragma once

// A stochastic differential equation dX = a(X, t) dt + b(X, t) dW on [0, T], in 2^k steps at level k.
//
//   euler      X <- X + a h + b dW                                                    [Maruyama 1955]
//   milstein   X <- X + a h + b dW + b b_x (dW^2 - h) / 2                             [Milstein 1974]
//   I_k = payoff(X_T) or payoff(summary of the path); the coarse path adds pairs of increments      [Giles 2008]
//
//   Notation: a = drift, b = diffusion, b_x = diffusion_derivative, T = horizon, h = T 2^-k.
// Lipschitz payoffs of the end, an average or an extreme: E D_k^2 ~ 2^(-2 k) under milstein, 2^(-1.5 k)
// behind a barrier (declare it), 2^-k under euler, where no PMF has finite variance and finite work. With
// additive noise, b_x = 0, the schemes are one: declare {2, 1}. Payoffs that jump: 2^-k and 2^(-k/2); on trees, which
// `Branching{}` asks for, 2^(-2 k) and 2^-k [Giles & Haji-Ali 2022]. Derivatives in parameters: sde/sensitivities.hpp.
// Numbers: a path draws increment 0, the number of its bridge if a summary uses one, increment 1, ... As a point of a net
// (estimators/stratified.hpp) it draws the end, midpoints by levels, then the numbers of the bridges in time: sde/brownian.hpp.
// Coefficients must be smooth and of linear growth. While a_x h < -2 a path is unstable: put the base level
// above. A path that leaves the finite numbers makes its sample NaN, whatever the payoff makes of it.
// Sources: Giles, Oper. Res. 56 (2008); Rhee & Glynn, Oper. Res. 63 (2015); Giles & Haji-Ali, arXiv 2209.03017.

#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/value.hpp>
#include <debias/sde/levels.hpp>
#include <debias/sde/models.hpp>
#include <debias/sde/schemes.hpp>
#include <debias/sde/summaries.hpp>

namespace debias {

/// What is wanted of the path: a Value computed from X_T.
template <class F, class State = double>
concept TerminalPayoff = requires(const F& f, const State& x) {
  requires Value<std::remove_cvref_t<decltype(f(x))>>;
};

/// E payoff(X_T) by Euler's scheme: `euler(OrnsteinUhlenbeck{.reversion = 2}, payoff, {2, 1})`.
/// Throws std::invalid_argument for a horizon that is not positive and finite.
template <ScalarSde M, TerminalPayoff F>
auto euler(M model, F payoff, const Rates& rates = {1, 1}) {
  return SdeLevels<EulerStep, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}

/// E payoff(summary of the path) by Euler's scheme.
template <ScalarSde M, PathSummary<double> Summary, TerminalPayoff<Summary> F>
auto euler(M model, Summary summary, F payoff, const Rates& rates = {1, 1}) {
  return SdeLevels<EulerStep, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff), rates);
}

/// E payoff(X_T) by Milstein's scheme: `milstein(GeometricBrownianMotion{.start = 100}, payoff)`.
/// Throws std::invalid_argument for a horizon that is not positive and finite.
template <DifferentiableSde M, TerminalPayoff F>
auto milstein(M model, F payoff, const Rates& rates = {2, 1}) {
  return SdeLevels<MilsteinStep, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}

/// E payoff(summary of the path) by Milstein's scheme:
/// `milstein(stock, Minimum{}, [](const Minimum& path) { return path.terminal - path.minimum; })`.
template <DifferentiableSde M, PathSummary<double> Summary, TerminalPayoff<Summary> F>
auto milstein(M model, Summary summary, F payoff, const Rates& rates = {2, 1}) {
  return SdeLevels<MilsteinStep, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff), rates);
}

/// Asks for paths that branch: `milstein(stock, digital, Branching{})`, with or without a summary, scalar or vector.
struct Branching {};

/// The same on trees of Milstein's scheme, for payoffs that jump: E D_k^2 ~ 2^(-2 k), up to a factor of k, in a work of
/// (k + 1) 2^(k - 1) steps of the fine path. Euler's trees have E D_k^2 ~ 2^-k then: no PMF.
/// A payoff of the end that knows its expectation (sde/payoffs.hpp) is taken so over the last step, which is Smoothed: of a digital
/// call at volatility 0.2, `milstein(stock, DigitalPayoff{100}, Branching{})`, that leaves a hundredth of variance x work.
template <DifferentiableSde M, TerminalPayoff F>
auto milstein(M model, F payoff, Branching /*tree*/, const Rates& rates = {2, 1.2}) {
  using Step =
      std::conditional_t<detail::KnowsExpectation<F, detail::state_of<M>>, Smoothed<MilsteinStep>, MilsteinStep>;
  return SdeLevels<Branched<Step>, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}
template <DifferentiableSde M, PathSummary<double> Summary, TerminalPayoff<Summary> F>
auto milstein(M model, Summary summary, F payoff, Branching /*tree*/, const Rates& rates = {2, 1.2}) {
  return SdeLevels<Branched<MilsteinStep>, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff),
                                                          rates);
}
template <ScalarSde M, TerminalPayoff F>
auto euler(M model, F payoff, Branching /*tree*/, const Rates& rates = {1, 1.2}) {
  return SdeLevels<Branched<EulerStep>, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}
template <ScalarSde M, PathSummary<double> Summary, TerminalPayoff<Summary> F>
auto euler(M model, Summary summary, F payoff, Branching /*tree*/, const Rates& rates = {1, 1.2}) {
  return SdeLevels<Branched<EulerStep>, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff), rates);
}

}  // namespace debias

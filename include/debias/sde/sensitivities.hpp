#pragma once

// The value of a payoff and its derivatives in parameters of the model, all from one path: delta, vega, rho, theta, gamma.
//
//   I_k = the payoff of a path of dual numbers: (payoff, d payoff / d parameter_i)      [pathwise: Glasserman 2003, 7.2]
//   Smoothed<Step>: the payoff's expectation over the last step, given the path before it   [Burgos & Giles 2012]
//   Branched<Step>: the mean over the leaves of a tree                                    [Giles & Haji-Ali 2022]
//
// Notation: parameters = numbers that make the model, `model(p...)`; r = smoothness of the payoff less the order of the derivatives:
// calls have 1, digitals 0, a payoff that does not say 1; pathwise derivatives are right for r >= 0, with Smoothed for any r.
// E D_k^2 ~ 2^(-beta k) of the worst derivative under Milstein's scheme, as measured (bench/README.md):
//
//   r          Milstein   Branched   Smoothed   Branched<Smoothed>     example
//   1          2          2          2          2                      a payoff with a continuous slope
//   0          1, no PMF  2          1.5        2                      delta of a call
//   -1         wrong      wrong      .5, no PMF 1.5                    delta of a digital, gamma of a call
//   -2         wrong      wrong      no PMF     .5, no PMF             gamma of a digital
//
// Where it says wrong it does not compile; where no PMF exists, estimators refuse with the rates (NoPmfError).
// Under Euler's scheme no PMF exists but for r >= 1 and additive noise.

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <utility>

#include <debias/core/rates.hpp>
#include <debias/sde.hpp>
#include <debias/sde/dual.hpp>
#include <debias/sde/payoffs.hpp>

namespace debias {

namespace detail {

template <class P, class M>
auto payoff_on(const P& payoff, const M& model) {
  using X = state_of<M>;
  if constexpr (requires { payoff.at(model); }) {
    return payoff.at(model);
  } else if constexpr (std::invocable<const P&, const X&, const M&>) {
    return [payoff, model](const X& x) -> X { return payoff(x, model); };
  } else {
    return payoff;
  }
}

/// The table above.
template <class Step>
constexpr Rates sensitivity_rates(int r) {
  const double work = Step::is_branched ? 1.2 : 1;
  if (!std::derived_from<Step, MilsteinStep>) return {r >= 0 ? 1.0 : 0.5, work};
  if (r >= 1) return {2, work};
  if (Step::is_branched) return {r == 0 ? 2 : r == -1 ? 1.5 : 0.5, work};
  if (Step::is_smoothed) return {r == 0 ? 1.5 : r == -1 ? 0.5 : -0.5, work};
  return {1, work};
}

template <class Step, int order, class D, class Model, class P, class... X>
auto sensitivities(const Model& model, const P& payoff, const X&... at) {
  std::size_t i = 0;
  const auto parameter = [&i](double x) {
    if constexpr (order == 1) {
      return D::parameter(i++, x);
    } else {
      using Inner = decltype(D{}.value);
      const std::size_t own = i++;
      return D::parameter(own, Inner::parameter(own, x));
    }
  };
  // In braces, so that parameters are numbered from the left.
  const std::array<D, sizeof...(X)> all{parameter(static_cast<double>(at))...};
  return std::apply(
      [&](const auto&... p) {
        const auto m = model(p...);
        auto on_model = payoff_on(payoff, m);
        return SdeLevels<Step, std::remove_cv_t<decltype(m)>, EndOnly, decltype(on_model)>(
            m, {}, std::move(on_model), sensitivity_rates<Step>(smoothness_of<P>() - order));
      },
      all);
}

template <class Step, class P, int order>
constexpr bool sees_every_derivative = Step::is_smoothed || smoothness_of<P>() >= order;

}  // namespace detail

/// Value and first derivatives of E payoff(X_T) at `parameters`, a Dual: `mean.value`, `mean.slopes[i]`.
///
///   const auto model = [](const auto& spot, const auto& volatility) {
///     return BlackScholes<std::remove_cvref_t<decltype(spot)>>{.start = spot, .rate = 0.05, .volatility = volatility};
///   };
///   sensitivities(Branched<Smoothed<MilsteinStep>>{}, model, discounted(CallPayoff{100}), 100.0, 0.2)
///
/// `payoff(x)` or `payoff(x, model)` of dual numbers, or a payoff of sde/payoffs.hpp, which Smoothed needs.
/// Throws as `milstein` does, and what the model says of itself.
template <class Step, class Model, class P, std::convertible_to<double>... X>
requires(sizeof...(X) > 0) auto sensitivities(Step /*scheme*/, const Model& model, const P& payoff,
                                              const X&... parameters) {
  static_assert(detail::sees_every_derivative<Step, P, 1>,
                "debias: the slope of a payoff that jumps is not the mean of its slopes; take Branched<Smoothed<...>>");
  return detail::sensitivities<Step, 1, Dual<sizeof...(X)>>(model, payoff, parameters...);
}

/// The same with all second derivatives, a Dual of Duals: `mean.value.value`, `mean.value.slopes[i]`,
/// `mean.slopes[i].slopes[j]`: gamma is slopes[0].slopes[0] if the spot is the first parameter.
template <class Step, class Model, class P, std::convertible_to<double>... X>
requires(sizeof...(X) > 0) auto second_sensitivities(Step /*scheme*/, const Model& model, const P& payoff,
                                                     const X&... parameters) {
  static_assert(detail::sees_every_derivative<Step, P, 2>,
                "debias: the second slope of a payoff with a kink is not the mean of its second slopes; take "
                "Branched<Smoothed<...>>, or say `static constexpr int smoothness = 2` of a payoff that has none");
  return detail::sensitivities<Step, 2, Dual<sizeof...(X), Dual<sizeof...(X)>>>(model, payoff, parameters...);
}

/// One component of the values of a sequence, as a sequence of its own: component 1 of sensitivities is the derivative in the
/// first parameter.
template <BiasedSequence S>
class ComponentOf {
 public:
  ComponentOf(S sequence, std::size_t component, const Rates& declared)
      : rates(declared), sequence_(std::move(sequence)), component_(component) {}

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const auto draw = sequence_(level, rng);
    return {debias::component(draw.value, component_), debias::component(draw.difference, component_), draw.work};
  }
  Term<double> value_at(std::int64_t level, Stream& rng) const {
    const auto term = debias::value_of(sequence_, level, rng);
    return {debias::component(term.value, component_), term.work};
  }
  [[nodiscard]] std::int64_t deepest_level() const { return deepest_level_of(sequence_); }

  Rates rates;

 private:
  S sequence_;
  std::size_t component_;
};
template <BiasedSequence S>
requires DeclaresRates<S> ComponentOf<S> component_of(S sequence, std::size_t component) {
  const Rates rates = sequence.rates;
  return {std::move(sequence), component, rates};
}

}  // namespace debias

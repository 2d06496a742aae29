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
#include <debias/core/refusals.hpp>
#include <debias/sde.hpp>
#include <debias/sde/dual.hpp>
#include <debias/sde/payoffs.hpp>

namespace debias {

namespace detail {

/// `Paid` is what it is paid for: the end, or a summary.
template <class Paid, class P, class M>
auto payoff_on(const P& payoff, const M& model) {
  using X = state_of<M>;
  if constexpr (requires { payoff.at(model); }) {
    return payoff.at(model);
  } else if constexpr (std::invocable<const P&, const Paid&, const M&>) {
    return [payoff, model](const Paid& x) -> X { return payoff(x, model); };
  } else {
    return payoff;
  }
}

/// A summary of plain numbers as one of X.
template <class X, class Summary>
auto summary_of(const Summary& summary) {
  if constexpr (requires { summary.template as<X>(); }) {
    return summary.template as<X>();
  } else {
    return summary;
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

template <class Step, class P, int order>
constexpr bool sees_every_derivative = Step::is_smoothed || smoothness_of<P>() >= order;

enum class SlopeMistake { jump, kink, no_expectation, summary_at_last_step, no_model, no_diffusion_derivative };

/// One sentence a mistake, as in core/refusals.hpp.
template <SlopeMistake m, class... Of>
constexpr Refused refuse_slope() {
  static_assert(m != SlopeMistake::jump,
                "debias: the slope of a payoff that jumps is not the mean of its slopes; take Branched<Smoothed<...>>");
  static_assert(m != SlopeMistake::kink,
                "debias: the second slope of a payoff with a kink is not the mean of its second slopes; take "
                "Branched<Smoothed<...>>, or say `static constexpr int smoothness = 2` of a payoff that has none");
  static_assert(m != SlopeMistake::no_expectation,
                "debias: this payoff does not know its expectation over the last step, which Smoothed<...> takes; "
                "give it a member `template <class X> X expected(const X& mean, const X& deviation) const` "
                "(debias/sde/payoffs.hpp), or take a scheme without Smoothed");
  static_assert(m != SlopeMistake::summary_at_last_step,
                "debias: the conditional last step of Smoothed<...> knows the end of a path and no summary of it; "
                "take Branched<MilsteinStep> or MilsteinStep");
  static_assert(m != SlopeMistake::no_model,
                "debias: model(parameters...) is no model of dual numbers; it needs start, horizon, drift(x, t) and "
                "diffusion(x, t), of any number type (debias/sde/models.hpp)");
  static_assert(m != SlopeMistake::no_diffusion_derivative,
                "debias: Milstein's scheme needs diffusion_derivative(x, t) of the model, the derivative of its "
                "diffusion in x, of any number type (debias/sde/models.hpp)");
  return {};
}

template <class Step, int order, class D, class Model, class Summary, class P, class... X>
auto sensitivities(const Model& model, const Summary& summary, const P& payoff, const Rates& rates, const X&... at) {
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
        using M = std::remove_cv_t<decltype(m)>;
        if constexpr (!ScalarSde<M>) {
          return refuse_slope<SlopeMistake::no_model, M>();
        } else if constexpr (Step::needs_derivative && !DifferentiableSde<M>) {
          return refuse_slope<SlopeMistake::no_diffusion_derivative, M>();
        } else {
          auto own = summary_of<state_of<M>>(summary);
          using Own = decltype(own);
          using Paid = std::conditional_t<std::same_as<Own, EndOnly>, state_of<M>, Own>;
          auto on_model = payoff_on<Paid>(payoff, m);
          if constexpr (Step::is_smoothed && !KnowsExpectation<decltype(on_model), state_of<M>>) {
            return refuse_slope<SlopeMistake::no_expectation, P, M>();  // M: said only where it comes to that
          } else {
            return SdeLevels<Step, M, Own, decltype(on_model)>(m, std::move(own), std::move(on_model), rates);
          }
        }
      },
      all);
}

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
  if constexpr (!detail::sees_every_derivative<Step, P, 1>) {
    return detail::refuse_slope<detail::SlopeMistake::jump, P>();
  } else {
    return detail::sensitivities<Step, 1, Dual<sizeof...(X)>>(
        model, detail::EndOnly{}, payoff, detail::sensitivity_rates<Step>(smoothness_of<P>() - 1), parameters...);
  }
}

/// The same of a payoff of what a path leaves behind, with the rates of its slopes, which the summary does not know. Beta of geometric
/// Brownian motion at levels 3 to 7, with the kurtosis at the last:
///
///                              MilsteinStep                              Branched<MilsteinStep>
///   call on the Average        1.2, 2400 (theory 1): no PMF              2.0, 150 (theory 5/3)
///   X_T less the Minimum       delta 2.0, 9; vega 1.5 falling to 1.3,
///                              900; rho 1.0, 1300: no PMF
///   call that StaysAbove       delta 0.7, 8000 (theory 1/2): no PMF      no better
///
/// Two minima far apart that are nearly equal, or a step that begins near a barrier, have slopes that no coupling brings together.
///
///   const auto asian = [](const auto& path) { return positive_part(path.average() - 100); };
///   sensitivities(Branched<MilsteinStep>{}, model, Average{}, discounted(asian), Rates{1.67, 1.2}, 100.0, 0.2)
///
/// A summary of yours has a template `add` and numbers of the type that `summary.template as<X>()` gives it.
template <class Step, class Model, class Summary, class P, std::convertible_to<double>... X>
requires(sizeof...(X) > 0) auto sensitivities(Step /*scheme*/, const Model& model, const Summary& summary,
                                              const P& payoff, const Rates& rates, const X&... parameters) {
  if constexpr (Step::is_smoothed) {
    return detail::refuse_slope<detail::SlopeMistake::summary_at_last_step, Summary>();
  } else {
    return detail::sensitivities<Step, 1, Dual<sizeof...(X)>>(model, summary, payoff, rates, parameters...);
  }
}

/// The same with all second derivatives, a Dual of Duals: `mean.value.value`, `mean.value.slopes[i]`,
/// `mean.slopes[i].slopes[j]`: gamma is slopes[0].slopes[0] if the spot is the first parameter.
template <class Step, class Model, class P, std::convertible_to<double>... X>
requires(sizeof...(X) > 0) auto second_sensitivities(Step /*scheme*/, const Model& model, const P& payoff,
                                                     const X&... parameters) {
  if constexpr (!detail::sees_every_derivative<Step, P, 2>) {
    return detail::refuse_slope<detail::SlopeMistake::kink, P>();
  } else {
    return detail::sensitivities<Step, 2, Dual<sizeof...(X), Dual<sizeof...(X)>>>(
        model, detail::EndOnly{}, payoff, detail::sensitivity_rates<Step>(smoothness_of<P>() - 2), parameters...);
  }
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
constexpr detail::Refused component_of(const detail::Refused& said, std::size_t /*component*/) { return said; }

}  // namespace debias

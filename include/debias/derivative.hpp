#pragma once

// Derivatives by finite differences: the step shrinks from level to level, and the bias goes with it.
//
//   forward   I_k = (f(x + h_k) - f(x)) / h_k                   E D_k^2 ~ 2^(-2 k)    [Misso et al. 2022]
//   central   I_k = (f(x + h_k) - f(x - h_k)) / (2 h_k)         E D_k^2 ~ 2^(-4 k)
//   second    I_k = (f(x + h_k) - 2 f(x) + f(x - h_k)) / h_k^2  E D_k^2 ~ 2^(-4 k)
//   n extrapolations (Richardson): 2^(-2 (n + 1) k), 2^(-4 (n + 1) k)
//
//   Notation: x = at, h_k = first_step ratio^k; f(x), or f(x, stream) for the derivative of x -> E f(x).
// All evaluations of a draw see the same random numbers. The rates hold where f is smooth in every sample.
// Samples with kinks have 2^-k (first derivatives; declare {1, 0}). Where they jump or have their own noise,
// E D_k^2 grows and no PMF helps: `survey` says so before a run, verdict and bias bound of a result after it. The bound
// of an f without noise is infinite where its differences fall by less than 3/4 of the declared rate: at jumps, cusps
// and poles, and at kinks of second differences.
// Numbers: those of f in its own order, the same for all evaluations of a draw.
// Rounding: f is off by eps |f|, I_k by 2^k eps |f| / h_0. Levels stop where that outgrows the difference
// (`last_level`); later differences are 0, and the result carries the bound on the bias (`bias_bound`).

#include <utility>

#include <debias/core/rates.hpp>
#include <debias/core/refusals.hpp>
#include <debias/derivative/complex_step.hpp>
#include <debias/derivative/finite_difference.hpp>

namespace debias {

/// The derivative of f (of E f, when f takes a Stream) at a point: `finite_difference(f, 1.0)`,
/// `finite_difference(f, 1.0, {.kind = Difference::central})`. Evaluates f at `at` and `at + first_step`, 32
/// times if it is random, to know where rounding takes over.
/// Throws std::invalid_argument for a step that is not positive and finite, or too small beside `at`, a ratio
/// outside (0, 1), too many extrapolations, or a last level whose step is lost.
template <ParameterFunction F>
FiniteDifference<F> finite_difference(F f, double at, const DifferenceOptions& options = {}) {
  return {std::move(f), at, options, detail::smooth_rates(options)};
}

/// The same where f is not smooth, with rates of its own: {1, 0} for a kink.
template <ParameterFunction F>
FiniteDifference<F> finite_difference(F f, double at, const DifferenceOptions& options, const Rates& rates) {
  return {std::move(f), at, options, rates};
}

template <class F>
requires(!ParameterFunction<F>) auto finite_difference(const F& /*f*/, double /*at*/,
                                                       const DifferenceOptions& /*options*/ = {},
                                                       const Rates& /*rates*/ = {}) {
  return detail::refuse<
      detail::mistake_in_parameter_function<F, detail::Mistake::no_function_of_parameter, const double&>(), F>();
}

}  // namespace debias

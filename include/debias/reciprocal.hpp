#pragma once

// 1 / E X, and 1 / (integral of f), by doubling.
//
//   I_k = 1 / (mean of 2^k),  D_k = -d^2 / (m (m - d) (m + d)),  m = mean, d = half the difference of halves
//
// Needs an X of one sign with E X not 0; differences and rates are those of function_of_mean.hpp.
// Fails near zero. Where X has a positive density at 0, the q-th moment of I_k is finite only for 2^k > q:
// start at base level 2 for a finite variance, at 3 for a standard error that can be trusted. Where X is zero
// with probability p > 0, I_k is infinite with probability p^(2^k), and no base level helps.
// Sources: Blanchet & Glynn, WSC 2015; Misso et al., ACM TOG 41(4), 2022 (combs).

#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>

namespace debias {

/// 1 / E X for real X: `x(rng)` draws X.
template <RandomVariable X>
auto reciprocal(X x, const Rates& rates = {2, 1}) {
  return function_of_mean(std::move(x), functions::Reciprocal{}, rates);
}

/// 1 / (integral of f over [from, to]) for real f: one comb of equidistant points a draw.
template <class F>
auto reciprocal_of_integral(F f, const IntegralOptions& options = {}) {
  return function_of_integral(std::move(f), functions::Reciprocal{}, options);
}

}  // namespace debias

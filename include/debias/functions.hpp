#pragma once

// Functions g of a mean whose doubling difference has a form without cancellation.
//
//   gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2,  m = mean, d = half the difference of the halves
//
// The gap is about -g''(m) d^2 / 2. For small d that is far below the rounding of g, and subtracting leaves a
// residue of 1e-17 that a PMF divides by the probability of its level. The forms here are off by some ten ulp of
// the gap (exponentials: |m| ulp; LogSumExp: |m| ulp of 1) and exactly zero at d = 0. Nothing is checked and nothing
// clamped: outside its domain a function is NaN or infinite and its gap NaN, and the run reports that.
// m and d know the smaller half to 2^-53 of the larger one only. gap_of_halves(a, b), a = m + d, b = m - d, knows both: a
// sequence uses it where one is below 2^-26 of the other (lopsided); above, a gap is off by 2^-52 |a / b|.
// Limits that are finite: e^-inf = 0, 1 / inf = inf^-p = 0, finite / inf = 0, inf^0 = 1, logistic(inf) = 1, (-inf) = 0,
// PositivePart(-inf) = 0. A NaN stays one.
// expand(a) is the power series of g about a, for taylor.hpp; it throws std::invalid_argument where there is
// none. Each takes one real number; componentwise(g) makes it a function of real arrays. A g of yours with a
// member gap(m, d) is used in the same way.
// values(m) and gaps(m, d), where there are some, do the same to many numbers in place: d becomes the gap.
// Source: derived here from expm1, atanh and (a - b)(a + b); tested against 50 digits.

#include <debias/functions/arrays.hpp>
#include <debias/functions/elementary.hpp>
#include <debias/functions/log_weights.hpp>
#include <debias/functions/power_series.hpp>
#include <debias/functions/powers.hpp>

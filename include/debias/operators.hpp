#pragma once

// Matrix functions of symmetric operators, unbiased, from products alone: log det, tr f(A), z^T f(A) z, <c, A^-1 b>.
//
//   estimate(roulette(log_determinant_spd(A, {.lower = nugget})), plan)
//
// operators/terms.hpp says how, bounds.hpp what must be known of the spectrum, probes.hpp which random vectors when.

#include <debias/operators/bounds.hpp>
#include <debias/operators/chebyshev.hpp>
#include <debias/operators/probes.hpp>
#include <debias/operators/spectrum.hpp>
#include <debias/operators/symmetric.hpp>
#include <debias/operators/terms.hpp>

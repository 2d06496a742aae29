#pragma once

// Elementary functions of many numbers at once, in place: for integrands and functions with a batch hook.
//
//   exp(x): x[i] becomes e^x[i], ...
//
// Those of the C library's vector mathematics where it has one (glibc 2.35 on x86-64: within 4 ulp, 4 to 8 times
// as fast as one by one), else std::exp and so on. A number's result does not depend on its place in the span. The
// bits differ from those of std::exp, and between machines with other vector instructions (core/instructions.hpp).
// Arguments outside a function's domain give NaN or infinity, as there.

#include <span>

namespace debias::vector_math {

void exp(std::span<double> x);
void expm1(std::span<double> x);
void log(std::span<double> x);
void log1p(std::span<double> x);
void sin(std::span<double> x);

}  // namespace debias::vector_math

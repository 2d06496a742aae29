#pragma once

// Student's law of location 0 and scale 1. Compiled once: one distribution of Boost.Math takes longer than most files.

namespace debias {

/// The x with P(T <= x) = u.
double student_quantile(double degrees, double u);
double student_density(double degrees, double x);

}  // namespace debias

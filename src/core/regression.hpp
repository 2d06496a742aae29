#pragma once

// The one weighted regression: a straight line through points that know their standard errors.

#include <span>

namespace debias {

/// y = at_zero + slope x. A fit of one point, or of none, has no slope (NaN), never a slope of zero.
struct Line {
  double at_zero = 0;
  double slope = 0;
  double at_zero_error = 0;
  double slope_error = 0;
  double chi_square = 0;  ///< sum of ((y - line) / error)^2
  int degrees = 0;        ///< points - 2
};

/// Least squares with the weights 1 / errors^2; standard errors are those that the errors of the points imply.
/// All spans have the same length, errors are positive.
Line fit_line(std::span<const double> x, std::span<const double> y, std::span<const double> errors);

}  // namespace debias

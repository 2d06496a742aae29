#include "core/regression.hpp"

#include <cmath>
#include <cstddef>
#include <limits>

namespace debias {

Line fit_line(std::span<const double> x, std::span<const double> y, std::span<const double> errors) {
  double weight = 0;
  double mean_x = 0;
  double mean_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double w = 1 / (errors[i] * errors[i]);
    weight += w;
    mean_x += w * x[i];
    mean_y += w * y[i];
  }
  mean_x /= weight;
  mean_y /= weight;
  double xx = 0;
  double xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double w = 1 / (errors[i] * errors[i]);
    xx += w * (x[i] - mean_x) * (x[i] - mean_x);
    xy += w * (x[i] - mean_x) * (y[i] - mean_y);
  }
  Line line;
  line.degrees = static_cast<int>(x.size()) - 2;
  if (!(xx > 0)) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    line.at_zero = line.slope = line.at_zero_error = line.slope_error = line.chi_square = nan;
    return line;
  }
  line.slope = xy / xx;
  line.at_zero = mean_y - line.slope * mean_x;
  line.slope_error = 1 / std::sqrt(xx);
  line.at_zero_error = std::sqrt(1 / weight + mean_x * mean_x / xx);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double residual = (y[i] - line.at_zero - line.slope * x[i]) / errors[i];
    line.chi_square += residual * residual;
  }
  return line;
}

}  // namespace debias

#include <debias/function_of_mean/densities.hpp>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "core/student.hpp"
#include "core/text.hpp"

namespace debias::densities {
namespace {

void check(const StudentT& law) {
  if (law.degrees > 0 && law.scale > 0) [[likely]]
    return;
  throw std::invalid_argument("StudentT: degrees = " + detail::format("%g", law.degrees) +
                              ", scale = " + detail::format("%g", law.scale) + " (must be positive)");
}

}  // namespace

double StudentT::quantile(double u) const {
  check(*this);
  const double off = u - 0.5;
  double t = 0;
  if (degrees == 1) {
    t = std::abs(off) < 0.25 ? std::tan(std::numbers::pi * off)
                             : std::copysign(1 / std::tan(std::numbers::pi * (0.5 - std::abs(off))), off);
  } else if (degrees == 2) {
    t = off * std::sqrt(2 / (u * (1 - u)));
  } else {
    t = off < 0 ? student_quantile(degrees, u) : -student_quantile(degrees, 1 - u);
  }
  return location + scale * t;
}

double StudentT::density(double x) const {
  check(*this);
  return student_density(degrees, (x - location) / scale) / scale;
}

}  // namespace debias::densities

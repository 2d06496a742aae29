#include <debias/transmittance.hpp>

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "core/text.hpp"

namespace debias::detail {

void refuse_extinction(const RayBounds& ray, double t, double mu) {
  const char* advice = mu > ray.majorant ? "raise the majorant, or take ratio_tracking"
                       : mu < 0          ? "ratio_tracking takes negative ones"
                                         : "the medium is not a number there";
  throw std::domain_error("delta_tracking: extinction = " + to_text(mu) + " at " + to_text(t) + " of [0, " +
                          to_text(ray.length) + "] (must lie in [0, majorant = " + to_text(ray.majorant) +
                          "], else the estimate is biased); " + advice);
}

void refuse_constant(const RayBounds& ray, double t, double mu, double control) {
  throw std::domain_error("residual_ratio_tracking: extinction = " + to_text(mu) + " at " + to_text(t) + " of [0, " +
                          to_text(ray.length) + "] (minorant = majorant = " + to_text(control) +
                          " say that it is that everywhere); give bounds that hold");
}

std::int64_t large_poisson_quantile(double mean, double probability) {
  if (!(mean >= 0 && mean <= 1e4 && probability >= 0 && probability <= 1)) {
    throw std::invalid_argument("poisson_quantile: mean = " + to_text(mean) +
                                ", probability = " + to_text(probability) + " (must lie in [0, 10^4] and [0, 1])");
  }
  // Masses in units of the largest one, which e^-mean would underflow. [P(J = k) = e^(k log mean - mean - log k!)]
  double log_mass = -mean;
  double cdf = 0;
  std::int64_t k = 0;
  for (;; ++k) {
    cdf += std::exp(log_mass);
    if (!(cdf < probability)) return k;
    if (static_cast<double>(k) > mean && log_mass < -745) return k;  // the rest of the masses underflow
    log_mass += std::log(mean / static_cast<double>(k + 1));
  }
}

}  // namespace debias::detail

#include <debias/chains/metropolis.hpp>

#include <cmath>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>

namespace debias::detail {

void refuse_density(const char* kernel, double log_density) {
  throw std::domain_error(std::string(kernel) + ": the log density is " + format("%g", log_density) +
                          " (must be a number, or minus infinity outside)");
}

void refuse_start(const char* kernel) {
  throw std::domain_error(
      std::string(kernel) +
      ": the chain starts where the density is zero (a chain cannot come from there); start inside");
}

void refuse_gradient(const char* kernel) {
  throw std::domain_error(std::string(kernel) +
                          ": the gradient of the log density is not finite where the density is (must be a number)");
}

void check_step(const char* kernel, double step) {
  if (step > 0 && std::isfinite(step) && std::isfinite(1 / step)) return;
  throw std::invalid_argument(std::string(kernel) + ": step = " + format("%g", step) +
                              " (must be positive and finite); 2.4 / sqrt(dimension) standard deviations of the target "
                              "is usual for a random walk");
}

}  // namespace debias::detail

#include <debias/core/pmf.hpp>

#include <stdexcept>
#include <string>

#include "core/text.hpp"

namespace debias {

void refuse_uniform(double u) {
  throw std::invalid_argument("pmf: u = " + to_text(u) + " (must lie in (0, 1]; levels are the inverse of the tail)");
}

double inverse_weight_error(double probability, std::int64_t level) {
  if (probability > 1) {
    throw std::domain_error("level " + std::to_string(level) + ": the PMF gives it the probability " +
                            to_text(probability) + " (must lie in (0, 1], and masses must sum to 1)");
  }
  throw std::length_error("level " + std::to_string(level) + ": its probability " + to_text(probability) +
                          " has underflowed, so 1 / p is no number; choose a PMF whose tail falls more slowly");
}

}  // namespace debias

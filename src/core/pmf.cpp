#include <debias/core/pmf.hpp>

#include <stdexcept>
#include <string>

#include "core/text.hpp"

namespace debias {

double inverse_weight_error(double probability, std::int64_t level) {
  throw std::length_error("level " + std::to_string(level) + ": its probability " + to_text(probability) +
                          " has underflowed, so 1 / p is no number; choose a law whose tail falls more slowly");
}

}  // namespace debias

#include <debias/chains/mixture.hpp>

#include <cmath>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>

namespace debias::detail {

void accumulate_weights(std::span<double> weights) {
  double sum = 0;
  for (double& w : weights) {
    if (!(w > 0 && std::isfinite(w))) {
      throw std::invalid_argument("mixture: a weight of " + format("%g", w) +
                                  " (must be positive and finite); leave out a kernel that is never taken");
    }
    sum += w;
    w = sum;
  }
  for (double& w : weights) w /= sum;
}

}  // namespace debias::detail

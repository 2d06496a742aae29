// Deterministic limits: no inner noise, so they test PMFs, weights and the bookkeeping alone.

#include <cmath>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {

Problem newton_sqrt() {
  // Newton's iteration x <- x - (x^2 - 2) / (2 x); D_k is the step itself.
  const auto sequence = [](std::int64_t level, Stream&) -> Draw<double> {
    double x = 2;
    double step = 2;
    for (std::int64_t k = 0; k < level; ++k) {
      step = -(x * x - 2) / (2 * x);
      x += step;
    }
    return {x, step, static_cast<double>(level + 1)};
  };
  return make({.id = "M01",
               .name = "newton-sqrt-2",
               .module = "core/sequence.hpp",
               .truth = 1.414213562373095048802,
               .formula = "limit of Newton's iteration for x^2 = 2 from x = 2: sqrt 2"},
              sequence, Rates{Rates::faster_than_any, 0});
}

Problem archimedes_pi() {
  // Half perimeter of the regular polygon with 6 2^k sides, side s_k = s_(k-1) / r, r = sqrt(2 + sqrt(4 - s_(k-1)^2)).
  const auto sequence = [](std::int64_t level, Stream&) -> Draw<double> {
    double side = 1;
    double half_perimeter = 3;
    double step = 3;
    for (std::int64_t k = 0; k < level; ++k) {
      const double root = std::sqrt(4 - side * side);
      const double r = std::sqrt(2 + root);
      const double growth = side * side / (4 * (2 + root) * (1 + r / 2));  // 1 - r / 2 without cancellation
      side /= r;
      half_perimeter *= 2 / r;
      step = half_perimeter * growth;
    }
    return {half_perimeter, step, static_cast<double>(level + 1)};
  };
  return make({.id = "M02",
               .name = "archimedes-pi",
               .module = "core/sequence.hpp",
               .truth = 3.141592653589793238463,
               .formula = "half perimeter of the polygon with 6 2^k sides: pi"},
              sequence, Rates{4, 0});
}

}  // namespace debias::catalog

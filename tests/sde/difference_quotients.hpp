#pragma once

// Slopes in the parameters of a path beside its difference quotients, in every parameter and at the same random numbers.

#include <array>
#include <cstddef>
#include <cstdint>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>

namespace debias::testing {

using Parameters = std::array<double, 4>;

/// `levels_at(parameters)` is a sequence of duals; `margin` is of the slopes of its values.
template <class LevelsAt>
void check_difference_quotients(const LevelsAt& levels_at, const Parameters& at, double margin) {
  const auto levels = levels_at(at);
  for (const std::int64_t k : {0, 1, 4}) {
    for (std::uint64_t sample = 0; sample < 8; ++sample) {
      Stream rng(9, sample);
      Stream same(rng);
      const auto draw = levels(k, rng);
      CHECK(levels.value_at(k, same).value.slopes == draw.value.slopes);
      for (std::size_t i = 0; i < at.size(); ++i) {
        const double h = 1e-6 * at[i];
        const auto moved = [&](double by) {
          Parameters p = at;
          p[i] += by;
          Stream again(9, sample);
          return levels_at(p)(k, again);
        };
        const auto up = moved(h);
        const auto down = moved(-h);
        CHECK(draw.value.slopes[i] ==
              Approx((up.value.value - down.value.value) / (2 * h)).epsilon(1e-5).margin(margin));
        CHECK(draw.difference.slopes[i] ==
              Approx((up.difference.value - down.difference.value) / (2 * h)).epsilon(1e-4).margin(1e-4));
      }
    }
  }
}

}  // namespace debias::testing

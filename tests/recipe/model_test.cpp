// What is predicted of a single term, from the moments of the levels.

#include <cmath>
#include <cstdint>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/recipe.hpp>
#include <debias/recipe/model.hpp>

using namespace debias;

namespace {

/// A value of mean 100, and differences of mean and standard deviation 2^-k above it, of work 2^k: the limit is 101.
struct Large {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double size = std::exp2(-static_cast<double>(level));
    const double d = level == 0 ? 100 + rng.normal() : size * (1 + rng.normal());
    return {level == 0 ? d : 101 - 2 * size + rng.normal() + d, d, 1 / size};
  }
};

}  // namespace

TEST_CASE("a variance predicted of members on their own is that without the square of the mean",
          "[recipe][statistical]") {
  const RecipeOptions options{.base_level = 0, .base = Base::one_outcome, .points = Points::plain};
  std::vector<double> ratios;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Advice advice = advise(level_runs(Large{}), {.samples = 800, .seed = seed, .threads = 1}, options);
    REQUIRE(advice.base == Base::one_outcome);
    REQUIRE(advice.block == 1);
    const auto r = estimate(estimator_of(Large{}, advice), {.samples = 20000, .seed = 100 + seed, .threads = 1});
    CAPTURE(seed, r.components[0].variance, advice.predicted.variance, advice.pmf.spec());
    CHECK(advice.predicted.variance < 0.1 * 101 * 101);  // about 100
    ratios.push_back(advice.predicted.variance / r.components[0].variance);
  }
  // A single one was 0.84 to 1.42 in 40 runs.
  const double ratio = Moments::of(ratios).mean;
  CAPTURE(ratio);
  CHECK(ratio < 1.3);
  CHECK(ratio > 1 / 1.3);
}

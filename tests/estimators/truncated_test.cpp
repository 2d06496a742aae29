#include <cmath>
#include <cstdint>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/truncated.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

TEST_CASE("truncated estimates one level without bias, and not the limit", "[truncated][statistical]") {
  for (const std::int64_t level : {0, 1, 3}) {
    CAPTURE(level);
    const auto check = [level](const auto& sequence, double at_level) {
      const auto e = truncated(sequence, level);
      CHECK(estimator_laws(e, at_level) == Failures{});
      const bool biased = std::abs(at_level - sequence.truth()) > 0;
      CHECK(laws::names(estimator_laws(e, sequence.truth(), {.repeats = 0}), "unbiased") == biased);
    };
    check(GeometricSeries{}, GeometricSeries{}.partial(level));
    check(SquaredMean{}, SquaredMean::value_mean(level));
    check(Steady{}, 0.5);
  }
}

TEST_CASE("the laws reject a truncated estimate that is scaled, or without its value", "[truncated][statistical]") {
  const laws::EstimatorLawOptions options;
  const Plan plan{.samples = options.samples, .seed = options.seed};
  const double at_level = SquaredMean::value_mean(2);
  const auto e = truncated(SquaredMean{}, 2);
  CHECK(laws::names(estimator_laws(scaled_detectably(e, at_level, plan, options.z_limit), at_level, {.repeats = 0}),
                    "unbiased"));
  CHECK(laws::names(estimator_laws(truncated(BaseDropped<SquaredMean>{{}}, 2), at_level, {.repeats = 0}), "unbiased"));
}

TEST_CASE("truncated says that it is biased, and pays for its level only", "[truncated][exact]") {
  const auto e = truncated(SquaredMean{}, 3);
  CHECK(e.describe() == "truncated (biased), level 3");
  CHECK_THROWS_WITH(truncated(SquaredMean{}, -1), Catch::Contains("truncated"));
  const auto traced = trace(e, 1, 0);
  REQUIRE(traced.levels.size() == 1);
  CHECK(traced.levels[0].is_base);
  CHECK(traced.levels[0].level == 3);
  CHECK(traced.sample.work == 8);
  const auto result = estimate(e, {.samples = 1000});
  CHECK(result.work == 8000);
  REQUIRE(result.levels.size() == 1);
  CHECK(result.levels[0].mean == Approx(result.mean).epsilon(1e-13));
}

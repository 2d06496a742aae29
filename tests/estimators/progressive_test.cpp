#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/progressive.hpp>
#include <debias/pmf/geometric.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

const Geometric pmf(0.6);
const Schedule schedule{.base_level = 1, .first_step = 64, .doublings = 2};

}  // namespace

TEST_CASE("progressive is unbiased and honest, its bases shared or not", "[progressive][statistical][stat]") {
  CHECK(estimator_laws(progressive(GeometricSeries{}, pmf, schedule), GeometricSeries{}.truth()) == Failures{});
  CHECK(estimator_laws(progressive(SquaredMean{}, pmf, schedule), 1) == Failures{});
  CHECK(estimator_laws(progressive(Comb{}, pmf, schedule), Comb{}.truth()) == Failures{});
}

TEST_CASE("progressive is unbiased at every index: in every group of one base level", "[progressive][statistical]") {
  const auto e = progressive(SquaredMean{}, pmf, schedule);
  for (std::int64_t m = 1; m < 5; ++m) {
    const std::int64_t first = schedule.first_index(m);
    const std::int64_t last = schedule.first_index(m + 1);
    const auto group = estimate(e, {.samples = last - first, .seed = 2, .first = first});
    CAPTURE(m, first, last);
    CHECK(group.levels.front().level == m);
    CHECK(std::abs(group.mean - 1) < 4.5 * group.standard_error);
  }
  // Power: the biased form is caught by the same claim where its bias is known, 2^-m.
  const std::int64_t first = schedule.first_index(3);
  const auto biased = estimate(biased_progressive(SquaredMean{}, schedule),
                               {.samples = schedule.first_index(4) - first, .seed = 2, .first = first});
  CHECK(std::abs(biased.mean - (1 + 1.0 / 8)) < 4.5 * biased.standard_error);
  CHECK(std::abs(biased.mean - 1) > 4.5 * biased.standard_error);
}

TEST_CASE("the classic average is biased at every index and converges", "[progressive][statistical]") {
  const GeometricSeries series{.q = 0.5};
  double before = 1;
  for (const std::int64_t samples : {1 << 8, 1 << 12, 1 << 16}) {
    const double error = series.truth() - estimate(biased_progressive(series, schedule), {.samples = samples}).mean;
    CHECK(error > 0);
    CHECK(error < 0.6 * before);
    before = error;
  }
  CHECK(laws::names(estimator_laws(biased_progressive(SquaredMean{}, schedule), 1, {.repeats = 0}), "unbiased"));
}

TEST_CASE("the schedule counts doublings of the index, and first_index inverts it", "[progressive][exact]") {
  CHECK(schedule.level(0) == 1);
  CHECK(schedule.level(191) == 1);
  CHECK(schedule.level(192) == 2);  // 1 + 192 / 64 = 4, two doublings
  for (std::int64_t m = 2; m < 14; ++m) {
    const std::int64_t first = schedule.first_index(m);
    CHECK(schedule.level(static_cast<std::uint64_t>(first)) == m);
    CHECK(schedule.level(static_cast<std::uint64_t>(first) - 1) == m - 1);
  }
  CHECK_THROWS_AS(progressive(Steady{}, pmf, {.doublings = 0}), std::invalid_argument);
  CHECK_THROWS_WITH(biased_progressive(Steady{}, {.base_level = -2}),
                    Catch::Contains("biased_progressive: base_level = -2"));
}

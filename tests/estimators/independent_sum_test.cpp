#include <cmath>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/pmf/geometric.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

const Geometric pmf(0.55);

template <class S>
void check_everywhere(const S& sequence) {
  for (const std::int64_t m : {0, 1, 3}) {
    CAPTURE(m);
    CHECK(estimator_laws(independent_sum(sequence, pmf, {.base_level = m}), sequence.truth()) == Failures{});
  }
}

}  // namespace

TEST_CASE("independent_sum is unbiased and honest on a series without noise and where differences are zero",
          "[independent_sum][statistical]") {
  check_everywhere(GeometricSeries{});
  check_everywhere(Steady{});
}

TEST_CASE("independent_sum is unbiased and honest on squares of means and combs",
          "[independent_sum][statistical][stat]") {
  check_everywhere(SquaredMean{});
  check_everywhere(Comb{});
}

TEST_CASE("independent_sum takes the PMF of the declared rates, and refuses a negative base level",
          "[independent_sum][exact]") {
  CHECK(independent_sum(SquaredMean{}).pmf().tail_exponent().exponent == Approx(7.0 / 6));
  CHECK(independent_sum(SquaredMean{}, pmf, {.base_level = 2}).describe() ==
        "independent_sum, geometric:r=0.55, base level 2");
  CHECK_THROWS_WITH(independent_sum(SquaredMean{}, pmf, {.base_level = -1}),
                    Catch::Contains("base_level = -1") && Catch::Contains("independent_sum"));
}

TEST_CASE("the laws reject independent sums that are scaled, off by one in their survival, unweighted or cut",
          "[independent_sum][statistical]") {
  const laws::EstimatorLawOptions options;
  const Plan plan{.samples = options.samples, .seed = options.seed};
  const auto check = [&](const auto& sequence) {
    const double truth = sequence.truth();
    CHECK(rejected(scaled_detectably(independent_sum(sequence, pmf), truth, plan, options.z_limit), truth));
    CHECK(rejected(independent_sum(sequence, PmfOffByOne{pmf}), truth));
    CHECK(rejected(independent_sum(sequence, NoReweighting{pmf}), truth));
    CHECK(rejected(independent_sum(sequence, Renormalised{pmf, 1}), truth));
    for (const std::int64_t m : {0, 2}) {
      const BaseDropped<std::remove_cvref_t<decltype(sequence)>> dropped{sequence};
      CHECK(rejected(independent_sum(dropped, pmf, {.base_level = m}), truth));
    }
  };
  check(GeometricSeries{});
  check(SquaredMean{});
  check(Comb{});
}

TEST_CASE("the variance of the independent sum is sum nu_k / P(J >= k - m) - I^2", "[independent_sum][statistical]") {
  // nu_k = Var D_k + (I - E I_(k-1))^2 - (I - E I_k)^2; the base stands for every level up to its own.
  const auto exact = [](std::int64_t m, double truth, double base_variance, const auto& mean, const auto& variance,
                        const Geometric& p) {
    const auto gap = [&](std::int64_t k) { return (truth - mean(k)) * (truth - mean(k)); };
    double sum = base_variance - gap(m);
    for (std::int64_t k = m + 1; k < m + 400; ++k) sum += (variance(k) + gap(k - 1) - gap(k)) / p.tail(k - m);
    return sum;
  };
  const Geometric p(0.5);
  for (const std::int64_t m : {0, 1, 3}) {
    const Plan plan{.samples = 100'000, .seed = 3};
    CAPTURE(m);
    const GeometricSeries series;
    const auto on_series = estimate(independent_sum(series, p, {.base_level = m}), plan);
    const auto partial = [&series](std::int64_t k) { return series.partial(k); };
    const auto none = [](std::int64_t) { return 0.0; };
    CHECK(has_variance(on_series, exact(m, series.truth(), 0, partial, none, p)));
    CHECK_FALSE(has_variance(on_series, exact(m, series.truth(), 0, partial, none, Geometric(0.45))));

    const auto on_square = estimate(independent_sum(SquaredMean{}, p, {.base_level = m}), plan);
    const auto variance = [](std::int64_t k) {
      return SquaredMean::difference_square(k) - std::pow(SquaredMean::difference_mean(k), 2);
    };
    const double base_variance = SquaredMean::value_variance(m);
    CHECK(has_variance(on_square, exact(m, 1, base_variance, SquaredMean::value_mean, variance, p)));
    CHECK_FALSE(has_variance(on_square, exact(m, 1, 0.5 * base_variance, SquaredMean::value_mean, variance, p)));
  }
}

TEST_CASE("the work of the independent sum is the base and sum work P(J >= k - m)", "[independent_sum][statistical]") {
  for (const std::int64_t m : {0, 3}) {
    const auto e = independent_sum(GeometricSeries{}, Geometric(0.5), {.base_level = m});
    std::vector<double> work;
    NullRecord record;
    for (std::uint64_t i = 0; i < 50'000; ++i) {
      Stream rng(4, i);
      work.push_back(e(rng, record).work);
    }
    // sum_{j >= 1} (m + j + 1) 2^-j = m + 3
    const auto exact = static_cast<double>(m + 1 + m + 3);
    const Moments measured = Moments::of(work);
    CHECK(std::abs(measured.mean - exact) <= 4.5 * measured.standard_error());
    CHECK_FALSE(std::abs(measured.mean - exact - 0.5) <= 4.5 * measured.standard_error());
  }
}

TEST_CASE("the independent sum touches every level up to its deepest, once", "[independent_sum][exact]") {
  const auto e = independent_sum(SquaredMean{}, Geometric(0.4), {.base_level = 1});
  for (std::int64_t i = 0; i < 200; ++i) {
    const auto traced = trace(e, 1, i);
    REQUIRE(traced.levels.at(0).is_base);
    for (std::size_t k = 0; k < traced.levels.size(); ++k) {
      REQUIRE(traced.levels[k].level == static_cast<std::int64_t>(k) + 1);
      REQUIRE(traced.levels[k].is_base == (k == 0));
    }
    REQUIRE(traced.sample.level == static_cast<std::int64_t>(traced.levels.size()));
  }
}

#include <algorithm>
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
#include <debias/estimators/roulette.hpp>
#include <debias/pmf/geometric.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

const Geometric pmf(0.55);

template <class S>
void check_everywhere(const S& terms) {
  for (const std::int64_t m : {0, 1, 3}) {
    CAPTURE(m);
    CHECK(estimator_laws(roulette(terms, pmf, {.base_level = m}), terms.truth()) == Failures{});
  }
}

struct RatedTerms : ReciprocalTerms {
  static constexpr Rates rates{3.5849625007211562, 0};  // log2 12
};

}  // namespace

TEST_CASE("roulette is unbiased and honest on series with noise, without, and with zeros only",
          "[roulette][statistical]") {
  check_everywhere(GeometricTerms{});
  check_everywhere(ReciprocalTerms{});
  check_everywhere(SteadyTerms{});
}

TEST_CASE("roulette takes the PMF of the declared rates, and refuses a negative base level", "[roulette][exact]") {
  CHECK(roulette(RatedTerms{}).pmf().tail_exponent().exponent == Approx(RatedTerms::rates.variance_decay / 2));
  CHECK(roulette(RatedTerms{}, pmf, {.base_level = 2}).describe() == "roulette, geometric:r=0.55, base level 2");
  CHECK_THROWS_WITH(roulette(RatedTerms{}, pmf, {.base_level = -1}),
                    Catch::Contains("base_level = -1") && Catch::Contains("roulette"));
}

TEST_CASE("the laws reject roulette that is scaled, off by one in its survival, unweighted or cut",
          "[roulette][statistical]") {
  const laws::EstimatorLawOptions options;
  const Plan plan{.samples = options.samples, .seed = options.seed};
  const auto check = [&](const auto& terms) {
    const double truth = terms.truth();
    CHECK(rejected(scaled_detectably(roulette(terms, pmf), truth, plan, options.z_limit), truth));
    CHECK(rejected(roulette(terms, PmfOffByOne{pmf}), truth));
    CHECK(rejected(roulette(terms, NoReweighting{pmf}), truth));
    CHECK(rejected(roulette(terms, Renormalised{pmf, 1}), truth));
    for (const std::int64_t m : {0, 2}) {
      const FirstTermDropped<std::remove_cvref_t<decltype(terms)>> dropped{terms};
      CHECK(rejected(roulette(dropped, pmf, {.base_level = m}), truth));
    }
  };
  check(GeometricTerms{});
  check(ReciprocalTerms{});
}

TEST_CASE("the variance of roulette is sum nu_k / P(J >= k - m) - I^2", "[roulette][statistical]") {
  const Geometric p(0.5);
  const auto exact = [](std::int64_t m, const Geometric& q, double truth, const auto& nu) {
    double sum = -truth * truth;
    for (std::int64_t k = 0; k < m + 200; ++k) sum += nu(k) / (k <= m ? 1 : q.tail(k - m));
    return sum;
  };
  const GeometricTerms plain;
  const auto gap = [&plain](std::int64_t k) { return std::pow(power(plain.q, k) * plain.truth(), 2); };
  const auto nu_of_plain = [&gap](std::int64_t k) { return gap(k) - gap(k + 1); };
  for (const std::int64_t m : {0, 1, 3}) {
    const Plan plan{.samples = 200'000, .seed = 3};
    CAPTURE(m);
    const auto without_noise = estimate(roulette(plain, p, {.base_level = m}), plan);
    CHECK(has_variance(without_noise, exact(m, p, plain.truth(), nu_of_plain)));
    CHECK_FALSE(has_variance(without_noise, exact(m, Geometric(0.45), plain.truth(), nu_of_plain)));
    const auto with_noise = estimate(roulette(ReciprocalTerms{}, p, {.base_level = m}), plan);
    const double truth = ReciprocalTerms{}.truth();
    CHECK(has_variance(with_noise, exact(m, p, truth, ReciprocalTerms::coupled_square)));
    const auto noisier = [](std::int64_t k) { return 1.01 * ReciprocalTerms::coupled_square(k); };
    CHECK_FALSE(has_variance(with_noise, exact(m, p, truth, noisier)));
  }
}

TEST_CASE("roulette pays for each term that it takes", "[roulette][statistical]") {
  const auto e = roulette(ReciprocalTerms{}, Geometric(0.5), {.base_level = 2});
  std::vector<double> work;
  NullRecord record;
  for (std::uint64_t i = 0; i < 50'000; ++i) {
    Stream rng(4, i);
    const auto sample = e(rng, record);
    REQUIRE(sample.work == 2 * static_cast<double>(sample.level + 1));
    work.push_back(sample.work);
  }
  const Moments measured = Moments::of(work);  // 2 (3 + sum_{j >= 1} 2^-j) = 8
  CHECK(std::abs(measured.mean - 8) <= 4.5 * measured.standard_error());
  CHECK_FALSE(std::abs(measured.mean - 8.2) <= 4.5 * measured.standard_error());
}

TEST_CASE("two PMFs walk along the same path at one seed", "[roulette][exact]") {
  const auto flat = roulette(ReciprocalTerms{}, Geometric(0.3));
  const auto steep = roulette(ReciprocalTerms{}, Geometric(0.7));
  for (std::int64_t i = 0; i < 200; ++i) {
    const auto a = trace(flat, 5, i).levels;
    const auto b = trace(steep, 5, i).levels;
    for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) {
      REQUIRE(a[k].level == b[k].level);
      REQUIRE(a[k].difference == b[k].difference);
    }
  }
}

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"

#include <debias/core/no_pmf.hpp>
#include <debias/core/rates.hpp>

using namespace debias;

namespace {

constexpr double forever = Rates::faster_than_any;

/// Does sum_k 2^(-e k), or sum_k k^(-e), converge? The definition that every verdict below goes back to.
bool summable(double exponent, Decay decay) { return exponent > (decay == Decay::geometric ? 0 : 1); }

bool in_range(const Rates& rates, double rho) {
  const ExponentRange range = finite_exponents(rates);
  return range.low < rho && rho < range.high;
}

bool fourth_moment_is_finite(const Rates& r, double rho) { return summable(2 * r.variance_decay - 3 * rho, r.decay); }

bool near(double a, double b) { return std::abs(a - b) < 1e-12; }

}  // namespace

TEST_CASE("the range of exponents is where variance and work are both sums that converge", "[core][rates][exact]") {
  int inside = 0;
  for (const Decay decay : {Decay::geometric, Decay::polynomial}) {
    for (const double variance : {0.5, 1.0, 2.0, 4.0, 6.5}) {
      for (const double work : {0.0, 1.0, 2.25}) {
        for (int i = 1; i < 64; ++i) {
          const double rho = i / 8.0;
          const bool variance_finite = summable(variance - rho, decay);
          const bool work_finite = summable(rho - work, decay);
          REQUIRE(in_range({variance, work, decay}, rho) == (variance_finite && work_finite));
          inside += variance_finite && work_finite ? 1 : 0;
        }
      }
    }
  }
  CHECK(inside > 100);
}

TEST_CASE("no PMF exists at the border, where variance and work rates meet", "[core][rates][exact]") {
  CHECK(pmf_exists({1.001, 1}));
  CHECK_FALSE(pmf_exists({1, 1}));
  CHECK_FALSE(pmf_exists({0.486, 1.485}));  // photons, area halved and number times 2.8: no PMF, as published
  CHECK(pmf_exists({3.001, 1, Decay::polynomial}));
  CHECK_FALSE(pmf_exists({3, 1, Decay::polynomial}));
  CHECK(pmf_exists({forever, 1}));
  CHECK_THROWS_AS(default_exponent({1, 1}), std::invalid_argument);
  CHECK_THROWS_AS(default_exponent({3, 1, Decay::polynomial}), std::invalid_argument);
  try {
    default_exponent({1, 1.5});
    FAIL("no PMF has both");
  } catch (const std::invalid_argument& e) {
    CHECK_THAT(e.what(),
               Catch::Contains("2^(-1 k)") && Catch::Contains("2^(1.5 k)") && Catch::Contains("no PMF has both"));
  }
}

TEST_CASE("a refusal of declared rates has them as numbers, and rates that are none are another mistake",
          "[core][rates][exact]") {
  const auto refused = [](const auto& rates) -> std::optional<NoPmfError> {
    try {
      default_exponent(rates);
    } catch (const NoPmfError& e) {
      return e;
    }
    return std::nullopt;
  };
  const auto declared = refused(Rates{1, 1.5});
  REQUIRE(declared);
  CHECK(declared->variance_decay().value == 1);
  CHECK(std::isnan(declared->variance_decay().error));
  CHECK(declared->work_growth().value == 1.5);
  CHECK(declared->grade() == NoPmfError::Grade::declared);
  CHECK(declared->reason() == "E D_k^2 falls like 2^(-1 k) and work grows like 2^(1.5 k)");
  CHECK_THAT(declared->help(), Catch::Contains("better coupling"));
  CHECK(refused(Rates{2.5, 1, Decay::polynomial})->decay() == Decay::polynomial);
  // What does not fall, or grows, is not said to fall.
  CHECK_THAT(refused(Rates{0, 1})->reason(), Catch::StartsWith("E D_k^2 does not fall"));
  CHECK_THAT(refused(Rates{-0.3, 0})->reason(), Catch::Equals("E D_k^2 grows like 2^(0.3 k) and work does not grow"));
  // Measured: with their errors, and graded by them.
  MeasuredRates m;
  m.variance_decay = {0.5, 0.02};
  m.work_growth = {1, 0};
  CHECK(refused(m)->grade() == NoPmfError::Grade::shown);
  CHECK(refused(m)->variance_decay().error == 0.02);
  m.variance_decay = {0.97, 0.02};
  CHECK(refused(m)->grade() == NoPmfError::Grade::likely);
  CHECK_FALSE(refused(Rates{2, 1}));
  // NaN is no rate: not a sequence without a PMF.
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(refused(Rates{2.1, 1}));
  for (const Rates& unknown : {Rates{nan, 1}, Rates{1, nan}}) {
    CHECK_THROWS_WITH(default_exponent(unknown), Catch::Contains("is not known"));
    CHECK_THROWS_AS(default_exponent(unknown), std::invalid_argument);
    try {
      default_exponent(unknown);
    } catch (const std::invalid_argument& e) {
      CHECK(dynamic_cast<const NoPmfError*>(&e) == nullptr);
    }
  }
}

TEST_CASE("the default exponent lies inside, and keeps the fourth moment where that is possible",
          "[core][rates][exact]") {
  CHECK(near(default_exponent({2, 1}), 7.0 / 6));  // work 1, fourth moment 4/3, tail index 1/7
  CHECK(near(default_exponent({4, 0}), 2));        // the best, (beta + gamma) / 2, is below 8/3
  CHECK(near(default_exponent({1.5, 1}), 1.25));   // the fourth moment is out of reach: the best
  CHECK(near(default_exponent({forever, 1}), 2));
  for (const Decay decay : {Decay::geometric, Decay::polynomial}) {
    for (const double work : {0.0, 0.5, 1.0, 2.0}) {
      for (int i = 1; i < 80; ++i) {
        const Rates rates{i / 8.0, work, decay};
        if (!pmf_exists(rates)) continue;
        const double rho = default_exponent(rates);
        CAPTURE(rates.variance_decay, work, rho);
        REQUIRE(in_range(rates, rho));
        REQUIRE(rho <= (rates.variance_decay + work) / 2);
        const bool possible = fourth_moment_is_finite(rates, finite_exponents(rates).low + 0.2) ||
                              fourth_moment_is_finite(rates, (rates.variance_decay + work) / 2);
        REQUIRE(fourth_moment_is_finite(rates, rho) == possible);
      }
    }
  }
}

TEST_CASE("zeta(2) by its terms: exponents 1 < s < 3, or 2 < s < 3 when a level walks to its term",
          "[core][rates][exact]") {
  const ExponentRange free = finite_exponents({4, 0, Decay::polynomial});
  CHECK(free.low == 1);
  CHECK(free.high == 3);
  CHECK(default_exponent({4, 0, Decay::polynomial}) == 2);
  const ExponentRange walking = finite_exponents({4, 1, Decay::polynomial});
  CHECK(walking.low == 2);
  CHECK(walking.high == 3);
  CHECK(near(default_exponent({4, 1, Decay::polynomial}), 13.0 / 6));
}

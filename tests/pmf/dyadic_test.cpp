#include <debias/pmf/dyadic.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

#include <debias/pmf/any.hpp>

using debias::AnyPmf;
using debias::Dyadic;

static_assert(debias::DescribedPmf<Dyadic>);

TEST_CASE("Dyadic masses are whole powers of two over the block, and the tail is one member", "[pmf][exact]") {
  const Dyadic pmf({5, 4, 0}, 1.25);
  CHECK(pmf.block() == 32 + 16 + 1 + 1);
  for (std::int64_t j = 0; j < 3; ++j) {
    CHECK(pmf.mass(j) == static_cast<double>(pmf.copies(j)) / 50);
  }
  CHECK(pmf.copies(0) == 32);
  CHECK(pmf.copies(1) == 16);
  CHECK(pmf.copies(2) == 1);
  CHECK(pmf.copies(3) == 0);
  CHECK(pmf.copies(-1) == 0);
  CHECK(pmf.tail(3) == 1.0 / 50);
  CHECK(pmf.tail(0) == 1);
  CHECK(pmf.mass(7) / pmf.mass(6) == Approx(std::exp2(-1.25)).epsilon(1e-14));
  CHECK(pmf.mass(200) == Approx(std::exp2(-1.25 * 197) * (1 - std::exp2(-1.25)) / 50).epsilon(1e-12));
  CHECK(pmf.tail_exponent().exponent == 1.25);
  CHECK(pmf.tail_exponent().decay == debias::Decay::geometric);
}

TEST_CASE("Dyadic is a PMF, also where counts rise or differ by millions", "[pmf][law]") {
  using debias::laws::Failures;
  using debias::laws::pmf_laws;
  CHECK(pmf_laws(Dyadic({5, 4, 0}, 1.25)) == Failures{});
  CHECK(pmf_laws(Dyadic({0}, 0.5)) == Failures{});
  CHECK(pmf_laws(Dyadic({3, 9, 1, 1, 20}, 2.25)) == Failures{});
  CHECK(pmf_laws(Dyadic({40, 0}, 1.1)) == Failures{});
  CHECK(pmf_laws(Dyadic(std::vector<int>(30, 6), 6)) == Failures{});
}

TEST_CASE("a Dyadic PMF prints a text that is read as the same PMF, bit for bit", "[pmf][exact]") {
  for (const Dyadic& pmf : {Dyadic({10, 8, 5}, 1.25), Dyadic({0}, 1.0 / 3), Dyadic({26, 26, 0, 1}, 52.9)}) {
    const AnyPmf again = AnyPmf::parse(pmf.spec());
    CAPTURE(pmf.spec());
    CHECK(again.spec() == pmf.spec());
    CHECK(again.block() == pmf.block());
    CHECK(again.tail_exponent().exponent == pmf.tail_exponent().exponent);
    for (std::int64_t j = 0; j < 300; ++j) {
      if (again.mass(j) != pmf.mass(j) || again.tail(j) != pmf.tail(j) || again.copies(j) != pmf.copies(j)) {
        FAIL_CHECK("level " << j);
      }
    }
  }
  CHECK(AnyPmf::parse("dyadic:10,8,5;theta=1.25").spec() == "dyadic:10,8,5;theta=1.25");
  CHECK(AnyPmf::parse("geometric:r=0.6").block() == 0);
  CHECK(AnyPmf::parse("geometric:r=0.6").copies(0) == 0);
}

TEST_CASE("Dyadic refuses counts that are none, and texts that name none", "[pmf][exact]") {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(Dyadic({}, 1), Catch::Contains("no levels"));
  CHECK_THROWS_WITH(Dyadic({3, -1}, 1), Catch::Contains("m_1 = -1"));
  CHECK_THROWS_WITH(Dyadic({41}, 1), Catch::Contains("m_0 = 41"));
  CHECK_THROWS_WITH(Dyadic(std::vector<int>(5000, 40), 1), Catch::Contains("at most 2^52"));
  for (const double theta : {0.0, -1.0, 60.0, nan, std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(Dyadic({1}, theta), std::invalid_argument);
  }
  const auto refused = [](const char* text, const char* message) {
    CHECK_THROWS_WITH(AnyPmf::parse(text), Catch::Contains(message));
  };
  refused("dyadic:3,2", "no tail");
  refused("dyadic:3,2.5;theta=1", "m_1 = 2.5");
  refused("dyadic:3,-2;theta=1", "m_1 = -2");
  refused("dyadic:3,,2;theta=1", "m_1 = ''");
  refused("dyadic:1e99;theta=1", "m_0 = 1e+99");
  refused("dyadic:3;tail=0.4", "'tail' (no such parameter)");
  refused("dyadc:3;theta=1", "did you mean 'dyadic'?");
}

TEST_CASE("the exponent of the tail lies between finite work and a finite fourth moment where there is room",
          "[pmf][exact]") {
  CHECK(debias::dyadic_exponent({2, 1}) == Approx(1.25));
  CHECK(debias::dyadic_exponent({4, 1}) == Approx(2.25));
  CHECK(debias::dyadic_exponent({2, 0}) == Approx(1));
  CHECK(debias::dyadic_exponent({1.5, 1}) == 1.25);
  CHECK_THROWS_AS(debias::dyadic_exponent({1, 1}), std::invalid_argument);
  CHECK_THROWS_AS(debias::dyadic_exponent({4, 0, debias::Decay::polynomial}), std::invalid_argument);
}

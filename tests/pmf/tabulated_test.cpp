#include <debias/pmf/tabulated.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

using debias::Tabulated;

static_assert(debias::DescribedPmf<Tabulated>);

TEST_CASE("Tabulated masses and tails are within 1e-15, in the table and beyond", "[pmf][exact]") {
  struct Reference {
    std::int64_t level;
    double mass;
    double tail;
  };
  // mpmath, 300 digits, at the doubles that the parameters are.
  static constexpr Reference references[] = {
      {0, 0.44117647058823528643, 1},
      {1, 0.26470588235294116206, 0.55882352941176471357},
      {2, 0.17647058823529412437, 0.2941176470588235515},
      {3, 0.070588235294117653666, 0.11764705882352942713},
      {34, 3.2553077777134561918e-14, 5.4255129628557605204e-14},
      {35, 1.3021231110853825490e-14, 2.1702051851423043286e-14},
      {100, 1.7723581370503666309e-40, 2.9539302284172778274e-40},
      {500, 1.1818109638084157902e-199, 1.9696849396806930566e-199},
  };
  const Tabulated pmf({0.5, 0.3, 0.2}, 0.4);
  for (const auto& [level, mass, tail] : references) {
    CAPTURE(level);
    CHECK(debias::laws::relative_error(pmf.mass(level), mass) < 1e-15);
    CHECK(debias::laws::relative_error(pmf.tail(level), tail) < 1e-15);
  }
}

TEST_CASE("Tabulated is a PMF, also where its masses rise", "[pmf][law]") {
  CHECK(debias::laws::pmf_laws(Tabulated({0.5, 0.3, 0.2}, 0.4)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(Tabulated({1}, 0.5)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(Tabulated({1, 1e-9, 1000, 3}, 0.01)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(Tabulated({2, 7}, 0.999)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(Tabulated({2, 7}, 1e-12)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(Tabulated({2, 7}, 1 - 0x1p-40)) == debias::laws::Failures{});
  std::vector<double> masses;
  for (int j = 1; j <= 500; ++j) masses.push_back(std::pow(j, -1.5));
  CHECK(debias::laws::pmf_laws(Tabulated(masses, 0.9)) == debias::laws::Failures{});
}

TEST_CASE("Tabulated weights need no normalisation", "[pmf][exact]") {
  const Tabulated pmf({4, 2}, 0.5);  // the geometric PMF with r = 1/2
  for (std::int64_t j = 0; j < 60; ++j) CHECK(pmf.mass(j) == std::ldexp(1.0, -static_cast<int>(j) - 1));
  CHECK(pmf.tail_exponent().exponent == 1);
  CHECK(pmf.tail_exponent().decay == debias::Decay::geometric);
}

TEST_CASE("Tabulated refuses a PMF that ends, and masses that are none", "[pmf][exact]") {
  CHECK_THROWS_WITH(Tabulated({0.5, 0.5}, 0), Catch::Contains("Tabulated: tail = 0 (a PMF that ends"));
  constexpr double infinity = std::numeric_limits<double>::infinity();
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double tail : {-0.1, 1.0, 1.5, infinity, nan}) {
    CAPTURE(tail);
    CHECK_THROWS_AS(Tabulated({1}, tail), std::invalid_argument);
  }
  for (const double mass : {0.0, -1.0, infinity, nan, 1e-320}) {
    CAPTURE(mass);
    CHECK_THROWS_AS(Tabulated({1, mass, 1}, 0.5), std::invalid_argument);
    CHECK_THROWS_AS(Tabulated({1, mass}, 0.5), std::invalid_argument);
  }
  CHECK_THROWS_AS(Tabulated({}, 0.5), std::invalid_argument);
  CHECK_THROWS_AS(Tabulated({1e308, 1e308}, 0.5), std::invalid_argument);
}

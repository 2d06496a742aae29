#include <debias/pmf/radius.hpp>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "catch_shim.hpp"

using debias::RadiusPmf;

TEST_CASE("the radius PMF: masses are the steps of its tail, and sampling inverts it", "[pmf][radius][exact]") {
  const RadiusPmf pmf(2.0 / 3);
  double sum = 0;
  for (std::int64_t j = 0; j < 1000; ++j) {
    sum += pmf.mass(j);
    CHECK(pmf.mass(j) == Approx(pmf.tail(j) - pmf.tail(j + 1)).epsilon(1e-12));
    CHECK(pmf.sample(pmf.tail(j)) == j);
    CHECK(pmf.sample(std::nextafter(pmf.tail(j + 1), 1)) == j);
  }
  CHECK(sum + pmf.tail(1000) == Approx(1));
}

TEST_CASE("the radius PMF refuses what it cannot draw", "[pmf][radius][exact]") {
  CHECK_THROWS_AS(RadiusPmf(2.0 / 3).sample(1e-7), std::length_error);
  for (const double alpha : {0.0, 1.0, std::nan("")}) {
    CHECK_THROWS_WITH(RadiusPmf(alpha), Catch::Contains("alpha = "));
  }
}

#include <debias/pmf/radius.hpp>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "catch_shim.hpp"

using debias::RadiusLaw;

TEST_CASE("the radius law: masses are the steps of its tail, and sampling inverts it", "[pmf][radius][exact]") {
  const RadiusLaw law(2.0 / 3);
  double sum = 0;
  for (std::int64_t j = 0; j < 1000; ++j) {
    sum += law.mass(j);
    CHECK(law.mass(j) == Approx(law.tail(j) - law.tail(j + 1)).epsilon(1e-12));
    CHECK(law.sample(law.tail(j)) == j);
    CHECK(law.sample(std::nextafter(law.tail(j + 1), 1)) == j);
  }
  CHECK(sum + law.tail(1000) == Approx(1));
}

TEST_CASE("the radius law refuses what it cannot draw", "[pmf][radius][exact]") {
  CHECK_THROWS_AS(RadiusLaw(2.0 / 3).sample(1e-7), std::length_error);
  for (const double alpha : {0.0, 1.0, std::nan("")}) {
    CHECK_THROWS_WITH(RadiusLaw(alpha), Catch::Contains("alpha = "));
  }
}

#include <debias/pmf/geometric.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

using debias::Geometric;

static_assert(debias::DescribedPmf<Geometric>);

TEST_CASE("Geometric masses and tails are within 1e-15 for r near 0, near 1 and at deep levels", "[pmf][exact]") {
  // mpmath, 300 digits, at the double that the parameter is.
  struct Reference {
    double r;
    std::int64_t level;
    double mass;
    double tail;
  };
  static constexpr Reference references[] = {
      {1e-06, 1, 9.9999899999999995475e-7, 0.999999},
      {1e-06, 5, 9.9999500000999994475e-7, 0.99999500000999999},
      {1e-06, 31, 9.9996900046499545978e-7, 0.99996900046499550503},
      {1e-06, 32, 9.9996800049599499479e-7, 0.99996800049599504004},
      {1e-06, 33, 9.9996700052799449879e-7, 0.99996700052799454404},
      {1e-06, 50, 9.9995000122498035498e-7, 0.99995000122498040023},
      {1e-06, 500, 9.9950012472929402757e-7, 0.9995001247292940728},
      {1e-06, 1000, 9.9900049933387436371e-7, 0.99900049933387440892},
      {1e-06, 100000000, 3.7198899767480726299e-50, 3.7198899767480727982e-44},
      {1e-06, 500000000, 7.1227954840770878627e-224, 7.1227954840770881850e-218},
      {0.3, 1, 0.20999999999999999556, 0.7000000000000000111},
      {0.3, 5, 0.050421000000000002133, 0.16807000000000001333},
      {0.3, 31, 4.7332614610453763505e-6, 0.000015777538203484588419},
      {0.3, 32, 3.3132830227317634979e-6, 0.000011044276742439212068},
      {0.3, 33, 2.3192981159122344853e-6, 7.7309937197074485705e-6},
      {0.3, 50, 5.3953951279422405188e-9, 1.7984650426474135728e-8},
      {0.3, 500, 1.0620409483485861771e-78, 3.5401364944952873881e-78},
      {0.3, 1000, 3.7597699198972144464e-156, 1.2532566399657381952e-155},
      {0.65, 1, 0.22749999999999999334, 0.3499999999999999778},
      {0.65, 5, 0.0034139218749999990337, 0.005252187499999998334},
      {0.65, 31, 4.7755426877480734192e-15, 7.3469887503816511632e-15},
      {0.65, 32, 1.6714399407118255907e-15, 2.5714460626335777440e-15},
      {0.65, 33, 5.8500397924913891962e-16, 9.0000612192175215329e-16},
      {0.65, 50, 1.0382825956519196949e-23, 1.5973578394644917837e-23},
      {0.65, 500, 7.0296796107104080098e-229, 1.0814891708785242723e-228},
      {0.999999, 1, 9.9999900002875560700e-7, 1.0000000000287556645e-6},
      {0.999999, 5, 9.9999900014377815006e-31, 1.0000000001437783226e-30},
      {0.999999, 31, 9.9999900089142468021e-187, 1.0000000008914256004e-186},
      {0.999999, 32, 9.9999900092018031599e-193, 1.0000000009201812649e-192},
      {0.999999, 33, 9.9999900094893595178e-199, 1.0000000009489369295e-198},
  };
  for (const auto& [r, level, mass, tail] : references) {
    CAPTURE(r, level);
    const Geometric pmf(r);
    CHECK(debias::laws::relative_error(pmf.mass(level), mass) < 1e-15);
    CHECK(debias::laws::relative_error(pmf.tail(level), tail) < 1e-15);
  }
}

TEST_CASE("Geometric is a PMF", "[pmf][law]") {
  for (const double r : {0x1p-40, 1e-6, 0.05, 0.3, 0.5, 0.65, 0.95, 0.999999, 1 - 0x1p-53}) {
    CAPTURE(r);
    CHECK(debias::laws::pmf_laws(Geometric(r)) == debias::laws::Failures{});
  }
}

TEST_CASE("A geometric exponent theta gives r = 1 - 2^-theta and is found again in the tail", "[pmf][exact]") {
  CHECK(Geometric::with_exponent(1).mass(0) == 0.5);
  CHECK(Geometric::with_exponent(53).tail(1) == 0x1p-53);
  CHECK(debias::laws::relative_error(Geometric::with_exponent(1.5).mass(0), 0.64644660940672623780) < 1e-15);
  CHECK(debias::laws::relative_error(Geometric::with_exponent(1e-9).mass(0), 6.9314718031971884568e-10) < 1e-15);
  for (const double theta : {1e-9, 0.1, 1.0, 1.5, 2.0, 8.0}) {
    CAPTURE(theta);
    const Geometric pmf = Geometric::with_exponent(theta);
    CHECK(pmf.tail_exponent().decay == debias::Decay::geometric);
    CHECK(pmf.tail_exponent().exponent == Approx(theta).epsilon(1e-13));
    CHECK(std::log2(pmf.mass(100) / pmf.mass(101)) == Approx(theta).epsilon(1e-6));
  }
}

TEST_CASE("Geometric knows that no level lies above 0", "[pmf][exact]") {
  CHECK(Geometric(0.6).mass(-1) == 0);
  CHECK(Geometric(0.6).tail(-1) == 1);
}

TEST_CASE("Geometric refuses an r that is no PMF or whose levels outgrow a double", "[pmf][exact]") {
  for (const double r : {0.0, -0.5, 1.0, 1.2, 0x1p-41, std::numeric_limits<double>::quiet_NaN()}) {
    CAPTURE(r);
    CHECK_THROWS_AS(Geometric(r), std::invalid_argument);
  }
  for (const double theta : {0.0, -1.0, 54.0, 1e-13, std::numeric_limits<double>::infinity()}) {
    CAPTURE(theta);
    CHECK_THROWS_AS(Geometric::with_exponent(theta), std::invalid_argument);
  }
  CHECK_THROWS_WITH(Geometric(1.2), Catch::Contains("Geometric: r = 1.2 (must lie in [2^-40, 1))"));
}

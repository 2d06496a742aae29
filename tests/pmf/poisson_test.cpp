#include <debias/pmf/poisson.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>

using namespace debias;

static_assert(debias::DescribedPmf<Poisson>);

TEST_CASE("Poisson masses and tails are within 1e-15 from lambda = 1e-3 to 1e4, deep tails too", "[pmf][exact]") {
  // mpmath, 300 digits, at the double that the parameter is.
  struct Reference {
    double lambda;
    std::int64_t level;
    double mass;
    double tail;
  };
  static constexpr Reference references[] = {
      {0.001, 0, 0.99900049983337499165, 1},
      {0.001, 1, 0.00099900049983337501244, 0.00099950016662500835274},
      {0.001, 2, 4.9950024991668751662e-7, 4.9966679163334029738e-7},
      {0.001, 5, 8.3250041652781257969e-18, 8.3263918642115032568e-18},
      {0.001, 20, 4.1062093601627843509e-79, 4.1064049028301252161e-79},
      {0.001, 60, 1.2005793138456749869e-262, 1.2005989957912214710e-262},
      {3, 0, 0.049787068367863942979, 1},
      {3, 1, 0.14936120510359182894, 0.95021293163213605702},
      {3, 3, 0.22404180765538774341, 0.57680991887315648468},
      {3, 20, 7.1353787687771349406e-11, 8.3144235881916988572e-11},
      {3, 60, 2.5363955822133288758e-55, 2.6674737374830621804e-55},
      {3, 150, 3.2241211408492957830e-193, 3.2894660604843631623e-193},
      {1000, 720, 1.9513770304129978815e-21, 1},
      {1000, 800, 6.5831516418805085782e-12, 0.99999999997428426441},
      {1000, 1000, 0.012614611348721499718, 0.5042052441802155085},
      {1000, 1100, 0.000094989442422995075762, 0.00096263040586655716094},
      {1000, 1500, 1.0548547842117314892e-49, 3.1520793370542074545e-49},
      {1000, 2000, 1.5306205776187484791e-170, 3.0581920801687567950e-170},
      {10000, 9110, 7.7027142452891150496e-21, 0.99999999999999999992},
      {10000, 9800, 0.00053809030579833027693, 0.97778886829490347012},
      {10000, 10000, 0.0039893895589628256487, 0.50132980833995520038},
      {10000, 10500, 1.7779219298037508498e-8, 3.5995897948120386168e-7},
      {10000, 12000, 9.4477341002607397881e-85, 5.6545807500086134013e-84},
      {10000, 13500, 1.1496151529255593057e-242, 4.4306199504306513463e-242},
  };
  for (const auto& [lambda, level, mass, tail] : references) {
    CAPTURE(lambda, level);
    const Poisson pmf(lambda);
    CHECK(debias::laws::relative_error(pmf.mass(level), mass) < 1e-15);
    CHECK(debias::laws::relative_error(pmf.tail(level), tail) < 1e-15);
  }
}

TEST_CASE("Poisson is a PMF", "[pmf][law]") {
  for (const double lambda : {1e-300, 1e-3, 0.5, 3.0, 40.0, 81.0, 100.0, 1000.0, 1e4, 1e6}) {
    CAPTURE(lambda);
    CHECK(debias::laws::pmf_laws(Poisson(lambda)) == debias::laws::Failures{});
  }
}

TEST_CASE("Poisson masses fall faster than any rate", "[pmf][exact]") {
  CHECK(std::isinf(Poisson(3).tail_exponent().exponent));
  CHECK(Poisson(3).mass(151) / Poisson(3).mass(150) == Approx(3.0 / 151));
}

TEST_CASE("Poisson levels beyond underflow have no mass and are refused, not cut", "[pmf][exact]") {
  const Poisson pmf(3);
  CHECK(pmf.mass(1000) == 0);
  CHECK(pmf.tail(1000) == 0);
  CHECK_THROWS_AS(debias::inverse_weight(pmf.mass(1000), 1000), std::length_error);
  CHECK_THROWS_AS(pmf.sample(1e-310), std::length_error);
  CHECK(pmf.sample(1e-290) > 200);
}

TEST_CASE("Poisson refuses a lambda that is no mean level", "[pmf][exact]") {
  for (const double lambda :
       {0.0, -3.0, 1.1e6, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    CAPTURE(lambda);
    CHECK_THROWS_AS(Poisson(lambda), std::invalid_argument);
  }
  CHECK_THROWS_WITH(Poisson(1e-320), Catch::Contains("no double holds the mass of level 1"));
  CHECK_THROWS_WITH(Poisson(0), Catch::Contains("Poisson: lambda = 0 (must lie in (0, 1e6])"));
}

TEST_CASE("only differences that fall as fast as a Poisson law are called finite beside it",
          "[pmf][verdict][statistical]") {
  const auto finite_of = [](const auto& size, double lambda) {
    const auto levels = [size](std::int64_t level, Stream& rng) {
      const double u = rng.exponential();
      double sum = size(0);
      for (std::int64_t k = 1; k < level; ++k) sum += size(k);
      return level == 0 ? base(u * sum) : coupled(u * (sum + size(level)), u * sum);
    };
    int finite = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const auto r = estimate(single_term(levels, Poisson(lambda)), {.samples = 1 << 14, .seed = seed, .threads = 1});
      finite += r.verdict().variance == Finiteness::finite;
    }
    return finite;
  };
  const auto power = [](std::int64_t k) { return std::exp2(static_cast<double>(-k)); };
  const auto factorial = [](std::int64_t k) {
    return std::exp(static_cast<double>(k) * std::log(2.0) - std::lgamma(static_cast<double>(k) + 1));
  };
  for (const double lambda : {0.5, 1.0, 2.0, 4.0}) {
    CAPTURE(lambda);
    CHECK(finite_of(power, lambda) <= 4);  // sum of k! / (4 lambda)^k: each term smaller than the one before at first
    if (lambda >= 1) CHECK(finite_of(factorial, lambda) >= 14);
  }
}

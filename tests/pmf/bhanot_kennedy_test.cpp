#include <debias/pmf/bhanot_kennedy.hpp>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <debias/core/stream.hpp>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

using debias::BhanotKennedy;

static_assert(debias::DescribedPmf<BhanotKennedy>);

TEST_CASE("without an atom at zero the PMF of Bhanot and Kennedy keeps all laws of a PMF", "[pmf][law]") {
  CHECK(debias::laws::pmf_laws(BhanotKennedy(0, 2, 2)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(BhanotKennedy(0, 1, 0.3)) == debias::laws::Failures{});
  CHECK(debias::laws::pmf_laws(BhanotKennedy(0, 16, 16)) == debias::laws::Failures{});
}

TEST_CASE("its tails are (1 - zero) prod min(1, c / i), its masses their differences, its samples their inverse",
          "[pmf][exact]") {
  const BhanotKennedy pmf(0.9, 2, 2);
  CHECK(pmf.tail(0) == 1);
  CHECK(pmf.tail(1) == Approx(0.1));
  CHECK(pmf.tail(2) == Approx(0.1));
  CHECK(pmf.tail(3) == Approx(0.1 * 2 / 3));
  CHECK(pmf.tail(5) == Approx(0.1 * 2 / 3 * 2 / 4 * 2 / 5));
  double sum = 0;
  for (std::int64_t j = 100; j >= 0; --j) {
    CHECK(pmf.mass(j) == Approx(pmf.tail(j) - pmf.tail(j + 1)).margin(1e-17));
    sum += pmf.mass(j);
  }
  CHECK(sum == Approx(1).epsilon(1e-15));
  CHECK(pmf.mass(1) == 0);
  CHECK(pmf.sample(0.5) == 0);
  CHECK(pmf.sample(0.1 * (1 + 1e-12)) == 0);
  CHECK(pmf.sample(0.1 * (1 - 1e-12)) == 2);
  for (std::int64_t j = 3; j < 100; ++j) {
    CHECK(pmf.sample(pmf.tail(j) * (1 - 1e-12)) == j);
    CHECK(pmf.sample(pmf.tail(j) * (1 + 1e-12)) == j - 1);
  }
}

TEST_CASE("its mean is the published K + K! / c^K (e^c - sum_(k <= K) c^k / k!), times 1 - zero", "[pmf][exact]") {
  CHECK(BhanotKennedy(0.9, 2, 2).mean() == Approx(0.3194528).epsilon(1e-7));
  CHECK(BhanotKennedy(0, 2, 2).mean() == Approx(2 + 2.0 / 4 * (std::exp(2) - 5)).epsilon(1e-14));
  const BhanotKennedy pmf(0.5, 3, 1.5);
  double mean = 0;
  for (std::int64_t j = 1; j < 100; ++j) mean += static_cast<double>(j) * pmf.mass(j);
  CHECK(pmf.mean() == Approx(mean).epsilon(1e-14));
}

TEST_CASE("impossible parameters of Bhanot and Kennedy are refused", "[pmf][exact]") {
  CHECK_THROWS_WITH(BhanotKennedy(1, 2, 2), Catch::Contains("zero = 1"));
  CHECK_THROWS_AS(BhanotKennedy(-0.1, 2, 2), std::invalid_argument);
  CHECK_THROWS_AS(BhanotKennedy(0.9, 0, 2), std::invalid_argument);
  CHECK_THROWS_AS(BhanotKennedy(0.9, 2, 0), std::invalid_argument);
  CHECK_THROWS_AS(BhanotKennedy(0.9, 2, std::nan("")), std::invalid_argument);
  CHECK(BhanotKennedy(0.9, 2, 2).spec() == "bhanot-kennedy:zero=0.9,first=2,c=2");
  CHECK_THROWS_AS(BhanotKennedy(0.9, 2, 2).sample(1e-305), std::length_error);
}

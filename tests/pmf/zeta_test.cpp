#include <debias/pmf/zeta.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

using debias::Zeta;

static_assert(debias::DescribedPmf<Zeta>);

TEST_CASE("Zeta masses and tails are within 2e-15 for s near 1, large s and up to level 2^61", "[pmf][exact]") {
  // mpmath, 300 digits, at the double that the parameter is.
  struct Reference {
    double s;
    std::int64_t level;
    double mass;
    double tail;
  };
  static constexpr Reference references[] = {
      {1.01, 0, 0.0099425377653078761503, 1},
      {1.01, 1, 0.0049369298201632845321, 0.99005746223469212385},
      {1.01, 20, 0.00045925697571611513073, 0.96467111774408259327},
      {1.01, 63, 0.00014902374583275377671, 0.95382668117946467793},
      {1.01, 64, 0.00014670832512417411292, 0.95367765743363192416},
      {1.01, 100, 0.000094001040695400491364, 0.94945758987731811648},
      {1.01, 1000, 9.2695538341417891820e-6, 0.92788697435391730512},
      {1.01, 1000000, 8.6595796391709749908e-9, 0.86595883420485119549},
      {1.01, 1000000000000, 7.5421861876357090825e-15, 0.75421861876432822808},
      {1.01, 2305843009213693952, 2.8251350706037331362e-21, 0.65143179526360479565},
      {1.5, 0, 0.38279338399942656225, 1},
      {1.5, 1, 0.13533789880967029021, 0.61720661600057343775},
      {1.5, 20, 0.0039777316501262356118, 0.16907726428521933159},
      {1.5, 63, 0.00074764332812388000439, 0.096073627852811115891},
      {1.5, 64, 0.00073045655056728967119, 0.095325984524687235886},
      {1.5, 100, 0.00037712242895620081184, 0.07636775859263800521},
      {1.5, 1000, 0.000012086854852721918285, 0.024203928351922930774},
      {1.5, 1000000, 3.8279280981006829987e-10, 0.00076558657660220897396},
      {1.5, 1000000000000, 3.8279338399885237217e-19, 7.6558676799866172781e-7},
      {1.5, 2305843009213693952, 1.0932508402248315000e-28, 5.0417296144988495929e-10},
      {2, 0, 0.60792710185402662866, 1},
      {2, 1, 0.15198177546350665717, 0.39207289814597337134},
      {2, 20, 0.0013785195053379288632, 0.029649105042033924974},
      {2, 63, 0.00014841970260108071989, 0.0095734573085426456103},
      {2, 64, 0.00014388807144474003045, 0.0094250376059415648904},
      {2, 100, 0.000059594853627490111623, 0.0060489759826049283444},
      {2, 1000, 6.0671306900295172227e-7, 0.00060762323962426299346},
      {2, 1000000, 6.0792588600164669948e-13, 6.0792679789057702283e-7},
      {2, 1000000000000, 6.0792710185281077446e-25, 6.0792710185372266511e-13},
      {2, 2305843009213693952, 1.1433837983058779004e-37, 2.6364635381718088044e-19},
      {30, 0, 0.99999999906867256845, 1},
      {30, 1, 9.3132257374811225426e-10, 9.3132743155229739730e-10},
      {30, 20, 2.1548704098944552534e-40, 2.8853173240949562417e-40},
      {30, 63, 6.5253044619213294764e-55, 1.7917196639793977727e-54},
      {30, 64, 4.0982580471170293793e-55, 1.1391892177872648251e-54},
      {30, 100, 7.4192291709615111947e-61, 2.9732346360390349050e-60},
      {30, 1000, 9.7046007973954275644e-91, 3.3985258547706022411e-89},
      {30, 1000000, 9.9996999953369554788e-181, 3.4482258591075381815e-176},
  };
  for (const auto& [s, level, mass, tail] : references) {
    CAPTURE(s, level);
    const Zeta pmf(s);
    CHECK(debias::laws::relative_error(pmf.mass(level), mass) < 2e-15);
    CHECK(debias::laws::relative_error(pmf.tail(level), tail) < 2e-15);
  }
}

TEST_CASE("Zeta is a PMF", "[pmf][law]") {
  for (const double s : {1.01, 1.1, 1.5, 2.0, 2.5, 4.0, 30.0, 150.0, 5000.0}) {
    CAPTURE(s);
    CHECK(debias::laws::pmf_laws(Zeta(s)) == debias::laws::Failures{});
  }
}

TEST_CASE("Zeta samples exactly at levels where neighbouring tails are one double", "[pmf][exact]") {
  const Zeta pmf(1.5);
  for (double u = pmf.tail(63); u > 1e-9; u *= 0.37) {
    CAPTURE(u);
    const std::int64_t j = pmf.sample(u);
    CHECK(pmf.tail(j) >= u);
    CHECK(pmf.tail(j + 1) < u);
  }
  CHECK(pmf.sample(1e-9) > std::int64_t{1} << 58);
}

TEST_CASE("Zeta refuses to cut levels of 2^62 and more", "[pmf][exact]") {
  const Zeta pmf(1.1);
  const double beyond = pmf.tail(std::int64_t{1} << 62);
  CHECK(beyond > 0.01);
  CHECK_THROWS_AS(pmf.sample(beyond), std::length_error);
  CHECK_THROWS_AS(pmf.sample(0x1p-53), std::length_error);
  CHECK(pmf.sample(beyond * (1 + 1e-12)) < std::int64_t{1} << 62);
}

TEST_CASE("Zeta tails fall like the exponent says", "[pmf][exact]") {
  const debias::TailExponent tail = Zeta(2.5).tail_exponent();
  CHECK(tail.decay == debias::Decay::polynomial);
  CHECK(tail.exponent == 2.5);
  CHECK(std::log2(Zeta(2.5).mass(999'999) / Zeta(2.5).mass(1'999'999)) == Approx(2.5).epsilon(1e-12));
}

TEST_CASE("Zeta refuses an s whose masses have no sum", "[pmf][exact]") {
  for (const double s :
       {1.0, 0.5, -2.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    CAPTURE(s);
    CHECK_THROWS_AS(Zeta(s), std::invalid_argument);
  }
  CHECK_THROWS_WITH(Zeta(1), Catch::Contains("Zeta: s = 1 (must be greater than 1"));
}

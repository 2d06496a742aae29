// What is declared beside what the levels show: the PMF beyond the levels that were drawn.

#include <cmath>
#include <cstdint>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/recipe.hpp>

using namespace debias;

namespace {

// D_k of sd 2^(-decay k / 2), for 2^k of work.
auto levels_of(double decay) {
  return [decay](std::int64_t level, Stream& rng) {
    const double z = rng.normal();
    if (level == 0) return base(1 + z);
    const auto k = static_cast<double>(level);
    return Draw<double>{1 + z, std::exp2(-decay * k / 2) * z, std::exp2(k)};
  };
}

double exponent_of(double shown, double declared, std::uint64_t seed) {
  const Advice a = advise(level_runs(levels_of(shown)), {.samples = 1 << 16, .seed = seed, .threads = 1},
                          {.rates = Rates{declared, 1}});
  REQUIRE(a.usable());
  REQUIRE(a.exponent.decay == Decay::geometric);
  return a.exponent.exponent;
}

}  // namespace

TEST_CASE("levels that fall faster than declared get a tail of finite variance by both", "[recipe][exact]") {
  for (const double declared : {1.5, 2.4, 3.3}) {
    for (const double shown : {4.0, 5.8, 9.0}) {
      for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        CAPTURE(declared, shown, seed);
        const double exponent = exponent_of(shown, declared, seed);
        CHECK(exponent > 1);
        CHECK(exponent < declared);
      }
    }
  }
}

TEST_CASE("levels that fall more slowly than declared get a tail of what they show", "[recipe][exact]") {
  for (const double declared : {3.0, 6.0}) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      CAPTURE(declared, seed);
      const double exponent = exponent_of(1.8, declared, seed);
      CHECK(exponent > 1);
      CHECK(exponent < 1.8);
    }
  }
}

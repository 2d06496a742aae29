// What is declared beside what the levels show: the PMF beyond the levels that were drawn.

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/recipe.hpp>

using namespace debias;

namespace {

// D_k of sd 2^(-decay k / 2), for 2^k of work.
auto falling_by(double decay) {
  return [decay](std::int64_t level, Stream& rng) {
    const double z = rng.normal();
    if (level == 0) return base(1 + z);
    const auto k = static_cast<double>(level);
    return Draw<double>{1 + z, std::exp2(-decay * k / 2) * z, std::exp2(k)};
  };
}

double exponent_of(double shown, double declared, std::uint64_t seed) {
  const Advice a = advise(level_runs(falling_by(shown)), {.samples = 1 << 16, .seed = seed, .threads = 1},
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

TEST_CASE("a constant beside the work leaves no tail of infinite work", "[recipe][nets][exact]") {
  // The decay that is declared is that of the levels, or the levels contradict it.
  for (const double excess : {0.0, 1.5}) {
    for (const double growth : {0.7, 1.0, 2.0}) {
      for (const double constant : {1.0, 6.0}) {
        for (const Points points : {Points::plain, Points::nets}) {
          const auto levels = [=](std::int64_t level, Stream& rng) {
            const double z = rng.normal();
            const auto k = static_cast<double>(level);
            const double work = std::exp2(growth * k) + constant;
            const double size = std::exp2(-(growth + 0.3) * k / 2);
            return level == 0 ? base(1 + z, work) : Draw<double>{1 + z, size * z * (1 + z / 2), work};
          };
          for (std::uint64_t seed = 1; seed <= 4; ++seed) {
            CAPTURE(excess, growth, constant, points, seed);
            const RecipeOptions options{.rates = Rates{growth + 0.3 + excess, growth}, .points = points};
            try {
              const Advice a = advise(level_runs(levels), {.samples = 1 << 17, .seed = seed, .threads = 1}, options);
              CHECK((a.exponent.exponent > growth || !a.usable()));
            } catch (const std::invalid_argument& e) {  // nets leave no room
              CHECK(excess > 0);
            }
          }
        }
      }
    }
  }
}

TEST_CASE("options of a recipe that contradict each other are refused, in the caller's words", "[recipe][exact]") {
  const auto refusal = [](const RecipeOptions& options) {
    return [options] { (void)advise(level_runs(falling_by(3)), {.samples = 4096, .threads = 1}, options); };
  };
  CHECK_THROWS_WITH(refusal({.lowest_base = -1})(), Catch::Contains("lowest_base = -1"));
  CHECK_THROWS_WITH(refusal({.lowest_base = 4, .base_level = 1})(),
                    Catch::Contains("base_level = 1 is below lowest_base = 4"));
  CHECK_THROWS_WITH(refusal({.rates = Rates{std::nan(""), 1}})(), Catch::Contains("rates"));
  const auto free = [](std::int64_t level, Stream& rng) {
    const double u = rng.uniform();
    return level == 0 ? base(u, 0.0) : coupled(u, u / 2, 1.0);
  };
  CHECK_THROWS_WITH(advise(level_runs(free), {.samples = 4096, .threads = 1}, RecipeOptions{}),
                    Catch::Contains("level 0 states no work"));
}

TEST_CASE("a relative goal is planned by the mean that all levels tell", "[recipe][goal][statistical]") {
  // Of the deepest level alone it is 1 +- 3: goals were planned by 0.1 or by 3.
  const auto noisy = [](std::int64_t level, Stream& rng) {
    const double z = 10 * rng.normal();
    const double e = rng.exponential();
    const auto of = [&](std::int64_t k) { return 1 + z + std::exp2(static_cast<double>(-k)) * (3 * e - 1); };
    const double work = std::exp2(static_cast<double>(level));
    return level == 0 ? base(of(0), work) : coupled(of(level), of(level - 1), work);
  };
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const auto r = estimate(recipe(noisy, {.points = Points::plain}),
                            {.seed = seed, .threads = 1, .goal = {.relative_error = 0.1}});
    CAPTURE(seed, r.samples, r.mean, r.standard_error);
    CHECK(r.standard_error < 0.2);
    CHECK(r.standard_error > 0.04);
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

TEST_CASE("an advice has the members that its variance asks for", "[recipe][goal][exact]") {
  for (const double error : {0.03, 0.01}) {
    const Advice a = advise(level_runs(falling_by(3)), {.seed = 2, .threads = 1, .goal = {.error = error}},
                            {.points = Points::plain});
    CAPTURE(error, a.members, a.predicted.variance);
    const double asked = a.predicted.variance / (error * error);
    CHECK(static_cast<double>(a.members) > 0.9 * asked);
    CHECK(static_cast<double>(a.members) < 2 * asked);
  }
}

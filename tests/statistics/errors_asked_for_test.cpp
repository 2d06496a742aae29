// Errors that were asked for and missed: by a recipe, and by multilevel where few levels overstate what they know.

#include <algorithm>
#include <cmath>
#include <functional>

#include "catch_shim.hpp"

#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>
#include <debias/sde.hpp>

using namespace debias;

namespace {

constexpr GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2, .horizon = 1};

double normal_cdf(double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; }
double digital_price(double strike) { return std::exp(-0.05) * normal_cdf((std::log(100 / strike) + 0.03) / 0.2); }
double call_price(double strike) {
  const double d = (std::log(100 / strike) + 0.07) / 0.2;
  return 100 * normal_cdf(d) - strike * std::exp(-0.05) * normal_cdf(d - 0.2);
}
auto call(double strike) {
  return milstein(stock, [strike](double s) { return std::exp(-0.05) * std::max(s - strike, 0.0); });
}

/// Root mean square of (estimate - truth) / goal.
struct Errors {
  double root_mean_square = 0;
  double worst = 0;
  int met = 0;
};
Errors errors_of(int seeds, double truth, double goal,
                 const std::function<std::pair<double, bool>(std::uint64_t)>& run) {
  Errors e;
  double square = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto [mean, met] = run(static_cast<std::uint64_t>(seed));
    const double error = (mean - truth) / goal;
    square += error * error;
    e.worst = std::max(e.worst, std::abs(error));
    e.met += met;
  }
  e.root_mean_square = std::sqrt(square / seeds);
  return e;
}

// What chance leaves of a root mean square of 1.1: once in 1e4.
double bound(int seeds) { return 1.1 * std::sqrt(1 + 3.7 * std::sqrt(2.0 / seeds)); }

/// Levels with means that are given, and noise that halves.
struct Means {
  std::function<double(std::int64_t)> mean;  // E D_k
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    double coarse = 0;
    for (std::int64_t k = 0; k < level; ++k) coarse += mean(k);
    const double x = rng.normal();
    const double h = std::exp2(-static_cast<double>(level));
    const double work = 1 / h;
    if (level == 0) return base(mean(0) + x, work);
    return coupled(coarse + mean(level) + x + h * rng.normal(), coarse + x, work);
  }
};

}  // namespace

TEST_CASE("a European call keeps the error that a recipe was asked for", "[evidence][inputs][goal][statistical]") {
  struct Case {
    double strike;
    double error;
    int seeds;
  };
  CHECK(std::abs(call_price(100) - 10.45058357218556678) < 1e-9);
  for (const Case c : {Case{100, 0.01, 2}, Case{100, 0.05, 20}, Case{120, 0.05, 20}, Case{80, 0.05, 20}}) {
    CAPTURE(c.strike, c.error);
    const Errors e = errors_of(c.seeds, call_price(c.strike), c.error, [&](std::uint64_t seed) {
      const auto r = estimate(recipe(call(c.strike)), {.seed = seed, .goal = {.error = c.error}});
      return std::pair(r.mean, r.goal_met());
    });
    CHECK(e.root_mean_square < bound(c.seeds));
    CHECK(e.met >= c.seeds - 1 - c.seeds / 10);  // stated errors above the goal: below 5 %
  }
}

TEST_CASE("multilevel keeps its goal on a rare digital", "[evidence][inputs][goal][statistical]") {
  for (const double strike : {180.0, 165.0, 150.0}) {
    CAPTURE(strike);
    const double truth = digital_price(strike);
    const double goal = truth / 10;
    const auto digital = milstein(
        stock, [strike](double s) { return s > strike ? std::exp(-0.05) : 0.0; }, Rates{0.5, 1});
    double sum = 0;
    const Errors e = errors_of(10, truth, goal, [&](std::uint64_t seed) {
      const auto r = multilevel(digital, goal, {.seed = seed});
      sum += (r.components[0].mean - truth) / goal / 10;
      return std::pair(r.components[0].mean, r.goal_met());
    });
    CHECK(e.root_mean_square < bound(10));
    CHECK(std::abs(sum) < 1.5);  // always low before
  }
}

TEST_CASE("two differences that fall steeply are no decay of the bias", "[evidence][inputs][goal][statistical]") {
  // E D_k = c 2^(-rate k), but for one level that is small by chance.
  struct Case {
    double rate;
    std::int64_t small;
  };
  for (const Case c : {Case{1, 2}, Case{0.7, 2}, Case{1, 3}}) {
    CAPTURE(c.rate, c.small);
    const Means sequence{[c](std::int64_t k) {
      if (k == c.small) return 0.002;
      return k == 0 ? 1.0 : 0.8 * std::exp2(-c.rate * static_cast<double>(k));
    }};
    double truth = 0;
    for (std::int64_t k = 0; k < 200; ++k) truth += sequence.mean(k);
    const Errors e = errors_of(6, truth, 0.02, [&](std::uint64_t seed) {
      const auto r = multilevel(sequence, 0.02, {.seed = seed});
      return std::pair(r.components[0].mean, r.goal_met());
    });
    CHECK(e.root_mean_square < bound(6));
  }
}

TEST_CASE("multilevel refuses coarse partners of another distribution", "[evidence][inputs][goal]") {
  // E I_k - E I_(k-1) = 2^-k; the coarse partner is off by a constant, by the step, or is the fine one.
  const auto with = [](auto coarse) {
    return [coarse](std::int64_t level, Stream& rng) {
      const double h = std::exp2(-static_cast<double>(level));
      const double x = rng.normal();
      return level == 0 ? base(x + h) : coupled(x + h, coarse(x, h), 1 / h);
    };
  };
  const auto off = with([](double x, double h) { return x + 2 * h + 0.5; });
  const auto same = with([](double x, double h) { return x + 10 * h; });
  const auto scaled = with([](double x, double h) { return 3 * x + 2 + 2 * h; });
  CHECK_THROWS_WITH(multilevel(off, 0.01), Catch::Contains("coupling"));
  CHECK_THROWS_WITH(multilevel(same, 0.01), Catch::Contains("coupling"));
  CHECK_THROWS_WITH(multilevel(scaled, 0.01), Catch::Contains("coupling"));
  // Power: right ones end.
  const auto right = with([](double x, double h) { return x + 2 * h; });
  CHECK(std::abs(multilevel(right, 0.02).components[0].mean) < 0.1);
}

// Problems on which an earlier version was wrong, each with siblings: recipe, verdict and goals by one evidence.

#include <cmath>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/multilevel.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>
#include <debias/reciprocal.hpp>
#include <debias/series.hpp>

#include "statistics/tally.hpp"

using namespace debias;
using test::Tally;

namespace {

template <BiasedSequence S>
Tally by_recipe(const S& sequence, double truth, std::int64_t samples, int seeds) {
  return test::by_recipe(sequence, truth, Plan{.samples = samples}, seeds);
}

/// 40 exp(-((x - at) / width)^2 / 2): its integral is 40 width sqrt(2 pi).
struct Needle {
  double at;
  double width;
  double operator()(double x) const {
    const double z = (x - at) / width;
    return 40 * std::exp(-z * z / 2);
  }
  [[nodiscard]] double integral() const { return 40 * width * std::sqrt(2 * 3.141592653589793); }
};

/// r^k cos(a k), deterministic.
auto oscillation(double r, double a) {
  return series(
      [r, a](std::int64_t k) { return std::pow(r, static_cast<double>(k)) * std::cos(a * static_cast<double>(k)); });
}
double oscillation_sum(double r, double a) { return (1 - r * std::cos(a)) / (1 - 2 * r * std::cos(a) + r * r); }

/// (a_1 Z_1 + ... + a_k Z_k)^2 with a_j = rho^j: the square of a chain that forgets its start, seen k steps back.
struct Chain {
  double rho;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    double sum = 0;
    double factor = 1;
    double last = 0;
    for (std::int64_t j = 0; j <= level; ++j) {
      last = factor * rng.normal();
      sum += last;
      factor *= rho;
    }
    const double work = static_cast<double>(level) + 1;
    return level == 0 ? base(sum * sum, work) : coupled(sum * sum, (sum - last) * (sum - last), work);
  }
  [[nodiscard]] double truth() const { return 1 / (1 - rho * rho); }
};

/// Waiting time of a queue with arrivals of that rate and service of rate 1, looking back 4 customers a level.
struct Queue {
  double arrivals;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    double walk = 0;
    double highest = 0;
    double below = 0;
    const std::int64_t steps = 4 * level;
    for (std::int64_t j = 0; j < steps; ++j) {
      const double service = rng.exponential();
      walk += service - rng.exponential() / arrivals;
      highest = std::max(highest, walk);
      if (j < steps - 4) below = highest;
    }
    return level == 0 ? base(0.0, 1.0) : coupled(highest, below, 4.0 * static_cast<double>(level));
  }
  [[nodiscard]] double truth() const { return arrivals / (1 - arrivals); }
};

}  // namespace

TEST_CASE("e^-25 and its siblings: no interval of a starved level is narrow", "[evidence][inputs][statistical]") {
  struct Case {
    double slope;
    std::int64_t samples;
  };
  for (const Case c : {Case{50, 1 << 17}, Case{30, 1 << 16}, Case{70, 1 << 17}}) {
    CAPTURE(c.slope);
    const auto integrand = [slope = c.slope](double x) { return slope * x; };
    const double truth = std::exp(-c.slope / 2);
    const Tally t = by_recipe(function_of_integral(integrand, functions::ExpMinus{}), truth, c.samples, 20);
    CHECK(t.refused == 0);
    CHECK(t.covered >= 18);
    CHECK(t.reliable_and_missed <= 1);
    CHECK(t.infinite == 0);
  }
}

TEST_CASE("a needle and oscillating terms are right or open, and their intervals cover",
          "[evidence][inputs][statistical]") {
  for (const Needle n : {Needle{0.7, 0.01}, Needle{0.37, 0.02}, Needle{0.25, 0.03}}) {
    CAPTURE(n.at, n.width);
    const Tally t = by_recipe(function_of_integral(n, functions::ExpMinus{}), std::exp(-n.integral()), 1 << 15, 10);
    CHECK(t.refused == 0);
    CHECK(t.infinite == 0);
    CHECK(t.covered >= 8);
  }
  for (const double a : {1.0, 2.0, 0.7}) {
    CAPTURE(a);
    const Tally t = by_recipe(oscillation(0.8, a), oscillation_sum(0.8, a), 1 << 15, 10);
    CHECK(t.refused == 0);
    CHECK(t.infinite == 0);
    CHECK(t.covered >= 8);
  }
}

TEST_CASE("slow chains and queues are not refused", "[evidence][inputs][statistical][!mayfail]") {
  // Not met: one seed of rho .98 is refused, two intervals of .9 are reliable and miss.
  for (const double rho : {0.98, 0.95, 0.9}) {
    CAPTURE(rho);
    const Tally t = by_recipe(Chain{rho}, Chain{rho}.truth(), 1 << 16, 10);
    CHECK(t.refused == 0);
    CHECK(t.infinite == 0);
    CHECK(t.covered >= 8);
    CHECK(t.reliable_and_missed <= 1);
  }
  for (const double arrivals : {0.8, 0.7}) {
    CAPTURE(arrivals);
    const Tally t = by_recipe(Queue{arrivals}, Queue{arrivals}.truth(), 1 << 16, 10);
    CHECK(t.refused == 0);
    CHECK(t.infinite == 0);
    CHECK(t.covered >= 8);
  }
}

namespace {

// 1 / p, from numbers that are 1 in a share p of the draws, else 0.
void check_clamped(double p) {
  CAPTURE(p);
  const auto x = [p](Stream& rng) { return rng.uniform() < p ? 1.0 : 0.0; };
  const Tally t = by_recipe(clamped_reciprocal(x), 1 / p, 1 << 15, 20);
  CHECK(t.refused == 0);
  CHECK(t.covered >= 18);
}

}  // namespace

TEST_CASE("a reciprocal with a clamp has a hump and an answer", "[evidence][inputs][statistical]") {
  check_clamped(0.2);
}
TEST_CASE("reciprocals with rarer clamps have a hump and an answer", "[.long][evidence][inputs]") {
  for (const double p : {0.05, 0.1}) check_clamped(p);
}

TEST_CASE("squares of Pareto numbers without a second moment are never a yes that is shown",
          "[evidence][inputs][statistical]") {
  for (const double index : {3.5, 3.0}) {
    CAPTURE(index);
    const auto x = [index](Stream& rng) { return std::pow(rng.uniform(), -1 / index); };
    const double mean = index / (index - 1);
    const Tally t = by_recipe(function_of_mean(x, functions::Square{}), mean * mean, 1 << 13, 8);
    CHECK(t.shown == 0);
    CHECK(t.reliable_and_missed == 0);
  }
}

TEST_CASE("rare differences whose second moment doubles are never finite and reliable",
          "[evidence][inputs][statistical]") {
  // I_h = (1(u < f(s + h)) - 1(u < f(s))) / h: E D_k^2 doubles at every level, P(D_k != 0) halves.
  for (const double power : {3.0, 2.0}) {
    CAPTURE(power);
    const auto rare = [power](std::int64_t level, Stream& rng) -> Draw<double> {
      constexpr double s = 0.6;
      const double u = rng.uniform();
      const double below = u < std::pow(s, power) ? 1 : 0;
      const auto at = [&](double h) { return ((u < std::pow(s + h, power) ? 1 : 0) - below) / h; };
      const double h = std::exp2(-static_cast<double>(level + 1));
      return level == 0 ? base(at(h)) : coupled(at(h), at(2 * h));
    };
    int wrong = 0;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      const RunVerdict v = estimate(single_term(rare, Geometric(0.5)), {.samples = 30'000, .seed = seed}).verdict();
      wrong += v.variance == Finiteness::finite && v.interval_reliable();
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("a level starved of mass widens the interval of a recipe", "[evidence][inputs][statistical]") {
  // The PMF of the run forced to 1e-7 on a level that the pilot saw.
  const auto square = function_of_mean([](Stream& rng) { return rng.exponential(); }, functions::Square{});
  int covered = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Plan plan{.samples = 1 << 14, .seed = seed};
    const Advice advice = advise(level_runs(square), plan);
    const auto starved = single_term(square, AnyPmf(Tabulated({1, 1e-7, 1e-7}, 0.4)));
    Statistics s = estimate(starved, plan);
    s.pilot_levels = advice.survey.evidence.facts;
    s.sequence = advice.facts;
    const Interval i = s.interval();
    covered += i.low <= 1 && 1 <= i.high;
    CHECK_FALSE(s.components[0].standard_error > 0.5 * (i.high - i.low) / 2);
  }
  CHECK(covered == 20);
}

TEST_CASE("a goal is not met by values that have not shown their variance", "[evidence][inputs][goal]") {
  // P(Z > 3.5) to 5 %: from 64 equal samples nothing is met.
  const auto rare = [](Stream& rng) { return rng.normal() > 3.5 ? 1.0 : 0.0; };
  int missed = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto r = estimate(rare, {.samples = 1 << 18, .seed = seed, .goal = {.relative_error = 0.05}});
    CHECK(std::abs(r.mean - 2.3263e-4) < 4.5 * 0.05 * 2.3263e-4);
    missed += !r.goal_met();
  }
  CHECK(missed <= 1);
  // A mean of 0 has no relative error: it ends, and is not met.
  const auto centred = [](Stream& rng) { return rng.normal(); };
  CHECK_FALSE(estimate(centred, {.samples = 1 << 12, .goal = {.relative_error = 0.01}}).goal_met());
  const auto nothing = [](Stream&) { return 0.0; };
  CHECK_FALSE(estimate(nothing, {.samples = 1 << 12, .goal = {.relative_error = 0.05}}).goal_met());
  // And one that nobody can pay for names its cost.
  CHECK_THROWS_WITH(estimate(centred, {.goal = {.error = 1e-8}}), Catch::Contains("seconds"));
}

TEST_CASE("multilevel keeps its goal on a rare payoff and on a slow bias", "[evidence][inputs][statistical]") {
  const auto payoff = [](double m) { return std::max(m - 3, 0.0); };
  const auto rare = [payoff](std::int64_t level, Stream& rng) -> Draw<double> {
    const std::int64_t n = std::int64_t{1} << level;
    const double y = rng.normal();
    double all = 0;
    double first = 0;
    for (std::int64_t i = 0; i < n; ++i) {
      all += y + 0.5 * rng.normal();
      if (i < n / 2) first = all;
    }
    const double fine = payoff(all / static_cast<double>(n));
    if (level == 0) return base(fine, 2.0);
    const double half = static_cast<double>(n) / 2;
    return coupled(fine, (payoff(first / half) + payoff((all - first) / half)) / 2, static_cast<double>(n) + 1);
  };
  double square = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto r = multilevel(rare, 5e-5, {.seed = seed});
    const double e = (r.components[0].mean - 3.8215e-4) / 5e-5;
    square += e * e / 10;
  }
  CHECK(std::sqrt(square) < 1.2);
}

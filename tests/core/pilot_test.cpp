// What a pilot takes counts in the result, and what a goal promises is judged with the stated bias.

#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/derivative.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>

using Catch::Contains;
using namespace debias;

namespace {

// D_k = 2^-k (1/2 + u), work 2^k.
struct Halving {
  Rates rates{2, 1};
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double d = std::exp2(-static_cast<double>(level)) * (rng.uniform() + 0.5);
    return {2 - d, level == 0 ? 2 - d : d, std::exp2(static_cast<double>(level))};
  }
};

// Counts the work of every draw, whoever asks for it.
struct Counted : Halving {
  double* total;
  explicit Counted(double* t) : total(t) {}
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const Draw<double> draw = Halving::operator()(level, rng);
    *total += draw.work;
    return draw;
  }
};

// A bias of a known size beside noise of standard deviation `deviation`.
struct Biased {
  double bias;
  double deviation;
  Sample<double> operator()(Stream& rng) const { return {1 + bias + deviation * rng.normal()}; }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& /*levels*/) const { return {bias, "as built"}; }
};

std::string text_of(const Statistics& s) {
  std::ostringstream text;
  text << s;
  return text.str();
}

}  // namespace

TEST_CASE("the work of a recipe is that of all its draws, the pilot's too", "[core][pilot][exact]") {
  for (const Goal& goal : {Goal{}, Goal{.error = 0.01}, Goal{.relative_error = 0.003}}) {
    double drawn = 0;
    const auto r = estimate(recipe(Counted(&drawn)), {.samples = 1 << 14, .seed = 2, .threads = 1, .goal = goal});
    CAPTURE(goal.error, goal.relative_error, r.work, r.pilot_work);
    CHECK(r.work == Approx(drawn).epsilon(1e-12));
    CHECK(r.pilot_work >= r.advice.pilot_work);
    CHECK(r.pilot_work > 0.03 * r.work);
    CHECK(r.pilot_seconds > 0);
    CHECK(r.seconds > r.pilot_seconds);
    CHECK(r.efficiency() == Approx(1 / (r.components[0].standard_error * r.components[0].standard_error * r.seconds)));
    CHECK(r.work_per_sample() * static_cast<double>(r.samples) == Approx(r.work - r.pilot_work));
    const std::string text = text_of(r);
    CHECK_THAT(text, Contains("of that ") && Contains(" by the pilot"));
  }
  // Nothing to print, and nothing to add, without one.
  const auto plain = estimate(single_term(Halving{}), {.samples = 100});
  CHECK(plain.pilot_work == 0);
  CHECK(text_of(plain).find("pilot") == std::string::npos);
}

TEST_CASE("the pilot of a goal counts, and moves neither mean nor error", "[core][pilot][exact]") {
  double drawn = 0;
  const auto e = single_term(Counted(&drawn));
  const auto goal = estimate(e, {.seed = 5, .threads = 1, .goal = {.error = 0.01}});
  CHECK(goal.work == Approx(drawn).epsilon(1e-12));
  CHECK(goal.pilot_work > 0);
  const auto plain = estimate(e, {.samples = goal.samples, .seed = 5});
  CHECK(goal.mean == plain.mean);
  CHECK(goal.standard_error == plain.standard_error);
  CHECK(goal.work - goal.pilot_work == Approx(plain.work).epsilon(1e-12));
  // A tighter goal has taken both pilots, and a merge those of its parts.
  const auto tighter = extend(e, goal, {.goal = {.error = 0.005}});
  CHECK(tighter.pilot_work > goal.pilot_work);
  CHECK(tighter.pilot_seconds > goal.pilot_seconds);
  const auto first = estimate(e, {.samples = 512, .seed = 5, .pilot = {100, 1}});
  const auto second = estimate(e, {.samples = 512, .seed = 5, .first = 512, .pilot = {30, 2}});
  const auto both = merge(first, second);
  CHECK(both.pilot_work == 130);
  CHECK(both.pilot_seconds == 3);
  CHECK(both.seconds > 3);
}

TEST_CASE("multilevel counts all its draws, and says what the first ones took", "[core][pilot][multilevel][exact]") {
  double drawn = 0;
  const MultilevelStatistics s = multilevel(level_runs(Counted(&drawn)), 0.01, {.seed = 2, .threads = 1});
  CHECK(s.work == Approx(drawn).epsilon(1e-12));
  CHECK(s.pilot_work >= 1000 * (1 + 2 + 4));
  CHECK(s.pilot_work < s.work);
  CHECK(s.pilot_seconds > 0);
  CHECK(s.pilot_seconds <= s.seconds);
  std::ostringstream text;
  text << s;
  CHECK_THAT(text.str(), Contains(" in the pilots"));
}

TEST_CASE("a goal counts the stated bias, and nothing meets it that is not a number", "[core][goal][exact]") {
  // At 1e-6 the standard error alone would do.
  const auto r = estimate(Biased{7.3e-4, 1e-5}, {.seed = 1, .goal = {.error = 1e-6}});
  CHECK(r.total_error() <= 1e-6);
  CHECK_FALSE(r.goal_met());
  CHECK_THAT(text_of(r), Contains("NOT met, 0.00073") && Contains("+ bias 0.00073^2"));
  // And so for a slope: its truncation is above the goal.
  const auto f = [](double x) { return std::sin(x); };
  const auto slope = single_term(finite_difference(f, 1.0, {.first_step = 0.5, .last_level = 3}));
  const auto cut = estimate(slope, {.seed = 1, .goal = {.error = 0.01}});
  CAPTURE(cut.bias_bound.size, cut.total_error());
  CHECK(cut.goal_met() == (std::hypot(cut.bias_bound.size, cut.total_error()) <= 0.01));

  const auto statistics = [](double error, double bias, double mean = 1) {
    Statistics s;
    s.samples = 100;
    s.components = {{mean, 100 * error * error, error}};
    s.bias_bound = {bias, "as built"};
    return s;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  const auto met = [](Statistics s, const Goal& goal) {
    s.goal = goal;
    return s.goal_met();
  };
  CHECK(met(statistics(0.3, 0.4), {.error = 0.5001}));
  CHECK_FALSE(met(statistics(0.3, 0.4), {.error = 0.4999}));
  CHECK(met(statistics(0.3, 0.4, -2), {.relative_error = 0.2501}));
  CHECK_FALSE(met(statistics(0.3, 0.4, -2), {.relative_error = 0.2499}));
  CHECK_FALSE(met(statistics(0.3, 0, 0), {.relative_error = 0.5}));
  for (const double x : {nan, infinite}) {
    CHECK_FALSE(met(statistics(x, 0), {.error = 1}));
    CHECK_FALSE(met(statistics(0.1, x), {.error = 1}));
    CHECK_FALSE(met(statistics(0.1, x), {.relative_error = 1}));
  }
  CHECK_FALSE(met(statistics(0.1, 0, nan), {.relative_error = 1}));
  Statistics lost = statistics(nan, 0, nan);
  lost.nonfinite = 1;
  CHECK_FALSE(met(lost, {.seconds = 10}));
  CHECK(met(statistics(0.1, 0), {.seconds = 10}));
  CHECK(statistics(0.1, 0).goal_met());  // none was asked for
}

TEST_CASE("samples for a goal leave room for a bias that has a part of it", "[core][goal][statistical]") {
  for (const double bias : {0.005, 0.008}) {
    const auto r = estimate(Biased{bias, 1}, {.seed = 4, .goal = {.error = 0.01}});
    CAPTURE(bias, r.samples, r.total_error());
    CHECK(r.goal_met());
    CHECK(r.goal_error() > 0.0093);
  }
  // A bias above the goal takes no more samples than the goal alone would.
  const auto hopeless = estimate(Biased{0.02, 1}, {.seed = 4, .goal = {.error = 0.01}});
  CHECK_FALSE(hopeless.goal_met());
  CHECK(hopeless.samples < 20'000);
}

TEST_CASE("multilevel meets its goal with bias and noise together, or says that it does not",
          "[core][goal][multilevel][exact]") {
  for (const double error : {0.1, 0.03, 0.01}) {
    const MultilevelStatistics s = multilevel(Halving{}, error, {.seed = 7});
    CAPTURE(error, s.bias, s.error());
    CHECK(s.converged);
    CHECK(s.goal_met());
    CHECK(s.error() <= error);
  }
  const auto lost = [](std::int64_t level, Stream& rng) {
    const double x = rng.uniform() < 0.01 ? std::numeric_limits<double>::quiet_NaN() : rng.uniform();
    return level == 0 ? base(x) : coupled(x, x / 2);
  };
  CHECK_THROWS_WITH(multilevel(lost, 0.1), Contains("level 0") && Contains("not finite"));
  MultilevelStatistics s;
  s.goal = 1;
  s.converged = true;
  s.components = {{1, 0, std::numeric_limits<double>::quiet_NaN()}};
  CHECK_FALSE(s.goal_met());
}

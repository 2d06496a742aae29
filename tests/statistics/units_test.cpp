// The unit of the values has no part in what is said of them: tiny and huge ones, whose squares of squares are no numbers.

#include <cmath>
#include <cstdint>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/verdict.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/multilevel.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>
#include <debias/survey.hpp>

using namespace debias;

namespace {

constexpr double units[] = {0x1p-300, 0x1p-200, 0x1p200, 0x1p300};

/// Differences of size 2^-k that are rarer at deeper levels, times the unit.
struct Rare {
  double unit = 1;
  double rarity = 0.3;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double low = unit * rng.normal();
    if (level == 0) return base(low);
    const bool differs = rng.uniform() < rarity * std::exp2(-0.3 * static_cast<double>(level));
    const double difference = differs ? unit * std::exp2(-static_cast<double>(level)) * (1 + rng.uniform()) : 0;
    return coupled(low + difference, low, std::exp2(static_cast<double>(level)));
  }
};

void same_words(const RunVerdict& a, const RunVerdict& b) {
  CHECK(a.variance == b.variance);
  CHECK(a.grade == b.grade);
  CHECK(a.kurtosis == Approx(b.kurtosis).epsilon(1e-9));
  CHECK(a.degrees == Approx(b.degrees).epsilon(1e-6));
  CHECK(a.unseen_share == Approx(b.unseen_share).epsilon(1e-6).margin(1e-12));
  CHECK(a.interval_reliable() == b.interval_reliable());
}

}  // namespace

TEST_CASE("a run in any unit has the same verdict and interval", "[verdict][evidence][exact]") {
  const Plan plan{.samples = 20000, .seed = 5};
  const auto run = [&](double unit, double r) { return estimate(single_term(Rare{unit}, Geometric(r)), plan); };
  for (const double r : {0.5, 0.9}) {  // the second one hardly draws level 3: that widens the interval
    const Statistics one = run(1, r);
    const Interval expected = one.interval(one.verdict());
    CHECK((one.verdict().unseen_share > 0.01) == (r == 0.9));
    for (const double unit : units) {
      CAPTURE(r, unit);
      const Statistics s = run(unit, r);
      const Interval interval = s.interval(s.verdict());
      same_words(s.verdict(), one.verdict());
      CHECK(interval.low / unit == Approx(expected.low).epsilon(1e-9));
      CHECK(interval.high / unit == Approx(expected.high).epsilon(1e-9));
    }
  }
}

TEST_CASE("a run in blocks in any unit has the same verdict and interval", "[verdict][evidence][exact]") {
  const Plan plan{.samples = 16384, .seed = 6};
  const auto run = [&](double unit) { return estimate(stratified(single_term(Rare{unit}, Geometric(0.8)), 64), plan); };
  const Statistics one = run(1);
  const Interval expected = one.interval(one.verdict());
  for (const double unit : units) {
    CAPTURE(unit);
    const Statistics s = run(unit);
    same_words(s.verdict(), one.verdict());
    CHECK(s.interval(s.verdict()).high / unit == Approx(expected.high).epsilon(1e-9));
  }
}

TEST_CASE("a recipe in any unit has the same answer, and an interval as wide", "[recipe][evidence][exact]") {
  for (const double rarity : {1.0, 0.02}) {
    const Plan plan{.samples = 16384, .seed = 7};
    const auto one = estimate(recipe(Rare{1, rarity}), plan);
    const Interval expected = one.interval(one.verdict());
    for (const double unit : units) {
      CAPTURE(rarity, unit);
      const auto s = estimate(recipe(Rare{unit, rarity}), plan);
      CHECK(s.advice.survey.pmf_exists == one.advice.survey.pmf_exists);
      CHECK(s.advice.survey.grade == one.advice.survey.grade);
      CHECK(s.advice.base_level == one.advice.base_level);
      const Interval interval = s.interval(s.verdict());
      // Masses have three digits, whose rounding may fall either way.
      CHECK((interval.high - interval.low) / unit == Approx(expected.high - expected.low).epsilon(0.05));
    }
  }
}

TEST_CASE("a goal in any unit asks for as many samples", "[goal][exact]") {
  const auto run = [&](double unit) {
    return estimate(single_term(Rare{unit}, Geometric(0.6)), {.seed = 8, .goal = {.error = 0.02 * unit}});
  };
  const Statistics one = run(1);
  for (const double unit : units) {
    CAPTURE(unit);
    CHECK(run(unit).samples == one.samples);
  }
}

TEST_CASE("survey and multilevel in any unit find the same rates and take the same draws",
          "[survey][multilevel][exact]") {
  const Survey one = survey(Rare{}, 10, {.samples = 4096, .seed = 9});
  const MultilevelStatistics all = multilevel(Rare{}, 0.02, {.seed = 9});
  for (const double unit : units) {
    CAPTURE(unit);
    const Survey s = survey(Rare{unit}, 10, {.samples = 4096, .seed = 9});
    CHECK(s.pmf_exists == one.pmf_exists);
    CHECK(s.grade == one.grade);
    CHECK(s.rates.variance_decay.value == Approx(one.rates.variance_decay.value).epsilon(1e-9));
    CHECK(s.rates.fourth_decay.value == Approx(one.rates.fourth_decay.value).epsilon(1e-9));
    CHECK(s.rates.mean_decay.value == Approx(one.rates.mean_decay.value).epsilon(1e-9));
    const MultilevelStatistics m = multilevel(Rare{unit}, 0.02 * unit, {.seed = 9});
    CHECK(m.work == Approx(all.work));
    CHECK(m.error() / unit == Approx(all.error()).epsilon(1e-6));
  }
}

TEST_CASE("a coupling is not called wrong where squares vanish or overflow", "[survey][evidence][exact]") {
  for (const double unit : {1e-145, 1e-150, 1e-155, 1e-160, 1e-165, 1e-170, 1e-200, 1e-250, 1e150, 1e160, 1e200}) {
    CAPTURE(unit);
    const auto levels = [unit](std::int64_t level, Stream& rng) {
      const double x = unit * (1 + rng.normal());
      const auto of = [](std::int64_t k) { return 2 - std::exp2(static_cast<double>(-k)); };
      return level == 0 ? base(x) : coupled(x * of(level), x * of(level - 1));
    };
    for (const Warning& w : survey(levels, 6, {.samples = 1 << 12}).remarks) {
      CAPTURE(w.text);
      CHECK(w.code != WarningCode::coupling);
    }
  }
}

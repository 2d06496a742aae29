// Every run checks its coupling: wrong ones are found by every estimator, right ones never alarm, whatever their tails.

#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>

#include <Eigen/Core>

#include "catch_shim.hpp"
#include "core/run_state_bytes.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/progressive.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/multilevel.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>
#include <debias/reciprocal.hpp>
#include <debias/survey.hpp>

using namespace debias;
using Catch::Contains;

namespace {

using State = Coupling::State;

/// README's (E X)^2 of an exponential, and what is wrong with it.
enum class Slip { none, exchanged, other_pmf, always_base, from_level_one, value_of_below, coarse_halved_late };

struct Squared {
  Slip slip = Slip::none;

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    if (slip == Slip::from_level_one) level = level > 1 ? level - 1 : 0;
    if (level == 0) {
      const double x = rng.exponential();
      return base(x * x);
    }
    const std::int64_t half = std::int64_t{1} << (level - 1);
    double a = 0;
    double b = 0;
    for (std::int64_t i = 0; i < half; ++i) {
      a += rng.exponential() / static_cast<double>(half);
      b += rng.exponential() / static_cast<double>(half);
    }
    const double mean = (a + b) / 2;
    const double fine = mean * mean;
    const double coarse = (a * a + b * b) / 2;
    const double work = 2.0 * static_cast<double>(half);
    switch (slip) {
      case Slip::exchanged:
        return coupled(coarse, fine, work);
      case Slip::other_pmf:  // of halves that are a third too long
        return coupled(fine, coarse / 1.2, work);
      case Slip::always_base:
        return base(fine, work);
      case Slip::value_of_below:
        return {coarse, fine - coarse, work};
      case Slip::coarse_halved_late:
        return coupled(fine, level == 2 ? coarse * 0.8 : coarse, work);
      default:
        return coupled(fine, coarse, work);
    }
  }
};

const Plan ten_thousand{.samples = 10'000, .seed = 1, .threads = 1};

Plan of_seed(std::uint64_t seed, std::int64_t samples = 10'000) {
  return {.samples = samples, .seed = seed, .threads = 1};
}

/// A number as some type of value.
template <class V>
V as(double x) {
  if constexpr (RealValue<V>) {
    return static_cast<V>(x);
  } else if constexpr (ComplexValue<V>) {
    return {1, static_cast<typename V::value_type>(x)};
  } else {
    V v = V::Zero(5);
    v[3] = x;
    v[1] = 2;
    return v;
  }
}

template <class V>
struct Of {
  Squared numbers;
  Draw<V> operator()(std::int64_t level, Stream& rng) const {
    const Draw<double> d = numbers(level, rng);
    if (level == 0) return base(as<V>(d.value));
    return coupled(as<V>(d.value), as<V>(d.value - d.difference), d.work);
  }
};

}  // namespace

TEST_CASE("a wrong coupling marks the mean, the verdict and the goal, by an estimator and by a recipe",
          "[core][coupling][exact]") {
  const auto marked = [](const auto& run) {
    std::ostringstream brief;
    brief << run;
    CHECK_THAT(brief.str(), Contains("(BIASED, see warning)") && Contains("the mean is BIASED") &&
                                Contains("NOT met, the mean is biased") && !Contains(": met"));
    CHECK(run.has_wrong_mean());
    CHECK_FALSE(run.goal_met());
    CHECK_FALSE(run.verdict().interval_reliable());
  };
  const Squared wrong{Slip::exchanged};
  marked(estimate(single_term(wrong, Geometric(0.65)), {.seed = 3, .goal = {.error = 0.01}}));
  marked(estimate(recipe(wrong), {.seed = 3, .goal = {.error = 0.01}}));
  const auto right = estimate(single_term(Squared{}, Geometric(0.65)), {.seed = 3, .goal = {.error = 0.01}});
  CHECK_FALSE(right.has_wrong_mean());
  CHECK(right.goal_met());
}

TEST_CASE("the exchange of fine and coarse is found at 10,000 samples, by every form of estimator",
          "[core][coupling][statistical]") {
  const Squared right;
  const Squared wrong{Slip::exchanged};
  const auto judge = [](const auto& make, const Squared& s, const Plan& plan) { return estimate(make(s), plan); };
  const auto tried = [&](const char* name, const auto& make) {
    CAPTURE(name);
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const auto result = judge(make, wrong, of_seed(seed));
      CHECK(result.coupling.state == State::wrong);
      REQUIRE(!result.warnings.empty());
      CHECK(result.warnings.front().code == WarningCode::coupling);
      CHECK_THAT(result.warnings.front().text, Contains("wrong coupling") && Contains("fine and coarse exchanged"));
      const auto good = judge(make, right, of_seed(seed));
      CHECK(good.coupling.state == State::right);
      CHECK_FALSE(warning_of(good.coupling));
    }
  };
  tried("single_term 0.65", [](const Squared& s) { return single_term(s, Geometric(0.65)); });
  tried("single_term 0.5", [](const Squared& s) { return single_term(s, Geometric(0.5)); });
  tried("single_term 0.75", [](const Squared& s) { return single_term(s, Geometric(0.75)); });
  tried("base one outcome",
        [](const Squared& s) { return single_term(s, Geometric(0.6), {.base = Base::one_outcome}); });
  tried("base 1", [](const Squared& s) { return single_term(s, Geometric(0.6), {.base_level = 1}); });
  tried("independent_sum", [](const Squared& s) { return independent_sum(s, Geometric(0.6)); });
  tried("progressive", [](const Squared& s) { return progressive(s, Geometric(0.6)); });
  tried("stratified", [](const Squared& s) { return stratified(single_term(s, Geometric(0.6)), 8); });
  tried("named", [](const Squared& s) { return named("mine", single_term(s, Geometric(0.6))); });
  // A recipe starts deep, where fine and coarse are nearly equal; its pilot sees the lower levels.
  const auto by_recipe = estimate(recipe(wrong), ten_thousand);
  REQUIRE(!by_recipe.warnings.empty());
  CHECK(by_recipe.warnings.back().code == WarningCode::coupling);
  CHECK_THAT(by_recipe.warnings.back().text, Contains("every estimate from it is biased"));
  CHECK(estimate(recipe(wrong, {.base_level = 0}), of_seed(1, 100'000)).coupling.state == State::wrong);
  const auto right_recipe = estimate(recipe(right), ten_thousand);
  CHECK(right_recipe.coupling.state == State::right);
}

TEST_CASE(
    "a coarse partner of another law, base() at every level, levels from 1, and values of the level below are found",
    "[core][coupling][statistical]") {
  for (const Slip slip :
       {Slip::other_pmf, Slip::always_base, Slip::from_level_one, Slip::value_of_below, Slip::coarse_halved_late}) {
    CAPTURE(static_cast<int>(slip));
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      CHECK(estimate(single_term(Squared{slip}, Geometric(0.6)), of_seed(seed, 200'000)).coupling.state ==
            State::wrong);
      CHECK(estimate(independent_sum(Squared{slip}, Geometric(0.6)), of_seed(seed, 200'000)).coupling.state ==
            State::wrong);
    }
  }
}

TEST_CASE("values with several components are checked too, in whichever component the slip is",
          "[core][coupling][statistical]") {
  const auto state = [](const auto& s) {
    return estimate(single_term(s, Geometric(0.6)), ten_thousand).coupling.state;
  };
  const Squared wrong{Slip::exchanged};
  CHECK(state(Of<float>{wrong}) == State::wrong);
  CHECK(state(Of<std::complex<double>>{wrong}) == State::wrong);
  CHECK(state(Of<Eigen::ArrayXd>{wrong}) == State::wrong);
  CHECK(state(Of<float>{}) == State::right);
  CHECK(state(Of<std::complex<double>>{}) == State::right);
  CHECK(state(Of<Eigen::ArrayXd>{}) == State::right);
}

TEST_CASE("heavy tails, rare events, offsets, tiny and noiseless numbers raise no alarm",
          "[core][coupling][statistical]") {
  // I_k is the mean of 2^k draws of X; the coarse partner that of one half, so that no difference is zero.
  const auto mean_of = [](auto x) {
    return [x](std::int64_t level, Stream& rng) {
      if (level == 0) return base(x(rng));
      const auto half = std::int64_t{1} << (level - 1);
      double a = 0;
      double b = 0;
      for (std::int64_t i = 0; i < half; ++i) {
        a += x(rng);
        b += x(rng);
      }
      return coupled((a + b) / (2 * static_cast<double>(half)), a / static_cast<double>(half));
    };
  };
  const auto quiet = [](const char* what, const auto& sequence) {
    CAPTURE(what);
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      for (const double r : {0.5, 0.9}) {
        const Coupling c = estimate(single_term(sequence, Geometric(r)), of_seed(seed, 4000)).coupling;
        CAPTURE(c.level, c.z, c.threshold);
        CHECK(c.state != State::wrong);
        CHECK(c.state != State::no_values);
      }
      CHECK(estimate(independent_sum(sequence, Geometric(0.5)), of_seed(seed, 4000)).coupling.state != State::wrong);
    }
  };
  for (const double alpha : {1.05, 1.2, 1.5, 2.0, 3.0}) {
    quiet("Pareto", mean_of([alpha](Stream& rng) { return std::pow(rng.uniform(), -1 / alpha); }));
  }
  quiet("Cauchy", mean_of([](Stream& rng) { return std::tan(std::numbers::pi * (rng.uniform() - 0.5)); }));
  for (const double p : {0.1, 0.01, 1e-3}) {
    quiet("rare", mean_of([p](Stream& rng) { return rng.uniform() < p ? 1 / p : 0.0; }));
  }
  quiet("lognormal", mean_of([](Stream& rng) { return std::exp(3 * rng.normal()); }));
  quiet("offset", mean_of([](Stream& rng) { return 1e9 + rng.normal(); }));
  quiet("tiny", mean_of([](Stream& rng) { return 1e-170 * rng.normal(); }));
  quiet("huge", mean_of([](Stream& rng) { return 1e200 * rng.normal(); }));
  quiet("one third", mean_of([](Stream&) { return 1.0 / 3; }));
  quiet("Newton", [](std::int64_t level, Stream&) {
    double x = 2;
    double before = 0;
    for (std::int64_t k = 0; k < level; ++k) {
      before = x;
      x = (x + 2 / x) / 2;
    }
    return level == 0 ? base(x) : coupled(x, before);
  });
}

TEST_CASE("few alarms: right couplings of 400 seeds stay far below the threshold", "[core][coupling][statistical]") {
  double worst = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    const Coupling c = estimate(single_term(Squared{}, Geometric(0.6)), of_seed(seed, 2000)).coupling;
    CHECK(c.state == State::right);
    worst = std::max(worst, c.z / c.threshold);
  }
  CHECK(worst > 0.3);  // and the check compares something
  CHECK(worst < 0.9);
}

TEST_CASE("a result whose differences come without values says that its coupling was not checked",
          "[core][coupling][exact]") {
  const auto x = [](Stream& rng) { return 1 + rng.uniform(); };
  const auto result = estimate(single_term(reciprocal(x)), of_seed(1, 1000));
  CHECK(result.coupling.state == State::no_values);
  std::ostringstream text;
  text << full(result);
  CHECK_THAT(text.str(), Contains("coupling      not checked (differences come without"));
  CHECK(estimate(x, of_seed(1, 1000)).coupling.state == State::no_levels);
  CHECK(text_of(estimate(x, of_seed(1, 1000)).coupling).empty());
  CHECK(estimate(truncated(Squared{}, 3), of_seed(1, 1000)).coupling.state == State::no_levels);
  CHECK(estimate(single_term(Squared{}, Geometric(0.5)), of_seed(1, 4)).coupling.state == State::too_few);
  text.str("");
  text << full(estimate(single_term(Squared{Slip::exchanged}, Geometric(0.5)), ten_thousand));
  CHECK_THAT(text.str(), Contains("WRONG at level"));
}

TEST_CASE("a draw of level 0 whose difference is not its value is refused, with both", "[core][coupling][exact]") {
  const auto at_zero = [](double value, double difference) {
    return [=](std::int64_t level, Stream& rng) {
      return level == 0 ? Draw<double>{value, difference} : Draw<double>{1, rng.uniform()};
    };
  };
  const auto wrong = at_zero(2, 1);
  const auto refuses = [](const auto& act) { CHECK_THROWS_WITH(act(), Contains("level 0: value 2 and difference 1")); };
  refuses([&] { estimate(single_term(wrong, Geometric(0.5)), ten_thousand); });
  refuses([&] { estimate(single_term(wrong, Geometric(0.5), {.base = Base::one_outcome}), ten_thousand); });
  refuses([&] { estimate(independent_sum(wrong, Geometric(0.5)), ten_thousand); });
  refuses([&] { estimate(truncated(wrong, 0), ten_thousand); });
  refuses([&] { estimate(recipe(wrong), ten_thousand); });
  refuses([&] { survey(wrong, 4); });
  refuses([&] { multilevel(wrong, 0.1); });
  refuses([&] { trace(single_term(wrong, Geometric(0.5)), 1, 0); });
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_NOTHROW(estimate(single_term(at_zero(nan, nan), Geometric(0.5)), ten_thousand));  // and its mean says so
  CHECK_THROWS(estimate(single_term(at_zero(nan, 1), Geometric(0.5)), ten_thousand));
  // one component of many
  const auto array = [](std::int64_t, Stream&) {
    Draw<Eigen::ArrayXd> d{Eigen::ArrayXd::Ones(3), Eigen::ArrayXd::Ones(3), 1};
    d.difference[2] = 0.5;
    return d;
  };
  CHECK_THROWS_WITH(estimate(single_term(array, Geometric(0.5)), ten_thousand), Contains("value 1 and difference 0.5"));
}

TEST_CASE("work that is negative or not finite is refused at every door, with its level", "[core][coupling][exact]") {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double work : {-1.0, -1e23, infinity, -infinity, std::numeric_limits<double>::quiet_NaN()}) {
    CAPTURE(work);
    const auto wrong = [work](std::int64_t level, Stream& rng) {
      const double x = rng.uniform();
      return level == 0 ? base(x) : coupled(x, rng.uniform(), level == 1 ? work : 1.0);
    };
    const auto refuses = [](const auto& act) { CHECK_THROWS_WITH(act(), Contains("work = ") && Contains("level 1 ")); };
    refuses([&] { estimate(single_term(wrong, Geometric(0.5)), ten_thousand); });
    refuses([&] { estimate(single_term(wrong, Geometric(0.5), {.base = Base::one_outcome}), ten_thousand); });
    refuses([&] { estimate(stratified(single_term(wrong, Geometric(0.5)), 8), ten_thousand); });
    refuses([&] { estimate(independent_sum(wrong, Geometric(0.5)), ten_thousand); });
    refuses([&] { estimate(truncated(wrong, 1), ten_thousand); });
    refuses([&] { estimate(progressive(wrong, Geometric(0.5)), ten_thousand); });
    refuses([&] { estimate(biased_progressive(wrong, {.base_level = 1}), ten_thousand); });
    refuses([&] { estimate(recipe(wrong), ten_thousand); });
    refuses([&] { survey(wrong, 4); });
    refuses([&] { multilevel(wrong, 0.1); });
    refuses([&] { trace(truncated(wrong, 1), 1, 0); });
    const auto terms = [work](Stream&) {
      return [k = 0, work]() mutable { return Term<double>{std::ldexp(1.0, -k), k++ == 1 ? work : 1.0}; };
    };
    refuses([&] { estimate(roulette(terms, Geometric(0.5)), ten_thousand); });
    refuses([&] { estimate(roulette(terms, Geometric(0.5), {.base_level = 2}), ten_thousand); });
    refuses([&] { estimate(single_term(levels_of(terms), Geometric(0.5)), ten_thousand); });
    const auto sampler = [work](Stream& rng) { return Sample<double>{rng.uniform(), work, 1}; };
    refuses([&] { estimate(sampler, ten_thousand); });
    refuses([&] { trace(sampler, 1, 0); });
  }
  const auto free = [](Stream& rng) { return Sample<double>{rng.uniform(), -0.0, 1}; };
  CHECK_NOTHROW(estimate(free, ten_thousand));  // costs nothing
}

TEST_CASE("zero differences of draws that vary at every level are a warning, of averages and constants they are none",
          "[core][coupling][statistical]") {
  const auto averages = [](int draws_that_differ) {
    return [draws_that_differ](std::int64_t level, Stream& rng) {
      const auto n = std::int64_t{1} << level;
      double a = 0;
      double b = 0;
      const double first = draws_that_differ == 0 ? 0.25 : rng.uniform();
      for (std::int64_t i = 0; i < n; ++i) {
        const double x = draws_that_differ < 2 ? first : std::floor(1024 * rng.uniform());  // sums are exact
        (2 * i < n ? a : b) += x;
      }
      const double mean = (a + b) / static_cast<double>(n);
      return level == 0 ? base(mean)
                        : coupled(mean, (2 * a / static_cast<double>(n) + 2 * b / static_cast<double>(n)) / 2);
    };
  };
  const auto warnings = [](const auto& e) {
    std::string all;
    for (const Warning& w : estimate(e, of_seed(1, 2000)).warnings) all += w.text;
    return all;
  };
  const auto everywhere = [&](const auto& s, const auto& matcher) {
    CHECK_THAT(warnings(single_term(s, Geometric(0.6))), matcher);
    CHECK_THAT(warnings(single_term(s, Geometric(0.6), {.base = Base::one_outcome})), matcher);
    CHECK_THAT(warnings(independent_sum(s, Geometric(0.6))), matcher);
  };
  everywhere(averages(1), Contains("all differences are exactly zero"));   // one draw stands for all
  everywhere(averages(2), !Contains("all differences are exactly zero"));  // a mean needs no levels
  everywhere(averages(0), !Contains("all differences are exactly zero"));  // nothing is drawn
  everywhere(Squared{}, !Contains("all differences are exactly zero"));
}

TEST_CASE("the sums of the coupling are the same bits however a run is cut, spread, saved and merged",
          "[core][coupling][exact]") {
  const auto e = single_term(Squared{}, Geometric(0.6));
  const auto run = [&e](std::int64_t first, std::int64_t samples, int threads = 1) {
    return estimate(e, {.samples = samples, .seed = 5, .first = first, .threads = threads});
  };
  const auto bytes = [](const Statistics& s) {
    RunState state = s.state;
    state.seconds = 0;
    return encode(std::move(state));
  };
  const auto whole = run(0, 10'000);
  CHECK(whole.coupling.state == State::right);
  CHECK(bytes(run(0, 10'000, 3)) == bytes(whole));
  const auto merged = merge(run(4096, 5904), run(0, 4096));
  CHECK(bytes(merged) == bytes(whole));
  CHECK(merged.coupling.z == whole.coupling.z);
  CHECK(merged.coupling.threshold == whole.coupling.threshold);
  const auto longer = extend(e, run(0, 7000), {.samples = 10'000});
  CHECK(bytes(longer) == bytes(whole));
  CHECK(longer.coupling.z == whole.coupling.z);
  const RunState read = decode(encode(run(0, 4096).state));
  Plan rest = of_seed(5);
  rest.earlier = std::make_shared<RunState>(read);
  const auto resumed = estimate(e, rest);
  CHECK(bytes(resumed) == bytes(whole));
  // and the moments are those of the draws
  const Accumulator sums = whole.state.total();
  const CouplingRow& one = sums.coupling.rows(0)[1];
  CHECK(one.coarse.count == sums.levels.rows()[1].count);
  CHECK(one.difference.count == 0);  // a number, which the level table has
  CHECK(one.value.count == one.coarse.count);
  CHECK(sums.coupling.rows(0)[0].value.mean == Approx(sums.levels.base().difference / 10'000));
  CHECK(one.value.m2 / static_cast<double>(one.value.count) == Approx(5.25).epsilon(0.2));
}

TEST_CASE("results of different estimators refuse to merge, to be extended and to be resumed",
          "[core][estimate][exact]") {
  const auto refuses = [](const auto& a, const auto& b, const std::string& why) {
    const auto first = estimate(a, {.samples = 1024, .seed = 3});
    const auto second = estimate(b, {.samples = 1024, .seed = 3, .first = 1024});
    CHECK_THROWS_WITH(merge(first, second), Contains("different estimators") && Contains(why));
    CHECK_THROWS_WITH(merge(second, first), Contains("different estimators") && Contains(why));
    CHECK_THROWS_WITH(extend(b, first, {.samples = 2048}), Contains("different estimators") && Contains(why));
    Plan plan{.samples = 2048, .seed = 3};
    plan.earlier = std::make_shared<RunState>(first.state);
    CHECK_THROWS_WITH(estimate(b, plan), Contains("different estimators") && Contains(why));
  };
  const auto x = [](Stream& rng) { return 1 + rng.uniform(); };
  const auto y = [](Stream& rng) { return 100 + rng.uniform(); };
  refuses(x, y, "two types");
  refuses(single_term(reciprocal(x)), single_term(reciprocal(y)), "two types");
  refuses(single_term(Squared{}, Geometric(0.6)), single_term(Of<double>{}, Geometric(0.6)), "two types");
  refuses(single_term(Squared{}, Geometric(0.6)), single_term(Squared{}, Geometric(0.7)), "geometric:r=0.7");
  refuses(single_term(Squared{}, Geometric(0.6)), independent_sum(Squared{}, Geometric(0.6)), "independent_sum");
  refuses(stratified(single_term(Squared{}, Geometric(0.6)), 8),
          stratified(single_term(Of<double>{}, Geometric(0.6)), 8), "two types");
  // One type over other data: a name tells them apart.
  const auto around = [](double m) { return [m](Stream& rng) { return m + rng.uniform(); }; };
  refuses(named("three", around(3)), named("four", around(4)), "'three'");
  refuses(named("three", around(3)), around(3), "no name");
  const auto file_of = [](const auto& result) { return decode(encode(result.state)); };
  const auto three = estimate(named("three", around(3)), {.samples = 1024, .seed = 3});
  CHECK(file_of(three).identity.name == "three");
  CHECK(file_of(three).identity.type == nullptr);
  Plan plan{.samples = 2048, .seed = 3};
  plan.earlier = std::make_shared<RunState>(file_of(three));
  CHECK_THROWS_WITH(estimate(named("four", around(4)), plan), Contains("'four' and 'three'"));
  CHECK_NOTHROW(estimate(named("three", around(3)), plan));
  CHECK_NOTHROW(merge(three, estimate(named("three", around(3)), {.samples = 1024, .seed = 3, .first = 1024})));
}

namespace {
double one_or_two(Stream& rng) { return 1 + rng.uniform(); }
}  // namespace

TEST_CASE("a named estimator is the same estimator, with all that it offers", "[core][estimate][exact]") {
  const auto x = [](Stream& rng) { return 1 + rng.uniform(); };
  const auto plain = single_term(reciprocal(x));
  const auto mine = named("gas, mu = 3", plain);
  CHECK(mine.name() == "gas, mu = 3");
  static_assert(StratifiableEstimator<std::remove_cvref_t<decltype(mine)>>);
  static_assert(KnowsProbabilities<std::remove_cvref_t<decltype(mine)>>);
  const auto a = estimate(plain, ten_thousand);
  const auto b = estimate(mine, ten_thousand);
  CHECK(a.mean == b.mean);
  CHECK(a.levels.back().probability == b.levels.back().probability);
  CHECK(a.bias_bound.size == b.bias_bound.size);
  CHECK(b.name == "gas, mu = 3");
  CHECK(b.estimator == a.estimator);
  std::ostringstream text;
  text << full(b);
  CHECK_THAT(text.str(), Contains("name          gas, mu = 3\n"));
  const auto block = estimate(stratified(plain, 64), ten_thousand);
  const auto named_block = estimate(stratified(mine, 64), ten_thousand);
  CHECK(block.mean == named_block.mean);  // batches too
  CHECK(block.standard_error == named_block.standard_error);
  CHECK(named_block.name == "gas, mu = 3");
  const auto outside = named("outside", stratified(plain, 64));
  static_assert(StatesChunk<std::remove_cvref_t<decltype(outside)>>);
  CHECK(estimate(outside, ten_thousand).mean == block.mean);
  CHECK(estimate(named("f", &one_or_two), ten_thousand).mean == estimate(&one_or_two, ten_thousand).mean);
  CHECK(trace(mine, 1, 7).sample.value == trace(plain, 1, 7).sample.value);
  CHECK_THROWS_WITH(named("", plain), Contains("an empty name"));
}

TEST_CASE("sides of a coupling merge to the moments of all their values", "[core][coupling][exact]") {
  CouplingSide a;
  a.count = 3;
  a.mean = 1;
  a.m2 = 2;
  CouplingSide b;
  b.count = 5;
  b.mean = 5;
  b.m2 = 7;
  a.merge(b);
  CHECK(a.count == 8);
  CHECK(a.mean == 3.5);
  CHECK(a.m2 == 2 + 7 + 16 * 15.0 / 8);
}

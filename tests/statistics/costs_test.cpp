// What a pilot may cost: work that is not stated, limits of time, interrupts, and goals that nobody can pay.

#include <chrono>
#include <cmath>
#include <ctime>
#include <string>

#include "catch_shim.hpp"

#include <debias/recipe.hpp>
#include <debias/survey.hpp>

using namespace debias;

namespace {

/// README's sequence, power = 2, with or without its third argument.
struct MeanTo {
  double power;
  bool states_work;

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const auto f = [this](double m) { return std::pow(m, power); };
    if (level == 0) return base(f(rng.exponential()));
    const std::int64_t half = std::int64_t{1} << (level - 1);
    double a = 0;
    double b = 0;
    for (std::int64_t i = 0; i < half; ++i) {
      a += rng.exponential() / static_cast<double>(half);
      b += rng.exponential() / static_cast<double>(half);
    }
    const double fine = f((a + b) / 2);
    const double coarse = (f(a) + f(b)) / 2;
    return states_work ? coupled(fine, coarse, 2.0 * static_cast<double>(half)) : coupled(fine, coarse);
  }
};

/// A path of 3^k steps that states one unit, as if a file were read.
struct Tripling {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double h = std::exp2(-static_cast<double>(level));
    double sum = 0;
    for (double i = 0; i < std::pow(3.0, static_cast<double>(level)); ++i) sum += rng.uniform();
    const double x = rng.normal() + 0 * sum;
    return level == 0 ? base(x) : coupled(x + h, x + 2 * h);
  }
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

TEST_CASE("a sequence that does not state its work is told to, early", "[evidence][inputs][pilot]") {
  const std::clock_t start = std::clock();  // of the processor: other work of the machine does not count
  const auto said = [](const auto& sequence, const Plan& plan) {
    std::string all;
    try {
      for (const Warning& remark : advise(level_runs(sequence), plan).survey.remarks) all += remark.text + ". ";
    } catch (const std::invalid_argument& e) {
      all = e.what();
    }
    return all;
  };
  CHECK_THAT(said(MeanTo{2, false}, {.samples = 1 << 17, .seed = 3}), Catch::Contains("state the work"));
  CHECK_THAT(said(MeanTo{3, false}, {.samples = 1 << 20, .seed = 1}), Catch::Contains("state the work"));
  CHECK_THAT(said(Tripling{}, {.samples = 1 << 15, .seed = 1}), Catch::Contains("state the work"));
  // Deep levels that nobody can pay for: before they are drawn.
  const LevelRuns flat = level_runs(MeanTo{2, false});
  const Plan plan{.samples = 1 << 22};
  CHECK_THROWS_WITH(advise(flat, plan, {.lowest_base = 14}), Catch::Contains("state the work"));
  CHECK(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC < 20);  // there was no end
  // Power: with its work stated it is an estimate.
  const auto r = estimate(recipe(MeanTo{2, true}), {.samples = 1 << 13, .seed = 3});
  CHECK(std::abs(r.mean - 1) < 4.5 * r.standard_error);
}

TEST_CASE("work that hardly shows in the time is not accused", "[evidence][inputs][pilot]") {
  // The stated work grows faster than the time.
  const auto cheap = [](std::int64_t level, Stream& rng) {
    const double h = std::exp2(-static_cast<double>(level));
    const double x = rng.normal();
    return level == 0 ? base(x + h) : coupled(x + h, x + h + h * rng.normal(), std::exp2(static_cast<double>(level)));
  };
  CHECK_NOTHROW(estimate(recipe(cheap), {.samples = 1 << 12}));
  // A first draw that takes long, once.
  bool first = true;
  LevelRuns runs = level_runs(MeanTo{2, true});
  const auto work = runs.work;
  runs.work = [&](std::int64_t level, const Plan& plan) {
    if (level == 6 && std::exchange(first, false)) {
      const auto start = std::chrono::steady_clock::now();
      while (seconds_since(start) < 0.2) {
      }
    }
    return work(level, plan);
  };
  CHECK_NOTHROW(advise(runs, {.samples = 1 << 12}));
}

TEST_CASE("a pilot can be watched, interrupted and limited in time", "[evidence][inputs][pilot]") {
  std::int64_t calls = 0;
  Plan plan{.samples = 1 << 14, .threads = 1};
  plan.progress = [&calls](std::int64_t) { return ++calls < 20; };
  CHECK_THROWS_AS(advise(level_runs(MeanTo{2, true}), plan), Interrupted);
  CHECK(calls == 20);
  // An open answer goes on to the cost of the run, but not beyond its time.
  const auto border = [](std::int64_t level, Stream& rng) -> Draw<double> {
    const double h = std::exp2(-static_cast<double>(level) / 2);
    double x = 0;
    for (std::int64_t i = 0; i < (std::int64_t{1} << level); ++i) x += rng.normal();
    const double n = std::exp2(static_cast<double>(level));
    return level == 0 ? base(x, n) : coupled(x + h * rng.normal(), x, n);
  };
  const auto start = std::chrono::steady_clock::now();
  const Advice a = advise(level_runs(border), {.goal = {.seconds = 1}});
  CHECK(a.pilot_seconds < 10);  // on a machine that does other things, too
  CHECK(seconds_since(start) < 20);
}

TEST_CASE("a goal that nobody can pay for names its cost", "[evidence][inputs][goal]") {
  for (const double power : {2.0, 3.0}) {
    CHECK_THROWS_WITH(estimate(recipe(MeanTo{power, true}), {.goal = {.error = 1e-9}}),
                      Catch::Contains("members") && Catch::Contains("seconds"));
  }
  CHECK_THROWS_WITH(estimate(recipe(MeanTo{2, true}), {.goal = {.relative_error = 1e-10}}), Catch::Contains("seconds"));
}

TEST_CASE("work that grows in steps has a rate", "[evidence][inputs][exact]") {
  const auto stepwise = [](double step) {
    return [step](std::int64_t level, Stream& rng) {
      const double h = std::exp2(-static_cast<double>(level));
      const double x = rng.normal();
      const double work = std::exp2(step * static_cast<double>(level / 2));
      return level == 0 ? base(x, work) : coupled(x + h * rng.normal(), x, work);
    };
  };
  for (const double step : {1.0, 2.0, 1.5}) {
    const Survey s = survey(stepwise(step), 10, {.samples = 1024});
    CAPTURE(step, s.rates.work_growth.value);
    CHECK(std::abs(s.rates.work_growth.value - step / 2) < 0.15);
  }
}

TEST_CASE("rates that are declared speak in survey and recipe", "[evidence][inputs][exact]") {
  struct Declared {
    Rates rates{1.5, 1};
    Draw<double> operator()(std::int64_t level, Stream& rng) const {
      const double h = std::exp2(-0.75 * static_cast<double>(level));
      const double x = rng.normal();
      return level == 0 ? base(x, 1.0) : coupled(x + h * rng.normal(), x, std::exp2(static_cast<double>(level)));
    }
  };
  const auto silent = [](std::int64_t level, Stream& rng) { return Declared{}(level, rng); };
  const Survey with = survey(Declared{}, 6, {.samples = 4096});
  const Survey without = survey(silent, 6, {.samples = 4096});
  CHECK(with.evidence.decay.error < without.evidence.decay.error);
  CHECK(with.evidence.diverges < without.evidence.diverges);
  const Advice told = advise(level_runs(silent), {.samples = 1 << 14}, {.rates = Rates{1.5, 1}});
  const Advice declared = advise(level_runs(Declared{}), {.samples = 1 << 14});
  CHECK(told.pmf.spec() == declared.pmf.spec());
  CHECK(told.survey.grade == declared.survey.grade);
  // Wrong ones are reported.
  const Survey wrong = [&] {
    LevelRuns runs = level_runs(silent);
    runs.facts.declared = Rates{3, 1};
    return survey(runs, 8, {.samples = 1 << 14});
  }();
  CHECK(wrong.evidence.contradiction.has_value());
}

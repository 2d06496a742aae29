#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "recipe/digital.hpp"

#include <debias/core/estimate.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>
#include <debias/recipe/model.hpp>

#include "catalog.hpp"
#include "catalog/run_by.hpp"

using namespace debias;
using namespace debias::trial;

namespace {

/// I_k = 1 - 2^-k on average, E D_k^2 = 2^(-beta k) with kurtosis 3 + a mean, work 2^k.
struct Chosen {
  double beta;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double mean = level == 0 ? 0.5 : power(2, -level) / 2;
    const double d = mean + std::exp2(-beta * static_cast<double>(level) / 2) * rng.normal();
    return {level == 0 ? d : 1 - power(2, -level) / 2 + rng.normal(), d, power(2, level)};
  }
  double truth() const { return 1; }
};

/// Differences 2^(-beta k / 2) times a normal number, and nothing else.
struct Pure {
  double beta;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double d = std::exp2(-beta * static_cast<double>(level) / 2) * rng.normal();
    return {level == 0 ? d : rng.normal() + d, d, power(2, level)};
  }
};

/// Differences of size 1 with probability 2^(-3 k / 2): soon nothing but zeros to see, and all of the mean behind them.
struct Rare {
  static double probability(std::int64_t level) { return std::exp2(-1.5 * static_cast<double>(level)); }
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double u = rng.uniform();
    const double v = rng.uniform();
    const double d = u < probability(level) ? 1.0 : 0.0;
    const double below = (1 - probability(level)) * truth();  // the sum of the means of the levels below
    return {level == 0 ? d : below + v - 0.5 + d, d, power(2, level)};
  }
  static double truth() { return 1 / (1 - probability(1)); }
};

/// sum 1 / (k + 1)^2, every term with noise in proportion.
struct Basel {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const auto k = static_cast<double>(level);
    const double d = (0.5 + rng.uniform()) / ((k + 1) * (k + 1));
    double below = 0;
    for (std::int64_t i = 0; i < level; ++i) below += 1 / (static_cast<double>(i + 1) * static_cast<double>(i + 1));
    return {below + d, d, 1.0};
  }
};

double z_of(const Statistics& s, double truth) {
  return (s.components[0].mean - truth) / s.components[0].standard_error;
}

/// Variance x work of one member, as the run has measured them.
template <class R>
double measured_product(const R& r) {
  return r.components[0].variance * r.work_per_sample();
}

}  // namespace

TEST_CASE("a sequence that declares nothing is estimated without bias in three lines", "[recipe][statistical]") {
  // (E X)^2 = 1 of an exponential X: the square of the mean of 2^k draws, and of its two halves.
  const auto my_sequence = [](std::int64_t level, Stream& rng) {
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
    return coupled(mean * mean, (a * a + b * b) / 2, 2.0 * static_cast<double>(half));
  };
  const auto result = estimate(recipe(my_sequence), {.samples = 1 << 17, .seed = 3});
  CHECK(std::abs(z_of(result, 1)) < 4.5);
  CHECK(result.advice.survey.pmf_exists == Answer::yes);
  std::ostringstream text;
  text << result;
  for (const char* word : {"mean", "by the pilot", "verdict"}) CHECK(text.str().find(word) != text.str().npos);
  for (const char* word : {"recipe", "times the bound", "kurtosis"}) CHECK(text.str().find(word) == text.str().npos);
  text.str("");
  text << full(result);
  for (const char* word : {"mean", "recipe", "times the bound", "pilot", "kurtosis", "levels"}) {
    CHECK(text.str().find(word) != text.str().npos);
  }
  // The advice alone: a line each for the answer, the PMF, the base, what it costs, the pilot.
  text.str("");
  text << result.advice;
  CHECK(text.str().find("pmf           " + result.advice.pmf.spec()) != text.str().npos);
  CHECK(text.str().find("times the bound") == text.str().npos);
  text << full(result.advice);
  CHECK(text.str().find("times the bound") != text.str().npos);
}

TEST_CASE("a recipe is unbiased and its error honest over many seeds", "[recipe][statistical]") {
  const auto check = [](const auto& sequence, double truth, std::int64_t samples) {
    std::vector<double> z;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      z.push_back(z_of(estimate(recipe(sequence), {.samples = samples, .seed = seed}), truth));
    }
    const Moments m = Moments::of(z);
    CHECK(std::abs(m.mean) < 4.5 * m.standard_error());
    CHECK(std::sqrt(m.variance()) == Approx(1).margin(4.5 / std::sqrt(200.0)));
    CHECK(std::abs(*std::max_element(z.begin(), z.end())) < 5.5);
  };
  check(Chosen{2}, 1, 1 << 14);
  check(Chosen{1.5}, 1, 1 << 14);
  check(GeometricSeries{.q = 0.5}, 2, 1 << 12);
}

TEST_CASE("a run by recipe is the run of the estimator that its advice names", "[recipe][exact]") {
  const SquaredMean sequence;
  const Plan plan{.samples = 1 << 15, .seed = 11};
  const auto result = estimate(recipe(sequence), plan);
  Advice advice = result.advice;
  const std::string spec = advice.pmf.spec();
  advice.pmf = AnyPmf::parse(spec);
  CHECK(advice.pmf.spec() == spec);
  const auto again = estimate(estimator_of(sequence, advice), {.samples = advice.members, .seed = 11});
  CHECK(again.mean == result.mean);
  CHECK(again.standard_error == result.standard_error);
  const LargeSample& largest = result.largest.front();
  CHECK(trace(estimator_of(sequence, advice), 11, largest.index).sample.value == largest.value);
  CHECK(advise(level_runs(sequence), {.samples = 1 << 15, .seed = 11, .threads = 1}).pmf.spec() == spec);
  CHECK(advice.members >= 1 << 15);
  CHECK(advice.members % advice.block == 0);
}

TEST_CASE("where no PMF has finite variance and finite work a recipe says so and what to expect", "[recipe][exact]") {
  CHECK_THROWS_WITH(estimate(recipe(Pure{0.3}), {.samples = 1 << 17}),
                    Catch::Contains("finite variance and finite work") && Catch::Contains("multilevel"));
  // beta = gamma is beyond what levels tell: it runs, and says so.
  const auto open = estimate(recipe(Pure{1}), {.samples = 1 << 14});
  CHECK(open.advice.survey.pmf_exists == Answer::open);
  CHECK_FALSE(open.verdict().interval_reliable());
  const Advice half = advise(level_runs(Pure{0.5}), {.samples = 1 << 17});
  CHECK_FALSE(half.usable());
  REQUIRE(half.sentences.size() == 3);
  CHECK_THAT(half.sentences[1], Catch::Contains("variance is infinite"));
  // Stable index 2 gamma / (2 gamma - beta) = 4/3, errors like work^-(beta / (2 gamma)) = work^-0.25.
  CHECK_THAT(half.sentences[1], Catch::Contains("stable index 1.3") && Catch::Contains("work^-0.2"));
  CHECK(half.exponent.exponent > half.survey.rates.work_growth.value);
}

TEST_CASE("a recipe without a PMF throws a NoPmfError with the measured rates, and a typing error does not",
          "[recipe][exact]") {
  const auto refused = [](const auto& sequence, const RecipeOptions& options = {}) -> std::optional<NoPmfError> {
    try {
      estimate(recipe(sequence, options), {.samples = 1 << 17});
    } catch (const NoPmfError& e) {
      return e;
    } catch (const std::invalid_argument&) {
    }
    return std::nullopt;
  };
  const std::optional<NoPmfError> slow = refused(Pure{0.3});
  REQUIRE(slow);
  CHECK(std::abs(slow->variance_decay().value - 0.3) < 0.2);
  CHECK(slow->variance_decay().error > 0);
  CHECK(slow->work_growth().value == Approx(1).margin(0.01));
  CHECK(slow->decay() == Decay::geometric);
  CHECK(slow->grade() != NoPmfError::Grade::declared);
  CHECK_THAT(slow->reason(), Catch::Contains("E D_k^2 falls like 2^("));
  CHECK_THAT(slow->help(), Catch::Contains("multilevel"));
  CHECK_THAT(slow->what(), Catch::StartsWith("recipe: no PMF has finite variance and finite work ("));
  // Differences that do not fall beside work that grows, and such as grow: no fall is claimed, and not even a mean.
  for (const double rate : {0.0, -0.2}) {
    const Advice none = advise(level_runs(Pure{rate}), {.samples = 1 << 17});
    REQUIRE_FALSE(none.usable());
    CHECK_THAT(none.sentences[0], !Catch::Contains("falls like"));
    CHECK_THAT(none.sentences[0], Catch::Contains(rate < 0 ? "E D_k^2 grows like 2^(0." : "E D_k^2 does not fall"));
    CHECK_THAT(none.sentences[1], Catch::Contains("even the mean") && !Catch::Contains("work^-"));
    CHECK(refused(Pure{rate}));
  }
  CHECK_FALSE(refused(SquaredMean{}, {.base_level = -1}));
  CHECK_FALSE(refused(SquaredMean{}, {.budget = -1.0}));
}

TEST_CASE("the moments that a survey measured give A10 its known products", "[recipe][statistical]") {
  // The catalogue's A10 numbers its differences from j = 0: level j + 1 here.
  const Survey s = survey(SquaredMean{}, 11, {.samples = 1 << 15, .seed = 1});
  const LevelModel model = model_of(s, 90);
  TermMoments t;
  const auto from_one = [](const std::vector<double>& v) { return std::vector<double>(v.begin() + 1, v.end()); };
  t.variance = from_one(model.variance);
  t.mean_square = from_one(model.mean_square);
  t.work = from_one(model.work);
  const auto geometric = [&](double r) {
    std::vector<double> masses;
    for (std::size_t j = 0; j < t.work.size(); ++j) masses.push_back(r * std::pow(1 - r, static_cast<double>(j)));
    return predict(t, masses).product();
  };
  CHECK(geometric(0.55) == Approx(54.5).epsilon(0.03));
  CHECK(geometric(0.60) == Approx(30.9).epsilon(0.03));
  CHECK(geometric(0.65) == Approx(25.28).epsilon(0.03));
  CHECK(geometric(0.70) == Approx(28.9).epsilon(0.03));
  CHECK(predict(t, best_masses(t)).product() == Approx(24.97).epsilon(0.03));
  t.block = std::int64_t{1} << 50;
  CHECK(predict(t, best_masses(t)).product() == Approx(19.01).epsilon(0.03));
}

TEST_CASE("levels of which the pilot saw only zeros keep the mass that the fitted decay asks for",
          "[recipe][statistical]") {
  const Plan plan{.samples = 1 << 18, .seed = 5};
  const Advice advice = advise(level_runs(Rare{}), plan);
  REQUIRE(advice.usable());
  bool zeros = false;
  for (const SurveyRow& r : advice.survey.rows) zeros = zeros || (r.level > 0 && r.second_moment == 0);
  const LevelModel model = model_of(advice.survey, 20);
  for (std::int64_t k = 1; k < 20; ++k) {
    const double truth = std::exp2(-1.5 * static_cast<double>(k));
    CAPTURE(k);
    const auto i = static_cast<std::size_t>(k);
    CHECK(model.variance[i] + model.mean_square[i] > truth / 2);
    CHECK(model.variance[i] + model.mean_square[i] < 16 * truth);
  }
  CHECK(std::abs(z_of(estimate(recipe(Rare{}), plan), Rare::truth())) < 4.5);
}

TEST_CASE("exact zeros, powers of the level and wild first levels each get a PMF that fits", "[recipe][statistical]") {
  const auto steady = estimate(recipe(Steady{}), {.samples = 1 << 14, .seed = 2});
  CHECK(std::abs(z_of(steady, 0.5)) < 4.5);
  CHECK(measured_product(steady) < 1.2 * steady.advice.bound);
  const Advice basel = advise(level_runs(Basel{}), {.samples = 1 << 16, .seed = 2});
  CHECK(basel.survey.rates.kind == RateKind::polynomial);
  CHECK(basel.pmf.spec().rfind("zeta:s=", 0) == 0);
  CHECK(basel.exponent.exponent > 1);
  CHECK(basel.exponent.exponent < 3);
}

TEST_CASE("on combs the base of a recipe is the deepest that the cap allows", "[recipe][statistical][!mayfail]") {
  // Not met since the rules of evidence: it is 5. Whether 5 costs more than 6 was not measured.
  CHECK(advise(level_runs(Comb{}), {.samples = 1 << 18, .seed = 2}, {.points = Points::plain}).base_level == 6);
}

TEST_CASE("on combs the base moves up and is made of the draws of the difference", "[recipe][statistical]") {
  const auto result = estimate(recipe(Comb{}, {.points = Points::plain}), {.samples = 1 << 18, .seed = 2});
  CHECK(result.advice.shares_base);
  CHECK(std::abs(z_of(result, Comb{}.truth())) < 4.5);
  CHECK(measured_product(result) < result.advice.bound);
  const auto fixed =
      estimate(recipe(Comb{}, {.base_level = 2, .base = Base::one_outcome}), {.samples = 1 << 15, .seed = 2});
  CHECK(fixed.advice.base_level == 2);
  CHECK(fixed.advice.base == Base::one_outcome);
  CHECK(std::abs(z_of(fixed, Comb{}.truth())) < 4.5);
}

TEST_CASE("a goal for the error fixes the members before the run", "[recipe][statistical]") {
  // Blocks of nets are fewer and larger: 32 of them may be better than was asked for.
  int met = 0;
  std::vector<double> z;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const auto r = estimate(recipe(Chosen{2}, {.points = Points::plain}), {.seed = seed, .goal = {.error = 0.004}});
    met += r.goal_met() ? 1 : 0;
    CHECK(r.total_error() < 1.1 * 0.004);
    // 0.8 where one error of the pilot's variance was allowed for; two are now: over sqrt(1.354 / 1.177) at its 32 hits.
    CHECK(r.total_error() > 0.746 * 0.004);
    z.push_back(z_of(r, 1));
  }
  CHECK(met >= 34);
  const Moments m = Moments::of(z);
  CHECK(std::abs(m.mean) < 4.5 * m.standard_error());
  const auto relative =
      estimate(recipe(Comb{}, {.points = Points::plain}), {.seed = 2, .goal = {.relative_error = 1e-4}});
  CHECK(relative.total_error() <= 1e-4 * relative.norm());
  CHECK(relative.total_error() > 0.7e-4 * relative.norm());
  CHECK_THROWS_WITH(estimate(recipe(Comb{}), {.goal = {.error = -1}}), Catch::Contains("error = -1"));
}

TEST_CASE("a recipe takes values with several components", "[recipe][statistical]") {
  using Complex = std::complex<double>;
  // Differences (1 + i / 2) 2^(-k-1) on average, with noise of that size: the sum is 1.5 + 0.75 i.
  const auto sequence = [](std::int64_t level, Stream& rng) {
    const double a = rng.uniform();
    const double b = rng.uniform();
    const Complex d = Complex(2 * a, b) * (level == 0 ? 1.0 : power(0.5, level + 1));
    const Complex below = level == 0 ? Complex(0) : Complex(1, 0.5) * (1.5 - power(0.5, level));
    return Draw<Complex>{below + d, d, power(2, level) / 2};
  };
  const auto r = estimate(recipe(sequence), {.samples = 1 << 15, .seed = 3});
  CHECK(std::abs(r.mean.real() - 1.5) < 4.5 * r.components[0].standard_error);
  CHECK(std::abs(r.mean.imag() - 0.75) < 4.5 * r.components[1].standard_error);
  CHECK_FALSE(std::any_of(r.advice.survey.remarks.begin(), r.advice.survey.remarks.end(),
                          [](const Warning& w) { return w.code == WarningCode::coupling; }));
}

TEST_CASE("a recipe refuses a base level that its pilot does not reach", "[recipe][exact]") {
  CHECK_THROWS_WITH(advise(level_runs(SquaredMean{}), {.samples = 1000}, {.base_level = -1}),
                    Catch::Contains("base_level = -1"));
}

namespace {

void check_bound(const char* id) {
  const catalog::Problem& p = catalog::find(id);
  const Plan plan{.samples = 1 << 20, .seed = 1};
  const Advice advice = advise(p.levels, plan, {.base_level = p.lowest_base});
  const Statistics s = testing::run_by(advice, p, plan);
  // The bound, from a pilot of its own.
  const Survey survey = survey_within(p.levels, s.work - s.pilot_work, {.seed = 9});
  const double bound = bound_of(survey, model_of(survey), advice.base_level);
  CAPTURE(id, advice.block, measured_product(s) / bound);
  CHECK(measured_product(s) < 1.08 * bound);
  CHECK(std::abs(z_of(s, p.truth)) < 5.5);
}

}  // namespace

TEST_CASE("measured variance x work in blocks is within 1.08 of the bound on eleven problems of six groups",
          "[recipe][statistical][stat]") {
  for (const char* id : {"A01", "A10", "A13", "C06", "E02", "E07", "asian-call", "F01", "F02", "H01", "H04"}) {
    check_bound(id);
  }
}

TEST_CASE("measured variance x work in blocks is within 1.08 of the bound on an alternating series",
          "[recipe][statistical][stat][!mayfail]") {
  check_bound("D17");  // not met since the rules of evidence: 1.11
}

TEST_CASE("a goal that is met by what was drawn says what it is with levels not seen", "[recipe][goal][exact]") {
  const catalog::Problem& p = catalog::find("A03");
  int said = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Plan plan{.seed = seed, .goal = {.relative_error = 0.01}};
    const Statistics r = testing::run_by(advise(p.levels, plan, {.lowest_base = p.lowest_base}), p, plan);
    std::ostringstream text;
    text << r;
    const double all = std::hypot(r.goal_error(), std::sqrt(r.verdict().unseen_variance)) / r.norm();
    const bool says = text.str().find("with levels not seen") != text.str().npos;
    CHECK(says == (r.goal_met() && all > 0.01));
    said += says ? 1 : 0;
  }
  CHECK(said > 0);
}

TEST_CASE("intervals of derivatives and exact combs that a goal was asked for are called reliable, and cover",
          "[recipe][goal][statistical]") {
  for (const char* id : {"C01", "B04"}) {
    const catalog::Problem& p = catalog::find(id);
    int reliable = 0;
    int covered = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const Plan plan{.seed = seed, .goal = {.error = 0.0016}};
      const Statistics s = testing::run_by(advise(p.levels, plan), p, plan);
      const Interval interval = s.interval();
      reliable += s.verdict().interval_reliable() ? 1 : 0;
      covered += interval.low <= p.truth && p.truth <= interval.high ? 1 : 0;
    }
    CAPTURE(id);
    CHECK(reliable >= 18);
    CHECK(covered >= 17);
  }
}

TEST_CASE("a recipe is unbiased on every problem of the catalogue for which it finds a PMF",
          "[recipe][statistical][stat]") {
  int runs = 0;
  for (const catalog::Problem& p : catalog::problems()) {
    const Plan plan{.samples = 1 << 15, .seed = 1};
    const Advice advice = advise(p.levels, plan, {.lowest_base = p.lowest_base});
    CAPTURE(p.id, advice.pmf.spec(), advice.base_level);
    CHECK((advice.survey.pmf_exists != Answer::no || !pmf_exists(p.rates)));
    if (!advice.usable()) continue;
    ++runs;
    const Statistics s = testing::run_by(advice, p, plan);
    const double error = std::max({s.total_error(), s.bias_bound.size, 1e-13 * std::abs(p.truth)});
    CHECK(std::abs(s.components[0].mean - p.truth) < 5.8 * error);
  }
  CHECK(runs > 60);
}

TEST_CASE(
    "a PMF from the plain second moments of a small pilot gives confident wrong answers where a recipe does "
    "not",
    "[recipe][statistical][stat]") {
  // Masses sqrt(E D^2 / work) as a pilot has seen them, zeros and all.
  double plain = 0;
  double careful = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Plan plan{.samples = 1 << 20, .seed = seed};
    const Survey pilot = survey(Rare{}, 14, {.samples = 128, .seed = seed});
    std::vector<double> masses;
    for (const SurveyRow& r : pilot.rows) {
      if (r.level > 0) masses.push_back(std::max(1e-12, std::sqrt(r.second_moment / r.difference_work)));
    }
    const auto e = stratified(single_term(Rare{}, Tabulated(masses, 0.4)), 256);
    plain = std::max(plain, std::abs(z_of(estimate(e, {.samples = plan.samples, .seed = seed}), Rare::truth())));
    careful = std::max(careful, std::abs(z_of(estimate(recipe(Rare{}), plan), Rare::truth())));
  }
  CAPTURE(plain, careful);
  CHECK(plain > 5.5);
  CHECK(careful < 4.5);
}

TEST_CASE("the tail index of a run is 1 - beta over 2 theta", "[recipe][statistical][stat]") {
  // Kurtosis 3 at every level: E |D|^q scales like (E D^2)^(q / 2).
  for (const double theta : {1.25, 1.5, 1.9, 2.4}) {
    const auto r = estimate(single_term(Pure{2}, Geometric::with_exponent(theta)), {.samples = 1 << 20, .seed = 6});
    const RunVerdict verdict = r.verdict();
    const double xi = 1 - 2 / (2 * theta);
    CAPTURE(theta, xi, verdict.upper.k, verdict.lower.k);
    CHECK(std::abs(verdict.upper.k - xi) < 0.1);
    CHECK(std::abs(verdict.lower.k - xi) < 0.1);
  }
}

TEST_CASE(
    "on the whole catalogue a recipe predicts no less than its run has, and no more than the best draws without strata",
    "[recipe][stat][!mayfail]") {
  // Not met since the rules of evidence: what is open runs with wide tables, whose prediction is far off (E06 and M01; B15
  // and C12 the other way).
  std::vector<std::string> too_good;
  std::vector<std::string> too_bad;
  int usable = 0;
  for (const catalog::Problem& p : catalog::problems()) {
    const Plan plan{.samples = 1 << 15, .seed = 3};
    const Advice advice = advise(p.levels, plan, {.lowest_base = p.lowest_base});
    if (!advice.usable()) continue;
    ++usable;
    const Statistics s = testing::run_by(advice, p, plan);
    const double predicted = advice.predicted.product();
    const double rounding = 1e-25 * s.components[0].mean * s.components[0].mean * advice.predicted.work;
    // The PMF of the waiting time, of too short a pilot, has infinite variance.
    if (predicted < 0.5 * measured_product(s) - rounding && p.id != "H02") too_good.push_back(p.id);
    const LevelModel model = model_of(advice.survey);
    double roots = 0;
    for (std::size_t k = 0; k < model.size(); ++k) {
      roots += std::sqrt((model.variance[k] + model.mean_square[k]) * model.work[k]);
    }
    if (!(predicted > 0 && predicted < 2 * roots * roots)) too_bad.push_back(p.id);
  }
  CAPTURE(usable, too_good, too_bad);
  CHECK(usable > 60);
  CHECK(too_good.empty());
  CHECK(too_bad.empty());
}

TEST_CASE("a recipe keeps the samples of its run, none of its pilot", "[recipe][exact]") {
  RunState held(default_chunk);
  int saves = 0;
  Plan plan{.samples = 1 << 14, .seed = 4};
  plan.save = [&](const RunState& finished, const Plan&) {
    held = finished;
    ++saves;
  };
  const auto run = estimate(recipe(Chosen{3}), plan);
  CHECK(saves == 1);
  CHECK(held.total().moments.count == run.blocks);
  CHECK(held.last() == run.samples);
  plan.earlier = std::make_shared<RunState>(held);
  CHECK(estimate(recipe(Chosen{3}), plan).mean == run.mean);
  plan.earlier = {};
  saves = 0;
  multilevel(level_runs(Chosen{3}), 0.1, plan);
  CHECK(saves == 0);
}

TEST_CASE("no goal ends a recipe with a handful of samples", "[recipe][stat]") {
  for (const auto& [id, error] : {std::pair("F06", 0.06),
                                  {"E10", 0.3},
                                  {"E10", 0.1},
                                  {"M01", 0.1},
                                  {"M02", 0.1},
                                  {"B08", 0.01},
                                  {"D07", 0.1},
                                  {"D08", 0.1}}) {
    const catalog::Problem& p = catalog::find(id);
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      const Plan plan{.seed = seed, .goal = {.error = error}};
      const Advice advice = advise(p.levels, plan, {.lowest_base = p.lowest_base});
      const Statistics s = testing::run_by(advice, p, plan);
      CAPTURE(id, error, seed, s.samples, s.components[0].mean - p.truth, s.components[0].standard_error);
      CHECK(s.blocks >= 64);
      CHECK(std::abs(s.components[0].mean - p.truth) < 4.5 * error);
    }
  }
}

TEST_CASE("options by recipe without nets take at most 0.1 (European) and 0.35 of the work of multilevel",
          "[recipe][statistical][.long][!mayfail]") {
  // Not met: one seed of the European call predicts .519 of what its run has, .6 is asked for. The work and the goals hold.
  const auto check = [](const char* id, double error, double bound) {
    const catalog::Problem& p = catalog::find(id);
    double work = 0;
    double baseline = 0;
    double squares = 0;
    double least = 1;
    double most = 1;
    std::vector<double> means;
    for (std::uint64_t seed = 1; seed <= 16; ++seed) {
      const Plan plan{.seed = seed, .goal = {.error = error}};
      const Advice advice = advise(p.levels, plan, {.points = Points::plain});
      const Statistics s = testing::run_by(advice, p, plan);
      const double reached = s.total_error() / error;
      // A goal aims at 95 % of it; 128 blocks in its pilot, of kurtosis 10, know a standard error to 13 %.
      CHECK(reached < 0.95 * (1 + 3 * 0.13));
      const double predicted = advice.predicted.product() / measured_product(s);
      least = std::min(least, predicted);
      most = std::max(most, predicted);
      squares += reached * reached;
      work += s.work * reached * reached;  // the pilots are in it
      if (seed <= 4) baseline += 4 * multilevel(p.levels, error, {.seed = seed}).work;
      means.push_back(s.components[0].mean);
    }
    const Moments m = Moments::of(means);
    CAPTURE(id, error, work / 16, baseline / 16, work / baseline, m.mean - p.truth, std::sqrt(squares / 16), least,
            most);
    CHECK(least > 0.6);  // predicted variance x work, over what the run has
    CHECK(most < 3);
    CHECK(work < bound * baseline);
    CHECK(squares / 16 < 1);
    CHECK(std::abs(m.mean - p.truth) < 4.5 * error / 4);
  };
  check("european-call", 0.01, 0.1);
  check("european-call", 0.0025, 0.1);
  check("asian-call", 0.01, 0.35);
  check("lookback-call", 0.01, 0.35);
}

TEST_CASE("the digital option has no PMF as it is and an honest one when its last step is smoothed",
          "[recipe][statistical][stat][!mayfail]") {
  // Not met by today's PMF: 64 z spread by .779, .8 is asked for; chance gives that once in a hundred.
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Advice plain = advise(level_runs(Digital{false}), {.samples = 1 << 18, .seed = seed});
    CAPTURE(seed, name_of(plain.survey.pmf_exists), plain.survey.rates.variance_decay.value);
    CHECK(plain.survey.pmf_exists != Answer::yes);  // open, or no
  }
  std::vector<double> z;
  for (std::uint64_t seed = 1; seed <= 64; ++seed) {
    const auto r = estimate(recipe(Digital{true}), {.samples = 1 << 15, .seed = seed});
    z.push_back(z_of(r, Digital::truth()));
    CHECK(std::abs(z.back()) < 5.5);
  }
  const Moments m = Moments::of(z);
  CHECK(std::abs(m.mean) < 4.5 * m.standard_error());
  CHECK(std::sqrt(m.variance()) > 0.8);
  CHECK(std::sqrt(m.variance()) < 1.25);
}

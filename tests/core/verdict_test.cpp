#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <ostream>
#include <sstream>
#include <string>
#include <vector>

#include "catch_shim.hpp"
#include "diagnostics/cases.hpp"
#include "validation/reliability.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/verdict.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/zeta.hpp>
#include <debias/recipe.hpp>
#include <debias/series.hpp>

using namespace debias;
using test::LabelledCase;

namespace {

constexpr double forever = std::numeric_limits<double>::infinity();

// ---- level tables as they would be if sample moments were exact

struct Table {
  double beta = 2;
  double rho = 1.5;
  double kurtosis = 3;
  double samples = 1e6;
  double power = 0;         // E D_k^2 = k^(-power) 2^(-beta k)
  bool polynomial = false;  // E D_k^2 = (k + 1)^(-beta), p_k = k^(-rho): level 0 is the base
  int zero_from = 1000;
  int probability_until = 1000;
};

Statistics statistics_of(const Table& t) {
  Statistics s;
  s.samples = s.moments.count = static_cast<std::int64_t>(t.samples);
  const auto fall = [&t](double exponent, int k) {
    return t.polynomial ? std::pow(k, -exponent) : std::exp2(-exponent * k);
  };
  double total = 0;
  for (int k = 1; k < 64; ++k) total += fall(t.rho, k);
  s.levels.push_back({0, 0, true, s.samples, 1, 2, 2, 1, 0});
  for (int k = 1; k < 64; ++k) {
    const double p = fall(t.rho, k) / total;
    const auto count = static_cast<std::int64_t>(std::floor(p * t.samples));
    if (count == 0) break;
    const double shape = fall(t.beta, t.polynomial ? k + 1 : k) * std::pow(k, -t.power);
    const double second = k < t.zero_from ? shape : 0;
    s.levels.push_back(
        {k, k, false, count, 0, second, second > 0 ? t.kurtosis : 0, 1.0 * k, k < t.probability_until ? p : 0});
  }
  return s;
}

LevelEvidence evidence(const Table& t) { return judge(statistics_of(t)).levels; }
RunVerdict verdict(const Table& t) { return judge(statistics_of(t)); }

// ---- many runs with known answers

struct Tally {
  int runs = 0;
  int wrong = 0;         // confident, and wrong
  int wrong_by_far = 0;  // at least 0.2 away from the border
  int far = 0;           // runs that are at least 0.2 away
  int undecided = 0;     // of those
  int light = 0;
  int light_flagged = 0;
  int cases = 0;
};

std::ostream& operator<<(std::ostream& out, const Tally& t) {
  return out << t.cases << " cases, " << t.runs << " runs: wrong " << t.wrong << ", wrong by far " << t.wrong_by_far
             << ", undecided " << t.undecided << " of " << t.far << " at least 0.2 away, light flagged "
             << t.light_flagged << " of " << t.light;
}

using Rule = std::function<Finiteness(const Statistics&, const RunVerdict&)>;

std::vector<Tally> tally(const std::vector<LabelledCase>& cases, const std::vector<Rule>& rules, std::int64_t samples,
                         int seeds) {
  std::vector<Tally> tallies(rules.size());
  for (const LabelledCase& c : cases) {
    const bool far = std::abs(c.index - 0.5) > 0.2 - 1e-9;
    for (int s = 1; s <= seeds; ++s) {
      const Statistics run = c.run(samples, 1000 + static_cast<std::uint64_t>(s));
      const RunVerdict verdict = run.verdict();
      for (std::size_t i = 0; i < rules.size(); ++i) {
        Tally& t = tallies[i];
        const Finiteness said = rules[i](run, verdict);
        const bool wrong = said == (c.finite() ? Finiteness::infinite : Finiteness::finite);
        t.cases += s == 1 ? 1 : 0;
        ++t.runs;
        t.wrong += wrong ? 1 : 0;
        t.wrong_by_far += wrong && far ? 1 : 0;
        t.far += far ? 1 : 0;
        t.undecided += far && said == Finiteness::undecided ? 1 : 0;
        t.light += c.index <= 0 ? 1 : 0;
        t.light_flagged += c.index <= 0 && said == Finiteness::infinite ? 1 : 0;
      }
    }
  }
  return tallies;
}

Finiteness by_verdict(const Statistics& /*run*/, const RunVerdict& v) { return v.variance; }
Finiteness by_plain_k(const Statistics& /*run*/, const RunVerdict& v) {
  return std::max(v.upper.plain, v.lower.plain) < 0.5 ? Finiteness::finite : Finiteness::infinite;
}
Finiteness by_kurtosis(const Statistics& s, const RunVerdict& /*verdict*/) {
  return s.moments.kurtosis() > 100 ? Finiteness::infinite : Finiteness::finite;
}

// The demands on a verdict.
bool trustworthy(const Tally& t) { return 100 * t.wrong < t.runs && t.wrong_by_far == 0; }
bool decisive(const Tally& t) { return 5 * t.undecided < t.far; }
bool calm(const Tally& t) { return 100 * t.light_flagged < t.light; }

// ---- intervals

struct Coverage : validation::Coverage {
  int unreliable = 0;  // of the intervals that miss: the verdict on the variance is not `finite`
  int infinite = 0;    // it is `infinite`

  [[nodiscard]] double fired() const { return static_cast<double>(unreliable) / static_cast<double>(low + high); }
  [[nodiscard]] double confident() const { return static_cast<double>(infinite) / static_cast<double>(low + high); }
};

std::ostream& operator<<(std::ostream& out, const Coverage& c) {
  return out << "covered " << c.covered() << ", below " << c.low << ", above " << c.high << " of " << c.replications
             << "; of the misses fired " << c.fired() << ", infinite " << c.confident();
}

Coverage coverage(const LabelledCase& c, int runs) {
  const double truth = catalog::find(c.problem).truth;
  std::atomic<int> unreliable = 0;
  std::atomic<int> infinite = 0;
  const auto run = [&](std::uint64_t seed) {
    Statistics s = c.run(10'000, 77'000 + seed);
    // By the standard error alone, as the coverage is: the interval allows for levels that were hardly drawn.
    const ComponentEstimate& e = s.components.front();
    if (!c.finite() && std::abs(e.mean - truth) > 1.959963984540054 * e.standard_error) {
      const Finiteness said = s.verdict().variance;
      unreliable += said != Finiteness::finite;
      infinite += said == Finiteness::infinite;
    }
    return s;
  };
  return {validation::coverage(run, truth, runs), unreliable, infinite};
}

std::string check_coverage(const std::vector<LabelledCase>& cases, int runs = 10'000) {
  std::ostringstream report;
  for (const LabelledCase& c : cases) {
    const Coverage found = coverage(c, runs);
    CAPTURE(c.problem, c.index, found);
    if (c.finite()) {
      CHECK(found.covered() >= 0.939);
      CHECK(found.covered() <= 0.960);
    } else {
      CHECK(found.covered() < 0.939);  // the power check: the same band finds a wrong error bar
      CHECK(found.fired() >= 0.95);
    }
    report << c.problem << " " << c.index << ": " << found << '\n';
  }
  return report.str();
}

}  // namespace

TEST_CASE("the index is that of the levels, with beta and rho", "[verdict][exact]") {
  for (const double xi : {0.1, 0.3, 0.6, 0.8}) {
    for (const double beta : {0.5, 2.0, 4.0}) {
      const LevelEvidence e = evidence({.beta = beta, .rho = beta / (2 * (1 - xi)), .kurtosis = 1, .samples = 1e9});
      CAPTURE(xi, beta, e.usable_levels);
      REQUIRE(e.available);
      CHECK(std::abs(e.tail_index - xi) < 0.005);
      CHECK(std::abs(e.beta - beta) < 0.02);
      CHECK(std::abs(e.rho - beta / (2 * (1 - xi))) < 1e-3);
      CHECK(e.error < 0.05);
      CHECK_FALSE(e.polynomial);
      CHECK_FALSE(e.contradicted);
    }
  }
}

TEST_CASE("power laws count levels as powers", "[verdict][exact]") {
  // xi = (rho - beta / 2) / (rho - 1)
  const LevelEvidence light = evidence({.beta = 4, .rho = 2, .kurtosis = 1, .polynomial = true});
  CHECK(light.polynomial);
  CHECK(std::abs(light.tail_index) < 0.05);
  CHECK(verdict({.beta = 4, .rho = 2, .kurtosis = 1, .polynomial = true}).variance == Finiteness::finite);
  const LevelEvidence heavy = evidence({.beta = 4, .rho = 4, .kurtosis = 1, .samples = 1e8, .polynomial = true});
  CHECK(std::abs(heavy.tail_index - 2.0 / 3) < 0.05);
  CHECK(verdict({.beta = 4, .rho = 4, .kurtosis = 1, .samples = 1e8, .polynomial = true}).variance ==
        Finiteness::infinite);
}

TEST_CASE("differences that end bound the values", "[verdict][exact]") {
  const RunVerdict v = verdict({.zero_from = 3});
  CHECK(v.variance == Finiteness::finite);
  CHECK(v.fourth_moment == Finiteness::finite);
  CHECK(v.tail_index == -forever);
  // Ten zeros are not enough to believe it.
  CHECK(verdict({.rho = 3, .samples = 100, .zero_from = 3}).variance == Finiteness::undecided);
}

TEST_CASE("a factor that is a power of the level is not taken for a rate", "[verdict][exact]") {
  // 0.81^k / k^2, the log series: over twenty levels it looks like 0.7^k, or like a power of the level.
  const Table t{.beta = 0.304, .rho = 0.304 / 0.6, .kurtosis = 1, .samples = 1e4, .power = 2};
  CHECK(verdict(t).variance != Finiteness::finite);
  // Levels that fall faster than the declared rate may not be there yet: it does not make them finite.
  Statistics s = statistics_of(t);
  s.sequence.declared = Rates{t.beta, 0};
  CHECK(judge(s).variance != Finiteness::finite);
}

TEST_CASE("few or noisy levels decide nothing", "[verdict][exact]") {
  const Table base{.beta = 2, .rho = 1.4};
  CHECK(verdict(base).variance == Finiteness::finite);
  Table few = base;
  few.samples = 30;
  CHECK(verdict(few).variance == Finiteness::undecided);
  Table noisy = base;
  noisy.kurtosis = 3e5;
  CHECK(verdict(noisy).variance == Finiteness::undecided);
  Table near = base;
  near.rho = 1.99;
  CHECK(verdict(near).variance == Finiteness::undecided);
}

TEST_CASE("levels that are too rare to be usable can contradict those that are", "[verdict][exact]") {
  Statistics s = statistics_of({.beta = 2, .rho = 1.2, .kurtosis = 3, .samples = 1e5});
  REQUIRE(judge(s).variance == Finiteness::finite);
  for (LevelRow& row : s.levels) {
    if (row.is_base || row.count >= 12) continue;
    row.second_moment *= 1000;
    row.kurtosis *= 1e6;
  }
  const RunVerdict v = judge(s);
  CHECK(v.levels.contradicted);
  CHECK(v.variance == Finiteness::undecided);
}

TEST_CASE("rows without a probability are not usable", "[verdict][exact]") {
  const LevelEvidence none = evidence({.probability_until = 1});
  CHECK_FALSE(none.available);
  const LevelEvidence some = evidence({.probability_until = 6});
  CHECK(some.last_level == 5);
}

TEST_CASE("every sentence has its grade, levels, consequence and advice", "[verdict][exact]") {
  const auto first = [](const Table& t) { return verdict(t).sentences().front(); };
  CHECK_THAT(first({.beta = 2, .rho = 1.2}),
             Catch::Contains("variance finite (shown)") && Catch::Contains("levels 1 to "));
  CHECK_THAT(first({.beta = 2, .rho = 3.5, .samples = 1e8}),
             Catch::Contains("variance INFINITE (") && Catch::Contains("grows by 1.5 octaves a level") &&
                 Catch::Contains("standard error is too small") && Catch::Contains("exponent below 2.0"));
  CHECK_THAT(first({.beta = 2, .rho = 2}),
             Catch::Contains("variance open") && Catch::Contains("too narrow") && Catch::Contains("samples"));
  for (const std::string& sentence : verdict({.beta = 2, .rho = 3.5, .samples = 1e8}).sentences()) {
    CHECK(sentence.back() == '.');
    CHECK(sentence.find('\n') == std::string::npos);
  }
}

TEST_CASE("a PMF that falls more slowly than the work grows is told so, and one that does not is not", "[verdict]") {
  const auto halves = [](std::int64_t level, Stream& rng) {
    const double u = rng.uniform();
    if (level == 0) return base(2 * u, 1);
    const double step = std::exp2(-static_cast<double>(level));
    return coupled(u + step * u, u + 2 * step * u, 1 / step);
  };
  for (const double r : {0.4, 0.6}) {
    const Statistics s = estimate(single_term(halves, Geometric(r)), {.samples = 4096, .seed = 2});
    const RunVerdict v = s.verdict();
    CAPTURE(r, v.sentence());
    CHECK(v.variance == Finiteness::finite);
    CHECK((v.work == Finiteness::infinite) == (r < 0.5));
    const bool is_said = v.sentence().find("expected work is INFINITE") != std::string::npos;
    CHECK(is_said == (r < 0.5));
    CHECK_FALSE(v.levels.ends);
  }
}

TEST_CASE("an infinite variance leaves two degrees of freedom", "[verdict][exact]") {
  const RunVerdict infinite = verdict({.beta = 1, .rho = 1.5});
  CHECK(infinite.variance == Finiteness::infinite);
  CHECK(infinite.degrees <= 2);
  CHECK(verdict({.beta = 2, .rho = 1.5}).degrees > 2);
}

TEST_CASE("only differences that end are said to be zero", "[verdict][exact]") {
  Table t;
  t.zero_from = 5;
  CHECK(verdict(t).levels.ends);
  CHECK_THAT(verdict(t).sentences().front(), Catch::Contains("zero beyond some level"));
  const auto halves = [](std::int64_t level, Stream& rng) {
    const double u = rng.uniform();
    if (level == 0) return base(2 * u, 1);
    const double step = std::exp2(-static_cast<double>(level));
    return coupled(u + step * u, u + 2 * step * u, 1);
  };
  const RunVerdict v = estimate(single_term(halves, Zeta(2.5)), {.samples = 8192, .seed = 3}).verdict();
  CHECK(std::isinf(v.tail_index));  // powers of 2 beside a power of the level
  CHECK_FALSE(v.levels.ends);
  CHECK(v.sentence().find("zero beyond") == std::string::npos);
}

TEST_CASE("the verdict names the samples to replay", "[verdict]") {
  const LabelledCase furnace{"D14", 0.68, catalog::Method::roulette};
  const Statistics run = furnace.run(10'000, 1);
  const RunVerdict v = run.verdict();
  CHECK(v.variance == Finiteness::infinite);
  CHECK_FALSE(v.interval_reliable());
  REQUIRE(v.largest.size() == 3);
  CHECK(v.largest.front() == run.largest.front());
  CHECK(v.deepest_level >= v.largest.front().level);
  CHECK(v.samples_needed == Approx(samples_for_mean(v.tail_index)));
  CHECK(v.rate == Approx(0.3).margin(0.1));
  const std::string all = [&v] {
    std::string text;
    for (const std::string& s : v.sentences()) text += s;
    return text;
  }();
  CHECK_THAT(all, Catch::Contains("index " + std::to_string(run.largest.front().index) + " of level"));
}

TEST_CASE("intervals of a high kurtosis that are called reliable cover", "[verdict][statistical]") {
  // The fourth moment is infinite, and the kurtosis of most runs above 100: their degrees, from the levels, widen them.
  const LabelledCase furnace{"D14", 0.37, catalog::Method::roulette};
  const double truth = catalog::find(furnace.problem).truth;
  int reliable = 0;
  int missed = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    const Statistics s = furnace.run(10'000, seed);
    if (!s.verdict().interval_reliable()) continue;
    ++reliable;
    const Interval i = s.interval();
    missed += truth < i.low || i.high < truth;
  }
  CAPTURE(reliable, missed);
  CHECK(reliable > 200);
  CHECK(missed <= 0.05 * reliable + 4.5 * std::sqrt(0.05 * 0.95 * reliable));
}

TEST_CASE("a high kurtosis alone does not speak against the variance", "[verdict]") {
  // xi = 0.37: finite variance, infinite fourth moment; the kurtosis of most runs is above 100, so that some 100 of 10,000
  // samples carry the variance.
  int flagged = 0;
  int high_kurtosis = 0;
  constexpr int runs = 20;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    const RunVerdict v = LabelledCase{"D14", 0.37, catalog::Method::roulette}.run(10'000, seed).verdict();
    flagged += v.variance != Finiteness::finite ? 1 : 0;
    high_kurtosis += v.kurtosis > 100 ? 1 : 0;
  }
  CHECK(flagged == 0);
  CHECK(high_kurtosis > runs / 2);
}

TEST_CASE("numbers without levels are judged by their tails", "[verdict]") {
  const auto judged = [](auto draw) {
    const auto r = estimate(draw, {.samples = 100'000, .seed = 5, .threads = 1});
    return judge(r.moments, r.upper_tail, r.lower_tail);
  };
  const auto pareto = [](double xi) {
    return [xi](Stream& rng) { return std::expm1(-xi * std::log(rng.uniform())) / xi; };
  };
  CHECK(judged(pareto(0.2)).variance == Finiteness::finite);
  CHECK(judged(pareto(0.8)).variance == Finiteness::infinite);
  CHECK(judged([&](Stream& rng) { return -pareto(0.8)(rng); }).variance == Finiteness::infinite);
  CHECK(judged([](Stream& rng) { return rng.normal(); }).variance == Finiteness::finite);
  CHECK(judged([](Stream& rng) { return rng.uniform() < 0.5 ? 1.0 : 0.0; }).variance == Finiteness::finite);
  CHECK(judged([](Stream&) { return 3.0; }).variance == Finiteness::finite);
  CHECK_FALSE(judged(pareto(0.5)).variance == Finiteness::finite);
}

TEST_CASE("where there is nothing to judge the verdict is undecided", "[verdict]") {
  const auto undecided = [](const RunVerdict& v) {
    return v.variance == Finiteness::undecided && v.fourth_moment == Finiteness::undecided;
  };
  CHECK(undecided(RunVerdict{}));
  CHECK(undecided(judge(Statistics{})));
  CHECK(undecided(judge(Moments{}, {}, {})));
  const auto estimator = single_term(
      [](std::int64_t k, Stream& rng) {
        const double d = std::exp2(-static_cast<double>(k)) * rng.normal();
        return Draw<double>{k == 0 ? d : 1, d, 1};
      },
      Geometric(0.6));
  CHECK(undecided(estimate(estimator, {.samples = 1}).verdict()));
  const auto nan_at = [](double bad) { return [bad](Stream& rng) { return rng.index() == 77 ? bad : rng.uniform(); }; };
  CHECK(undecided(estimate(nan_at(std::nan("")), {.samples = 1000}).verdict()));
  CHECK(undecided(estimate(nan_at(forever), {.samples = 1000}).verdict()));
  CHECK(undecided(estimate(nan_at(1e200), {.samples = 1000}).verdict()));  // its square overflows
  // Scales at which fourth powers leave the doubles change nothing.
  for (const double scale : {0x1p-400, 0x1p400}) {
    const Statistics in_unit = statistics_of({.beta = 2, .rho = 1.2});
    Statistics s = in_unit;
    for (LevelRow& row : s.levels) row.second_moment *= scale * scale;
    CHECK(judge(s).variance == judge(in_unit).variance);
    CHECK(judge(s).grade == judge(in_unit).grade);
  }
}

TEST_CASE("merged results have the verdict of one run", "[verdict]") {
  const auto estimator = single_term(
      series([](std::int64_t k) { return std::exp2(-static_cast<double>(k)); }, geometric_terms(0.5)), Geometric(0.9));
  const auto whole = estimate(estimator, {.samples = 4 * 4096, .seed = 3});
  const auto half_a = estimate(estimator, {.samples = 2 * 4096, .seed = 3});
  const auto half_b = estimate(estimator, {.samples = 2 * 4096, .seed = 3, .first = 2 * 4096});
  const RunVerdict a = whole.verdict();
  const RunVerdict b = merge(half_a, half_b).verdict();
  CHECK(a.tail_index == b.tail_index);
  CHECK(a.error == b.error);
  CHECK(a.upper.k == b.upper.k);
  CHECK(a.sentences() == b.sentences());
}

TEST_CASE("runs with known answers: hardly ever wrong, seldom undecided, calm on light tails",
          "[verdict][statistical][stat]") {
  const std::vector<Tally> t = tally(test::labelled_cases(), {by_verdict, by_plain_k, by_kurtosis}, 10'000, 50);
  CAPTURE(t[0], t[1], t[2]);
  REQUIRE(t[0].cases >= 40);
  CHECK(trustworthy(t[0]));
  CHECK(decisive(t[0]));
  CHECK(calm(t[0]));
  // The power check: what others use fails the same demands.
  CHECK_FALSE(trustworthy(t[1]));
  CHECK_FALSE(trustworthy(t[2]));
}

TEST_CASE("problems that the rule was not built on: hardly ever wrong", "[verdict][statistical][stat]") {
  const std::vector<Tally> t = tally(test::held_out_cases(), {by_verdict, by_plain_k}, 10'000, 25);
  CAPTURE(t[0], t[1]);
  CHECK(100 * t[0].wrong < t[0].runs);
  CHECK(t[0].wrong_by_far <= 1);
  CHECK_FALSE(trustworthy(t[1]));
}

TEST_CASE("runs of a million samples with known answers", "[.long][verdict]") {
  const std::vector<Tally> t = tally(test::labelled_cases(), {by_verdict, by_plain_k, by_kurtosis}, 1'000'000, 50);
  WARN("verdict " << t[0] << "\nplain k " << t[1] << "\nkurtosis " << t[2]);
  CHECK(trustworthy(t[0]));
  CHECK(decisive(t[0]));
  CHECK(calm(t[0]));
}

TEST_CASE("intervals cover where the fourth moment is finite", "[verdict][statistical][stat]") {
  check_coverage({{"D01", 0.2, catalog::Method::roulette}, {"C01", 0.2}}, 5'000);
}

TEST_CASE("where the variance is infinite the verdict knows the intervals that miss", "[verdict][statistical][stat]") {
  check_coverage({{"D14", 0.68, catalog::Method::roulette}, {"B18", 0.7}}, 4'000);
}

TEST_CASE("intervals of more problems cover, or their misses are known", "[.long][verdict]") {
  using enum catalog::Method;
  WARN(check_coverage({{"D01", 0.2, roulette},
                       {"C01", 0.2},
                       {"D14", 0.68, roulette},
                       {"B18", 0.7},
                       {"B02", 0.2},
                       {"A13", 0.2},
                       {"A10", 0.1},
                       {"D14", 0.1, roulette},
                       {"D03", 0, single_term, "zeta:s=2"},
                       {"F02", 0.2},
                       {"D14", 0.56, roulette},
                       {"D02", 0.7, roulette},
                       {"C01", 0.7},
                       {"A10", 0.7},
                       {"A01", 0.7},
                       {"D01", 0.7},
                       {"F01", 0.7},
                       {"D14", 0.8, roulette}}));
}

TEST_CASE("an interval is reliable by its variance, degrees, unseen levels, samples and coupling", "[verdict][exact]") {
  RunVerdict good;
  good.variance = Finiteness::finite;
  good.samples = 1'000'000;
  good.kurtosis = 3;
  CHECK(good.interval_reliable());
  const auto spoilt = [&](auto change) {
    RunVerdict v = good;
    change(v);
    return v.interval_reliable();
  };
  CHECK(spoilt([](RunVerdict& v) { v.unseen_share = 0.4; }));
  CHECK_FALSE(spoilt([](RunVerdict& v) { v.unseen_share = 0.6; }));
  CHECK_FALSE(spoilt([](RunVerdict& v) { v.degrees = 2; }));
  CHECK_FALSE(spoilt([](RunVerdict& v) { v.variance = Finiteness::undecided; }));
  CHECK_FALSE(spoilt([](RunVerdict& v) { v.kurtosis = 1e6; }));
  CHECK_FALSE(spoilt([](RunVerdict& v) { v.wrong_mean = true; }));
}

// [0, 0] and [2.6e-161, 2.6e-161] were called reliable.
TEST_CASE("an interval of zeros alone, or of squares that underflow, is not reliable", "[verdict]") {
  const auto is_reliable = [](const auto& estimator, std::uint64_t seed) {
    const auto r = estimate(estimator, {.samples = 8192, .seed = seed, .threads = 1});
    CAPTURE(r.estimator, r.mean, r.standard_error);
    return r.verdict().interval_reliable();
  };
  const auto rare = [](Stream& rng) { return rng.uniform() < 1e-5 ? 1.0 : 0.0; };
  const auto constant = [](Stream& /*rng*/) { return 3.0; };
  const auto tiny = [](double scale) {
    return function_of_mean([](Stream& rng) { return rng.uniform(); }, [scale](double m) { return scale * m * m; });
  };
  int zeros = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const auto seen = estimate(rare, {.samples = 8192, .seed = seed, .threads = 1});
    zeros += seen.mean == 0;
    CHECK((seen.mean != 0 || !seen.verdict().interval_reliable()));
    for (const double scale : {1e-155, 1e-160, 1e-200, 1e-300}) {
      CHECK_FALSE(is_reliable(single_term(tiny(scale), Geometric::with_exponent(1.5)), seed));
    }
    CHECK_FALSE(is_reliable(recipe(tiny(1e-155)), seed));
    CHECK_FALSE(is_reliable(recipe(tiny(1e-300)), seed));
    CHECK(is_reliable(recipe(tiny(1e-140)), seed));
  }
  CHECK(zeros >= 8);
  CHECK(is_reliable(constant, 1));  // what it says of itself is a warning
}

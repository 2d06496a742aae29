#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "catch_shim.hpp"
#include "validation/unseen.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/zeta.hpp>

using namespace debias;
using namespace debias::validation;

namespace {

constexpr double thousand_claims = 6.1;  // standard errors, at 1e-6 for the whole

struct Sums {
  double n = 0;
  double sum = 0;
  double square = 0;
  void operator()(double x) {
    ++n;
    sum += x;
    square += x * x;
  }
  [[nodiscard]] double mean() const { return sum / n; }
  [[nodiscard]] double error() const { return std::sqrt(std::max(0.0, square / n - mean() * mean()) / n); }
};

struct DrawnSums {
  Sums difference, second, coarse, nonzero, value;
};

DrawnSums draw_level(const UnseenSequence& sequence, std::int64_t level, std::int64_t draws) {
  DrawnSums sums;
  const double unit = sequence.family().unit;
  for (std::int64_t i = 0; i < draws; ++i) {
    Stream rng = split_level(Stream(7, static_cast<std::uint64_t>(i)), level);
    const Draw<double> draw = sequence(level, rng);
    const double d = draw.difference / unit;
    sums.difference(d);
    sums.second(d * d);
    sums.coarse((draw.value - draw.difference) / unit);
    sums.value(draw.value / unit);
    sums.nonzero(d != 0 ? 1 : 0);
  }
  return sums;
}

double z_of(const Sums& sums, double truth, double rounding) {
  return std::abs(sums.mean() - truth) / std::max(sums.error(), rounding * 1e-13 + 1e-300);
}

/// A report of 40 families of seed 3, 20 seeds each, with these opinions.
template <class Answer>
UnseenReport report_of(const Answer& answer) {
  UnseenReport report;
  report.seed = 3;
  report.seeds = 20;
  report.samples = 1 << 16;
  for (int i = 0; i < 40; ++i) {
    const Family family = draw_family(3, i);
    report.families.push_back({family, labels_of(UnseenSequence(family), report.samples)});
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      report.runs.push_back(judge_run(report.families.back(), seed, answer(report.families.back(), seed)));
    }
  }
  report.gates = gates_of(report);
  return report;
}

/// Knows the labels, and draws its intervals as the best PMF would, times `width`, with errors times `error`.
Opinion oracle(const UnseenFamily& f, std::uint64_t seed, double width = 1, double error = 1) {
  Opinion opinion;
  opinion.answer = f.labels.exists ? Said::yes : Said::no;
  opinion.grade = Certainty::shown;
  opinion.variance_finite = Said::yes;
  opinion.variance_grade = Certainty::shown;
  opinion.refused = !f.labels.exists;
  if (opinion.refused) return opinion;
  opinion.work = 1 << 16;
  const double best = f.labels.root_of_price / std::sqrt(opinion.work);
  Stream rng = Stream(seed, static_cast<std::uint64_t>(f.family.index));
  opinion.mean = f.labels.truth + best * error * rng.normal();
  opinion.low = opinion.mean - 1.96 * best * width;
  opinion.high = opinion.mean + 1.96 * best * width;
  opinion.reliable = true;
  return opinion;
}

const Gate& gate(const UnseenReport& report, const std::string& start) {
  for (const Gate& g : report.gates) {
    if (g.name.rfind(start, 0) == 0) return g;
  }
  FAIL("no gate " << start);
  throw 0;
}

}  // namespace

TEST_CASE("every level of an unseen family has the moments that its closed form states", "[validation][statistical]") {
  constexpr std::int64_t draws = 8000;
  int means = 0;
  int seconds = 0;
  for (int index = 0; index < 40; ++index) {
    const UnseenSequence sequence(draw_family(11, index));
    for (const std::int64_t level : {0, 1, 2, 3, 6, 11}) {
      CAPTURE(index, level, sequence.family().description());
      const LevelTruth truth = sequence.level(level);
      const DrawnSums sums = draw_level(sequence, level, draws);
      const double size = std::abs(truth.mean) + std::abs(truth.difference) + 1;
      CHECK(std::abs(sums.nonzero.mean() - truth.nonzero) <
            thousand_claims * std::sqrt(truth.nonzero * (1 - truth.nonzero) / draws) + 12.0 / draws);
      const double hits = draws / truth.kurtosis;
      if (truth.nonzero == 0 || hits > 200) {  // else a normal law knows little of the sums
        ++means;
        CHECK(z_of(sums.difference, truth.difference, 0) < thousand_claims);
        CHECK(z_of(sums.value, truth.mean, size) < thousand_claims);
        if (level > 0) CHECK(z_of(sums.coarse, sequence.level(level - 1).mean, size) < thousand_claims);
        CHECK(std::abs(std::sqrt(draws) * sums.value.error() / std::sqrt(truth.variance) - 1) < 0.3);
      }
      if (truth.nonzero > 0 && hits > 1000) {
        ++seconds;
        CHECK(z_of(sums.second, truth.second_moment, 0) < thousand_claims);
        CHECK(z_of(sums.second, truth.second_moment * 1.5, 0) > 4.5);  // power
      }
    }
  }
  CHECK(means > 80);
  CHECK(seconds > 60);
}

TEST_CASE("the truth of an unseen family is the mean of an unbiased estimator of it", "[validation][statistical]") {
  int families = 0;
  int seen = 0;
  for (int index = 0; index < 40; ++index) {
    const UnseenSequence sequence(draw_family(5, index));
    const Family& f = sequence.family();
    const Labels labels = labels_of(sequence, 1 << 16);
    const bool light = f.shape != Shape::pareto && f.heavy_levels == 0 && f.unit > 1e-20 && f.hump_height < 4;
    if (!labels.exists || labels.margin < 0.9 || !light) continue;
    CAPTURE(index, f.description());
    ++families;
    const auto z = [&](const auto& pmf) {
      const auto result = estimate(single_term(sequence, pmf), {.samples = 30000, .seed = 3, .threads = 1});
      const double first = sequence.level(1).difference * f.unit;
      if (std::abs(first) > 10 * result.standard_error) {  // without it the truth would be wrong
        ++seen;
        CHECK(std::abs(result.mean - labels.truth + first) > 4.5 * result.standard_error);
      }
      return std::abs(result.mean - labels.truth) / result.standard_error;
    };
    if (f.powers) {
      CHECK(z(Zeta((f.beta + f.gamma) / 2)) < 5);
    } else {
      const double gamma = f.work_powers ? 0 : f.gamma;
      CHECK(z(Geometric(1 - std::exp2(-(std::isfinite(labels.margin) ? (f.beta + gamma) / 2 : 1.2)))) < 5);
    }
  }
  CHECK(families >= 8);
  CHECK(seen >= 5);
}

TEST_CASE("the truth of an unseen family is the sum of its differences, of powers by half a million terms",
          "[validation][exact]") {
  for (const int index : {9, 19, 29, 39, 0, 5, 8, 18}) {
    const UnseenSequence sequence(draw_family(2, index));
    const Family& f = sequence.family();
    CAPTURE(index, f.description());
    const std::int64_t terms = f.powers ? 1 << 19 : 500;
    long double sum = 0;
    for (std::int64_t k = 0; k < terms; ++k) sum += sequence.level(k).difference;
    if (f.powers) {  // the rest by the midpoint rule: relative error 1e-11 of it
      const double s = f.beta / 2 + f.bias_slope;
      const double middle = static_cast<double>(terms) + 0.5;
      const double first = sequence.level(terms).difference;
      sum += first * std::pow((static_cast<double>(terms) + 1) / middle, s) * middle / (s - 1);
      CHECK(std::abs(sequence.level(1000).mean - (sequence.level(999).mean + sequence.level(1000).difference)) <
            1e-14 * (1 + std::abs(sequence.level(1000).mean)));
    }
    CHECK(std::abs(static_cast<double>(sum) * f.unit - sequence.truth()) <= 1e-11 * std::abs(sequence.truth()));
  }
}

TEST_CASE("a PMF is labelled to exist exactly where the tail of the price falls from octave to octave",
          "[validation][exact]") {
  int yes = 0;
  int no = 0;
  for (int index = 0; index < 200; ++index) {
    const UnseenSequence sequence(draw_family(17, index));
    const Labels labels = labels_of(sequence, 1 << 16);
    CAPTURE(index, sequence.family().description());
    const auto octave = [&](std::int64_t first) {
      double sum = 0;
      for (std::int64_t k = first; k < 2 * first; ++k) {
        const LevelTruth level = sequence.level(k);
        sum += std::sqrt(level.second_moment) * std::sqrt(level.work);
      }
      return sum;
    };
    REQUIRE(labels.settled < 100);
    const double early = octave(128);
    const double late = octave(256);
    const bool converges = late < early || (late == 0 && early == 0);
    CHECK(labels.exists == converges);
    CHECK(std::isfinite(labels.root_of_price) == labels.exists);
    ++(labels.exists ? yes : no);
  }
  CHECK(yes > 80);
  CHECK(no > 40);
}

TEST_CASE("families are a pure function of seed and index, of every kind, within the ranges that their header states",
          "[validation][exact]") {
  std::array<int, kinds> seen{};
  int beyond = 0;
  std::set<std::string> texts;
  for (int index = 0; index < 400; ++index) {
    const Family f = draw_family(23, index);
    CHECK(f.description() == draw_family(23, index).description());
    texts.insert(f.description());
    ++seen[static_cast<std::size_t>(f.kind)];
    CAPTURE(index, f.description());
    const Labels labels = labels_of(UnseenSequence(f), 1 << 16);
    beyond += labels.beyond();
    CHECK(std::isfinite(labels.truth));
    CHECK(f.rarity <= 1);
    CHECK(f.unit >= 1e-150);
    CHECK(f.unit <= 1e6);
    const int turn = index / kinds % 4;
    if (f.kind != Kind::end && f.kind != Kind::moments && (f.kind != Kind::polynomial || f.work_powers)) {
      CHECK(labels.margin >= (turn < 2 ? 0.5 : -1.5) - 1e-12);
      CHECK(labels.margin <= (turn == 2 ? -0.5 : 2.2) + 1e-12);
    }
    if (f.powers) CHECK(f.beta > 2.09);
    if (!f.powers && f.factorial == 0 && f.end == 0)
      CHECK(f.beta + f.rarity_slope > 0.29 - (f.rarity_slope < 0 ? 9 : 0));
  }
  for (const int n : seen) CHECK(n == 40);
  CHECK(texts.size() == 400);
  CHECK(beyond > 10);
  CHECK(beyond < 120);
  CHECK(draw_family(23, 0).description() != draw_family(24, 0).description());
}

TEST_CASE("exact binomial bands leave out a millionth", "[validation][exact]") {
  CHECK(binomial_band(400, 0.95).low == 356);
  CHECK(binomial_band(400, 0.95).high == 397);
  CHECK(binomial_band(800, 0.95).low == 727);
  CHECK(binomial_band(800, 0.95).high == 786);
  CHECK(binomial_band(100, 0.9).low == 73);
  CHECK(binomial_band(100, 0.9).high == 100);
  CHECK(binomial_band(0, 0.95).high == 0);
  CHECK(binomial_band(3, 0.95).high == 3);
}

TEST_CASE("a judge that knows passes the gates, and one with a wrong label, a narrow interval or no courage does not",
          "[validation][exact]") {
  const UnseenReport right = report_of([](const auto& f, std::uint64_t seed) { return oracle(f, seed); });
  for (const Gate& g : right.gates) {
    CAPTURE(g.name, g.measured, g.demand);
    CHECK(g.holds);
  }
  CHECK(right.holds());

  SECTION("one family of forty with the wrong label") {
    UnseenReport wrong = right;
    wrong.families[0].labels.exists = false;
    for (UnseenRun& run : wrong.runs) run = judge_run(wrong.family_of(run), run.seed, run.opinion);
    wrong.gates = gates_of(wrong);
    CHECK_FALSE(gate(wrong, "answers shown and wrong").holds);
  }
  SECTION("one good family refused") {
    const UnseenReport wrong = report_of([](const auto& f, std::uint64_t seed) {
      Opinion o = oracle(f, seed);
      if (f.family.index == 10) o.refused = true;
      return o;
    });
    CHECK_FALSE(gate(wrong, "refusals of a good PMF").holds);
  }
  SECTION("likely answers that are wrong in a third") {
    const UnseenReport wrong = report_of([](const auto& f, std::uint64_t seed) {
      Opinion o = oracle(f, seed);
      o.grade = Certainty::likely;
      if (f.family.index % 3 == 0) o.answer = o.answer == Said::yes ? Said::no : Said::yes;
      return o;
    });
    CHECK_FALSE(gate(wrong, "answers likely and wrong").holds);
  }
  SECTION("intervals of two thirds") {
    const UnseenReport wrong = report_of([](const auto& f, std::uint64_t seed) { return oracle(f, seed, 1, 1.5); });
    CHECK_FALSE(gate(wrong, "intervals that cover, answer shown").holds);
    CHECK_FALSE(gate(wrong, "intervals called reliable that miss").holds);
  }
  SECTION("intervals half as wide again") {
    const UnseenReport wrong = report_of([](const auto& f, std::uint64_t seed) { return oracle(f, seed, 1.5, 1.5); });
    CHECK_FALSE(gate(wrong, "median width over the best PMF's, others").holds);
    CHECK(gate(wrong, "intervals that cover, answer shown").holds);
  }
  SECTION("open, always") {
    const UnseenReport wrong = report_of([](const auto& f, std::uint64_t seed) {
      Opinion o = oracle(f, seed, 9, 1);
      o.answer = Said::open;
      o.grade = Certainty::open;
      return o;
    });
    CHECK_FALSE(gate(wrong, "yes, margin 1/2 or more").holds);
    CHECK_FALSE(gate(wrong, "no, margin -1/2 or less").holds);
    CHECK_FALSE(gate(wrong, "median width over the best PMF's, answer open").holds);
  }
  SECTION("a finite variance called infinite") {
    const UnseenReport wrong = report_of([](const auto& f, std::uint64_t seed) {
      Opinion o = oracle(f, seed);
      if (!o.refused && f.family.index < 3) o.variance_finite = Said::no;
      return o;
    });
    CHECK_FALSE(gate(wrong, "verdicts shown and wrong").holds);
  }
}

TEST_CASE("a run over unseen families is the same for any threads, can be interrupted, and prints every family",
          "[validation][exact]") {
  const auto text_of = [](UnseenReport report) {
    report.seconds = 0;
    std::ostringstream out;
    out << report;
    return out.str();
  };
  const std::string one = text_of(run_unseen(29, 4, 1, {.samples = 2048, .threads = 1}));
  CHECK(one == text_of(run_unseen(29, 4, 1, {.samples = 2048, .threads = 3})));
  for (int index = 0; index < 4; ++index) {
    CHECK(one.find(draw_family(29, index).description()) != std::string::npos);
  }
  CHECK_THROWS_AS(run_unseen(29, 4, 1, {.samples = 64, .threads = 1, .progress = [](std::int64_t) { return false; }}),
                  Interrupted);
  CHECK_THROWS_AS(run_unseen(29, 0, 1), std::invalid_argument);
  CHECK_THROWS_AS(run_unseen(29, 1, 0), std::invalid_argument);
}

TEST_CASE("a refusal since levels do not fit 64 bits is no defect, and names what can be drawn",
          "[validation][exact]") {
  Family slow;
  slow.kind = Kind::polynomial;
  slow.powers = slow.work_powers = true;
  slow.beta = 2.3;
  slow.gamma = 0.2;
  for (const Family& family : {slow, draw_family(13944001, 39)}) {
    const Opinion opinion = ask(family, {.samples = 1 << 16, .seed = 1, .threads = 1});
    CHECK(opinion.refused);
    CHECK_FALSE(opinion.failed);
    CHECK(opinion.answer != Said::no);
    CHECK(opinion.refusal.find("does not fit 64 bits") != std::string::npos);
    CHECK(opinion.refusal.find("the PMF zeta:s=") != std::string::npos);
  }
}

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/report.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/multilevel.hpp>
#include <debias/pmf/geometric.hpp>

using namespace debias;
using Catch::Contains;

namespace {

template <class Report>
std::string text_of(const Report& report) {
  std::ostringstream text;
  text << report;
  return text.str();
}

std::ptrdiff_t lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

Statistics made() {
  Statistics s;
  s.estimator = "single_term, geometric:r=0.6, base level 0";
  s.seed = 7;
  s.samples = 1'000'000;
  s.components = {{0.75003, 0.0144, 0.00012}};
  s.work = 4.25e6;
  s.seconds = 0.5;
  return s;
}

/// (E U)^2 from means of 2^k draws.
struct Squares {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const std::int64_t half = level == 0 ? 1 : std::int64_t{1} << (level - 1);
    double a = 0;
    double b = 0;
    for (std::int64_t i = 0; i < half; ++i) a += rng.uniform() / static_cast<double>(half);
    if (level == 0) return base(a * a);
    for (std::int64_t i = 0; i < half; ++i) b += rng.uniform() / static_cast<double>(half);
    return coupled((a + b) * (a + b) / 4, (a * a + b * b) / 2, 2.0 * static_cast<double>(half));
  }
};

}  // namespace

TEST_CASE("a result prints mean, interval, samples, work, seconds and its warnings, and more when asked",
          "[report][exact]") {
  Statistics s = made();
  s.warnings = {{WarningCode::dominant_sample, "mind the tail."}};
  CHECK(text_of(s) ==
        "mean          0.75003(12)   95 % interval [0.7497948, 0.7502652]\n"
        "samples       1000000, seed 7\n"
        "work          4.25e+06\n"
        "seconds       0.5\n"
        "warning       mind the tail.\n");
  CHECK(text_of(full(s)) ==
        "mean          0.75003(12)   95 % interval [0.7497948, 0.7502652]\n"
        "estimator     single_term, geometric:r=0.6, base level 0\n"
        "samples       1000000, seed 7\n"
        "work          4.25e+06 (4.25 per sample)\n"
        "seconds       0.5\n"
        "efficiency    1.39e+08 = 1 / (variance x seconds per sample)\n"
        "warning       mind the tail.\n");
  s.first = 4096;
  s.warnings.clear();
  s.components.push_back({-2, 1, 0.001});
  s.pilot_work = 2.5e5;
  s.pilot_seconds = 0.1;
  CHECK(text_of(s) ==
        "mean          0.75003(12)   95 % interval [0.7497948, 0.7502652]\n"
        "              -2.0000(10)   95 % interval [-2.00196, -1.99804]\n"
        "samples       1000000, seed 7, from index 4096\n"
        "work          4.25e+06, of that 2.5e+05 by the pilot\n"
        "seconds       0.5, of that 0.1 by the pilot\n");
}

TEST_CASE("a stated bias and a missed goal are in the brief report", "[report][exact]") {
  Statistics s = made();
  s.bias_bound = {0.01, "no level beyond 20."};
  s.goal.error = 1e-5;
  CHECK_THAT(text_of(s), Contains("bias          at most 0.01: no level beyond 20.") && Contains("NOT met"));
}

TEST_CASE("a brief report has one line of verdict, a full one levels, tails and largest samples", "[report][exact]") {
  const auto result = estimate(single_term(Squares{}, Geometric(0.6)), {.samples = 20'000, .seed = 3});
  const std::string brief = text_of(result);
  CHECK(lines(brief) == 5 + std::ssize(result.warnings));
  CHECK_THAT(brief, Contains("\nverdict       variance finite"));
  const std::string whole = text_of(full(result));
  for (const char* word :
       {"coupling", "efficiency", "upper tail", "lower tail", "largest", "kurtosis", "E D^2", "base"}) {
    CHECK_THAT(whole, Contains(word));
    CHECK_THAT(brief, !Contains(word));
  }
  // Everything that the brief one says: its figures do not change.
  CHECK(whole.substr(0, whole.find('\n')) == brief.substr(0, brief.find('\n')));
  // Of an interval that is not to be trusted the one line says so.
  const auto rare = [](Stream& rng) { return rng.uniform() < 0.002 ? 1.0 : 0.0; };
  const auto few = estimate(rare, {.samples = 2000, .seed = 1});
  REQUIRE_FALSE(few.verdict().interval_reliable());
  CHECK(text_of(few).find("\nverdict") == text_of(few).rfind("\nverdict"));
  CHECK_THAT(few.verdict().sentence(), Contains("unreliable") || Contains("open"));
}

TEST_CASE("of more than 16 components a report shows three at either end and says how many are left out",
          "[report][exact]") {
  Statistics s = made();
  const auto with = [&s](int n) {
    s.components.clear();
    for (int i = 0; i < n; ++i) s.components.push_back({static_cast<double>(100 + i), 1, 0.1});
    return text_of(s);
  };
  CHECK(lines(with(16)) == 16 + 3);
  CHECK_THAT(with(16), !Contains("left out"));
  const std::string long_one = with(17);
  CHECK(lines(long_one) == 7 + 3);
  CHECK_THAT(long_one, Contains("\n              ... 11 of 17 components are left out ...\n"));
  for (const char* shown : {"100.00(", "101.00(", "102.00(", "114.00(", "115.00(", "116.00("}) {
    CHECK_THAT(long_one, Contains(shown));
  }
  for (const char* hidden : {"103.00(", "113.00("}) CHECK_THAT(long_one, !Contains(hidden));
  CHECK_THAT(with(4000), Contains("... 3994 of 4000"));
  CHECK_THAT(text_of(full(s)), Contains("... 3994 of 4000"));
  MultilevelStatistics m;
  m.rows.push_back({});
  for (int i = 0; i < 40; ++i) m.components.push_back({static_cast<double>(i), 1, 0.1});
  CHECK_THAT(text_of(m), Contains("... 34 of 40") && Contains("39.00(") && !Contains("20.00("));
}

TEST_CASE("no text decides in the library: the codes of warnings do", "[report][exact]") {
  // A sentence that was rewritten loses nothing: add_new() compares codes.
  const auto result = estimate([](Stream&) { return 0.1; }, {.samples = 1000});
  REQUIRE(result.warnings.size() == 1);
  CHECK(result.warnings[0].code == WarningCode::equal_samples);
  CHECK(text_of(result.warnings[0]) == result.warnings[0].text);
  const auto code_of = [](const auto& e, std::int64_t samples = 1000) {
    const auto r = estimate(e, {.samples = samples});
    return r.warnings.empty() ? std::string() : std::string(name_of(r.warnings.front().code));
  };
  CHECK(code_of([](Stream& rng) { return 1e-200 * rng.uniform(); }) == "square_underflow");
  CHECK(code_of([](Stream& rng) { return 1e200 * rng.uniform(); }) == "square_overflow");
  CHECK(code_of([](Stream& rng) { return 1e308 * rng.uniform(); }) == "mean_overflow");
  CHECK(code_of([](Stream& rng) { return rng.uniform() / 0.0; }) == "nonfinite_samples");
  CHECK(code_of([](Stream& rng) { return rng.uniform(); }, 1) == "one_sample");
  CHECK(code_of([](Stream& rng) { return rng.uniform(); }).empty());
}

TEST_CASE("the whole report of a result without a name keeps it", "[report]") {
  const auto run = [] {
    return estimate([](Stream& rng) { return rng.uniform(); }, {.samples = 1000, .seed = 4, .threads = 1});
  };
  const auto whole = [&] { return full(run()); };
  const auto kept = whole();
  std::vector<Statistics> others;  // in what a dangling reference would point at
  for (int i = 0; i < 4; ++i) others.push_back(estimate([](Stream&) { return 1e9; }, {.samples = 100, .threads = 1}));
  std::ostringstream text;
  text << kept;
  const Statistics named = run();
  std::ostringstream expected;
  expected << full(named);
  const auto first_line = [](const std::string& all) { return all.substr(0, all.find('\n')); };
  CHECK(first_line(text.str()) == first_line(expected.str()));
}

// They were "[1e+08, 1e+08]" and "1e+06": the width was lost.
TEST_CASE("far from zero intervals, largest samples and means of levels show where they are", "[report][exact]") {
  Statistics s = made();
  s.components = {{1e8, 1, 0.001}};
  CHECK_THAT(text_of(s), Contains("95 % interval [99999999.99804, 100000000.002]"));
  const auto far = [](std::int64_t level, Stream& rng) {
    const double x = 1e6 + rng.normal();
    return level == 0 ? base(x) : coupled(x, x);
  };
  auto result = estimate(single_term(far, Geometric(0.6)), {.samples = 4000, .seed = 3});
  result.seconds = 1;  // an efficiency is rounded, and must not look like a mean that is
  const std::string text = text_of(full(result));
  CHECK_THAT(text, !Contains("1e+06 ") && Contains("\nlargest       100000"));
}

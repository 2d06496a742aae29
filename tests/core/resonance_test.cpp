#include <debias/core/resonance.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>
#include <debias/survey.hpp>

using namespace debias;

namespace {

constexpr double two_pi = 2 * std::numbers::pi;

bool is_warned(const std::vector<Warning>& warnings) {
  return std::any_of(warnings.begin(), warnings.end(),
                     [](const Warning& w) { return w.code == WarningCode::aliased_differences; });
}

// exp(-integral of 2 + a cos(2 pi periods x) + slope x).
struct Wave {
  double periods;
  double amplitude = 1.9;
  double slope = 0;
  double operator()(double x) const { return -(2 + amplitude * std::cos(two_pi * periods * x) + slope * x); }
  [[nodiscard]] double truth() const { return std::exp(-2 - slope / 2); }
};

// Slats: 3 in a quarter of each period, else nothing.
struct Fence {
  double periods;
  double operator()(double x) const { return periods * x - std::floor(periods * x) < 0.25 ? -3 : 0; }
  [[nodiscard]] static double truth() { return std::exp(-0.75); }
};

template <class F>
auto transmitted(const F& f) {
  return function_of_integral(f, functions::Exp{});
}

// Wrong by more than five standard errors and rounding, and silent.
template <class R>
bool is_silently_wrong_of(const R& r, double truth) {
  return std::abs(r.mean - truth) > 5 * r.standard_error + 1e-14 * truth && !is_warned(r.warnings);
}
template <class F>
bool is_silently_wrong(const F& f, std::uint64_t seed, std::int64_t samples) {
  const auto r = estimate(single_term(transmitted(f)), {.samples = samples, .seed = seed, .threads = 1});
  return is_silently_wrong_of(r, f.truth());
}

// The same by a recipe.
template <class F>
bool recipe_is_silently_wrong(const F& f, std::uint64_t seed, std::int64_t samples) {
  const auto r = estimate(recipe(transmitted(f)), {.samples = samples, .seed = seed, .threads = 1});
  return is_silently_wrong_of(r, f.truth());
}

}  // namespace

// One batch in fifty is three of its errors off: 12 of these 800 runs were warned of.
TEST_CASE("integrands that are in step with nothing are not warned of", "[core][resonance][statistical]") {
  const auto warned_of = [](const auto& sequence, int runs, std::int64_t samples) {
    int warned = 0;
    for (int i = 0; i < runs; ++i) {
      const auto seed = 5000 + static_cast<std::uint64_t>(i);
      warned += is_warned(estimate(recipe(sequence), {.samples = samples, .seed = seed, .threads = 1}).warnings);
    }
    return warned;
  };
  int warned = warned_of(
      function_of_integral([](double x) { return std::exp(x); }, [](double m) { return std::log(m); }), 200, 20'000);
  warned += warned_of(function_of_integral([](double x) { return 1 / (1 + x); }, [](double m) { return m * m; }), 200,
                      20'000);
  warned += warned_of(
      function_of_integral([](double x) { return std::sqrt(x); }, functions::ExpMinus{}, {.rates = Rates{3, 1}}), 200,
      20'000);
  // Written after the rule was fixed.
  warned += warned_of(
      function_of_integral([](double x) { return x * std::cos(3 * x); }, [](double m) { return std::exp(2 * m); }), 200,
      8'000);
  CHECK(warned <= 1);
}

// No level has a bias, and all differences vanish.
TEST_CASE("a linear function of an integral is in step with nothing, and its interval is narrow", "[core][resonance]") {
  const auto plan = [](std::uint64_t seed) { return Plan{.samples = 20'000, .seed = seed, .threads = 1}; };
  const auto covered = [&](const auto& estimator, double truth) {
    int all = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const auto r = estimate(estimator, plan(seed));
      CHECK_FALSE(is_warned(r.warnings));
      all += r.interval().low <= truth && truth <= r.interval().high;
    }
    return all;
  };
  const auto square = function_of_integral([](double x) { return x * x; }, [](double m) { return m; });
  CHECK(covered(single_term(square), 1. / 3) >= 15);
  CHECK(covered(recipe(square), 1. / 3) >= 15);
  const auto r = estimate(recipe(square), plan(1));
  CHECK(r.verdict().interval_reliable());
  CHECK(r.interval().high - r.interval().low < 6 * r.standard_error);
  // Of independent points nothing tells a linear g from one that is not where values are rare: a wide interval.
  const auto line = function_of_mean([](Stream& rng) { return rng.exponential(); }, [](double m) { return 5 - 3 * m; });
  CHECK(covered(single_term(line), 2) == 20);
  CHECK(covered(recipe(line), 2) == 20);
  CHECK(survey(line, 8, {.samples = 2000, .seed = 1, .threads = 1}).pmf_exists == Answer::yes);
}

TEST_CASE("a merged run keeps what its parts found and what that took", "[core][resonance][exact]") {
  const auto e = single_term(transmitted(Wave{.periods = 1024}));
  const auto part = [&](std::int64_t first, std::int64_t samples) {
    return estimate(e, {.samples = samples, .seed = 3, .first = first, .threads = 1});
  };
  const auto a = part(0, 4096);
  const auto b = part(4096, 8192);
  CHECK(a.pilot_work > 0);
  const auto merged = merge(b, a);
  CHECK(merged.pilot_work == a.pilot_work + b.pilot_work);
  CHECK(merged.work == a.work + b.work);
  CHECK(is_warned(b.warnings));
  CHECK(is_warned(merged.warnings));
}

// A pilot's doubts were lost by merge and extend.
TEST_CASE("a doubt of the levels outlives merge and extend, one of the samples is judged again", "[core][exact]") {
  const auto e = single_term(transmitted(Wave{.periods = 3.3}));
  const auto part = [&](std::int64_t first, std::int64_t samples) {
    return estimate(e, {.samples = samples, .seed = 3, .first = first, .threads = 1});
  };
  auto a = part(0, 4096);
  const auto b = part(4096, 8192);
  REQUIRE(a.warnings.empty());
  REQUIRE(b.warnings.empty());
  const std::vector<Warning> doubts = {{WarningCode::coupling, "of a pilot"},
                                       {WarningCode::no_second_moment, "of level 3"},
                                       {WarningCode::no_second_moment, "of level 4"}};
  a.warnings = doubts;
  a.warnings.push_back({WarningCode::uncertain_error, "of few samples"});
  CHECK(merge(b, a).warnings == doubts);
  CHECK(merge(a, b).warnings == doubts);
  const auto longer = extend(e, a, {.samples = 10'000, .threads = 1});
  CHECK(longer.warnings == doubts);
  CHECK(longer.has_wrong_mean());
}

TEST_CASE("an integrand in step with the comb is warned of: 1024 periods under exp", "[resonance]") {
  const Wave wave{1024};
  const auto r = estimate(single_term(transmitted(wave)), {.samples = 1 << 14, .seed = 1});
  CHECK(std::abs(r.mean - wave.truth()) > 20 * r.standard_error);  // it is wrong, and looks right
  CHECK(is_warned(r.warnings));
}

TEST_CASE("cos(128 x)^2 over [0, pi] is warned of", "[resonance]") {
  const auto f = [](double x) { return -std::pow(std::cos(128 * x), 2); };
  const auto r = estimate(single_term(function_of_integral(f, functions::Exp{}, {.to = std::numbers::pi})),
                          {.samples = 1 << 14, .seed = 1});
  CHECK(std::abs(r.mean - std::exp(-std::numbers::pi / 2)) > 5 * r.standard_error);
  CHECK(is_warned(r.warnings));
}

TEST_CASE("no period q 2^m is more than five standard errors off without a warning", "[resonance][stat]") {
  for (const int q : {1, 3, 5, 7, 9}) {
    for (int m = 0; m <= 12; ++m) {
      const double periods = q * std::exp2(m);
      for (std::uint64_t seed = 1; seed <= 2; ++seed) {
        CAPTURE(q, m, seed);
        CHECK_FALSE(recipe_is_silently_wrong(Wave{periods}, seed, 1 << 13));
        CHECK_FALSE(recipe_is_silently_wrong(Wave{periods, 0.4, 1}, seed, 1 << 13));
        CHECK_FALSE(recipe_is_silently_wrong(Fence{periods}, seed, 1 << 13));
        CHECK_FALSE(is_silently_wrong(Wave{periods}, seed, 1 << 13));
        CHECK_FALSE(is_silently_wrong(Wave{periods, 0.4, 1}, seed, 1 << 13));
        CHECK_FALSE(is_silently_wrong(Fence{periods}, seed, 1 << 13));
      }
    }
  }
}

// Every door of 1 / (q 2^m) over 20 seeds. A survey has no answer of its own: it is wrong where the limit lies farther from its
// last level than its last differences explain.
TEMPLATE_TEST_CASE_SIG(
    "no period q 2^m is more than five standard errors off without a warning by any door over 20 seeds",
    "[resonance][.long]", ((int q), q), 1, 3, 5, 7, 9) {
  using F = std::function<double(double)>;
  constexpr std::int64_t samples = 1 << 13;
  std::map<std::string, int> runs;
  std::map<std::string, int> wrong;
  std::map<std::string, int> silent;
  const auto count = [&](const std::string& door, bool is_wrong, bool warned) {
    ++runs[door];
    wrong[door] += is_wrong;
    silent[door] += is_wrong && !warned;
    return !(is_wrong && !warned);
  };
  const auto is_off = [](double mean, double error, double truth) {
    return std::abs(mean - truth) > 5 * error + 1e-13 * truth;
  };
  const auto by_all_doors = [&](const F& f, double truth, std::uint64_t seed) {
    const auto levels = transmitted(f);
    const auto judged = [&](const std::string& door, const auto& r) {
      CHECK(count(door, is_off(r.mean, r.standard_error, truth), is_warned(r.warnings)));
    };
    const Plan plan{.samples = samples, .seed = seed, .threads = 1};
    const Plan goal{.seed = seed, .threads = 1, .goal = {.relative_error = 3e-2}};
    judged("pmf", estimate(single_term(levels), plan));
    const auto base_level = static_cast<std::int64_t>(1 + seed % 7);
    judged("pmf and base level", estimate(single_term(levels, Geometric(0.75), {.base_level = base_level}), plan));
    judged("pmf and goal", estimate(single_term(levels), goal));
    judged("recipe", estimate(recipe(levels), plan));
    judged("recipe and goal", estimate(recipe(levels), goal));
    const MultilevelStatistics m = multilevel(levels, 1e-2 * truth, {.seed = seed, .threads = 1});
    CHECK(count("multilevel", is_off(m.components.front().mean, m.error(), truth), is_warned(m.warnings)));
    const Survey s = survey(levels, 8, {.samples = 1024, .seed = seed, .threads = 1});
    const SurveyRow& last = s.rows.back();
    double explained = 0;
    for (std::size_t k = 5; k < 8; ++k) explained = std::max(explained, 8 * std::sqrt(s.rows[k].second_moment));
    const bool is_wrong = std::abs(last.mean - truth) > explained + 5 * last.mean_error + 1e-13 * truth;
    CHECK(count("survey", is_wrong, s.pmf_exists == Answer::open && is_warned(s.remarks)));
  };
  for (int m = 0; m <= 12; ++m) {
    const double periods = q * std::exp2(m);
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      CAPTURE(q, m, seed);
      by_all_doors(Wave{periods}, Wave{periods}.truth(), seed);
      const Wave added{periods, 0.4, 1};
      by_all_doors(added, added.truth(), seed);
      by_all_doors(Fence{periods}, Fence::truth(), seed);
      by_all_doors([fence = Fence{periods}](double x) { return fence(x) - x * x; }, Fence::truth() * std::exp(-1.0 / 3),
                   seed);
    }
  }
  for (const auto& [door, n] : runs) {
    WARN(door << ": runs " << n << ", wrong " << wrong[door] << ", silent " << silent[door]);
    CHECK(wrong[door] > n / 20);  // there is something to be warned of
  }
}

TEST_CASE("smooth integrands, and functions without bias, are not warned of", "[resonance]") {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto smooth = [](double x) { return -1 - std::sin(2 * x); };
    CHECK_FALSE(is_warned(estimate(single_term(transmitted(smooth)), {.samples = 1 << 12, .seed = seed}).warnings));
    const auto linear = [](double m) { return 3 * m; };
    CHECK_FALSE(is_warned(
        estimate(single_term(function_of_integral(Wave{1024}, linear)), {.samples = 1 << 12, .seed = seed}).warnings));
  }
}

TEST_CASE("survey, recipe and multilevel warn of it as well", "[resonance]") {
  const auto levels = transmitted(Wave{4096});
  const Survey s = survey(levels, 8, {.samples = 1024});
  CHECK(is_warned(s.remarks));
  CHECK(s.pmf_exists == Answer::open);
  CHECK(is_warned(estimate(recipe(levels), {.samples = 1 << 13}).warnings));
  const MultilevelStatistics m = multilevel(levels, 1e-2);
  CHECK(is_warned(m.warnings));
  CHECK_FALSE(m.goal_met());
}

TEST_CASE("of what batches see, what deeper levels have added is no news", "[resonance][exact]") {
  // 3 means see two thirds of it: 6, 6, 7.5 and 6 are the whole.
  CHECK(detail::left_out({4, 4, 5, 4}, 3, 0).size == 6.375);
  CHECK(detail::left_out({4, 4, 5, 4}, 3, 0).noise == 0.375);
  CHECK(detail::left_out({4, 4, 5, 4}, 3, 6).size == 0.375);
  CHECK(detail::left_out({4, 4, 5, 4}, 3, 20).size == 0);  // more was found: the batches miss what is rare
  CHECK(detail::left_out({4, 4, 5, 4}, 3, -20).size == 6.375);
  CHECK(detail::left_out({-4, -4, -5, -4}, 3, -2).size == -4.375);
  CHECK(detail::left_out({1, 1, 1, std::nan("")}, 3, 0).size == 0);
}

TEST_CASE("it is seen beyond three times the error of the answer and its own noise", "[resonance][exact]") {
  CHECK(detail::LeftOut{15.1, 4}.is_seen(3));
  CHECK(detail::LeftOut{-15.1, 4}.is_seen(3));
  CHECK_FALSE(detail::LeftOut{14.9, 4}.is_seen(3));
  CHECK_FALSE(detail::LeftOut{15.1, 4}.is_seen(std::nan("")));
  // One batch of eight that met something is noise.
  CHECK_FALSE(detail::left_out({0, 0, 0, 0, 0, 0, 0, 5}, 8, 0).is_seen(0));
}

TEST_CASE("a check reads the base, the last level and one between them, each once", "[resonance][exact]") {
  CHECK(detail::levels_to_check(2, 8) == std::vector<std::int64_t>{2, 5, 8});
  CHECK(detail::levels_to_check(2, 3) == std::vector<std::int64_t>{2, 3});
  CHECK(detail::levels_to_check(4, 4) == std::vector<std::int64_t>{4});
}

TEST_CASE("the look-ups of the check count in the work of a result, of combs only", "[resonance][exact]") {
  const Plan plan{.samples = 1 << 12};
  const auto own = [](const Statistics& s) {
    double work = 0;
    for (const LevelRow& row : s.levels) work += static_cast<double>(row.count) * row.work;
    return work;
  };
  const auto f = [](double x) { return -1 - std::sin(2 * x); };
  const auto comb = estimate(single_term(transmitted(f)), plan);
  CHECK(comb.pilot_work > 0);
  CHECK(comb.pilot_work <= std::max(own(comb) / 16, 4096.0));
  CHECK(comb.work == own(comb) + comb.pilot_work);
  const auto jittered = estimate(single_term(function_of_jittered_integral(f, functions::Exp{})), plan);
  CHECK(jittered.pilot_work == 0);
  CHECK(jittered.work == own(jittered));
}

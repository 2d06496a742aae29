// The split of work between paths and terms.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/report.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>
#include <debias/series.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"

using namespace debias;

namespace {

// Terms x r^k of a path: x = 1 + spread times a uniform number about 0.
auto paths(double ratio, double spread) {
  struct State {
    double x;
    double power;
  };
  return path_series(
      [spread](Stream& rng) {
        return State{1 + spread * (rng.uniform() - 0.5), 1};
      },
      [ratio](const State& s, Stream&) {
        return State{s.x, s.power * ratio};
      },
      [](const State& s) { return s.x * s.power; }, geometric_terms(ratio));
}

double predicted(const WorkSplit& s) { return (s.probe_variance + s.stopping_variance) * s.work; }

template <class E>
double product(const E& e, std::int64_t samples = 1 << 14) {
  const auto r = estimate(e, {.samples = samples, .seed = 5});
  return r.components[0].variance * r.work / static_cast<double>(r.samples);
}

}  // namespace

TEST_CASE("a split says which is the noise, and predicts variance and work", "[recipe][statistical]") {
  const auto noisy = paths(0.8, 2);
  const auto quiet = paths(0.8, 0.02);
  const WorkSplit a = split_work(noisy, {.paths = 1024});
  const WorkSplit b = split_work(quiet, {.paths = 1024});
  CHECK(a.probe_share() > 0.5);
  CHECK(a.sentence().find("probes are the noise") != std::string::npos);
  CHECK(b.base_level > a.base_level);
  CHECK(product(estimator_of(noisy, a)) == Approx(predicted(a)).epsilon(0.3));
  CHECK(product(estimator_of(quiet, b)) == Approx(predicted(b)).epsilon(0.3));
  // no worse than the roulette of the declared rates, and much better where a prefix pays
  CHECK(product(estimator_of(noisy, a)) < 1.05 * product(roulette(noisy)));
  CHECK(product(estimator_of(quiet, b)) < 0.2 * product(roulette(quiet)));
  // a few paths choose nearly as well
  CHECK(product(estimator_of(noisy, split_work(noisy, {.seed = 3}))) < 1.3 * predicted(a));
}

TEST_CASE("the recipe of a series is unbiased and counts its pilot", "[recipe][statistical]") {
  const auto terms = paths(0.8, 2);
  const auto r = estimate(recipe(terms), {.samples = 1 << 14, .seed = 8});
  INFO(r);
  CHECK(std::abs(r.mean - 5) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 5.2) > 4.5 * r.standard_error);
  CHECK(r.split.pilot_work > 0);
  const auto alone = estimate(estimator_of(terms, r.split), {.samples = 1 << 14, .seed = 8});
  CHECK(r.mean == alone.mean);
  CHECK(r.work == alone.work + r.split.pilot_work);
}

TEST_CASE("a split without noise of the paths takes all terms that the pilot saw, and terms that are none are refused",
          "[recipe][exact]") {
  const WorkSplit s = split_work(paths(0.5, 0));
  CHECK(s.probe_variance == 0);
  CHECK(s.base_level > 20);
  CHECK_THROWS_AS(split_work(paths(0.5, 1), {.paths = 1}), std::invalid_argument);
  CHECK_THROWS_AS(split_work(paths(0.5, std::numeric_limits<double>::quiet_NaN())), std::invalid_argument);
}

// "finite (shown)" stood beside a pilot's "the answer is likely and not shown", and a half sentence beside no bound.
TEST_CASE("a report by a recipe does not contradict itself", "[recipe][exact]") {
  int shown = 0;
  int doubted = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const auto terms = [](std::int64_t k, Stream& rng) {
      return std::pow(0.7, static_cast<double>(k)) * rng.exponential();
    };
    const auto result =
        estimate(recipe(series(terms, geometric_terms(0.7))), {.samples = 20'000, .seed = seed, .threads = 1});
    const auto has = [](const std::vector<Warning>& warnings) {
      return std::any_of(warnings.begin(), warnings.end(),
                         [](const Warning& w) { return w.code == WarningCode::no_second_moment; });
    };
    if (result.verdict().grade != Grade::shown) continue;
    ++shown;
    doubted += has(result.advice.warnings);
    CHECK_FALSE(has(result.warnings));
  }
  CHECK(shown > 0);
  CHECK(doubted > 0);                       // else nothing was tested
  for (const double spread : {0.0, 1.0}) {  // without a variance there is no bound to compare with
    const auto terms = [spread](std::int64_t k, Stream& rng) {
      return std::exp2(-static_cast<double>(k)) * (1 + spread * rng.uniform());
    };
    std::ostringstream text;
    text << full(estimate(recipe(series(terms, geometric_terms(0.5))), {.samples = 20'000, .threads = 1}));
    const std::size_t at = text.str().find(" and are not stratified");
    const std::string of_bound = " of draws that share nothing";
    CHECK((at == std::string::npos || text.str().compare(at - of_bound.size(), of_bound.size(), of_bound) == 0));
  }
}

// A PMF whose levels are not drawn as its masses say: every difference has a wrong weight.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/series.hpp>

using namespace debias;

namespace {

// Geometric, but for one slip.
struct Halves {
  [[nodiscard]] double mass(std::int64_t j) const { return std::exp2(-static_cast<double>(j) - 1); }
  [[nodiscard]] double tail(std::int64_t j) const { return std::exp2(-static_cast<double>(j)); }
  [[nodiscard]] std::int64_t sample(double u) const { return Geometric(0.5).sample(u); }
};
struct NotNormalised : Halves {
  [[nodiscard]] double mass(std::int64_t j) const { return std::exp2(-static_cast<double>(j)); }
};
struct SlowerTail : Halves {
  [[nodiscard]] double tail(std::int64_t j) const { return std::pow(0.55, static_cast<double>(j)); }
};
struct OneLevelDeeper : Halves {
  [[nodiscard]] std::int64_t sample(double u) const { return Halves::sample(u) + 1; }
};
struct NeverDeep : Halves {
  [[nodiscard]] std::int64_t sample(double u) const { return std::min<std::int64_t>(4, Halves::sample(u)); }
};
struct NineTenths : Halves {
  [[nodiscard]] double mass(std::int64_t j) const { return j == 2 ? 0.9 / 8 : Halves::mass(j); }
};

auto terms() {
  return series([](std::int64_t k) { return std::pow(0.6, static_cast<double>(k)); });
}
auto mean_of_exponentials() {
  return function_of_mean([](Stream& rng) { return rng.exponential(); }, functions::ExpMinus{});
}

bool is_warned(const Statistics& s) {
  return std::any_of(s.warnings.begin(), s.warnings.end(),
                     [](const Warning& w) { return w.code == WarningCode::wrong_masses; });
}

template <class E>
void check_warned(const E& estimator, std::int64_t samples = 64'000) {
  const auto r = estimate(estimator, {.samples = samples, .seed = 7, .threads = 1});
  CAPTURE(r.estimator);
  CHECK(is_warned(r));
  CHECK(r.has_wrong_mean());
  CHECK_FALSE(r.verdict().interval_reliable());
  CHECK(r.verdict().sentence().find("BIASED") != std::string::npos);
}

}  // namespace

TEST_CASE("a PMF that is not drawn by its masses is warned of by every estimator", "[core][pmf]") {
  check_warned(single_term(terms(), NotNormalised{}));
  check_warned(single_term(terms(), OneLevelDeeper{}));
  check_warned(single_term(terms(), NeverDeep{}));
  check_warned(single_term(terms(), NineTenths{}));
  check_warned(single_term(terms(), NineTenths{}, {.base_level = 3}));
  check_warned(single_term(terms(), NineTenths{}, {.base = Base::one_outcome}));
  check_warned(single_term(mean_of_exponentials(), NineTenths{}));
  check_warned(independent_sum(terms(), SlowerTail{}));
  check_warned(independent_sum(terms(), NeverDeep{}));
  check_warned(stratified(single_term(terms(), NineTenths{}), 16));
}

TEST_CASE("parts whose counts are each by chance are warned of together", "[core][pmf]") {
  struct Close : Halves {
    [[nodiscard]] double mass(std::int64_t j) const { return j == 2 ? 0.97 / 8 : Halves::mass(j); }
  };
  const auto part = [](std::int64_t first, std::int64_t samples) {
    return estimate(single_term(terms(), Close{}), {.samples = samples, .seed = 3, .first = first, .threads = 1});
  };
  const auto a = part(0, 8192);
  const auto b = part(8192, 1 << 20);
  CHECK_FALSE(is_warned(a));
  CHECK(is_warned(merge(a, b)));
}

TEST_CASE("levels that are drawn by their masses are warned of in no run", "[core][pmf]") {
  int warned = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const auto run = [&](const auto& estimator, std::int64_t samples) {
      warned += is_warned(estimate(estimator, {.samples = samples, .seed = seed, .threads = 1}));
    };
    run(single_term(terms(), Halves{}), 3000);
    run(single_term(terms(), Halves{}, {.base = Base::one_outcome}), 3000);
    run(independent_sum(terms(), Halves{}), 3000);
    run(stratified(single_term(terms(), Geometric(0.7)), 16), 3200);
    run(single_term(mean_of_exponentials()), 100);
  }
  CHECK(warned == 0);
}

// Its masses go on below level 0, where nobody asks: they are no outcome of the base.
TEST_CASE("a mass before the first level of a PMF is none of the levels", "[core][pmf][exact]") {
  const auto own = single_term(terms(), Halves{});
  CHECK(own.probability(0) == 0);
  CHECK(own.probability(1) == 0.5);
  const auto as_outcome = single_term(terms(), Halves{}, {.base = Base::one_outcome});
  CHECK(as_outcome.probability(0) == 0.5);
  const Plan plan{.samples = 20'000, .seed = 5, .threads = 1};
  const auto a = estimate(own, plan);
  const auto b = estimate(single_term(terms(), Geometric(0.5)), plan);
  CHECK(a.mean == b.mean);
  CHECK(a.masses.first_level == b.masses.first_level);
  CHECK(a.interval().high == b.interval().high);
}

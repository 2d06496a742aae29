#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/tabulated.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

constexpr Strata all_strata[] = {Strata::systematic, Strata::uniform, Strata::residual};
const Geometric law(0.6);
const laws::EstimatorLawOptions few{.samples = 1 << 12, .samples_per_repeat = 256};

/// Counts the differences of each level.
struct Counter {
  std::map<std::int64_t, std::int64_t> counts;
  void base(std::int64_t level, double, double) { ++counts[level]; }
  void difference(std::int64_t level, double, double) { ++counts[level]; }
};

template <class E>
double member_variance(const E& e, std::int64_t members, std::int64_t block) {
  return estimate(e, {.samples = members / block, .seed = 4}).moments.variance() * static_cast<double>(block);
}

/// Strata that leave the first of them out: level 0 of the law is drawn too often.
template <class E>
struct StratumSkipped : E {
  using E::E;
  std::int64_t level_at(double u) const { return E::level_at(u < 1.0 / 16 ? u + 1.0 / 16 : u); }
};

}  // namespace

TEST_CASE("stratified blocks are unbiased and honest on three sequences, base always or drawn",
          "[stratified][statistical][stat]") {
  const auto check = [](const auto& sequence, double truth) {
    for (const Strata strata : all_strata) {
      for (const Base how : {Base::always, Base::drawn}) {
        for (const std::int64_t block : {1, 16}) {
          CAPTURE(name_of(strata), how == Base::drawn, block);
          CHECK(estimator_laws(stratified(single_term(sequence, law, {.base = how}), block, strata), truth,
                               few) == Failures{});
        }
      }
    }
  };
  check(GeometricSeries{}, GeometricSeries{}.truth());
  check(SquaredMean{}, 1);
  check(Comb{}, Comb{}.truth());
}

TEST_CASE("the laws reject stratified blocks of a law off by one, without weights, or with a stratum left out",
          "[stratified][statistical]") {
  const Geometric steep(0.7);
  const laws::EstimatorLawOptions options{.samples = 1 << 12, .repeats = 0};
  for (const Strata strata : all_strata) {
    const auto rejected = [&](const auto& e) {
      return laws::names(estimator_laws(stratified(e, 16, strata), 1, options), "unbiased");
    };
    CHECK(rejected(single_term(SquaredMean{}, NoReweighting{steep})));
    CHECK(rejected(single_term(SquaredMean{}, LawOffByOne{steep})));
    using E = SingleTerm<SquaredMean, Geometric>;
    if (strata != Strata::residual) {
      CHECK(rejected(StratumSkipped<E>(SquaredMean{}, Geometric(0.4), SingleTermOptions{})));
    }
  }
}

TEST_CASE("every level gets its share of a block: whole parts exactly, fractions in the mean", "[stratified][exact]") {
  const std::int64_t n = 40;
  const auto member = single_term(Steady{}, law, {.base = Base::drawn});
  for (const Strata strata : all_strata) {
    const auto e = stratified(member, n, strata);
    std::map<std::int64_t, std::int64_t> total;
    const std::uint64_t blocks = 4000;
    for (std::uint64_t i = 0; i < blocks; ++i) {
      Stream rng(1, i);
      Counter record;
      e(rng, record);
      std::int64_t members = 0;
      for (const auto& [level, count] : record.counts) {
        const double expected = static_cast<double>(n) * law.mass(level);
        const auto c = static_cast<double>(count);
        CAPTURE(name_of(strata), level, expected, c);
        if (strata == Strata::systematic) REQUIRE(std::abs(c - expected) < 1);
        if (strata == Strata::uniform) REQUIRE(std::abs(c - expected) < 2);
        if (strata == Strata::residual) REQUIRE(c >= std::floor(expected));
        members += count;
        total[level] += count;
      }
      REQUIRE(members == n);
    }
    for (std::int64_t level = 0; level < 8; ++level) {
      const double expected = static_cast<double>(n) * law.mass(level) * static_cast<double>(blocks);
      CHECK(std::abs(static_cast<double>(total[level]) - expected) < 5 * std::sqrt(expected));
    }
  }
}

TEST_CASE("strata take out the variance of choosing the level: n Var Z tends to sum Var D / p",
          "[stratified][statistical]") {
  const Geometric p(0.55);
  double within = SquaredMean::value_variance(0) / p.mass(0);
  double independent = (SquaredMean::value_variance(0) + 1) / p.mass(0) * 1 - 1;
  independent = (SquaredMean::value_variance(0) + std::pow(SquaredMean::value_mean(0), 2)) / p.mass(0) - 1;
  for (std::int64_t k = 1; k < 60; ++k) {
    const double square = SquaredMean::difference_square(k);
    independent += square / p.mass(k);
    within += (square - std::pow(SquaredMean::difference_mean(k), 2)) / p.mass(k);
  }
  const auto member = single_term(SquaredMean{}, p, {.base = Base::drawn});
  const std::int64_t members = 1 << 18;
  CHECK(member_variance(member, members, 1) == Approx(independent).epsilon(0.05));
  for (const Strata strata : all_strata) {
    const double measured = member_variance(stratified(member, 64, strata), members, 64);
    CAPTURE(name_of(strata), within, independent);
    CHECK(measured == Approx(within).epsilon(strata == Strata::residual ? 0.12 : 0.06));
    CHECK(measured < 0.85 * independent);
  }
}

TEST_CASE("a block of one, its name, its replay and its refusals", "[stratified][exact]") {
  const auto member = single_term(SquaredMean{}, law);
  CHECK(stratified(member, 64).describe() ==
        "stratified in blocks of 64 (systematic), single_term, geometric:r=0.6, base level 0");
  CHECK_THROWS_WITH(stratified(member, 0), Catch::Contains("block = 0"));
  const auto e = stratified(member, 8);
  const auto once = trace(e, 3, 17);
  CHECK(once.levels.size() == 16);
  const auto run = estimate(e, {.samples = 64, .seed = 3});
  CHECK(run.samples == 64);
  CHECK(run.levels.front().count == 8 * 64);
  CHECK(run.levels.at(1).probability == 0.6);
}

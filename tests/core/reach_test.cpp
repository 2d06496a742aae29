// Whether a run can be drawn is decided from PMF, base level and number of samples, never from the seed.

#include <debias/core/reach.hpp>

#include <cmath>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/derivative.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/progressive.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/multilevel.hpp>
#include <debias/pmf/any.hpp>
#include <debias/pmf/radius.hpp>
#include <debias/pmf/zeta.hpp>
#include <debias/recipe.hpp>
#include <debias/sde.hpp>
#include <debias/series.hpp>
#include <debias/survey.hpp>

using Catch::Contains;
using namespace debias;

namespace {

// I_k = 1 - 2^-k with a little noise: levels that double their work and end at `deepest`.
struct Halving {
  std::int64_t deepest = 24;
  Rates rates{2, 1};

  [[nodiscard]] std::int64_t deepest_level() const { return deepest; }
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    if (level > deepest) throw std::length_error("level " + std::to_string(level) + " is too large");
    const double noise = rng.uniform() + 0.5;
    const double d = std::exp2(-static_cast<double>(level)) * noise;
    return {1 - d, level == 0 ? 1 - d : d, std::exp2(static_cast<double>(level))};
  }
};

// The same without a stated limit.
struct Silent {
  Rates rates{2, 1};
  Draw<double> operator()(std::int64_t level, Stream& rng) const { return Halving{3}(level, rng); }
};

Geometric falls(double theta) { return Geometric::with_exponent(theta); }

std::string refusal_of(const std::function<void()>& run) {
  try {
    run();
  } catch (const UndrawableError& e) {
    return e.what();
  }
  return "drawn";
}

}  // namespace

TEST_CASE("the chance that one of N samples is too deep is 1 - (1 - t)^N, without cancellation", "[reach][exact]") {
  CHECK(detail::chance_beyond(0x1p-40, 1e6) == Approx(1e6 * 0x1p-40).epsilon(1e-6));
  CHECK(detail::chance_beyond(0.5, 2) == Approx(0.75));
  CHECK(detail::chance_beyond(1, 1) == 1);
  CHECK(detail::chance_beyond(0, 1e15) == 0);
  for (const double n : {1.0, 100.0, 1e6, 1e15}) {
    CHECK(detail::chance_beyond(detail::allowed_beyond(n), n) == Approx(Reach::threshold));
  }
}

TEST_CASE(
    "a run that is likely to need a level that cannot be drawn is refused before it draws anything, whatever the seed",
    "[reach][exact]") {
  // Level 4 + 1 + J > 24 has probability 2^(-1.5 * 20): a chance of 1e-3 at 1.07 million samples.
  const auto shallow = single_term(Halving{}, falls(1.5), {.base_level = 4});
  CHECK(shallow.reach(0).beyond == Approx(0x1p-30).epsilon(1e-6));
  std::int64_t drawn = 0;
  const Plan million{.samples = 4'000'000, .progress = [&](std::int64_t done) {
                       drawn = done;
                       return true;
                     }};
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Plan plan = million;
    plan.seed = seed;
    const std::string why = refusal_of([&] { estimate(shallow, plan); });
    CHECK_THAT(why, Contains("samples = 4000000") && Contains("a level beyond 24") && Contains("is 0.37 %") &&
                        Contains("take at most 1074279 samples") && Contains("geometric:theta=1.6"));
  }
  CHECK(drawn == 0);
  // The numbers of the refusal hold: that many samples, or that PMF, run.
  CHECK(refusal_of([&] { detail::require_reach(shallow.reach(0), 1'074'279); }) == "drawn");
  CHECK(refusal_of([&] { detail::require_reach(shallow.reach(0), 1'074'280); }) != "drawn");
  const auto steeper = single_term(Halving{}, AnyPmf::parse("geometric:theta=1.6"), {.base_level = 4});
  CHECK(refusal_of([&] { detail::require_reach(steeper.reach(0), 4'000'000); }) == "drawn");
  const auto too_flat = single_term(Halving{}, AnyPmf::parse("geometric:theta=1.59"), {.base_level = 4});
  CHECK(refusal_of([&] { detail::require_reach(too_flat.reach(0), 4'000'000); }) != "drawn");
}

TEST_CASE("a refusal holds its numbers", "[reach][exact]") {
  try {
    estimate(single_term(Halving{9}, falls(1.5), {.base_level = 4}), {.samples = 1000});
    FAIL("drawn");
  } catch (const UndrawableError& e) {
    CHECK(e.deepest_level() == 9);
    CHECK(e.chance() == Approx(1 - std::pow(1 - std::exp2(-7.5), 1000)));
    CHECK(e.most_samples() == 0);
    CHECK_THAT(e.what(), Contains("not even one sample can be drawn; take the PMF "));
    CHECK_FALSE(e.pmf().empty());
    // It is named with the price that it has: 19.9 / 5 is above beta.
    CHECK_THAT(e.what(), Contains("whose variance is infinite"));
  }
}

TEST_CASE("every estimator with a PMF knows what its level takes, and a block counts its members", "[reach][exact]") {
  const Geometric half(0.5);
  CHECK(single_term(Halving{10}, half).reach(0).beyond == 0x1p-10);                               // 1 + J > 10
  CHECK(single_term(Halving{10}, half, {.base = Base::one_outcome}).reach(0).beyond == 0x1p-11);  // J > 10
  CHECK(independent_sum(Halving{10}, half, {.base_level = 2}).reach(0).beyond == 0x1p-9);
  CHECK(stratified(single_term(Halving{10}, half), 64).reach(0).block == 64);
  CHECK(progressive(Halving{10}, half, {.base_level = 0, .first_step = 1, .doublings = 1}).reach(7).beyond == 0x1p-7);
  CHECK(truncated(Halving{10}, 10).reach(0).beyond == 0);
  CHECK(truncated(Halving{10}, 11).reach(0).beyond == 1);
  CHECK(biased_progressive(Halving{10}, {.base_level = 9, .first_step = 1, .doublings = 1}).reach(2).beyond == 0);
  CHECK(biased_progressive(Halving{10}, {.base_level = 9, .first_step = 1, .doublings = 1}).reach(3).beyond == 1);
  const auto block = stratified(single_term(Halving{10}, Geometric(0.9)), 64);
  const std::string why = refusal_of([&] { estimate(block, {.samples = 1 << 24}); });  // at 1e-10 each
  CHECK_THAT(why, Contains("samples = 16777216 in blocks of 64 (") && Contains("take at most 10004992 samples"));
  CHECK(10'004'992 % 64 == 0);
  CHECK(refusal_of([&] { detail::require_reach(block.reach(0), 10'004'992); }) == "drawn");
  CHECK(refusal_of([&] { detail::require_reach(block.reach(0), 10'004'992 + 64); }) != "drawn");
  CHECK(refusal_of([&] { detail::require_reach(block.reach(0), 1 << 23); }) == "drawn");
  // A base that cannot be drawn is no matter of chance.
  CHECK_THAT(refusal_of([&] { estimate(single_term(Halving{10}, half, {.base_level = 10}), {.samples = 1}); }),
             Contains("every one needs a level beyond 10") && Contains("lower base level"));
}

TEST_CASE("a shard is refused with the run that it belongs to, and an extension as the whole", "[reach][exact]") {
  const auto e = single_term(Halving{14}, falls(1.5), {.base_level = 4});  // 2^-15: 32 samples, and no more
  CHECK(refusal_of([&] { estimate(e, {.samples = 32}); }) == "drawn");
  CHECK(refusal_of([&] { estimate(e, {.samples = 32, .whole = 64}); }) != "drawn");
  const auto half = estimate(e, {.samples = 16});
  CHECK(refusal_of([&] { extend(e, half, {.samples = 32}); }) == "drawn");
  CHECK(refusal_of([&] { extend(e, half, {.samples = 64}); }) != "drawn");
}

TEST_CASE("the samples that a goal asks for are judged like given ones", "[reach][exact]") {
  const auto e = single_term(Halving{20}, falls(1.5), {.base_level = 4});  // 2^-24: 16785 samples
  CHECK(refusal_of([&] { estimate(e, {.goal = {.error = 0.01}}); }) == "drawn");
  CHECK_THAT(refusal_of([&] { estimate(e, {.goal = {.error = 1e-4}}); }), Contains("take at most 16785 samples"));
}

TEST_CASE("a limit that nobody states is still a failure of that sample, and says how to state it", "[reach][exact]") {
  try {
    estimate(single_term(Silent{}), {.samples = 10'000, .threads = 1});
    FAIL("drawn");
  } catch (const SampleError& e) {
    CHECK_THAT(e.what(), Contains("is too large") && Contains("with_deepest_level(sequence, level)"));
  }
  const auto stated = with_deepest_level(Silent{}, 3);
  CHECK(stated.deepest_level() == 3);
  CHECK(stated.rates.variance_decay == 2);
  CHECK_THAT(refusal_of([&] { estimate(single_term(stated), {.samples = 10'000}); }), Contains("a level beyond 3"));
  const auto lambda = with_deepest_level([](std::int64_t level, Stream& rng) { return Halving{3}(level, rng); }, 3);
  CHECK_THAT(refusal_of([&] { estimate(single_term(lambda, Geometric(0.5)), {.samples = 100}); }),
             Contains("a level beyond 3") && Contains("falls faster"));
  CHECK(with_deepest_level(Halving{5}, 30).deepest_level() == 5);
  CHECK_THROWS_AS(with_deepest_level(Silent{}, -1), std::invalid_argument);
}

TEST_CASE("sequences of the library that end somewhere say where", "[reach][exact]") {
  const auto x = [](Stream& rng) { return rng.uniform(); };
  CHECK(function_of_mean(x, functions::Exp{}).deepest_level() == 62);
  CHECK(deepest_level_of(milstein(GeometricBrownianMotion{.start = 1}, [](double s) { return s; })) == 62);
  const auto terms = series([](std::int64_t k) { return std::exp2(-static_cast<double>(k)); }, geometric_terms(0.5));
  CHECK(deepest_level_of(terms) == deepest_of_all);
  CHECK(deepest_level_of(blocks(terms)) == 62);
  CHECK(deepest_level_of(paired(terms)) == deepest_of_all);
  CHECK(deepest_level_of(blocks(paired(terms))) == 62);
  const auto f = [](double t) { return std::sin(t); };
  CHECK(deepest_level_of(finite_difference(f, 1.0)) == deepest_of_all);
  const auto strict = finite_difference(f, 1.0, {.last_level = 5, .beyond = BeyondLast::throws});
  CHECK(deepest_level_of(strict) == 5);
  CHECK_THAT(refusal_of([&] { estimate(single_term(strict), {.samples = 1'000'000}); }), Contains("a level beyond 5"));
  CHECK(deepest_level_of(levels_of(with_deepest_level(terms, 7))) == 7);
  CHECK_THAT(refusal_of([&] { estimate(roulette(with_deepest_level(terms, 7), Geometric(0.5)), {.samples = 1000}); }),
             Contains("a level beyond 7"));
}

TEST_CASE("a Zeta whose levels do not fit 64 bits is drawn as long as none of the samples needs them",
          "[reach][exact]") {
  const auto terms =
      series([](std::int64_t k) { return std::pow(static_cast<double>(k) + 1, -1.6); }, polynomial_terms(1.6));
  for (const double s : {1.05, 1.1, 1.2, 1.3}) {
    const double beyond = Zeta(s).tail(deepest_of_all);
    const std::string why =
        refusal_of([&] { estimate(single_term(terms, Zeta(s), {.base = Base::one_outcome}), {.samples = 1 << 16}); });
    CHECK(beyond > 1e-6);
    CHECK_THAT(why, Contains("a level of 2^62 or more, which does not fit 64 bits") && Contains("zeta:s=1.4"));
  }
  // 1000 samples may take what 65536 may not.
  CHECK(refusal_of([&] { estimate(single_term(terms, Zeta(1.35)), {.samples = 1 << 16}); }) != "drawn");
  CHECK(refusal_of([&] { estimate(single_term(terms, Zeta(1.35)), {.samples = 1000}); }) == "drawn");
  CHECK(refusal_of([&] { estimate(single_term(terms, Zeta(1.45)), {.samples = 1 << 16}); }) == "drawn");
  CHECK(refusal_of([&] { estimate(single_term(terms, RadiusPmf(0.5)), {.samples = 1 << 16}); }) == "drawn");
  CHECK(refusal_of([&] { estimate(single_term(terms, RadiusPmf(2.0 / 3)), {.samples = 1 << 16}); }) != "drawn");
}

TEST_CASE("a recipe chooses within what can be drawn, says the price, and is unbiased",
          "[reach][recipe][statistical]") {
  // E D_k^2 ~ k^-2.8 at constant work: the best s is 1.4, and 2^16 samples can take 1.43.
  const auto noisy = series([](std::int64_t k, Stream& rng) -> double {
    return std::pow(static_cast<double>(k) + 1, -1.4) * (1 + 0.5 * rng.normal());
  });
  constexpr double truth = 3.10554728;  // zeta(1.4)
  const Plan plan{.samples = 1 << 18, .seed = 3};
  const auto result = estimate(recipe(noisy), plan);
  CHECK(result.advice.pmf.spec().find("zeta") == 0);
  CHECK(result.advice.price > 1);
  std::string said;
  for (const Warning& w : result.advice.warnings) said += w.code == WarningCode::deepest_level ? w.text : "";
  CHECK_THAT(said, Contains("no level of 2^62 or more can be drawn") && Contains("times its variance x work"));
  CHECK(std::abs(result.mean - truth) < 4.5 * result.standard_error);
  // Halving differences that end at level 16: the tail is steeper, and a deep base is no choice.
  const auto shallow = estimate(recipe(Halving{16}), {.samples = 1 << 16});
  CHECK(shallow.advice.price > 1);
  CHECK(shallow.advice.exponent.exponent >
        estimate(recipe(Halving{40}), {.samples = 1 << 16}).advice.exponent.exponent);
  CHECK(shallow.advice.exponent.exponent < 2);
  CHECK(std::abs(shallow.mean - 1) < 4.5 * shallow.standard_error);
  // Where nothing is in the way nothing is said.
  CHECK(estimate(recipe(Halving{40}), {.samples = 1 << 16}).advice.price == 1);
}

TEST_CASE("a survey and multilevel keep to the levels that can be drawn", "[reach][exact]") {
  CHECK_THROWS_WITH(survey(Halving{5}, 8, {.samples = 100}), Contains("ask for at most 6"));
  CHECK(survey(Halving{5}, 6, {.samples = 100}).rows.size() == 6);
  const MultilevelStatistics s = multilevel(Halving{5}, 0.01, {.seed = 2});
  CHECK(s.rows.size() == 6);
  CHECK_FALSE(s.converged);
  CHECK_FALSE(s.goal_met());
  CHECK(multilevel(Halving{}, 0.05, {.seed = 2}).goal_met());
}

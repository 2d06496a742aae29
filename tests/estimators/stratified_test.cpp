#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/zeta.hpp>
#include <debias/sde.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

constexpr Strata all_strata[] = {Strata::systematic, Strata::uniform, Strata::residual};
const Geometric pmf(0.6);
const laws::EstimatorLawOptions few{.samples = 1 << 12, .samples_per_repeat = 256};

/// Counts the differences of each level.
struct Counter {
  std::map<std::int64_t, std::int64_t> counts;
  void base(std::int64_t level, double, double) { ++counts[level]; }
  void difference(std::int64_t level, double, double) { ++counts[level]; }
};

template <class E>
double member_variance(const E& e, std::int64_t members, std::int64_t block) {
  const auto r = estimate(e, {.samples = members, .seed = 4});
  CHECK(r.block == block);
  return r.components[0].variance;
}

/// The lower strata in place of the upper ones: shallow levels are left out, the others drawn twice as often.
template <class E>
struct HalfTheStrata : E {
  using E::E;
  std::int64_t level_at(double u) const { return E::level_at(u > 0.5 ? u - 0.5 : u); }
};

/// Differences 2^-k with little noise: the variance of choosing the level is most of what there is.
struct NoisySeries {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double d = power(0.5, level) * (0.75 + rng.uniform() / 2);
    return {2 - 2 * power(0.5, level) + d, d};
  }
  static double difference_variance(std::int64_t level) { return power(0.25, level) / 48; }
};

/// I_k = 1/2 + 2^-k (U - 1/2) by batches: right (0), with differences that do not telescope (1), with every member in the first
/// stratum (2).
template <int mistake>
struct Skewed {
  Draw<double> operator()(std::int64_t level, Stream& rng) const { return draw(level, rng.uniform()); }
  void values(std::int64_t level, StreamBatch& batch, std::span<Term<double>> out) const {
    fill(level, batch, out, false);
  }
  void differences(std::int64_t level, StreamBatch& batch, std::span<Term<double>> out) const {
    fill(level, batch, out, true);
  }

 private:
  static Draw<double> draw(std::int64_t level, double u) {
    if (level == 0) return base(u);
    return {0.5 + power(0.5, level) * (u - 0.5), -power(0.5, level) * (u - 0.5)};
  }
  static void fill(std::int64_t level, StreamBatch& batch, std::span<Term<double>> out, bool difference) {
    std::vector<double> u(out.size());
    batch.uniforms(u);
    for (std::size_t b = 0; b < out.size(); ++b) {
      if (mistake == 2) u[b] = u[0];
      const Draw<double> d = draw(level, u[b]);
      out[b] = {difference ? d.difference : d.value};
      if (mistake == 1 && difference) out[b].value += 0.1 * power(0.5, level);
    }
  }
};

}  // namespace

TEST_CASE("stratified blocks are unbiased and honest on three sequences, base in every sample or one outcome",
          "[stratified][statistical][stat]") {
  const auto check = [](const auto& sequence, double truth) {
    for (const Strata strata : all_strata) {
      for (const Base how : {Base::every_sample, Base::one_outcome}) {
        for (const std::int64_t block : {1, 16}) {
          CAPTURE(name_of(strata), how == Base::one_outcome, block);
          CHECK(estimator_laws(stratified(single_term(sequence, pmf, {.base = how}), block, strata), truth, few) ==
                Failures{});
        }
      }
    }
  };
  check(GeometricSeries{}, GeometricSeries{}.truth());
  check(SquaredMean{}, 1);
  check(Comb{}, Comb{}.truth());
}

TEST_CASE("the laws reject stratified blocks of a PMF off by one, without weights, or with strata left out",
          "[stratified][statistical]") {
  const Geometric steep(0.7);
  const laws::EstimatorLawOptions options{.samples = 1 << 12, .repeats = 0};
  for (const Strata strata : all_strata) {
    const auto rejected = [&](const auto& e) {
      return laws::names(estimator_laws(stratified(e, 16, strata), 1, options), "unbiased");
    };
    CAPTURE(name_of(strata));
    CHECK(rejected(single_term(SquaredMean{}, PmfOffByOne{steep})));
    if (strata == Strata::residual) continue;  // they ask the PMF for its masses, not for its strata
    CHECK(rejected(single_term(SquaredMean{}, NoReweighting{steep})));
    using E = SingleTerm<SquaredMean, Geometric>;
    CHECK(rejected(HalfTheStrata<E>(SquaredMean{}, pmf, SingleTermOptions{})));
  }
}

TEST_CASE("residual strata of a PMF without a falling tail are refused, not searched for ever", "[stratified][exact]") {
  const auto refused = [](const auto& p) {
    CHECK_THROWS_WITH(stratified(single_term(SquaredMean{}, p), 64, Strata::residual),
                      Catch::Contains("residual strata") && Catch::Contains("Strata::systematic"));
  };
  refused(NoReweighting{pmf});
  refused(Zeta(1.1));  // a PMF, but tail(j) = 1 / 64 only at j = 10^18
  stratified(single_term(SquaredMean{}, Zeta(1.5)), 64, Strata::residual);
}

TEST_CASE("every level gets its share of a block: whole parts exactly, fractions in the mean", "[stratified][exact]") {
  const std::int64_t n = 40;
  const auto member = single_term(Steady{}, pmf, {.base = Base::one_outcome});
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
        const double expected = static_cast<double>(n) * pmf.mass(level);
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
      const double expected = static_cast<double>(n) * pmf.mass(level) * static_cast<double>(blocks);
      CHECK(std::abs(static_cast<double>(total[level]) - expected) < 5 * std::sqrt(expected));
    }
  }
}

TEST_CASE("strata take out the variance of choosing the level: n Var Z tends to sum Var D / p",
          "[stratified][statistical]") {
  const Geometric p(0.4);
  double within = 0;
  double independent = -4;  // the square of the mean
  for (std::int64_t k = 0; k < 60; ++k) {
    const double variance = NoisySeries::difference_variance(k);
    within += variance / p.mass(k);
    independent += (variance + power(0.25, k)) / p.mass(k);
  }
  REQUIRE(independent > 4 * within);
  const auto member = single_term(NoisySeries{}, p, {.base = Base::one_outcome});
  const std::int64_t block = 256;
  const std::int64_t members = block << 12;  // the variance of 4096 blocks is known to 2.2 %
  CHECK(member_variance(member, members, 1) == Approx(independent).epsilon(0.05));
  for (const Strata strata : all_strata) {
    const double measured = member_variance(stratified(member, block, strata), members, block);
    CAPTURE(name_of(strata), within, independent);
    CHECK(measured == Approx(within).epsilon(strata == Strata::residual ? 0.2 : 0.15));
  }
}

TEST_CASE("a block takes part in chunks of about a thousand members, with the same bits on any threads",
          "[stratified][exact]") {
  const auto member = single_term(SquaredMean{}, pmf);
  for (const auto& [block, chunk] :
       {std::pair<int, int>{1, 512}, {2, 1024}, {3, 768}, {64, 1024}, {1024, 1024}, {5000, 5000}}) {
    CHECK(stratified(member, block).chunk() == chunk);
  }
  const auto e = stratified(member, 64);
  const std::int64_t n = 300 * 64;
  const auto reference = estimate(e, {.samples = n, .seed = 3, .threads = 1});
  for (const int threads : {2, 3, 7, 64}) {
    const auto run = estimate(e, {.samples = n, .seed = 3, .threads = threads});
    CHECK(run.mean == reference.mean);
    CHECK(run.standard_error == reference.standard_error);
  }
  const auto merged =
      merge(estimate(e, {.samples = n - 1024, .seed = 3, .first = 1024}), estimate(e, {.samples = 1024, .seed = 3}));
  CHECK(merged.mean == reference.mean);
  CHECK(merged.samples == n);
  CHECK(merged.blocks == 300);
  CHECK_THROWS_WITH(merge(estimate(e, {.samples = 17 * 64, .seed = 3}),
                          estimate(e, {.samples = 283 * 64, .seed = 3, .first = 17 * 64})),
                    Catch::Contains("multiple of 1024"));
  RunState blocks(1024, 64);
  CHECK_THROWS_WITH(blocks.merge(RunState()), Catch::Contains("chunks of 1024 in blocks of 64 and of 512"));
  CHECK_THROWS_WITH(RunState(12), Catch::Contains("power of two"));
  CHECK_THROWS_WITH(RunState(192, 64), Catch::Contains("power of two of blocks of 64"));
  CHECK_THROWS_WITH(RunState(1000, 64), Catch::Contains("power of two of blocks of 64"));
  CHECK_NOTHROW(RunState(768, 3));
}

namespace {

/// A block as one sample of work of its own: how samples were counted once.
template <class E>
struct AsOne {
  E e;
  std::int64_t blocks_of_chunk;
  template <Record R>
  auto operator()(Stream& rng, R& record) const {
    return e(rng, record);
  }
  [[nodiscard]] std::int64_t chunk() const { return blocks_of_chunk; }
};

}  // namespace

TEST_CASE("N samples in blocks have the bits of N / block blocks that count as samples", "[stratified][exact]") {
  const auto member = single_term(SquaredMean{}, pmf);
  for (const auto& [block, chunk] : {std::pair<std::int64_t, std::int64_t>{1, 512}, {3, 256}, {64, 16}, {100, 8}}) {
    const auto e = stratified(member, block);
    const AsOne<Stratified<std::remove_cvref_t<decltype(member)>>> one{e, chunk};
    for (const Plan& asked : {Plan{.samples = 700, .seed = 5}, Plan{.samples = 80, .seed = 5, .first = 300},
                              Plan{.seed = 6, .goal = {.error = 0.02}}}) {
      Plan members = asked;
      members.samples *= block;
      members.first *= block;
      const auto blocks = estimate(one, asked);
      const auto samples = estimate(e, members);
      CAPTURE(block, asked.samples, asked.first);
      CHECK(samples.mean == blocks.mean);
      CHECK(samples.standard_error == blocks.standard_error);
      CHECK(samples.moments.m4 == blocks.moments.m4);
      CHECK(samples.work == blocks.work);
      CHECK(samples.upper_tail == blocks.upper_tail);
      CHECK(samples.blocks == blocks.samples);
      CHECK(samples.block == block);
      CHECK(samples.samples == block * blocks.samples);
      CHECK(samples.first == block * blocks.first);
      CHECK(samples.largest.front().index == block * blocks.largest.front().index);
      CHECK(trace(e, asked.seed, samples.largest.front().index).sample.value == samples.largest.front().value);
    }
  }
}

TEST_CASE("samples are members wherever they are counted, in whole blocks", "[stratified][exact]") {
  const auto e = stratified(single_term(SquaredMean{}, pmf), 64);
  const auto run = estimate(e, {.samples = 1000, .seed = 3});
  CHECK(run.samples == 1024);
  CHECK(run.blocks == 16);
  CHECK(run.moments.count == 16);
  CHECK(run.state.last() == 1024);
  CHECK(run.components[0].standard_error ==
        Approx(std::sqrt(run.components[0].variance / static_cast<double>(run.samples))).epsilon(1e-14));
  CHECK(run.efficiency() == Approx(1 / (run.components[0].variance * run.seconds / 1024)).epsilon(1e-12));
  std::ostringstream text;
  text << run;
  CHECK_THAT(text.str(), Catch::Contains("samples       1024 in 16 blocks of 64, seed 3\n"));

  std::int64_t told = 0;
  Plan plan{.samples = 100'000, .seed = 3, .threads = 1};
  plan.progress = [&](std::int64_t done) {
    told = done;
    return true;
  };
  std::int64_t saved = 0;
  std::int64_t planned = 0;
  plan.save = [&](const RunState& state, const Plan& now) {
    saved = state.last();
    planned = now.samples;
  };
  const auto longer = estimate(e, plan);
  CHECK(longer.samples == 100'032);
  CHECK(told == 100'032);
  CHECK(saved == 100'032);
  CHECK(planned == 100'032);
  CHECK(extend(e, run, {.samples = 100'000}).mean == longer.mean);
  CHECK_THROWS_WITH(extend(e, run, {.samples = 900}), Catch::Contains("ask for at least those"));
  CHECK(extend(e, run, {.samples = 1000}).samples == 1024);

  CHECK_THROWS_WITH(estimate(e, {.samples = 64, .first = 100}),
                    Catch::Contains("first = 100 (lies inside a block of 64") && Catch::Contains("take 64"));
  CHECK_THROWS_WITH(estimate(e, {.samples = 0}), Catch::Contains("samples = 0"));
  CHECK_THROWS_WITH(estimate(e, {.samples = std::numeric_limits<std::int64_t>::max()}),
                    Catch::Contains("do not fit 64 bits"));
  const auto one = estimate(e, {.samples = 1});
  CHECK(one.samples == 64);
  REQUIRE(!one.warnings.empty());
  CHECK_THAT(one.warnings.front().text, Catch::Contains("one block of 64 samples has no standard error"));
  CHECK(one.state.block() == 64);
}

TEST_CASE("what goes wrong in a block names its first sample", "[stratified][exact]") {
  const auto breaks = [](double bad) {
    return [bad](std::int64_t level, Stream& rng) {
      const double u = rng.uniform();
      if (rng.index() == 7) {
        if (std::isnan(bad)) throw std::runtime_error("no");
        return base(bad);
      }
      return level == 0 ? base(u) : coupled(u, u / 2);
    };
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  try {
    estimate(stratified(single_term(breaks(nan), pmf), 16), {.samples = 1600, .seed = 3});
    FAIL("drawn");
  } catch (const SampleError& e) {
    CHECK(e.index() == 7 * 16);
  }
  const auto infinite = [](Stream& rng) {
    return rng.index() == 7 ? std::numeric_limits<double>::infinity() : rng.uniform();
  };
  const auto r = estimate(stratified(single_term([&](std::int64_t, Stream& rng) { return base(infinite(rng)); }, pmf,
                                                 {.base = Base::one_outcome}),
                                     16),
                          {.samples = 1600});
  CHECK(r.first_nonfinite == 7 * 16);
  CHECK(r.nonfinite == 1);
  REQUIRE(!r.warnings.empty());
  CHECK_THAT(r.warnings.front().text,
             Catch::Contains("1 of 100 blocks of 16 samples") && Catch::Contains("sample 112"));
}

TEST_CASE("a replay names block and member", "[stratified][exact]") {
  const auto f = [](double x) { return 4 + 3 * std::sin(17 * x); };
  const auto together = stratified(single_term(function_of_integral(f, functions::ExpMinus{}), pmf), 16);
  const auto apart = stratified(single_term(SquaredMean{}, pmf, {.base = Base::one_outcome}), 16);
  const auto check = [](const auto& e, std::size_t levels_of_member) {
    const auto t = trace(e, 3, 16 * 5 + 11);
    CHECK(t.block == 16);
    CHECK(t.first == 80);
    CHECK(t.member == 11);
    std::map<std::int64_t, std::size_t> count;
    for (const TracedLevel& l : t.levels) ++count[l.member];
    CHECK(count.size() == 16);
    for (const auto& [member, levels] : count) CHECK(levels == levels_of_member);
    CHECK(t.sample.value == trace(e, 3, 80).sample.value);
    CHECK(t.sample.value != trace(e, 3, 96).sample.value);
  };
  check(together, 2);
  check(apart, 1);
  const auto plain = trace(single_term(SquaredMean{}, pmf), 3, 91);
  CHECK(plain.block == 1);
  CHECK(plain.first == 91);
  CHECK(plain.member == 0);
}

TEST_CASE("a block of one, its name, its replay and its refusals", "[stratified][exact]") {
  const auto member = single_term(SquaredMean{}, pmf);
  CHECK(stratified(member, 64).describe() ==
        "stratified in blocks of 64 (systematic), single_term, geometric:r=0.6, base level 0");
  CHECK_THROWS_WITH(stratified(member, 0), Catch::Contains("block = 0"));
  const auto e = stratified(member, 8);
  const auto once = trace(e, 3, 17);
  CHECK(once.levels.size() == 16);
  const auto run = estimate(e, {.samples = 512, .seed = 3});
  CHECK(run.samples == 512);
  CHECK(run.levels.front().count == 512);
  CHECK(run.levels.at(1).probability == 0.6);
}

TEST_CASE("members that run together are unbiased and honest, and stratified over their first uniform",
          "[stratified][statistical][stat]") {
  const auto f = [](double x) { return 4 + 3 * std::sin(17 * x); };
  const double tau = 4 + 3 * (1 - std::cos(17.0)) / 17;
  const auto comb = function_of_integral(f, functions::ExpMinus{});
  static_assert(BatchesLevels<decltype(comb)>);
  for (const Strata strata : all_strata) {
    for (const Base how : {Base::every_sample, Base::one_outcome}) {
      for (const std::int64_t block : {1, 200}) {
        CAPTURE(name_of(strata), how == Base::one_outcome, block);
        CHECK(estimator_laws(stratified(single_term(comb, pmf, {.base_level = 2, .base = how}), block, strata),
                             std::exp(-tau), few) == Failures{});
      }
    }
  }
  // The same members one by one: a sequence behind a lambda offers no batch.
  const auto alone = [comb](std::int64_t level, Stream& rng) { return comb(level, rng); };
  const auto together = stratified(single_term(comb, pmf, {.base_level = 2, .base = Base::one_outcome}), 64);
  const auto apart = stratified(single_term(alone, pmf, {.base_level = 2, .base = Base::one_outcome}), 64);
  CHECK(member_variance(together, 1 << 16, 64) < 0.3 * member_variance(apart, 1 << 16, 64));

  const auto call = [](double s) { return std::max(s - 100, 0.0) * std::exp(-0.05); };
  const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2};
  for (const Base how : {Base::every_sample, Base::one_outcome}) {
    CHECK(
        estimator_laws(stratified(single_term(milstein(stock, call), Geometric::with_exponent(1.5), {.base = how}), 64),
                       10.450583572185565, few) == Failures{});
  }
}

TEST_CASE("the laws reject a batch whose differences are off, or whose members are all in the first stratum",
          "[stratified][statistical]") {
  const laws::EstimatorLawOptions options{.samples = 1 << 12, .repeats = 0};
  CHECK(laws::names(estimator_laws(stratified(single_term(Skewed<1>{}, pmf), 16), 0.5, options), "unbiased"));
  CHECK(laws::names(estimator_laws(stratified(single_term(Skewed<2>{}, pmf), 16), 0.5, options), "unbiased"));
  CHECK(estimator_laws(stratified(single_term(Skewed<0>{}, pmf), 16), 0.5, options) == Failures{});
}

TEST_CASE("stratified roulette and independent sums are unbiased", "[stratified][statistical][stat]") {
  const auto terms = [](Stream& rng) {
    return [&rng, k = std::int64_t{0}]() mutable { return Term<double>{2 * rng.uniform() * power(0.5, k++)}; };
  };
  for (const Strata strata : all_strata) {
    CAPTURE(name_of(strata));
    CHECK(estimator_laws(stratified(roulette(terms, Geometric(0.4)), 16, strata), 2, few) == Failures{});
    CHECK(estimator_laws(stratified(independent_sum(GeometricSeries{}, Geometric(0.4)), 16, strata),
                         GeometricSeries{}.truth(), few) == Failures{});
  }
  const auto plain = estimate(roulette(terms, Geometric(0.4)), {.samples = 1 << 16});
  const auto strata = stratified(roulette(terms, Geometric(0.4)), 64);
  CHECK(member_variance(strata, 1 << 16, 64) < plain.moments.variance());
}

// Blocks of nets: unbiased and honest for any sequence, and what is wrong with them is seen.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch_shim.hpp"
#include "core/sobol.hpp"
#include "estimators/sequences.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/points.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/any.hpp>
#include <debias/pmf/dyadic.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/sde.hpp>
#include <debias/series.hpp>
#include <debias/steady_state.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

/// exp(u + v) / (e - 1)^2, of mean 1.
double wave(double u, double v) { return std::exp(u + v) / std::pow(std::exp(1.0) - 1, 2); }

/// I_k = (2 - 2^-k) wave, a lambda as anyone writes it: E I = 2.
const auto waves = [](std::int64_t level, Stream& rng) {
  const double u = rng.uniform();
  const double v = rng.uniform();
  const double d = power(0.5, level) * wave(u, v);
  return Draw<double>{(2 - power(0.5, level)) * wave(u, v), d, power(2, level)};
};

template <class S>
auto nets(const S& sequence, const Dyadic& pmf, Points points = Points::nets, std::int64_t base_level = 0) {
  return stratified(single_term(sequence, pmf, {.base_level = base_level, .base = Base::one_outcome}), pmf.block(),
                    Strata::residual, points);
}

template <class E>
double block_variance(const E& e, std::int64_t blocks = 512) {
  return estimate(e, {.samples = blocks * debias::detail::pieces_of(e).block, .seed = 6}).moments.variance();
}

/// Blocks of `waves` written out, right (none) or wrong on purpose.
enum class Fault { none, weight, twice, instead, raw, one_scramble, one_shift };
struct ByHand {
  Dyadic pmf;
  std::vector<int> log2_counts;
  Fault fault = Fault::none;

  Sample<double> operator()(Stream& rng) const {
    Sample<double> z{0, 0, 0};
    const auto heads = static_cast<std::int64_t>(log2_counts.size());
    for (std::int64_t k = 0; k < heads; ++k) {
      const auto n = static_cast<std::uint64_t>(pmf.copies(k));
      double sum = 0;
      for (std::uint64_t r = 0; r < n; ++r)
        sum += of_point(k, fault == Fault::instead && k == 0 && r == 7 ? 6 : r, rng);
      if (fault == Fault::twice && k == 0) sum += of_point(k, 7, rng);
      z.value += sum / (static_cast<double>(n) + (fault == Fault::weight && k == 0 ? 1 : 0));
    }
    Stream choice = rng.split(1000);
    const std::int64_t level = heads + Geometric::with_exponent(pmf.tail_exponent().exponent).sample(choice.uniform());
    Stream alone = rng.split(2000);
    z.value += waves(level, alone).difference / (pmf.mass(level) * static_cast<double>(pmf.block()));
    z.work = 1;
    return z;
  }

 private:
  double of_point(std::int64_t level, std::uint64_t r, const Stream& rng) const {
    if (fault == Fault::raw) {
      double u[2];
      for (std::size_t t = 0; t < 2; ++t) {
        u[t] = 0x1p-40;
        for (std::uint64_t b = 0; b < 32; ++b) {  // the table has the half in bit 0
          if ((r >> b & 1) == 0) continue;
          for (int i = 0; i < 32; ++i) u[t] += (detail::sobol_table().of_bit[b][t] >> i & 1) * std::ldexp(0.5, -i);
        }
        u[t] = std::fmod(u[t], 1.0);
      }
      return power(0.5, level) * wave(u[0], u[1]);
    }
    Stream net = fault == Fault::one_scramble ? split_level(Stream(1, 0), level)
                 : fault == Fault::one_shift  ? split_level(rng, 0)
                                              : split_level(rng, level);
    Stream point = net.point(r);
    return waves(level, point).difference;
  }
};

const std::vector<int> head = {6, 4, 3, 1};
const Dyadic dyadic(head, 1.25);
const laws::EstimatorLawOptions few{.samples = 1 << 10, .samples_per_repeat = 64};

}  // namespace

TEST_CASE("blocks of nets are unbiased and honest, for lambdas, series, combs and paths", "[nets][statistical][stat]") {
  CHECK(estimator_laws(nets(waves, dyadic), 2, few) == Failures{});
  CHECK(estimator_laws(nets(waves, Dyadic({0}, 1.25)), 2, few) == Failures{});
  CHECK(estimator_laws(nets(SquaredMean{}, Dyadic({3, 5, 2, 4}, 1.5)), 1, few) == Failures{});
  CHECK(estimator_laws(nets(Comb{}, Dyadic({3, 2, 2}, 2), Points::nets, 1), Comb{}.truth(), few) == Failures{});

  const auto f = [](double x) { return 4 + 3 * std::sin(17 * x); };
  const double tau = 4 + 3 * (1 - std::cos(17.0)) / 17;
  const auto comb = function_of_integral(f, functions::ExpMinus{});
  CHECK(estimator_laws(nets(comb, Dyadic({6, 2, 1}, 2.25), Points::nets, 2), std::exp(-tau), few) == Failures{});

  const auto call = [](double s) { return std::max(s - 100, 0.0) * std::exp(-0.05); };
  const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2};
  CHECK(estimator_laws(nets(milstein(stock, call), Dyadic({7, 6, 4, 3}, 1.25)), 10.450583572185565, few) == Failures{});
}

TEST_CASE("nets are unbiased with any strata and PMF, and with roulette", "[nets][statistical][stat]") {
  const auto terms = [](Stream& rng) {
    return [&rng, k = std::int64_t{0}]() mutable { return Term<double>{2 * rng.uniform() * power(0.5, k++)}; };
  };
  const auto single = single_term(waves, Geometric(0.6), {.base = Base::one_outcome});
  for (const Strata strata : {Strata::systematic, Strata::uniform, Strata::residual}) {
    CAPTURE(name_of(strata));
    CHECK(estimator_laws(stratified(single, 40, strata, Points::nets), 2, few) == Failures{});
    CHECK(estimator_laws(stratified(roulette(terms, Geometric(0.4)), 16, strata, Points::nets), 2, few) == Failures{});
  }
}

TEST_CASE("a block of nets is the sum written out, and its wrong relatives are seen", "[nets][statistical][stat]") {
  const auto e = nets(waves, dyadic);
  const ByHand right{dyadic, head};
  // The points are the same, the tail draw is not: beside it the blocks agree.
  struct Heads {
    double sum = 0;
    std::int64_t deepest;
    void base(std::int64_t /*level*/, double value, double) { sum += value / static_cast<double>(dyadic.copies(0)); }
    void difference(std::int64_t level, double d, double) {
      if (level < deepest) sum += d / static_cast<double>(dyadic.copies(level));
    }
  };
  for (std::uint64_t i = 0; i < 5; ++i) {
    Stream one(1, i);
    Heads record{0, static_cast<std::int64_t>(head.size())};
    const auto sample = e(one, record);
    double sum = 0;
    for (std::int64_t k = 0; k < record.deepest; ++k) {
      for (std::int64_t r = 0; r < dyadic.copies(k); ++r) {
        Stream point = split_level(Stream(1, i), k).point(static_cast<std::uint64_t>(r));
        sum += waves(k, point).difference / static_cast<double>(dyadic.copies(k));
      }
    }
    CHECK(record.sum == Approx(sum).epsilon(1e-14));
    CHECK(sample.level >= record.deepest);
  }

  const laws::EstimatorLawOptions means{.samples = 1 << 11, .repeats = 0};
  const laws::EstimatorLawOptions spreads{.samples = 64, .repeats = 200, .samples_per_repeat = 64};
  const auto biased = [&](Fault fault) {
    return laws::names(estimator_laws(ByHand{dyadic, head, fault}, 2, means), "unbiased");
  };
  const auto dishonest = [&](Fault fault) {
    return laws::names(estimator_laws(ByHand{dyadic, head, fault}, 2, spreads), "honest");
  };
  CHECK_FALSE(biased(Fault::none));
  CHECK_FALSE(dishonest(Fault::none));
  CHECK(biased(Fault::weight));
  CHECK(biased(Fault::twice));
  CHECK(biased(Fault::raw));
  // With a deep head, so that the tail does not hide it.
  const std::vector<int> deep = {4, 4, 4, 4, 4, 4, 4, 4, 4, 4};
  const laws::EstimatorLawOptions runs{.samples = 64, .repeats = 200, .samples_per_repeat = 64};
  CHECK(estimator_laws(ByHand{Dyadic(deep, 1.25), deep}, 2, runs) == Failures{});
  CHECK_FALSE(estimator_laws(ByHand{Dyadic(deep, 1.25), deep, Fault::one_scramble}, 2, runs) == Failures{});

  // What no mean shows, a variance does: that of a block is the sum of those of its levels.
  const Dyadic pmf(deep, 1.25);
  const auto variance = [&](Fault fault) { return block_variance(ByHand{pmf, deep, fault}, 2048); };
  const double independent = block_variance(nets(waves, pmf), 2048);
  CHECK(variance(Fault::none) == Approx(independent).epsilon(0.25));  // each is known to 4 %
  CHECK(variance(Fault::one_shift) > 1.6 * independent);
  CHECK(variance(Fault::instead) > 1.6 * independent);
}

TEST_CASE("runs of a fixed number of blocks are unbiased, and of as many as bring the error below a goal are not",
          "[nets][statistical]") {
  // Means and errors of blocks go together where blocks are skewed: a run that ends when its error is small ends low.
  const ByHand block{Dyadic({2, 1}, 1.25), {2, 1}};
  constexpr int runs = 4000;
  constexpr std::int64_t fewest = 32;
  const double goal = std::sqrt(block_variance(block, 4096) / (2 * fewest));
  const auto z = [&](bool extended) {
    double sum = 0;
    double squares = 0;
    for (std::uint64_t run = 0; run < runs; ++run) {
      double mean = 0;
      double spread = 0;  // of blocks about their mean
      std::int64_t n = 0;
      for (std::int64_t wanted = extended ? fewest : 2 * fewest; n < wanted;) {
        Stream rng(1000 + run, static_cast<std::uint64_t>(n));
        const double d = block(rng).value - mean;
        mean += d / static_cast<double>(++n);
        spread += d * d * static_cast<double>(n - 1) / static_cast<double>(n);
        const double count = static_cast<double>(n);
        if (extended && n == wanted && std::sqrt(spread / (count * (count - 1))) > goal) wanted += fewest / 4;
      }
      sum += (mean - 2) / runs;
      squares += (mean - 2) * (mean - 2) / runs;
    }
    return sum / std::sqrt((squares - sum * sum) / runs);
  };
  CHECK(std::abs(z(false)) < 4.5);
  CHECK(z(true) < -4.5);
}

TEST_CASE("the variance of a level of nets falls faster than its members, that of plain ones does not",
          "[nets][statistical]") {
  // Heads deep enough that the tail is nothing beside them.
  const auto variance = [](int m, Points points) {
    std::vector<int> counts;
    for (int k = 0; k < 12; ++k) counts.push_back(std::max(m - k, 2));
    return block_variance(nets(waves, Dyadic(counts, 1.25), points), 256);
  };
  const double plain = variance(4, Points::plain) / variance(8, Points::plain);
  const double netted = variance(4, Points::nets) / variance(8, Points::nets);
  CAPTURE(plain, netted);
  CHECK(plain == Approx(16).epsilon(0.6));
  CHECK(netted > 40);
}

TEST_CASE("chains and random series gain by the first number of each of their steps", "[nets][statistical][stat]") {
  // X = X / 2 + Z: E X^2 = 4 / 3. And the sum of 2 U_k 2^-k, which is 2.
  const auto chain = steady_state([](double x, Stream& rng) { return 0.5 * x + rng.normal(); }, 0.0,
                                  [](double x) { return x * x; }, contraction(0.5));
  const auto terms = series([](std::int64_t k, Stream& rng) { return 2 * rng.uniform() * power(0.5, k); }, Rates{2, 0});
  const Dyadic pmf({8, 8, 7, 6, 5, 4, 3}, 1);
  CHECK(estimator_laws(nets(chain, pmf), 4.0 / 3, few) == Failures{});
  CHECK(estimator_laws(nets(terms, pmf), 2, few) == Failures{});
  // Exact for plain members: 0.0261 of the heads and 0.0052 of the tail draw, which no net touches: of 0.0313 nets can take a factor
  // of 6 at most. A factor of 3 asks that they take one of 5 from the heads; without the coordinates of its steps a chain gains nothing.
  CHECK(block_variance(nets(chain, pmf)) < block_variance(nets(chain, pmf, Points::plain)) / 3);
  CHECK(block_variance(nets(terms, pmf)) < block_variance(nets(terms, pmf, Points::plain)) / 4);
}

TEST_CASE("levels, weights, threads and replay of blocks of nets are those of any block", "[nets][exact]") {
  const auto e = nets(waves, dyadic);
  constexpr std::int64_t block = 64 + 16 + 8 + 2 + 1;
  constexpr std::int64_t n = 40 * block;
  const auto run = estimate(e, {.samples = n, .seed = 3, .threads = 1});
  CHECK(run.samples == n);
  CHECK(run.blocks == 40);
  CHECK(run.levels.front().count == 40 * 64);
  CHECK(run.levels.at(1).count == 40 * 16);
  CHECK(run.levels.at(3).count == 40 * 2);
  CHECK(run.levels.at(1).probability == 16.0 / 91);
  CHECK(estimate(e, {.samples = n, .seed = 3, .threads = 3}).mean == run.mean);
  const auto merged = merge(estimate(e, {.samples = 24 * block, .seed = 3, .first = 16 * block}),
                            estimate(e, {.samples = 16 * block, .seed = 3}));
  CHECK(merged.mean == run.mean);
  const auto once = trace(e, 3, 17 * block + 69);
  CHECK(once.member == 69);
  REQUIRE(once.levels.size() == block);
  Stream member = split_level(Stream(3, 17), 1).point(5);
  CHECK(once.levels.at(64 + 5).difference == waves(1, member).difference);
  CHECK(once.levels.at(64 + 5).member == 69);
  CHECK(e.describe() ==
        "stratified in blocks of 91 (residual, nets), single_term, base one outcome, dyadic:6,4,3,1;theta=1.25, "
        "base level 0");
  CHECK_THROWS_AS(merge(estimate(nets(waves, dyadic, Points::plain), {.samples = 16 * block, .seed = 3}),
                        estimate(e, {.samples = 16 * block, .seed = 3, .first = 16 * block})),
                  std::invalid_argument);
  // The same from a PMF chosen at run time.
  const AnyPmf any = AnyPmf::parse(dyadic.spec());
  const auto erased =
      stratified(single_term(waves, any, {.base = Base::one_outcome}), any.block(), Strata::residual, Points::nets);
  CHECK(estimate(erased, {.samples = n, .seed = 3}).mean == run.mean);
}

TEST_CASE("a level has its whole power of two of members, whatever rounding makes of n p", "[nets][exact]") {
  for (std::size_t levels = 1; levels < 12; ++levels) {
    for (int m = 0; m < 9; ++m) {
      const Dyadic pmf(std::vector<int>(levels, m), 1.25);
      const auto once = trace(nets(waves, pmf), 1, 0);
      std::vector<std::int64_t> counts(levels);
      std::int64_t deeper = 0;
      for (const TracedLevel& l : once.levels) {
        l.level < static_cast<std::int64_t>(levels) ? ++counts[static_cast<std::size_t>(l.level)] : ++deeper;
      }
      CAPTURE(levels, m);
      CHECK(counts == std::vector<std::int64_t>(levels, std::int64_t{1} << m));
      CHECK(deeper == 1);
    }
  }
}

TEST_CASE("nets of what they cannot be made of are refused", "[nets][exact]") {
  const auto refused = [](const auto& e, std::int64_t block, Strata strata, const char* message) {
    CHECK_THROWS_WITH(stratified(e, block, strata, Points::nets), Catch::Contains(message));
  };
  refused(single_term(waves, Geometric(0.6)), 64, Strata::systematic, "Base::one_outcome");
  refused(independent_sum(waves, Geometric(0.6)), 64, Strata::residual, "several streams");
  const auto drawn = [](const Dyadic& pmf) { return single_term(waves, pmf, {.base = Base::one_outcome}); };
  refused(drawn(dyadic), 64, Strata::residual, "blocks of 91");
  refused(drawn(Dyadic({28}, 1.25)), (1 << 28) + 1, Strata::residual, "134217728 points");
  CHECK_THROWS_WITH(stratified(drawn(dyadic), 64, Strata::residual), Catch::Contains("take pmf.block()"));
}

TEST_CASE("the variance of a block of one level is that of a scrambled net, 1 / (12 n^3) for a line", "[nets][exact]") {
  const auto line = [](std::int64_t level, Stream& rng) {
    const double u = rng.uniform();
    return level == 0 ? base(u) : coupled(u, u);
  };
  for (const int m : {1, 3, 6}) {
    const Dyadic pmf({m}, 1.25);
    const auto e =
        stratified(single_term(line, pmf, {.base = Base::one_outcome}), pmf.block(), Strata::residual, Points::nets);
    constexpr std::int64_t blocks = 4096;
    const auto r = estimate(e, {.samples = blocks * pmf.block(), .seed = 7, .threads = 1});
    const double n = std::exp2(m);
    const double expected = 1 / (12 * n * n * n);
    const double variance = r.standard_error * r.standard_error * blocks;
    CAPTURE(m, variance, expected);
    // The mean of n uniform numbers, one a stratum, has kurtosis 3 - 1.2 / n.
    CHECK(std::abs(variance / expected - 1) < 4.5 * std::sqrt(2.0 / blocks));
  }
}

// Scrambled nets: nanoseconds of a number, beside plain ones in the same run (points/...), and what nets take from the
// variance of a member of a block (nets/...).
//
//   ratio_of_least  ns of a netted number over that of a plain one, alternating: rows over `fill`, alone over `uniform`
//   gain            variance of a block of plain members over that of a block of nets, the same Dyadic PMF
//   variance_work   variance of a block of nets x its work; plain_variance_work of plain members in the same blocks
//   error_of_32     standard error of a run of 32 blocks of nets, whose work is work_of_32
// The first number of plain members is stratified already where the sequence has batch hooks. Heads are those that a pilot with
// a goal of 0.01, 0.001 and 0.0002 (European), 0.01 and 0.0025 (the others) chose.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/core/estimate.hpp>
#include <debias/core/instructions.hpp>
#include <debias/core/points.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/dyadic.hpp>
#include <debias/sde.hpp>
#include <debias/sde/brownian.hpp>

#include "paired.hpp"

namespace debias::bench {
namespace {

std::array<double, 4096> netted;
std::array<double, 4096> plain;

template <class Ours, class Theirs>
void compare(const std::string& name, const Ours& ours, const Theirs& theirs) {
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
    constexpr int calls = 4;  // a round shorter than the time slices of a busy machine
    std::uint64_t i = 0;
    Ratio ratio;
    for (auto _ : state) {
      ratio = paired_ratio(
          [&] {
            for (int k = 0; k < calls; ++k) ours(i++);
            benchmark::ClobberMemory();
          },
          [&] {
            for (int k = 0; k < calls; ++k) theirs(i++);
            benchmark::ClobberMemory();
          },
          1001);
    }
    report(state, ratio, calls * static_cast<double>(netted.size()));
    state.SetLabel(name_of(instructions()));
  })->Iterations(1);
}

/// Blocks of nets against blocks of the same members with plain numbers.
template <class S>
void gain(const std::string& name, const S& sequence, const Dyadic& pmf, std::int64_t base_level = 0) {
  benchmark::RegisterBenchmark(
      name.c_str(),
      [=](benchmark::State& state) {
        const auto member = single_term(sequence, pmf, {.base_level = base_level, .base = Base::one_outcome});
        const Plan plan{.samples = 128 * pmf.block(), .seed = 5, .threads = 1};  // 128 blocks: variances to 12 %
        for (auto _ : state) {
          const auto nets = estimate(stratified(member, pmf.block(), Strata::residual, Points::nets), plan);
          const auto strata = estimate(stratified(member, pmf.block(), Strata::residual), plan);
          const double work = nets.work / static_cast<double>(nets.blocks);
          state.counters["gain"] = strata.moments.variance() / nets.moments.variance();
          state.counters["variance_work"] = nets.moments.variance() * work;
          state.counters["plain_variance_work"] = strata.moments.variance() * work;
          state.counters["error_of_32"] = std::sqrt(nets.moments.variance() / 32);
          state.counters["work_of_32"] = 32 * work;
          state.counters["kurtosis"] = nets.moments.kurtosis();
        }
        state.SetLabel(pmf.spec());
      })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

constexpr double discount = 0.951229424500714;  // exp(-0.05)
double call(double s) { return std::max(s - 100, 0.0) * discount; }

/// The European call by Milstein's scheme, written out by a user: by bridges, or in the order of time.
template <bool bridges>
Draw<double> own_call(std::int64_t level, Stream& rng) {
  const std::int64_t n = std::int64_t{1} << level;
  const double h = 1 / static_cast<double>(n);
  const auto step = [](double x, double dw, double dt) {
    return x * (1 + 0.05 * dt + 0.2 * dw + 0.02 * (dw * dw - dt));
  };
  BrownianPath w(rng, n);
  const auto increment = [&] { return bridges ? w.next() : std::sqrt(h) * rng.normal(); };
  double fine = 100;
  double coarse = 100;
  if (n == 1) return base(call(step(fine, increment(), h)));
  for (std::int64_t i = 0; i < n; i += 2) {
    const double a = increment();
    const double b = increment();
    fine = step(step(fine, a, h), b, h);
    coarse = step(coarse, a + b, 2 * h);
  }
  return coupled(call(fine), call(coarse), 1.5 * static_cast<double>(n));
}

const bool registered = [] {
  compare(
      "points/rows", [](std::uint64_t i) { net_uniforms(i, 64, 64, 0, netted); },
      [](std::uint64_t i) { Stream(1, i).fill(plain); });
  compare(
      "points/alone",
      [](std::uint64_t i) {
        for (std::uint64_t r = 0; r < 64; ++r) {
          Stream rng = Stream(1, i).point(r);
          for (std::size_t t = 0; t < 64; ++t) netted[64 * r + t] = rng.uniform();
        }
      },
      [](std::uint64_t i) {
        for (std::uint64_t r = 0; r < 64; ++r) {
          Stream rng = Stream(1, i).split(r);
          for (std::size_t t = 0; t < 64; ++t) plain[64 * r + t] = rng.uniform();
        }
      });

  const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2};
  const auto european = milstein(stock, call);
  const auto asian = milstein(stock, Average{}, [](const Average& p) { return call(p.average()); });
  const auto lookback =
      milstein(stock, Minimum{}, [](const Minimum& p) { return (p.terminal - p.minimum) * discount; });
  const auto comb = function_of_integral([](double x) { return 8 * x; }, functions::ExpMinus{});
  const std::vector<std::vector<int>> european_heads = {
      {9, 6, 6, 4, 2, 1}, {13, 11, 9, 8, 8, 6, 5, 4, 2, 1}, {15, 13, 12, 12, 12, 10, 9, 8, 6, 4, 3, 2, 1}};
  for (const std::vector<int>& head : european_heads) {
    const Dyadic pmf(head, 1.25);
    gain("nets/european", european, pmf);
    gain("nets/own_call_by_bridges", own_call<true>, pmf);
    gain("nets/own_call_in_time", own_call<false>, pmf);
  }
  const std::vector<std::vector<int>> asian_heads = {{9, 6, 5, 4, 3, 1}, {11, 9, 8, 7, 6, 4, 2, 1}};
  for (const std::vector<int>& head : asian_heads) gain("nets/asian", asian, Dyadic(head, 1.25));
  const std::vector<std::vector<int>> lookback_heads = {{10, 7, 8, 8, 5, 4, 3, 2},
                                                        {12, 11, 11, 11, 10, 8, 7, 6, 4, 3, 1}};
  for (const std::vector<int>& head : lookback_heads) gain("nets/lookback", lookback, Dyadic(head, 1.25));
  for (const int m : {6, 9, 12}) {
    std::vector<int> head;
    for (int k = m; k >= 0; k -= 2) head.push_back(k);
    gain("nets/comb_of_base_4", comb, Dyadic(head, 2.25), 2);
    gain(
        "nets/own_comb_of_base_4", [comb](std::int64_t level, Stream& rng) { return comb(level, rng); },
        Dyadic(head, 2.25), 2);
  }
  return true;
}();

}  // namespace
}  // namespace debias::bench

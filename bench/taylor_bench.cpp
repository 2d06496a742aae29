// The estimators of exp(-tau) against plain loops of the published ones (plain/...: ratio of times,
// alternating in one run), and against each other at equal mean look-ups: `--benchmark_filter=table` prints
// the tables of README.

#include <cmath>
#include <string>

#include <benchmark/benchmark.h>

#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/taylor.hpp>
#include <debias/transmittance.hpp>

#include "against_loops.hpp"
#include "baseline_exponential.hpp"
#include "media.hpp"

namespace debias::bench {
namespace {

const BhanotKennedy order_pmf(0.9, 2, 2);
const functions::ExpMinus exp_minus;

// ---- ours against plain loops

template <class F>
void register_comparisons(double tau) {
  const F f(tau);
  const double a = f.bound;
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const auto series = taylor(x, exp_minus, a);
  const std::string where = std::string("/") + F::name + "/tau_" + std::to_string(static_cast<int>(tau));
  const int k = static_cast<int>(poisson_quantile(a, 0.99));
  register_comparison("ratio_tracking" + where, single_term(series, Poisson(a), {.base = Base::one_outcome}),
                      [f, a](Stream& n, Stream& at) { return plain::ratio_tracking(f, a, n, at); });
  register_comparison("p_series_cumulative" + where, roulette(series, RunningWeight(std::exp(-a))),
                      [f, a](Stream& n, Stream& at) { return plain::p_series_cumulative(f, a, n, at); });
  register_comparison("p_series_cmf" + where, roulette(series, IndexRoulette(a), {.base_level = k}),
                      [f, a, k](Stream& n, Stream& at) { return plain::p_series_cmf(f, a, k, n, at); });
  register_comparison("u_statistics" + where, taylor_sum(comb_mean(f, 12), exp_minus, drawn_pivot, order_pmf),
                      [f](Stream& n, Stream& at) { return plain::u_statistics(f, 12, n, at); });
}

// ---- the tables

template <class F>
Cell ratio_tracking(const F& f, double truth) {  // in closed form: it needs more samples than one can draw
  constexpr int points = 1 << 16;
  double second = 0;
  for (int i = 0; i < points; ++i) {
    const double r = 1 - f((i + 0.5) / points) / f.bound;
    second += r * r / points;
  }
  const double a = f.bound;
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const auto e = single_term(taylor(x, exp_minus, a), Poisson(a), {.base = Base::one_outcome});
  const auto plain = [f, a](Stream& n, Stream& at) { return plain::ratio_tracking(f, a, n, at); };
  return {"ratio tracking", std::expm1(-a + a * second - 2 * std::log(truth)), 0, a, time_against(e, plain, 25)};
}

// At equal look-ups: combs of n points as the unit of a telescope, of U-statistics, and jittered points. The
// look-ups of the others are what they are: n samples of variance V each have V / n.
template <class F>
void add_rows(Table& table, double tau) {
  const F f(tau);
  const double a = f.bound;
  const double truth = std::exp(-tau);
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const auto series = taylor(x, exp_minus, a);
  const int k = static_cast<int>(poisson_quantile(a, 0.99));
  const Cell tracking = ratio_tracking(f, truth);
  const Cell cumulative = measure_against(
      "p-series cumulative", roulette(series, RunningWeight(std::exp(-a))),
      [f, a](Stream& n, Stream& at) { return plain::p_series_cumulative(f, a, n, at); }, truth, 1);
  const Cell cmf = measure_against(
      "p-series CMF", roulette(series, IndexRoulette(a), {.base_level = k}),
      [f, a, k](Stream& n, Stream& at) { return plain::p_series_cmf(f, a, k, n, at); }, truth, 1);
  for (const int lookups : {8, 16, 32}) {
    const int comb = static_cast<int>(std::lround(lookups / (1 + order_pmf.mean())));
    const Cell pivoted = measure_against(
        "U-statistics", taylor_sum(comb_mean(f, comb), exp_minus, drawn_pivot, order_pmf),
        [f, comb](Stream& n, Stream& at) { return plain::u_statistics(f, comb, n, at); }, truth);
    // E 2^(1 + J) = 2 r / (2 r - 1) times the base size: 8/3 for r = 4/5, and 4 for r = 2/3
    const Folded<F> unit{f, 3 * lookups / 8};
    const Cell telescoping = measure_against(
        "comb", single_term(function_of_integral(unit, exp_minus), Geometric(0.8)),
        [unit](Stream& n, Stream& at) { return plain::telescoping_comb(unit, exp_minus, 0, 0.8, n, at); }, truth, 0,
        unit.n);
    const int base = lookups == 8 ? 1 : lookups == 16 ? 2 : 3;
    const Cell jittered = measure(
        "jittered", single_term(function_of_jittered_integral(f, exp_minus), Geometric(2.0 / 3), {.base_level = base}),
        truth);
    table.add(std::string(F::name) + ", tau " + std::to_string(static_cast<int>(tau)) + ", " + std::to_string(lookups) +
                  " look-ups",
              {tracking, cumulative, cmf, pivoted, telescoping, jittered});
  }
}

const bool registered = [] {
  register_comparisons<Sinusoid>(4);
  register_comparisons<Step>(4);
  register_comparisons<Linear>(1);
  register_table("exponential", [](Table& table) {
    for (const double tau : {1.0, 4.0, 16.0}) {
      add_rows<Sinusoid>(table, tau);
      add_rows<Step>(table, tau);
      add_rows<Linear>(table, tau);
    }
  });
  return true;
}();

}  // namespace
}  // namespace debias::bench

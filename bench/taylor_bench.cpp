// The estimators of exp(-tau) against plain loops of the published ones (plain/...: ratio of times, alternating in
// one run), and against each other at equal mean look-ups: `--benchmark_filter=table` prints the tables of README.

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>

#include <benchmark/benchmark.h>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/taylor.hpp>

#include "baseline_exponential.hpp"
#include "media.hpp"

namespace debias::bench {
namespace {

int prefix_of(double bound) {
  const Poisson law(bound);
  int k = 0;
  while (law.tail(k + 1) > 0.01) ++k;
  return k;
}

const BhanotKennedy order_law(0.9, 2, 2);
const functions::ExpMinus exp_minus;

// ---- ours against plain loops

template <class F>
void register_comparisons(double tau) {
  const F f(tau);
  const double a = f.bound;
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const auto series = taylor(x, exp_minus, a);
  const std::string where = std::string("/") + F::name + "/tau_" + std::to_string(static_cast<int>(tau));
  const auto add = [&where](const std::string& name, const auto& e, const auto& plain) {
    benchmark::RegisterBenchmark(("plain/" + name + where).c_str(),
                                 [e, plain](benchmark::State& state) { compare(state, e, plain); })
        ->Iterations(1)
        ->Unit(benchmark::kMillisecond);
  };
  add("ratio_tracking", single_term(series, Poisson(a), {.base = Base::drawn}),
      [f, a](Stream& rng) { return plain::ratio_tracking(f, a, rng); });
  add("p_series_cumulative", roulette(series, RunningWeight(std::exp(-a))),
      [f, a](Stream& rng) { return plain::p_series_cumulative(f, a, rng); });
  const int k = prefix_of(a);
  add("p_series_cmf", roulette(series, IndexRoulette(a), {.base_level = k}),
      [f, a, k](Stream& rng) { return plain::p_series_cmf(f, a, k, rng); });
  add("u_statistics", taylor_sum(comb_mean(f, 12), exp_minus, drawn_pivot, order_law),
      [f](Stream& rng) { return plain::u_statistics(f, 12, rng); });
}

// ---- the tables

struct Figures {
  double relative_variance = 0;  // of one sample
  double error = 0;              // its relative error
  double lookups = 0;            // a sample
};

template <Estimator E>
Figures measure(const E& e, double truth, double free_work = 0, double scale = 1) {
  const auto r = estimate(e, {.samples = 1 << 19, .threads = 1});
  return {r.moments.variance() / (truth * truth),
          std::sqrt((r.moments.kurtosis() - 1) / static_cast<double>(r.samples)),
          scale * (r.work_per_sample() - free_work)};
}

template <class F>
Figures ratio_tracking(const F& f, double truth) {  // in closed form: it needs more samples than one can draw
  constexpr int points = 1 << 16;
  double second = 0;
  for (int i = 0; i < points; ++i) {
    const double r = 1 - f((i + 0.5) / points) / f.bound;
    second += r * r / points;
  }
  return {std::expm1(-f.bound + f.bound * second - 2 * std::log(truth)), 0, f.bound};
}

template <class F>
void print_rows(double tau) {
  const F f(tau);
  const double truth = std::exp(-tau);
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const auto series = taylor(x, exp_minus, f.bound);
  const Figures tracking = ratio_tracking(f, truth);
  const Figures cumulative = measure(roulette(series, RunningWeight(std::exp(-f.bound))), truth, 1);
  const Figures cmf =
      measure(roulette(series, IndexRoulette(f.bound), {.base_level = prefix_of(f.bound)}), truth, 1);
  for (const int lookups : {8, 16, 32}) {
    const int comb = static_cast<int>(std::lround(lookups / (1 + order_law.mean())));
    const Figures pivoted = measure(taylor_sum(comb_mean(f, comb), exp_minus, drawn_pivot, order_law), truth);
    // E 2^(1 + J) = 2 r / (2 r - 1) times the base size: 8/3 for r = 4/5, and 4 for r = 2/3
    const int n = 3 * lookups / 8;
    const Figures telescoping =
        measure(single_term(function_of_integral(Folded<F>{f, n}, exp_minus), Geometric(0.8)), truth, 0, n);
    const int base = lookups == 8 ? 1 : lookups == 16 ? 2 : 3;
    const Figures jittered = measure(
        single_term(function_of_jittered_integral(f, exp_minus), Geometric(2.0 / 3), {.base_level = base}),
        truth);
    const std::array<std::pair<const char*, Figures>, 6> all = {{{"ratio tracking", tracking},
                                                                 {"p-series cumulative", cumulative},
                                                                 {"p-series CMF", cmf},
                                                                 {"U-statistics", pivoted},
                                                                 {"comb", telescoping},
                                                                 {"jittered", jittered}}};
    const char* winner = nullptr;
    double least = 0;
    std::printf("| %s | %g | %d |", F::name, tau, lookups);
    for (const auto& [name, figures] : all) {
      // per look-up of the budget: n samples of V each have V / n
      const double v = figures.relative_variance * figures.lookups;
      std::printf(" %.2g%s |", v, figures.error > 0.1 ? " ?" : "");
      if (winner == nullptr || v < least) {
        winner = name;
        least = v;
      }
    }
    std::printf(" %s |\n", winner);
  }
}

void print_table(benchmark::State& state) {
  for (auto _ : state) {
    std::printf(
        "| medium | tau | look-ups | ratio tracking | p-series cumulative | p-series CMF | U-statistics | "
        "comb | jittered | least |\n|---|---|---|---|---|---|---|---|---|---|\n");
    for (const double tau : {1.0, 4.0, 16.0}) {
      print_rows<Sinusoid>(tau);
      print_rows<Step>(tau);
      print_rows<Linear>(tau);
    }
  }
}

const bool registered = [] {
  register_comparisons<Sinusoid>(4);
  register_comparisons<Step>(4);
  register_comparisons<Linear>(1);
  benchmark::RegisterBenchmark("table/exponential", print_table)
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
  return true;
}();

}  // namespace
}  // namespace debias::bench

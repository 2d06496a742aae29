#pragma once

// The published estimators of exp(-integral of f over [0, 1]) for 0 <= f <= majorant, as special methods; and
// those that other functions of an integral share with it.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/taylor.hpp>
#include <debias/transmittance.hpp>

#include "make.hpp"

namespace debias::catalog {

/// Kurtosis of ratio tracking: E Z^q = exp(-a + a E (1 - X / a)^q), a = majorant.
template <class F>
double kurtosis_of_ratio_tracking(const F& f, double majorant) {
  constexpr int points = 4096;
  double second = 0;
  double fourth = 0;
  for (int i = 0; i < points; ++i) {
    const double r = 1 - f((i + 0.5) / points) / majorant;
    second += r * r / points;
    fourth += r * r * r * r / points;
  }
  return std::exp(-majorant + majorant * fourth - 2 * (-majorant + majorant * second));
}

template <class F, class G>
void add_jittered(Problem& p, const F& f, const G& g, std::int64_t base_level,
                  const Rates& rates = JitteredOptions{}.rates) {
  add(p, {.name = "jittered", .description = "single_term on jittered points in place of a comb"},
      single_term(function_of_jittered_integral(f, g, {.rates = rates}), {.base_level = base_level}));
}

template <class F, class G, Pmf P>
void add_u_statistics(Problem& p, const F& f, const G& g, std::int64_t points, const P& order) {
  add(p,
      {.name = "u_statistics",
       .description = "symmetric products of combs about each of them (pivoted series)"},
      taylor_sum(comb_mean(f, points), g, drawn_pivot, order));
}

/// About one fixed estimate of the integral, from `points` look-ups at the middles of parts; four combs at least in
/// each average.
template <class F, class G>
void add_fixed_pivot(Problem& p, const F& f, const G& g, std::int64_t points) {
  double pivot = 0;
  for (std::int64_t i = 0; i < points; ++i) {
    pivot += f((static_cast<double>(i) + 0.5) / static_cast<double>(points)) / static_cast<double>(points);
  }
  add(p,
      {.name = "u_statistics_fixed",
       .description = "symmetric products of combs about a fixed estimate of the integral"},
      taylor_sum(comb_mean(f, points), g, pivot, Geometric(0.5), {.draws = 4}));
}

template <TermSequence S>
void add_p_series_cumulative(Problem& p, const S& series, double first_term) {
  add(p,
      {.name = "p_series_cumulative", .description = "the power series with roulette on the running weight"},
      roulette(series, RunningWeight(first_term)));
}

/// Ratio tracking, both p-series, pivoted U-statistics, and jittered points from `base_level` on.
template <class F>
void add_exponential_methods(Problem& p, const F& f, double majorant, const Rates& jittered,
                             std::int64_t base_level) {
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const functions::ExpMinus g;
  const auto series = taylor(x, g, majorant);
  add(p,
      {.name = "ratio_tracking",
       .description = "one term of the power series about a majorant, drawn from its Poisson law",
       .kurtosis = kurtosis_of_ratio_tracking(f, majorant),
       .reason = "E Z^q = exp(-a + a E (1 - X/a)^q) gives"},
      single_term(series, Poisson(majorant), {.base = Base::drawn}));
  add_p_series_cumulative(p, series, std::exp(-majorant));
  add(p,
      {.name = "p_series_cmf", .description = "the power series, terms to the 99 % quantile, then roulette"},
      roulette(series, IndexRoulette(majorant), {.base_level = poisson_quantile(majorant, 0.99)}));
  const BhanotKennedy order(0.9, 2, 2);
  const std::int64_t points = comb_of_u_statistics(majorant, order.mean());
  add_u_statistics(p, f, g, points, order);
  add_fixed_pivot(p, f, g, points);
  add_jittered(p, f, g, base_level, jittered);
}

}  // namespace debias::catalog

#pragma once

// The published estimators of exp(-integral of f over [0, 1]) for 0 <= f <= majorant, as special methods; and
// those that other functions of an integral share with it.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
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

/// E (1 - X / a)^q for q = 0 ... 4, X = f at a uniform point, a = majorant.
template <class F>
std::array<double, 5> ratio_moments(const F& f, double majorant) {
  constexpr int points = 4096;
  std::array<double, 5> moments{};
  for (int i = 0; i < points; ++i) {
    double power = 1.0 / points;
    const double ratio = 1 - f((i + 0.5) / points) / majorant;
    for (double& moment : moments) {
      moment += power;
      power *= ratio;
    }
  }
  return moments;
}

/// Kurtosis of ratio tracking: E Z^q = exp(-a + a E (1 - X / a)^q).
inline double kurtosis_of_ratio_tracking(const std::array<double, 5>& ratio, double a) {
  return std::exp(-a + a * ratio[4] - 2 * (-a + a * ratio[2]));
}

/// Kurtosis of the power series summed in full: V_(k-1) = 1 + (1 - X / a) a / k V_k, in units of its term k - 1,
/// with X and V_k independent. Roulette adds noise of the size of the first term, nothing where this is large.
inline double kurtosis_of_p_series(const std::array<double, 5>& ratio, double a) {
  std::array<double, 5> v{1, 0, 0, 0, 0};  // E V^q
  for (int k = 3 * static_cast<int>(a) + 64; k > 0; --k) {
    std::array<double, 5> tail = v;  // E ((1 - X / a) a / k V)^q
    for (std::size_t q = 1; q < v.size(); ++q) tail[q] *= ratio[q] * std::pow(a / k, q);
    v[1] = 1 + tail[1];
    v[2] = 1 + 2 * tail[1] + tail[2];
    v[3] = 1 + 3 * tail[1] + 3 * tail[2] + tail[3];
    v[4] = 1 + 4 * tail[1] + 6 * tail[2] + 4 * tail[3] + tail[4];
  }
  return v[4] / (v[2] * v[2]);
}

template <class F, class G>
void add_jittered(Problem& p, const F& f, const G& g, std::int64_t base_level,
                  const Rates& rates = JitteredOptions{}.rates) {
  add(p, {.name = "jittered", .description = "single_term on jittered points in place of a comb"},
      single_term(function_of_jittered_integral(f, g, {.rates = rates}), {.base_level = base_level}));
}

template <class F, class G, Pmf P>
void add_u_statistics(Problem& p, const F& f, const G& g, std::int64_t points, const P& order) {
  add(p, {.name = "u_statistics", .description = "symmetric products of combs about each of them (pivoted series)"},
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

constexpr const char* reason_of_p_series = "the moments of the power series summed in full give";

/// `kurtosis` of the samples, 0 where it is unknown.
template <TermSequence S>
void add_p_series_cumulative(Problem& p, const S& series, double first_term, double kurtosis = 0) {
  add(p,
      {.name = "p_series_cumulative",
       .description = "the power series with roulette on the running weight",
       .kurtosis = kurtosis,
       .reason = kurtosis > 0 ? reason_of_p_series : ""},
      roulette(series, RunningWeight(first_term)));
}

/// Ratio tracking, both p-series, pivoted U-statistics, and jittered points from `base_level` on.
template <class F>
void add_exponential_methods(Problem& p, const F& f, double majorant, const Rates& jittered, std::int64_t base_level) {
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const functions::ExpMinus g;
  const auto series = taylor(x, g, majorant);
  const auto ratio = ratio_moments(f, majorant);
  const double kurtosis = kurtosis_of_p_series(ratio, majorant);
  add(p,
      {.name = "ratio_tracking",
       .description = "one term of the power series about a majorant, drawn from its Poisson law",
       .kurtosis = kurtosis_of_ratio_tracking(ratio, majorant),
       .reason = "E Z^q = exp(-a + a E (1 - X/a)^q) gives"},
      single_term(series, Poisson(majorant), {.base = Base::one_outcome}));
  add_p_series_cumulative(p, series, std::exp(-majorant), kurtosis);
  add(p,
      {.name = "p_series_cmf",
       .description = "the power series, terms to the 99 % quantile, then roulette",
       .kurtosis = kurtosis,
       .reason = reason_of_p_series},
      roulette(series, IndexRoulette(majorant), {.base_level = poisson_quantile(majorant, 0.99)}));
  const BhanotKennedy order(0.9, 2, 2);
  const std::int64_t points = comb_of_u_statistics(majorant, order.mean());
  add_u_statistics(p, f, g, points, order);
  add_fixed_pivot(p, f, g, points);
  add_jittered(p, f, g, base_level, jittered);
}

}  // namespace debias::catalog

// 1 / E X in every way against plain loops (plain/...), and against each other at equal mean look-ups:
// `--benchmark_filter=table/reciprocal`.

#include <cmath>
#include <limits>
#include <string>

#include <benchmark/benchmark.h>

#include <debias/core/accumulator.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/reciprocal.hpp>
#include <debias/taylor.hpp>

#include "against_loops.hpp"
#include "media.hpp"

namespace debias::bench {
namespace {

/// The number of trials until one succeeds, for 0 <= X <= a [Zeltner et al. 2020].
template <class X>
double plain_trials(const X& x, double a, Stream& points) {
  int n = 1;
  while (points.uniform() * a >= x(points)) ++n;
  return n / a;
}

/// One term of the geometric series about 1 / w, drawn with survival s [Moka, Kroese & Juneja 2019].
template <class X>
double plain_product(const X& x, double w, double s, Stream& points) {
  double value = w / (1 - s);
  while (points.uniform() < s) value *= (1 - w * x(points)) / s;
  return value;
}

/// The geometric series about a, with roulette of survival s [Booth 2007].
template <class X>
double plain_series(const X& x, double a, double s, Stream& order, Stream& points) {
  double term = 1 / a;
  double sum = term;
  const int n = static_cast<int>(std::log(order.uniform()) / std::log(s));
  for (int k = 1; k <= n; ++k) sum += term *= (1 - x(points) / a) / s;
  return sum;
}

/// Doubling of 1 / max(mean, scale 2^-(level + 1)), geometric PMF with parameter r.
template <class X>
double plain_clamped(const X& x, double scale, double r, Stream& order, Stream& points) {
  const auto base = [scale](double value) { return 1 / std::fmax(value, scale / 2); };
  const auto gap = [scale](int n, double mean, double half) {
    const double coarse = scale / n;  // the least mean one level below
    return 1 / std::fmax(mean, coarse / 2) - 0.5 / std::fmax(mean + half, coarse) -
           0.5 / std::fmax(mean - half, coarse);
  };
  return plain::doubling(x, base, gap, r, order, points);
}

/// An integrand with its bounds, and the moments of f(U).
struct Integrand {
  const char* name;
  double (*f)(double);
  double low;
  double high;
  bool has_low_density;  // at 0, like x^(-1/2): means of 4 draws have no second moment of 1 / mean
  double mean = 0;
  double square = 0;

  double operator()(double x) const { return f(x); }
};

Integrand with_moments(Integrand i) {
  constexpr int points = 1 << 20;
  for (int k = 0; k < points; ++k) {
    const double y = i.f((k + 0.5) / points);
    i.mean += y / points;
    i.square += y * y / points;
  }
  return i;
}

double ramp(double x) { return 0.5 + x; }
double wave(double x) { return 2 + std::sin(two_pi / 0.37 * x + 1); }
double wave_to_zero(double x) { return 4 * (1 + std::sin(two_pi / 0.37 * x + 1)); }

/// f(U) with f known to the compiler, as a user has it.
template <double (*f)(double)>
struct At {
  double operator()(double x) const { return f(x); }
  double operator()(Stream& rng) const { return f(rng.uniform()); }
};

template <double (*f)(double)>
void add_rows(Table& table, const char* name, double low, double high) {
  const Integrand facts = with_moments({name, f, low, high, low == 0});
  const At<f> x;
  const double truth = 1 / facts.mean;
  const double a = facts.square / facts.mean;  // the best centre
  const double b = 1 - facts.mean / a;
  const double s = std::sqrt(b);
  const functions::Reciprocal g;

  const Cell trials = measure_against(
      "trials", reciprocal_trials(x, high), [x, high](Stream&, Stream& at) { return plain_trials(x, high, at); },
      truth);
  const Cell product = measure_against(
      "product", ReciprocalProduct(x, 1 / a, s),
      [x, a, s](Stream&, Stream& at) { return plain_product(x, 1 / a, s, at); }, truth, 1);
  Cell residual{"residual"};
  if (low > 0) {
    residual = measure_against(
        "residual", reciprocal_residual(x, low, high),
        [x, low, high](Stream&, Stream& at) { return plain_product(x, 1 / high, 1 - low / high, at); }, truth, 1);
  }
  const Cell series = measure_against(
      "series", roulette(reciprocal_series(x, a), Geometric(1 - s)),
      [x, a, s](Stream& n, Stream& at) { return plain_series(x, a, s, n, at); }, truth, 1);
  for (const int lookups : {8, 16, 32}) {
    const Cell symmetric =
        measure("symmetric", taylor_sum(x, g, a, Geometric(0.5), {.base_level = lookups - 1}), truth, 1);
    // E 2^(1 + J) = 2 r / (2 r - 1) times the base size: 8 for r = 4/7, 8/3 for 4/5, 4 for 2/3
    const MeanOf<At<f>> mean{x, lookups / 8};
    Cell doubling{"doubling", std::numeric_limits<double>::infinity(), 0, 1};
    if (!facts.has_low_density) {
      doubling = measure_against(
          "doubling", single_term(reciprocal(mean), Geometric(4.0 / 7)),
          [mean, g](Stream& n, Stream& at) { return plain::doubling(mean, g, 4.0 / 7, n, at); }, truth, 0, mean.n);
    }
    const Cell clamped = measure_against(
        "clamped", single_term(clamped_reciprocal(mean, facts.mean), Geometric(4.0 / 7)),
        [mean, scale = facts.mean](Stream& n, Stream& at) { return plain_clamped(mean, scale, 4.0 / 7, n, at); }, truth,
        0, mean.n);
    const Folded<At<f>> unit{x, 3 * lookups / 8};
    const Cell comb = measure_against(
        "comb", single_term(reciprocal_of_integral(unit), Geometric(0.8)),
        [unit, g](Stream& n, Stream& at) { return plain::telescoping_comb(unit, g, 0, 0.8, n, at); }, truth, 0, unit.n);
    const int base = lookups == 8 ? 1 : lookups == 16 ? 2 : 3;
    const Cell jittered = measure(
        "jittered", single_term(function_of_jittered_integral(x, g), Geometric(2.0 / 3), {.base_level = base}), truth);
    table.add(std::string(name) + ", " + std::to_string(lookups) + " look-ups",
              {trials, residual, product, series, symmetric, doubling, clamped, comb, jittered});
  }
}

const bool registered = [] {
  const At<wave> x;
  const functions::Reciprocal g;
  const Integrand facts = with_moments({"", wave, 1, 3, false});
  const double a = facts.square / facts.mean;
  const double s = std::sqrt(1 - facts.mean / a);
  register_comparison("reciprocal_trials", reciprocal_trials(x, 3),
                      [x](Stream&, Stream& at) { return plain_trials(x, 3, at); });
  register_comparison("reciprocal_product", ReciprocalProduct(x, 1 / a, s),
                      [x, a, s](Stream&, Stream& at) { return plain_product(x, 1 / a, s, at); });
  register_comparison("reciprocal_series", roulette(reciprocal_series(x, a), Geometric(1 - s)),
                      [x, a, s](Stream& n, Stream& at) { return plain_series(x, a, s, n, at); });
  register_comparison("reciprocal_doubling", single_term(reciprocal(x), Geometric(4.0 / 7)),
                      [x, g, r = 4.0 / 7](Stream& n, Stream& at) { return plain::doubling(x, g, r, n, at); });
  register_table("reciprocal", [](Table& table) {
    add_rows<ramp>(table, "1/2 ... 3/2, a ramp", 0.5, 1.5);
    add_rows<wave>(table, "1 ... 3, a sine", 1, 3);
    add_rows<wave_to_zero>(table, "0 ... 8, a sine", 0, 8);
  });
  return true;
}();

}  // namespace
}  // namespace debias::bench

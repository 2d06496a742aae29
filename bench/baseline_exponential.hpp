#pragma once

// The published estimators of exp(-integral of f over [0, 1]) as anybody writes them: plain loops. f(x) is
// the integrand, a its bound. What the library's are compared with. `order` draws how far to go, `points`
// where to look; one stream may serve for both.

#include <cmath>

#include <debias/core/stream.hpp>

namespace debias::bench::plain {

/// The stream of a level, split from `points`; the one stream, where there is one only.
inline Stream points_of_level(const Stream& order, const Stream& points, int level) {
  return &order == &points ? Stream(order) : split_level(points, level);
}

/// A level and its mass under a geometric PMF with parameter r, by going through the levels.
struct DrawnLevel {
  int level;
  double mass;
};
inline DrawnLevel geometric_level(int first, double r, Stream& order) {
  DrawnLevel d{first, r};
  double tail = 1 - r;
  for (const double u = order.uniform(); u <= tail && d.level < 62; ++d.level) {
    d.mass *= 1 - r;
    tail *= 1 - r;
  }
  return d;
}

/// Ratio tracking, its order by inversion of the Poisson law.
template <class F>
double ratio_tracking(const F& f, double a, Stream& order_stream, Stream& points) {
  const double u = order_stream.uniform();
  double mass = std::exp(-a);
  double cdf = mass;
  int order = 0;
  while (u > cdf && order < 1000) {
    mass *= a / ++order;
    cdf += mass;
  }
  double weight = 1;
  for (int i = 0; i < order; ++i) weight *= 1 - f(points.uniform()) / a;
  return weight;
}

/// p-series, cumulative: roulette on the running weight [Georgiev et al. 2019].
template <class F>
double p_series_cumulative(const F& f, double a, Stream& order, Stream& points) {
  double weight = 1;
  double sum = 1;
  for (int i = 1;; ++i) {
    weight *= (a - f(points.uniform())) / i;
    const double p = std::abs(weight);
    if (p < 1) {
      if (order.uniform() >= p) break;
      weight /= p;
    }
    sum += weight;
  }
  return std::exp(-a) * sum;
}

/// p-series, CMF: `prefix` terms, then roulette by index.
template <class F>
double p_series_cmf(const F& f, double a, int prefix, Stream& order, Stream& points) {
  double weight = 1;
  double sum = 1;
  for (int i = 1;; ++i) {
    if (i > prefix) {
      const double p = std::fmin(1, a / i);
      if (order.uniform() >= p) break;
      weight /= p;
    }
    weight *= (a - f(points.uniform())) / i;
    sum += weight;
  }
  return std::exp(-a) * sum;
}

/// Pivoted U-statistics on combs of `comb` points [Kettunen et al. 2021], zero = 0.9, first = 2, c = 2.
template <class F>
double u_statistics(const F& f, int comb, Stream& order, Stream& points) {
  double x[64];
  double weights[64];
  int n = 0;
  weights[0] = 1;
  if (order.uniform() <= 0.1) {
    n = 2;
    double tail = 0.1;
    weights[1] = weights[2] = 1 / tail;
    while (n < 62 && order.uniform() < 2.0 / (n + 1)) {
      ++n;
      tail *= 2.0 / n;
      weights[n] = 1 / tail;
    }
  }
  for (int i = 0; i <= n; ++i) {
    const double u = points.uniform();
    double sum = 0;
    for (int j = 0; j < comb; ++j) sum += f((j + u) / comb);
    x[i] = -sum / comb;
  }
  double total = 0;
  for (int p = 0; p <= n; ++p) {
    double m[64] = {1};
    int used = 0;
    for (int i = 0; i <= n; ++i) {
      if (i == p) continue;
      ++used;
      const double y = x[i] - x[p];
      for (int k = used; k > 0; --k) m[k] += (m[k - 1] * y - m[k]) * k / used;
    }
    double factorial = 1;
    double series = 0;
    for (int k = 0; k <= n; ++k) {
      if (k > 0) factorial *= k;
      series += m[k] / factorial * weights[k];
    }
    total += std::exp(x[p]) * series;
  }
  return total / (n + 1);
}

/// Telescoping comb for g(integral of f) with g(m) and gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2: geometric PMF
/// with parameter r, the base averaged over all combs of 2^base points.
template <class F, class G>
double telescoping_comb(const F& f, const G& g, int base, double r, Stream& order, Stream& points) {
  const auto [level, mass] = geometric_level(base + 1, r, order);
  const int n = 1 << level;
  const int groups = 1 << (level - base);
  const double u = points_of_level(order, points, level).uniform();
  double even = 0;
  double odd = 0;
  double bases = 0;
  for (int group = 0; group < groups; ++group) {
    double sum = 0;
    for (int i = group; i < n; i += groups) sum += f((i + u) / n);
    (group % 2 == 0 ? even : odd) += sum;
    bases += g(sum * groups / n);
  }
  return bases / groups + g.gap((even + odd) / n, (even - odd) / n) / mass;
}

}  // namespace debias::bench::plain

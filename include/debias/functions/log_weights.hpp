#pragma once

// Means of weights e^l that no l makes under- or overflow, and the logarithm of such a mean.
//
//   e^l v = 2^k (2^-k e^l v),  k = the whole part of l / ln 2           Weighted: v = 1, or an array of what the weight multiplies
//   LogMeanExp   log m_0  (+ ratios m_i / m_0, i >= 1)                  m = mean of e^l v, v_0 = 1
//
// Notation: l = log weight, below 2^60 in size (beyond it is taken for infinite). A sum takes the larger exponent, so what is 2^-1100 of it or less is lost, which no double
// would have shown. The gap of a logarithm does not change when both halves are multiplied by a number: exponents drop out of it.
// l = -inf is a weight of zero; a mean of zeros has the logarithm -inf and the gap NaN, as with functions::Log. A NaN stays one.
//
//   function_of_mean([](Stream& rng) { return exp_of(-2000 - 3 * rng.uniform()); }, functions::LogMeanExp{})   -2000 + log E e^(-3 U)
//
// The difference from ShiftedLog (functions/arrays.hpp): no number c has to be near all l. It costs some ns a draw more.
// Source: derived here.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <type_traits>
#include <utility>

#include <debias/core/value.hpp>
#include <debias/functions/arrays.hpp>
#include <debias/functions/elementary.hpp>

namespace debias {

/// value * 2^exponent. Its components are those of `value`: what is scaled is the value, and the exponent stays.
template <Value V>
struct Weighted {
  V value;
  std::int64_t exponent = 0;

  friend Weighted operator+(const Weighted& a, const Weighted& b) {
    const std::int64_t e = common(a, b);
    return {debias::sum(a.at(e), b.at(e)), e};
  }
  friend Weighted operator-(const Weighted& a, const Weighted& b) {
    const std::int64_t e = common(a, b);
    return {debias::difference(a.at(e), b.at(e)), e};
  }
  /// The value in units of 2^e.
  [[nodiscard]] V at(std::int64_t e) const {
    if (e == exponent) [[likely]]
      return value;
    const std::int64_t by = exponent - e;
    constexpr std::int64_t all = 2200;  // from the largest double to zero
    return debias::scaled(value, std::ldexp(1.0, static_cast<int>(by < -all ? -all : by > all ? all : by)));
  }
  /// The larger exponent: of sums, that of neither part need be lost.
  static std::int64_t common(const Weighted& a, const Weighted& b) {
    return a.exponent < b.exponent ? b.exponent : a.exponent;
  }
};

template <Value V>
std::size_t component_count(const Weighted<V>& w) {
  return component_count(w.value);
}
template <Value V>
double component(const Weighted<V>& w, std::size_t i) {
  return component(w.value, i);
}
template <Value V>
void set_component(Weighted<V>& w, std::size_t i, double x) {
  set_component(w.value, i, x);
}

/// Does a component of one half say little beside that of the other? With the exponents counted.
template <Value V>
bool lopsided(const Weighted<V>& a, const Weighted<V>& b) {
  const std::int64_t apart = a.exponent - b.exponent;
  if (apart > 26 || apart < -26) return true;  // or nearly so: gap_of_halves is right there, too
  return debias::lopsided(a.value, b.at(a.exponent));
}

/// e^l v. An l of +inf gives an infinite weight, a NaN a NaN.
template <Value V>
Weighted<V> exp_of(double l, V v) {
  if (l == -std::numeric_limits<double>::infinity()) {
    return {debias::zero_like(std::move(v)), std::numeric_limits<std::int64_t>::min() / 4};
  }
  if (!(std::abs(l) < 0x1p60)) return {debias::scaled(std::move(v), std::exp(l)), 0};
  const double k = std::floor(l * std::numbers::log2e);
  constexpr double ln2_high = 0x1.62e42feep-1;  // 32 bits: its products with k below 2^21 are exact
  constexpr double ln2_low = 0x1.a39ef35793c76p-33;
  const double rest = (l - k * ln2_high) - k * ln2_low;
  return {debias::scaled(std::move(v), std::exp(rest)), static_cast<std::int64_t>(k)};
}
inline Weighted<double> exp_of(double l) { return exp_of(l, 1.0); }

namespace functions {

/// log m_0 of a mean of weights; of weighted arrays (1, a, b, ...) an array of log m_0 and the weighted means of a, b, ...
struct LogMeanExp {
  template <class V>
  V operator()(const Weighted<V>& m) const {
    V value = m.value;
    set_component(value, 0, log_of(m));
    for (std::size_t i = 1; i < component_count(value); ++i) {
      set_component(value, i, component(m.value, i) / component(m.value, 0));
    }
    return value;
  }

  template <class V>
  V gap(const Weighted<V>& m, const Weighted<V>& d) const {
    const V scaled_d = d.at(m.exponent);
    V gap = m.value;
    const double bottom = component(m.value, 0);
    const double bottom_d = component(scaled_d, 0);
    set_component(gap, 0, Log{}.gap(bottom, bottom_d));
    for (std::size_t i = 1; i < component_count(gap); ++i) {
      set_component(gap, i, Ratio::gap_of(component(m.value, i), bottom, component(scaled_d, i), bottom_d));
    }
    return gap;
  }

  template <class V>
  V gap_of_halves(const Weighted<V>& a, const Weighted<V>& b) const {
    // log((1 + r) / 2) - log(r) / 2, r = smaller over larger half, whose logarithm is in range whatever r is.
    const double of_a = component(a.value, 0);
    const double of_b = component(b.value, 0);
    V gap = a.value;
    double apart = -std::abs(std::log(of_a) - std::log(of_b) + powers(a.exponent - b.exponent));
    if (!(of_a > 0 && of_b > 0)) apart = std::numeric_limits<double>::quiet_NaN();
    const double r = std::exp(apart);
    set_component(gap, 0, std::log1p(r) - std::numbers::ln2 - 0.5 * apart);
    // (ratio_a - ratio_b) (w_a - w_b) / (w_a + w_b) / 2
    const bool is_larger = log_of(a) >= log_of(b);
    const double lean = 0.5 * (is_larger ? -std::expm1(apart) : std::expm1(apart)) / (1 + r);
    for (std::size_t i = 1; i < component_count(gap); ++i) {
      set_component(gap, i, (component(a.value, i) / of_a - component(b.value, i) / of_b) * lean);
    }
    return gap;
  }

 private:
  static double powers(std::int64_t exponent) { return static_cast<double>(exponent) * std::numbers::ln2; }
  template <class V>
  static double log_of(const Weighted<V>& m) {
    const double mantissa = component(m.value, 0);
    return mantissa == 0 ? std::log(mantissa) : std::log(mantissa) + powers(m.exponent);
  }
};

}  // namespace functions

}  // namespace debias

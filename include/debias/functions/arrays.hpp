#pragma once

// Functions of several means, with the gap of functions.hpp: componentwise(g), a ratio, log-sum-exp.
//
//   Ratio      m_0 / m_1          gap: the determinant of (d, m) over m_1 (m_1^2 - d_1^2), times d_1
//   ShiftedLog log m_0 + m_1      gap: that of log m_0, for m_1 is the same in both halves
//   LogSumExp  log sum e^(m_i)    gap = -log(1 + 4 sum_(i<j) p_i p_j sinh^2((d_i - d_j) / 2)) / 2, p_i ~ e^(m_i)
//
// Notation, accuracy, and where they fail: functions.hpp. Source: derived here; the determinant is Kahan's.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <debias/core/value.hpp>
#include <debias/functions/elementary.hpp>

namespace debias::functions {

/// Arrays that a function of one real number can be applied to, component by component.
template <class M>
concept RealArray = ArrayValue<M> && RealValue<typename M::Scalar>;

/// g applied to each component of a real array.
template <class G>
struct Componentwise {
  G g;

  template <RealArray M>
  M operator()(M m) const {
    for (std::size_t i = 0; i < component_count(m); ++i) set_component(m, i, g(component(m, i)));
    return m;
  }
  template <RealArray M>
  requires requires(const G& f, double x) { f.gap(x, x); }
  M gap(M m, const M& d) const {
    for (std::size_t i = 0; i < component_count(m); ++i) {
      set_component(m, i, g.gap(component(m, i), component(d, i)));
    }
    return m;
  }
  template <RealArray M>
  requires requires(const G& f, double x) { f.gap_of_halves(x, x); }
  M gap_of_halves(M a, const M& b) const {
    for (std::size_t i = 0; i < component_count(a); ++i) {
      const double x = component(a, i);
      const double y = component(b, i);
      set_component(a, i, lopsided(x, y) ? g.gap_of_halves(x, y) : g.gap((x + y) / 2, (x - y) / 2));
    }
    return a;
  }
};

template <class G>
Componentwise<G> componentwise(G g) {
  return {std::move(g)};
}

/// The ratio m_0 / m_1 of a mean of two components: of self-normalised weights, X = (weight * value, weight).
struct Ratio {
  template <RealArray M>
  double operator()(const M& m) const {
    return component(m, 0) / component(m, 1);
  }
  template <RealArray M>
  double gap(const M& m, const M& d) const {
    return gap_of(component(m, 0), component(m, 1), component(d, 0), component(d, 1));
  }
  /// The gap of top / bottom, with half the differences of both.
  static double gap_of(double top, double bottom, double top_d, double bottom_d) {
    double apart = top_d - top / bottom * bottom_d;
    if (std::abs(apart) < 0.0625 * std::abs(top_d)) [[unlikely]]  // nearly the same ratio in both halves
      apart = determinant(top_d, bottom_d, top, bottom);
    return apart / (bottom + bottom_d) * (bottom_d / (bottom - bottom_d));
  }
  /// (r_a - r_b) (w_a - w_b) / (w_a + w_b) / 2, r = ratio and w = weight of a half.
  template <RealArray M>
  double gap_of_halves(const M& a, const M& b) const {
    const double x = component(a, 1);
    const double y = component(b, 1);
    double apart = component(a, 0) / x - component(b, 0) / y;
    if (std::abs(apart) < 0.0625 * std::abs(component(a, 0) / x)) {
      apart = determinant(component(a, 0), x, component(b, 0), y) / x;
    }
    return 0.5 * apart * ((x / 2 - y / 2) / (x / 2 + y / 2));
  }

 private:
  /// a - (c / d) b = (a d - b c) / d where the two nearly cancel, without the rounding of products [Kahan].
  static double determinant(double a, double b, double c, double d) {
    if (c == 0 && d == 0) return std::numeric_limits<double>::quiet_NaN();
    int of_first = 0;  // powers of two that no product over- or underflows with
    int of_second = 0;
    (void)std::frexp(std::max(std::abs(a), std::abs(b)), &of_first);
    (void)std::frexp(std::max(std::abs(c), std::abs(d)), &of_second);
    a = std::ldexp(a, -of_first);
    b = std::ldexp(b, -of_first);
    c = std::ldexp(c, -of_second);
    d = std::ldexp(d, -of_second);
    const double product = b * c;
    const double rounding = std::fma(b, c, -product);
    return std::ldexp((std::fma(a, d, -product) - rounding) / d, of_first);
  }
};

/// log(e^(m_0) + e^(m_1) + ...), with the largest m taken out.
struct LogSumExp {
  template <RealArray M>
  double operator()(const M& m) const {
    double largest = component(m, 0);
    for (std::size_t i = 1; i < component_count(m); ++i) largest = std::max(largest, component(m, i));
    double total = 0;
    for (std::size_t i = 0; i < component_count(m); ++i) total += std::exp(component(m, i) - largest);
    return largest + std::log(total);
  }
  /// -log(1 + 4 sum_(i<j) p_i p_j sinh^2((d_i - d_j) / 2)) / 2, p = the weights e^(m_i) / sum.
  template <RealArray M>
  double gap(const M& m, const M& d) const {
    const double log_sum = (*this)(m);
    double widest = 0;
    for (std::size_t i = 1; i < component_count(m); ++i) {
      const double width = std::abs(component(d, i) - component(d, 0));
      if (!(width <= widest)) widest = width;
    }
    if (!(widest <= 150)) return wide_gap(m, d, log_sum);
    double total = 0;
    for (std::size_t i = 0; i < component_count(m); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double p = std::exp(component(m, i) + component(m, j) - 2 * log_sum);
        const double s = std::sinh(0.5 * (component(d, i) - component(d, j)));
        total += p * s * s;
      }
    }
    return -0.5 * std::log1p(4 * total);
  }

 private:
  /// The same where sinh over- or the weights underflow: 4 p_i p_j sinh^2(w / 2) = e^(m_i + m_j - 2 log_sum + |w|) (1 -
  /// e^-|w|)^2, w = d_i - d_j, with the largest exponent taken out.
  template <RealArray M>
  static double wide_gap(const M& m, const M& d, double log_sum) {
    double largest = 0;
    double total = 1;  // in units of e^largest, and the 1 of log1p
    for (std::size_t i = 0; i < component_count(m); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double width = std::abs(component(d, i) - component(d, j));
        const double exponent = (component(m, i) - log_sum) + (component(m, j) - log_sum) + width;
        const double fall = std::expm1(-width);
        if (exponent > largest) {
          total *= std::exp(largest - exponent);
          largest = exponent;
        }
        total += std::exp(exponent - largest) * fall * fall;
      }
    }
    return -0.5 * (largest + std::log(total));
  }
};

/// log m_0 + m_1: the log of a mean of weights e^(l - c), and c beside them. l itself may lie anywhere, e^l would be 0.
struct ShiftedLog {
  template <RealArray M>
  double operator()(const M& m) const {
    return Log{}(component(m, 0)) + component(m, 1);
  }
  template <RealArray M>
  double gap(const M& m, const M& d) const {
    return Log{}.gap(component(m, 0), component(d, 0));
  }
  template <RealArray M>
  double gap_of_halves(const M& a, const M& b) const {
    const double x = component(a, 0);
    const double y = component(b, 0);
    return lopsided(x, y) ? Log{}.gap_of_halves(x, y) : Log{}.gap((x + y) / 2, (x - y) / 2);
  }
};

}  // namespace debias::functions

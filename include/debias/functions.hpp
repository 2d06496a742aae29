#pragma once

// Functions g of a mean whose doubling difference has a form without cancellation.
//
//   gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2,  m = mean, d = half the difference of the halves
//
// The gap is about -g''(m) d^2 / 2. For small d that is far below the rounding of g, and subtracting leaves a
// residue of 1e-17 that a law divides by the probability of its level. The forms here are off by a few ulp of
// the gap (exponentials: |m| ulp) and exactly zero at d = 0. Nothing is checked and nothing clamped: outside
// its domain a function is NaN or infinite and its gap NaN, and the run reports that.
// expand(a) is the power series of g about a, for taylor.hpp; it throws std::invalid_argument where there is
// none. Each takes one real number; componentwise(g) makes it a function of real arrays. A g of yours with a
// member gap(m, d) is used in the same way.
// values(m) and gaps(m, d), where there are some, do the same to many numbers in place: d becomes the gap.
// Source: derived here from expm1, atanh and (a - b)(a + b); tested against 50 digits.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/text.hpp>
#include <debias/core/value.hpp>
#include <debias/core/vector_math.hpp>
#include <debias/power_series.hpp>

namespace debias::functions {

namespace detail {
[[noreturn]] inline void refuse_centre(const char* function, double a, const char* domain) {
  throw std::invalid_argument(std::string("functions::") + function + ": centre = " + debias::detail::format("%f", a) +
                              " (must " + domain + ")");
}
inline void require_centre(bool holds, const char* function, double a, const char* domain) {
  if (!holds || !std::isfinite(a)) [[unlikely]]
    refuse_centre(function, a, domain);
}
}  // namespace detail

/// e^x. The form has one exponential of the larger half, so that it cannot overflow before g does.
struct Exp {
  double operator()(double m) const { return std::exp(m); }
  double gap(double m, double d) const {
    const double fall = std::expm1(-std::abs(d));
    return -0.5 * std::exp(m + std::abs(d)) * fall * fall;
  }
  static void values(std::span<double> m) { vector_math::exp(m); }
  /// Uses m up.
  static void gaps(std::span<double> m, std::span<double> d) {
    for (std::size_t i = 0; i < m.size(); ++i) {
      d[i] = std::abs(d[i]);
      m[i] += d[i];
      d[i] = -d[i];
    }
    vector_math::exp(m);
    vector_math::expm1(d);
    for (std::size_t i = 0; i < m.size(); ++i) d[i] = -0.5 * m[i] * d[i] * d[i];
  }
  ExponentialSeries expand(double a) const {
    detail::require_centre(std::abs(a) <= 700, "Exp", a, "lie in [-700, 700], where doubles hold its exponential");
    return {(*this)(a), 1, a};
  }
};

/// e^-x: the transmittance of an optical depth.
struct ExpMinus {
  double operator()(double m) const { return std::exp(-m); }
  double gap(double m, double d) const { return Exp{}.gap(-m, d); }
  static void values(std::span<double> m) {
    negate(m);
    vector_math::exp(m);
  }
  static void gaps(std::span<double> m, std::span<double> d) {
    negate(m);
    Exp::gaps(m, d);
  }
  ExponentialSeries expand(double a) const {
    detail::require_centre(std::abs(a) <= 700, "ExpMinus", a, "lie in [-700, 700], where doubles hold its exponential");
    return {(*this)(a), -1, a};
  }

 private:
  static void negate(std::span<double> m) {
    for (double& x : m) x = -x;
  }
};

/// 1 / x.
struct Reciprocal {
  double operator()(double m) const { return 1 / m; }
  double gap(double m, double d) const { return -(d / m) * (d / (m - d)) / (m + d); }
  BinomialSeries expand(double a) const {
    detail::require_centre(a != 0, "Reciprocal", a, "not be 0");
    return {1 / a, -1, a};
  }
};

/// x^2.
struct Square {
  double operator()(double m) const { return m * m; }
  double gap(double /*m*/, double d) const { return -d * d; }
  QuadraticSeries expand(double a) const {
    detail::require_centre(true, "Square", a, "be finite");
    return {a * a, 2 * a, 1};
  }
};

/// log x.
struct Log {
  double operator()(double m) const { return std::log(m); }
  double gap(double m, double d) const {
    if (!(m > 0)) return std::numeric_limits<double>::quiet_NaN();  // (d / m)^2 has forgotten the sign of m
    const double r = d / m;
    return -0.5 * std::log1p(-r * r);
  }
  static void values(std::span<double> m) { vector_math::log(m); }
  static void gaps(std::span<double> m, std::span<double> d) {
    for (std::size_t i = 0; i < m.size(); ++i) {
      const double r = d[i] / m[i];
      d[i] = m[i] > 0 ? -r * r : std::numeric_limits<double>::quiet_NaN();
    }
    vector_math::log1p(d);
    for (double& x : d) x *= -0.5;
  }
  LogSeries expand(double a) const {
    detail::require_centre(a > 0, "Log", a, "be positive");
    return LogSeries(a);
  }
};

/// The square root of x.
struct Sqrt {
  double operator()(double m) const { return std::sqrt(m); }
  double gap(double m, double d) const {
    if (m == 0 && d == 0) return 0;  // all draws zero: legal, and 0 / 0 below
    const double high = std::sqrt(m + d);
    const double low = std::sqrt(m - d);
    return d / (2 * std::sqrt(m) + high + low) * (d / (m + high * low));
  }
  BinomialSeries expand(double a) const {
    detail::require_centre(a > 0, "Sqrt", a, "be positive");
    return {std::sqrt(a), 0.5, a};
  }
};

namespace detail {
/// 1 - ((1 + r)^a + (1 - r)^a) / 2 for |r| < 1, from the even and odd parts of a log(1 +- r).
inline double relative_power_gap(double a, double r) {
  const double even = 0.5 * a * std::log1p(-r * r);
  const double odd = a * std::atanh(r);
  const double half = std::sinh(0.5 * odd);
  return -(std::expm1(even) * std::cosh(odd) + 2 * half * half);
}
/// Beyond this r = d / m the halves differ so much that subtracting loses no digits worth a formula; and at
/// r = 1, a half that is zero, the logarithms are infinite.
inline constexpr double largest_ratio = 0.5;
}  // namespace detail

/// x^exponent, for x > 0 (any x where the exponent is an integer).
struct Power {
  double exponent;

  double operator()(double m) const { return std::pow(m, exponent); }
  double gap(double m, double d) const {
    const double value = (*this)(m);
    const double r = d / m;
    if (std::abs(r) <= detail::largest_ratio) return value * detail::relative_power_gap(exponent, r);
    return value - 0.5 * ((*this)(m + d) + (*this)(m - d));
  }
  BinomialSeries expand(double a) const {
    detail::require_centre(a > 0 || (a < 0 && exponent == std::floor(exponent)), "Power", a,
                           "be positive; not 0 for a whole exponent");
    return {(*this)(a), exponent, a};
  }
};

/// (1 + c^2 x)^(-1 / c^2), c > 0: the transmittance of an optical depth in a correlated medium; e^-x for
/// c -> 0 [Davis & Mineev-Weinstein 2011].
struct Davis {
  double c;

  double operator()(double m) const { return std::exp(-std::log1p(c * c * m) / (c * c)); }
  double gap(double m, double d) const {
    const double value = (*this)(m);
    const double r = c * c * d / (1 + c * c * m);
    if (std::abs(r) <= detail::largest_ratio) return value * detail::relative_power_gap(-1 / (c * c), r);
    return value - 0.5 * ((*this)(m + d) + (*this)(m - d));
  }
  BinomialSeries expand(double a) const {
    detail::require_centre(1 + c * c * a > 0, "Davis", a, "lie above -1 / c^2");
    return {(*this)(a), -1 / (c * c), a + 1 / (c * c)};
  }
};

/// 1 / (1 + e^-x).
struct Logistic {
  double operator()(double m) const { return 1 / (1 + std::exp(-m)); }
  double gap(double m, double d) const {
    // tanh(m / 2) sinh^2(d / 2) / (cosh m + cosh d), divided through by e^|d| against overflow
    const double fall = std::expm1(-std::abs(d));
    const double bottom =
        1 + std::exp(-2 * std::abs(d)) + std::exp(std::abs(m) - std::abs(d)) * (1 + std::exp(-2 * std::abs(m)));
    return 0.5 * std::tanh(0.5 * m) * fall * fall / bottom;
  }
  LogisticSeries expand(double a) const {
    detail::require_centre(true, "Logistic", a, "be finite");
    return LogisticSeries(a);
  }
};

/// |x|. The gap is zero unless the halves lie on both sides of the kink.
struct Absolute {
  double operator()(double m) const { return std::abs(m); }
  double gap(double m, double d) const {
    const double excess = std::abs(d) - std::abs(m);
    return excess <= 0 ? 0.0 : -excess;  // a NaN gets through
  }
};

/// max(x, 0). The gap is zero unless the halves lie on both sides of the kink.
struct PositivePart {
  double operator()(double m) const { return m < 0 ? 0.0 : m; }
  double gap(double m, double d) const { return 0.5 * Absolute{}.gap(m, d); }
};

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
    const double bottom = component(m, 1);
    const double bottom_d = component(d, 1);
    const double top = component(d, 0) - (*this)(m)*bottom_d;
    return top / (bottom + bottom_d) * (bottom_d / (bottom - bottom_d));
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
};

}  // namespace debias::functions

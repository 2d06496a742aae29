#pragma once

// Functions g of a mean whose doubling difference has a form without cancellation.
//
//   gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2,  m = mean, d = half the difference of the halves
//
// The gap is about -g''(m) d^2 / 2. For small d that is far below the rounding of g, and subtracting leaves a
// residue of 1e-17 that a PMF divides by the probability of its level. The forms here are off by some ten ulp of
// the gap (exponentials: |m| ulp; LogSumExp: |m| ulp of 1) and exactly zero at d = 0. Nothing is checked and nothing
// clamped: outside its domain a function is NaN or infinite and its gap NaN, and the run reports that.
// m and d know the smaller half to 2^-53 of the larger one only. gap_of_halves(a, b), a = m + d, b = m - d, knows both: a
// sequence uses it where one is below 2^-26 of the other (lopsided); above, a gap is off by 2^-52 |a / b|.
// Limits that are finite: e^-inf = 0, 1 / inf = inf^-p = 0, finite / inf = 0, inf^0 = 1, logistic(inf) = 1, (-inf) = 0,
// PositivePart(-inf) = 0. A NaN stays one.
// expand(a) is the power series of g about a, for taylor.hpp; it throws std::invalid_argument where there is
// none. Each takes one real number; componentwise(g) makes it a function of real arrays. A g of yours with a
// member gap(m, d) is used in the same way.
// values(m) and gaps(m, d), where there are some, do the same to many numbers in place: d becomes the gap.
// Source: derived here from expm1, atanh and (a - b)(a + b); tested against 50 digits.

#include <algorithm>
#include <array>
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
#include <debias/functions/power_series.hpp>

namespace debias::functions {

namespace detail {
/// |m| - |d| without rounding: positive where both halves are on one side of zero.
inline double nearer_half(double a, double b) {
  const double least = std::abs(b) < std::abs(a) ? std::abs(b) : std::abs(a);
  return std::signbit(a) == std::signbit(b) ? least : -least;
}

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
  double gap_of_halves(double a, double b) const {
    const double fall = std::expm1(-std::abs(a / 2 - b / 2));
    return -0.5 * std::exp(b > a ? b : a) * fall * fall;
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
  double gap_of_halves(double a, double b) const { return Exp{}.gap_of_halves(-a, -b); }
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
  double gap(double m, double d) const { return form(m, d, m + d, m - d); }
  double gap_of_halves(double a, double b) const { return form(a / 2 + b / 2, a / 2 - b / 2, a, b); }
  BinomialSeries expand(double a) const {
    detail::require_centre(a != 0, "Reciprocal", a, "not be 0");
    return {1 / a, -1, a};
  }

 private:
  // The squares under- or overflow, the gap may not.
  [[gnu::noinline]] static double far_form(double m, double d, double a, double b) {
    const bool a_is_larger = std::abs(a) > std::abs(b);
    if (std::abs(d / m) < 1) return -(d / m) * (d / b / a);
    return -(d / m) * (d / (a_is_larger ? a : b)) / (a_is_larger ? b : a);
  }
  static double form(double m, double d, double a, double b) {
    const double squares = -(d / m) * (d / b);
    const double size = std::abs(squares);
    if (!(size > 1e-290 && size < 1e290)) [[unlikely]]
      return far_form(m, d, a, b);
    return squares / a;
  }
};

/// x^2.
struct Square {
  double operator()(double m) const { return m * m; }
  double gap(double m, double d) const { return std::isnan(m) ? m : -d * d; }
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
    if (1 - r * r < far) [[unlikely]]
      return far_gap(m, m + d, m - d);
    return -0.5 * std::log1p(-r * r);
  }
  double gap_of_halves(double a, double b) const {
    if (!(a > 0 && b > 0)) return std::numeric_limits<double>::quiet_NaN();
    return far_gap(a / 2 + b / 2, a, b);
  }
  static void values(std::span<double> m) { vector_math::log(m); }
  static void gaps(std::span<double> m, std::span<double> d) {
    constexpr std::size_t some = 64;
    for (; m.size() > some; m = m.subspan(some), d = d.subspan(some)) gaps(m.first(some), d.first(some));
    std::array<double, some> given;
    std::copy(d.begin(), d.end(), given.begin());
    bool any_far = false;
    for (std::size_t i = 0; i < m.size(); ++i) {
      const double r = d[i] / m[i];
      d[i] = m[i] > 0 ? -r * r : std::numeric_limits<double>::quiet_NaN();
      any_far = any_far || 1 + d[i] < far;
    }
    vector_math::log1p(d);
    for (double& x : d) x *= -0.5;
    if (!any_far) [[likely]]
      return;
    for (std::size_t i = 0; i < m.size(); ++i) {
      if (std::abs(given[i]) > 0.5 * m[i]) d[i] = Log{}.gap(m[i], given[i]);
    }
  }
  LogSeries expand(double a) const {
    detail::require_centre(a > 0, "Log", a, "be positive");
    return LogSeries(a);
  }

 private:
  static constexpr double far = 0x1p-7;  // (1 - r)(1 + r) of halves that r no longer tells apart
  /// log(m^2 / (a b)) / 2. A half that is zero or negative makes it infinite or NaN.
  static double far_gap(double m, double a, double b) {
    const double low = (b < a ? b : a) / m;
    const double of_low = low < 1e-290 && low >= 0 ? std::log(b < a ? b : a) - std::log(m) : std::log(low);
    return -0.5 * (std::log((b < a ? a : b) / m) + of_low);
  }
};

/// The square root of x.
struct Sqrt {
  double operator()(double m) const { return std::sqrt(m); }
  double gap(double m, double d) const {
    if (m == 0 && d == 0) return 0;  // all draws zero: legal, and 0 / 0 below
    if (m < tiny) [[unlikely]]
      return 0x1p-150 * form(m * 0x1p300, d * 0x1p300, (m + d) * 0x1p300, (m - d) * 0x1p300);
    return form(m, d, m + d, m - d);
  }
  double gap_of_halves(double a, double b) const {
    if (a < tiny && b < tiny) return gap(a / 2 + b / 2, a / 2 - b / 2);
    return form(a / 2 + b / 2, a / 2 - b / 2, a, b);
  }
  BinomialSeries expand(double a) const {
    detail::require_centre(a > 0, "Sqrt", a, "be positive");
    return {std::sqrt(a), 0.5, a};
  }

 private:
  static constexpr double tiny = 1e-280;  // near the smallest numbers products have no digits
  static double form(double m, double d, double a, double b) {
    const double high = std::sqrt(a);
    const double low = std::sqrt(b);
    return d / (2 * std::sqrt(m) + high + low) * (d / (m + high * low));
  }
};

namespace detail {
/// Exponents so near to 0 or 1, where a gap is zero, that what is left of it has to be a factor of its form.
inline bool nearly_linear(double a) { return std::abs(a) < 0.125 || std::abs(a - 1) < 0.125; }

/// 1 - ((1 + r)^a + (1 - r)^a) / 2 = -sum_(k >= 1) binomial(a, 2 k) r^(2 k) for |r| <= 1/2 and a near 0 or 1.
inline double nearly_linear_gap(double a, double r) {
  double term = 1;
  double total = 0;
  for (int k = 0; k < 60; k += 2) {
    term *= (a - k) / (k + 1) * ((a - k - 1) / (k + 2)) * (r * r);
    total -= term;
  }
  return total;
}

/// The same from the halves high = 1 + |r| and low = 1 - |r| for |r| > 1/2 and a near 0 or 1.
inline double nearly_linear_gap(double a, double high, double low) {
  if (std::abs(a) < 0.125) {
    if (low == 0 && a > 0) return 0.5 - 0.5 * std::expm1(a * std::log(high));
    return -0.5 * (std::expm1(a * std::log(high)) + std::expm1(a * std::log(low)));
  }
  const double b = a - 1;
  const double of_low = low == 0 ? 0 : low * std::expm1(b * std::log(low));
  return -0.5 * (high * std::expm1(b * std::log(high)) + of_low);
}

/// 1 - ((1 + r)^a + (1 - r)^a) / 2 for |r| < 1, from the even and odd parts of a log(1 +- r).
inline double relative_power_gap(double a, double r) {
  if (nearly_linear(a)) [[unlikely]]
    return nearly_linear_gap(a, r);
  const double even = 0.5 * a * std::log1p(-r * r);
  const double odd = a * std::atanh(r);
  const double half = std::sinh(0.5 * odd);
  return -(std::expm1(even) * std::cosh(odd) + 2 * half * half);
}
/// Beyond this r = d / m the halves differ so much that subtracting loses no digits worth a formula; and at
/// r = 1, a half that is zero, the logarithms are infinite.
inline constexpr double largest_ratio = 0.5;
/// Where a |r| is larger, cosh overflows, and one half is all there is.
inline constexpr double largest_odd_part = 300;
inline bool near_enough(double a, double r) {
  return std::abs(r) <= largest_ratio && std::abs(a * r) <= largest_odd_part;
}
}  // namespace detail

/// x^exponent, for x > 0 (any x where the exponent is an integer).
struct Power {
  double exponent;

  double operator()(double m) const {
    if (std::isnan(m) || std::isnan(exponent)) return m + exponent;  // pow(NaN, 0) and pow(1, NaN) are 1
    return std::pow(m, exponent);
  }
  double gap(double m, double d) const {
    const double r = d / m;
    if (detail::near_enough(exponent, r)) return (*this)(m)*detail::relative_power_gap(exponent, r);
    return far_gap(m, m + d, m - d);
  }
  double gap_of_halves(double a, double b) const { return far_gap(a / 2 + b / 2, a, b); }
  BinomialSeries expand(double a) const {
    detail::require_centre(a > 0 || (a < 0 && exponent == std::floor(exponent)), "Power", a,
                           "be positive; not 0 for a whole exponent");
    return {(*this)(a), exponent, a};
  }

 private:
  /// From halves that are far apart.
  [[nodiscard]] double far_gap(double m, double a, double b) const {
    if (exponent == 1) return 0 * (a + b);
    if (detail::nearly_linear(exponent) && a >= 0 && b >= 0 && m > 0) {
      return (*this)(m)*detail::nearly_linear_gap(exponent, (b > a ? b : a) / m, (b > a ? a : b) / m);
    }
    // Halves of either sign whose odd powers nearly cancel: with s = m / d, d^p sinh(p atanh s) (1 - s^2)^(p / 2)
    const double d = a / 2 - b / 2;
    const double s = m / d;
    const bool odd = std::abs(std::fmod(exponent, 2.0)) == 1;
    if (odd && std::abs(s) < 1.0 / 16 && std::abs(exponent * s) < 1) {
      const double even_part = std::exp(0.5 * exponent * std::log1p(-s * s));
      return (*this)(m) - (*this)(d)*even_part * std::sinh(exponent * std::atanh(s));
    }
    return (*this)(m)-0.5 * ((*this)(a) + (*this)(b));
  }
};

/// (1 + c^2 x)^(-1 / c^2), c > 0: the transmittance of an optical depth in a correlated medium; e^-x for
/// c -> 0 [Davis & Mineev-Weinstein 2011].
struct Davis {
  double c;

  double operator()(double m) const { return std::exp(-std::log1p(c * c * m) / (c * c)); }
  double gap(double m, double d) const { return form(m, d, m + d, m - d); }
  double gap_of_halves(double a, double b) const { return form(a / 2 + b / 2, a / 2 - b / 2, a, b); }
  BinomialSeries expand(double a) const {
    detail::require_centre(1 + c * c * a > 0, "Davis", a, "lie above -1 / c^2");
    return {(*this)(a), -1 / (c * c), a + 1 / (c * c)};
  }

 private:
  [[nodiscard]] double form(double m, double d, double a, double b) const {
    const double value = (*this)(m);
    const double power = -1 / (c * c);
    const double base = 1 + c * c * m;
    const double r = c * c * d / base;
    if (detail::near_enough(power, r)) return value * detail::relative_power_gap(power, r);
    const double high = (1 + c * c * (b > a ? b : a)) / base;
    const double low = (1 + c * c * (b > a ? a : b)) / base;
    if (detail::nearly_linear(power) && base > 0 && low > 0) return value * detail::nearly_linear_gap(power, high, low);
    return value - 0.5 * ((*this)(a) + (*this)(b));
  }
};

/// 1 / (1 + e^-x).
struct Logistic {
  double operator()(double m) const { return 1 / (1 + std::exp(-m)); }
  double gap(double m, double d) const { return form(m, d, std::abs(m) - std::abs(d)); }
  double gap_of_halves(double a, double b) const {
    return form(a / 2 + b / 2, a / 2 - b / 2, detail::nearer_half(a, b));
  }
  LogisticSeries expand(double a) const {
    detail::require_centre(true, "Logistic", a, "be finite");
    return LogisticSeries(a);
  }

 private:
  static double form(double m, double d, double nearer) {
    // tanh(m / 2) sinh^2(d / 2) / (cosh m + cosh d), divided through by e^|d| against overflow
    const double fall = std::expm1(-std::abs(d));
    const double bottom = 1 + std::exp(-2 * std::abs(d)) + std::exp(nearer) * (1 + std::exp(-2 * std::abs(m)));
    return 0.5 * std::tanh(0.5 * m) * fall * fall / bottom;
  }
};

/// |x|. The gap is zero unless the halves lie on both sides of the kink.
struct Absolute {
  double operator()(double m) const { return std::abs(m); }
  double gap(double m, double d) const {
    const double excess = std::abs(d) - std::abs(m);
    return excess <= 0 ? 0.0 : -excess;  // a NaN gets through
  }
  double gap_of_halves(double a, double b) const {
    const double nearer = detail::nearer_half(a, b);
    return nearer >= 0 ? 0.0 : nearer;
  }
};

/// max(x, 0). The gap is zero unless the halves lie on both sides of the kink.
struct PositivePart {
  double operator()(double m) const { return m < 0 ? 0.0 : m; }
  double gap(double m, double d) const { return 0.5 * Absolute{}.gap(m, d); }
  double gap_of_halves(double a, double b) const { return 0.5 * Absolute{}.gap_of_halves(a, b); }
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
    const double bottom = component(m, 1);
    const double bottom_d = component(d, 1);
    double top = component(d, 0) - (*this)(m)*bottom_d;
    if (std::abs(top) < 0.0625 * std::abs(component(d, 0))) [[unlikely]]  // nearly the same ratio in both halves
      top = determinant(component(d, 0), bottom_d, component(m, 0), bottom);
    return top / (bottom + bottom_d) * (bottom_d / (bottom - bottom_d));
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

}  // namespace debias::functions

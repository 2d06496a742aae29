#pragma once

// Functions of one number, with the gap of functions.hpp: exponentials, 1/x, x^2, log, square root, logistic, and the two
// that bend, |x| and max(x, 0).
//
//   gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2
//
// Notation, accuracy, and where they fail: functions.hpp. Source: derived from expm1, atanh and (a - b)(a + b).

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>
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

}  // namespace debias::functions

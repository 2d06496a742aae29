#pragma once

// Powers x^p and (1 + c^2 x)^(-1 / c^2), with the gap of functions.hpp.
//
//   gap / g(m) = 1 - ((1 + r)^p + (1 - r)^p) / 2,  r = d / m
//
// From the even and odd parts of p log(1 +- r); where p is near 0 or 1, and a gap near zero, from its series.
// Notation, accuracy, and where they fail: functions.hpp. Source: derived there.

#include <cmath>

#include <debias/functions/elementary.hpp>
#include <debias/functions/power_series.hpp>

namespace debias::functions {

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

}  // namespace debias::functions

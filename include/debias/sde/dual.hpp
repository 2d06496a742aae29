#pragma once

// A number with its slopes in n parameters: what a path carries along to have its own derivatives.
//
//   (f, f_1 ... f_n):  f g -> (f g, f_i g + f g_i),  u(f) -> (u(f), u'(f) f_i)          [Griewank & Walther 2008, 3.1]
//
// Notation: value = f, slopes[i] = f_i. Dual<n, Dual<n>> has second derivatives too. As a Value of the library a Dual has
// n + 1 components, the value first.
// No comparisons: `x > 100 ? 1.0 : 0.0` would have the slope 0 where the mean has not, so that it does not compile; kinks are
// positive_part, max, min and abs, jumps need the conditional last step (sde/sensitivities.hpp). A NaN stays one.
// Why not Boost.Math's autodiff: a path of 64 Milstein steps with three slopes takes 0.6 us here and 176 us there, where three
// variables carry 8 mixed derivatives (`debias_bench --benchmark_filter=dual`); a file that includes it and squares a number
// compiles for 4.4 s, one that includes this for 0.85 s (g++ 12 -O2).
// Source: Griewank & Walther, Evaluating Derivatives, 2nd ed., SIAM 2008.

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <numbers>
#include <type_traits>

#include <debias/sde/models.hpp>

namespace debias {

template <std::size_t n, class T = double>
struct Dual {
  T value{};
  std::array<T, n> slopes{};

  constexpr Dual() = default;
  constexpr Dual(double x) : value(x) {}  // NOLINT: numbers are duals
  constexpr Dual(const T& f, const std::array<T, n>& s) : value(f), slopes(s) {}
  constexpr Dual(const T& f) requires(!std::same_as<T, double>) : value(f) {}  // NOLINT
  constexpr explicit operator double() const { return static_cast<double>(value); }

  /// Parameter i of n, at x.
  static constexpr Dual parameter(std::size_t i, const T& x) {
    Dual p;
    p.value = x;
    p.slopes[i] = T(1);
    return p;
  }
};

namespace detail {

template <std::size_t n, class T>
inline constexpr bool is_number<Dual<n, T>> = true;

/// f(x) and f(x, y) from their values and derivatives.
template <std::size_t n, class T>
constexpr Dual<n, T> chain(const T& f, const T& fx, const Dual<n, T>& x) {
  Dual<n, T> r;
  r.value = f;
  for (std::size_t i = 0; i < n; ++i) r.slopes[i] = fx * x.slopes[i];
  return r;
}
template <std::size_t n, class T>
constexpr Dual<n, T> chain(const T& f, const T& fx, const Dual<n, T>& x, const T& fy, const Dual<n, T>& y) {
  Dual<n, T> r;
  r.value = f;
  for (std::size_t i = 0; i < n; ++i) r.slopes[i] = fx * x.slopes[i] + fy * y.slopes[i];
  return r;
}
/// Each number of a by itself.
template <std::size_t n, class T, class F>
constexpr Dual<n, T> each(const Dual<n, T>& a, const F& f) {
  Dual<n, T> r;
  r.value = f(a.value);
  for (std::size_t i = 0; i < n; ++i) r.slopes[i] = f(a.slopes[i]);
  return r;
}

/// The other operand of an operation: a double, or the number within a nested dual.
template <class S, class T>
concept Within = std::is_arithmetic_v<S> ||(std::same_as<S, T> && !std::same_as<T, double>);

}  // namespace detail

template <std::size_t n, class T>
constexpr Dual<n, T> operator-(const Dual<n, T>& a) {
  return detail::each(a, [](const T& x) { return -x; });
}
template <std::size_t n, class T>
constexpr Dual<n, T> operator+(const Dual<n, T>& a, const Dual<n, T>& b) {
  Dual<n, T> r;
  r.value = a.value + b.value;
  for (std::size_t i = 0; i < n; ++i) r.slopes[i] = a.slopes[i] + b.slopes[i];
  return r;
}
template <std::size_t n, class T>
constexpr Dual<n, T> operator-(const Dual<n, T>& a, const Dual<n, T>& b) {
  Dual<n, T> r;
  r.value = a.value - b.value;
  for (std::size_t i = 0; i < n; ++i) r.slopes[i] = a.slopes[i] - b.slopes[i];
  return r;
}
template <std::size_t n, class T>
constexpr Dual<n, T> operator*(const Dual<n, T>& a, const Dual<n, T>& b) {
  return detail::chain<n, T>(a.value * b.value, b.value, a, a.value, b);
}
template <std::size_t n, class T>
constexpr Dual<n, T> operator/(const Dual<n, T>& a, const Dual<n, T>& b) {
  const T inverse = 1 / b.value;
  const T q = a.value * inverse;
  return detail::chain<n, T>(q, inverse, a, -q * inverse, b);
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator+(Dual<n, T> a, const S& b) {
  a.value = a.value + b;
  return a;
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator+(const S& a, Dual<n, T> b) {
  b.value = a + b.value;
  return b;
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator-(Dual<n, T> a, const S& b) {
  a.value = a.value - b;
  return a;
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator-(const S& a, const Dual<n, T>& b) {
  return -b + a;
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator*(const Dual<n, T>& a, const S& b) {
  return detail::each(a, [&b](const T& x) { return x * b; });
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator*(const S& a, const Dual<n, T>& b) {
  return b * a;
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator/(const Dual<n, T>& a, const S& b) {
  return detail::each(a, [&b](const T& x) { return x / b; });
}
template <std::size_t n, class T, detail::Within<T> S>
constexpr Dual<n, T> operator/(const S& a, const Dual<n, T>& b) {
  const T q = a / b.value;
  return detail::chain<n, T>(q, -q / b.value, b);
}
template <std::size_t n, class T, class S>
constexpr Dual<n, T>& operator+=(Dual<n, T>& a, const S& b) {
  return a = a + b;
}
template <std::size_t n, class T, class S>
constexpr Dual<n, T>& operator-=(Dual<n, T>& a, const S& b) {
  return a = a - b;
}
template <std::size_t n, class T, class S>
constexpr Dual<n, T>& operator*=(Dual<n, T>& a, const S& b) {
  return a = a * b;
}
template <std::size_t n, class T, class S>
constexpr Dual<n, T>& operator/=(Dual<n, T>& a, const S& b) {
  return a = a / b;
}

template <std::size_t n, class T>
Dual<n, T> exp(const Dual<n, T>& x) {
  using std::exp;
  const T f = exp(x.value);
  return detail::chain<n, T>(f, f, x);
}
template <std::size_t n, class T>
Dual<n, T> log(const Dual<n, T>& x) {
  using std::log;
  return detail::chain<n, T>(log(x.value), 1 / x.value, x);
}
template <std::size_t n, class T>
Dual<n, T> sqrt(const Dual<n, T>& x) {
  using std::sqrt;
  const T f = sqrt(x.value);
  return detail::chain<n, T>(f, 0.5 / f, x);
}
template <std::size_t n, class T>
Dual<n, T> pow(const Dual<n, T>& x, double p) {
  using std::pow;
  return detail::chain<n, T>(pow(x.value, p), p * pow(x.value, p - 1), x);
}
template <std::size_t n, class T>
Dual<n, T> sin(const Dual<n, T>& x) {
  using std::cos;
  using std::sin;
  return detail::chain<n, T>(sin(x.value), cos(x.value), x);
}
template <std::size_t n, class T>
Dual<n, T> cos(const Dual<n, T>& x) {
  using std::cos;
  using std::sin;
  return detail::chain<n, T>(cos(x.value), -sin(x.value), x);
}
template <std::size_t n, class T>
Dual<n, T> tanh(const Dual<n, T>& x) {
  using std::tanh;
  const T f = tanh(x.value);
  return detail::chain<n, T>(f, 1 - f * f, x);
}
template <std::size_t n, class T>
Dual<n, T> abs(const Dual<n, T>& x) {
  return static_cast<double>(x) < 0 ? -x : x;
}

/// x where it is positive, else 0: the slope of a kink is that of its side, at 0 that of the left.
template <class X>
X positive_part(const X& x) {
  return static_cast<double>(x) <= 0 ? X(0) : x;  // in this order a NaN stays
}
template <std::size_t n, class T, class S>
requires std::convertible_to<S, Dual<n, T>> Dual<n, T> max(const Dual<n, T>& a, const S& b) {
  return b + positive_part(a - b);
}
template <std::size_t n, class T, class S>
requires std::convertible_to<S, Dual<n, T>> Dual<n, T> min(const Dual<n, T>& a, const S& b) {
  return a - positive_part(a - b);
}

/// The standard normal density and distribution.
inline double normal_density(double x) { return std::exp(-x * x / 2) / std::sqrt(2 * std::numbers::pi); }
inline double normal_distribution(double x) { return std::erfc(-x * std::numbers::sqrt2 / 2) / 2; }
template <std::size_t n, class T>
Dual<n, T> normal_density(const Dual<n, T>& x) {
  const T f = normal_density(x.value);
  return detail::chain<n, T>(f, -x.value * f, x);
}
template <std::size_t n, class T>
Dual<n, T> normal_distribution(const Dual<n, T>& x) {
  return detail::chain<n, T>(normal_distribution(x.value), normal_density(x.value), x);
}

namespace detail {

/// (e^v - 1) / v and log(1 + u) / u, of any number, at 0 by their series.
template <class X>
X exp_ratio(const X& v) {
  using std::exp;
  if (!(std::abs(static_cast<double>(v)) < 0.1)) return (exp(v) - 1) / v;
  X sum = X(1);
  for (int n = 11; n >= 2; --n) sum = sum * v / n + 1;
  return sum;
}
template <class X>
X log_ratio(const X& u) {
  using std::log;
  if (!(std::abs(static_cast<double>(u)) < 0.04)) return log(X(u + 1)) / u;
  X sum = X(1.0 / 12);
  for (int n = 11; n >= 1; --n) sum = 1.0 / n - sum * u;
  return sum;
}
/// The mean of the normal density over [-z, q - z].
template <class X>
X mean_density(const X& z, const X& q) {
  if (!(std::abs(static_cast<double>(q)) < 0.05)) {
    return (normal_distribution(X(q - z)) - normal_distribution(X(-z))) / q;
  }
  // Hermite polynomials: the derivatives of the density
  X below = X(0);
  X hermite = X(1);
  X factor = X(1);
  X sum = X(1);
  for (int n = 1; n <= 8; ++n) {
    const X next = z * hermite - static_cast<double>(n - 1) * below;
    below = hermite;
    hermite = next;
    factor = factor * q / (n + 1);
    sum = sum + factor * hermite;
  }
  return sum * normal_density(z);
}

}  // namespace detail

// What no mean of slopes knows: a jump.
template <std::size_t n, class T, class S>
void operator<(const Dual<n, T>& a, const S& b) = delete;
template <std::size_t n, class T, class S>
void operator>(const Dual<n, T>& a, const S& b) = delete;
template <std::size_t n, class T, class S>
void operator<=(const Dual<n, T>& a, const S& b) = delete;
template <std::size_t n, class T, class S>
void operator>=(const Dual<n, T>& a, const S& b) = delete;

// A Value (core/value.hpp).
template <std::size_t n, class T>
constexpr std::size_t component_count(const Dual<n, T>&) {
  if constexpr (std::same_as<T, double>) {
    return n + 1;
  } else {
    return (n + 1) * component_count(T{});
  }
}
template <std::size_t n, class T>
constexpr double component(const Dual<n, T>& v, std::size_t i) {
  if constexpr (std::same_as<T, double>) {
    return i == 0 ? v.value : v.slopes[i - 1];
  } else {
    constexpr std::size_t each = component_count(T{});
    return component(i < each ? v.value : v.slopes[i / each - 1], i % each);
  }
}
template <std::size_t n, class T>
constexpr void set_component(Dual<n, T>& v, std::size_t i, double x) {
  if constexpr (std::same_as<T, double>) {
    (i == 0 ? v.value : v.slopes[i - 1]) = x;
  } else {
    constexpr std::size_t each = component_count(T{});
    set_component(i < each ? v.value : v.slopes[i / each - 1], i % each, x);
  }
}

}  // namespace debias

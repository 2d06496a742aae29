#pragma once

// What can be estimated: double, float, complex, plain Eigen arrays (fixed or dynamic), and any type of yours.
//
// A value is a list of real components (a complex number has two) with + and -. Estimators scale differences
// by 1/p and add them; statistics read the components in double. A type of yours takes part when it has
// a + b, a - b and, found by argument-dependent lookup in its own namespace,
//
//   std::size_t component_count(const V&);
//   double      component(const V&, std::size_t i);
//   void        set_component(V&, std::size_t i, double x);
//
// All values of one run must have the same number of components. Fails when a component does not fit a
// double, or when + is not componentwise: means are taken component by component.

#include <algorithm>
#include <cmath>
#include <complex>
#include <concepts>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace debias {

template <class T>
concept RealValue = std::same_as<T, double> || std::same_as<T, float>;

template <class T>
concept ComplexValue = std::same_as<T, std::complex<double>> || std::same_as<T, std::complex<float>>;

/// An Eigen array or matrix that owns its numbers, recognised without including Eigen.
template <class T>
concept ArrayValue = std::same_as<T, typename T::PlainObject> && requires(T& a) {
  requires RealValue<typename T::Scalar> || ComplexValue<typename T::Scalar>;
  { a.data() } -> std::convertible_to<typename T::Scalar*>;
  a.size();
};

template <RealValue T>
constexpr std::size_t component_count(T) {
  return 1;
}
template <RealValue T>
constexpr double component(T v, std::size_t) {
  return static_cast<double>(v);
}
template <RealValue T>
constexpr void set_component(T& v, std::size_t, double x) {
  v = static_cast<T>(x);
}

template <ComplexValue T>
constexpr std::size_t component_count(const T&) {
  return 2;
}
template <ComplexValue T>
constexpr double component(const T& v, std::size_t i) {
  return static_cast<double>(i == 0 ? v.real() : v.imag());
}
template <ComplexValue T>
constexpr void set_component(T& v, std::size_t i, double x) {
  using R = typename T::value_type;
  i == 0 ? v.real(static_cast<R>(x)) : v.imag(static_cast<R>(x));
}

template <ArrayValue A>
std::size_t component_count(const A& a) {
  return static_cast<std::size_t>(a.size()) * component_count(typename A::Scalar{});
}
template <ArrayValue A>
double component(const A& a, std::size_t i) {
  constexpr std::size_t n = component_count(typename A::Scalar{});
  return component(a.data()[i / n], i % n);
}
template <ArrayValue A>
void set_component(A& a, std::size_t i, double x) {
  constexpr std::size_t n = component_count(typename A::Scalar{});
  set_component(a.data()[i / n], i % n, x);
}

template <class V>
concept Value = std::copy_constructible<V> && std::is_copy_assignable_v<V> &&
    requires(V& v, const V& a, const V& b, std::size_t i, double x) {
  { component_count(a) } -> std::convertible_to<std::size_t>;
  { component(a, i) } -> std::convertible_to<double>;
  set_component(v, i, x);
  { a + b } -> std::convertible_to<V>;
  { a - b } -> std::convertible_to<V>;
};

/// The relative spacing of the numbers that a value is made of: 2^-23 for single precision, else 2^-52.
template <Value V>
constexpr double epsilon_of() {
  if constexpr (RealValue<V>) {
    return static_cast<double>(std::numeric_limits<V>::epsilon());
  } else if constexpr (ComplexValue<V>) {
    return epsilon_of<typename V::value_type>();
  } else if constexpr (ArrayValue<V>) {
    return epsilon_of<typename V::Scalar>();
  } else {
    return std::numeric_limits<double>::epsilon();
  }
}

/// factor * v, component by component in double.
template <Value V>
V scaled(V v, double factor) {
  for (std::size_t i = 0; i < component_count(v); ++i) set_component(v, i, component(v, i) * factor);
  return v;
}

namespace detail {
// Eigen checks this by assertions only; without them it would read beyond the end of the smaller array.
template <ArrayValue A>
void check_same_shape(const A& a, const A& b) {
  if (a.rows() == b.rows() && a.cols() == b.cols()) return;
  const auto shape = [](const A& x) { return std::to_string(x.rows()) + " x " + std::to_string(x.cols()); };
  throw std::invalid_argument("value: arrays of " + shape(a) + " and " + shape(b) +
                              " meet (all values of a run must have the same shape)");
}
}  // namespace detail

/// a + b without a temporary on the heap: dynamic arrays reuse the storage of a.
/// Throws std::invalid_argument for arrays of different shapes.
template <Value V>
V sum(V a, const V& b) {
  if constexpr (ArrayValue<V>) {
    detail::check_same_shape(a, b);
    a += b;
  } else {
    a = a + b;
  }
  return a;
}

/// a - b, likewise.
template <Value V>
V difference(V a, const V& b) {
  if constexpr (ArrayValue<V>) {
    detail::check_same_shape(a, b);
    a -= b;
  } else {
    a = a - b;
  }
  return a;
}

/// Zero of the same shape as v.
template <Value V>
V zero_like(V v) {
  for (std::size_t i = 0; i < component_count(v); ++i) set_component(v, i, 0.0);
  return v;
}

/// True where every component is finite.
template <Value V>
bool is_finite(const V& v) {
  for (std::size_t i = 0; i < component_count(v); ++i) {
    if (!std::isfinite(component(v, i))) return false;
  }
  return true;
}

/// True where some component is NaN.
template <Value V>
bool has_nan(const V& v) {
  for (std::size_t i = 0; i < component_count(v); ++i) {
    if (std::isnan(component(v, i))) return true;
  }
  return false;
}

/// NaN of the same shape as v: what is left of a value that was made of numbers that are none.
template <Value V>
V nan_like(V v) {
  for (std::size_t i = 0; i < component_count(v); ++i) {
    set_component(v, i, std::numeric_limits<double>::quiet_NaN());
  }
  return v;
}

/// Is a component of one half, not zero, so small beside that of the other that their mean and half difference know
/// less than half of its digits?
template <Value V>
bool lopsided(const V& a, const V& b) {
  for (std::size_t i = 0; i < component_count(a); ++i) {
    const double x = std::abs(component(a, i));
    const double y = std::abs(component(b, i));
    const double small = y < x ? y : x;
    if (small > 0 && small < 0x1p-26 * (y < x ? x : y)) return true;
  }
  return false;
}

/// The one number that level rows, third and fourth moments and the largest samples use: a real value itself,
/// with its sign; what a value names by `double scalar() const`; of anything else the Euclidean norm over its components,
/// safe from overflow.
template <Value V>
double as_scalar(const V& v) {
  if constexpr (RealValue<V>) {
    return static_cast<double>(v);
  } else if constexpr (requires {
                         { v.scalar() } -> std::same_as<double>;
                       }) {
    return v.scalar();
  } else {
    double largest = 0;
    for (std::size_t i = 0; i < component_count(v); ++i) {
      const double x = std::abs(component(v, i));
      if (x > largest || std::isnan(x)) largest = x;  // a NaN stays
    }
    if (largest == 0 || !std::isfinite(largest)) return largest;
    double squares = 0;
    for (std::size_t i = 0; i < component_count(v); ++i) {
      const double x = component(v, i) / largest;
      squares += x * x;
    }
    return largest * std::sqrt(squares);
  }
}

/// The type of a mean: double precision for scalars, the value's own type otherwise.
template <Value V>
using mean_t = std::conditional_t<RealValue<V>, double, std::conditional_t<ComplexValue<V>, std::complex<double>, V>>;

}  // namespace debias

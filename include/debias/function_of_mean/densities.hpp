#pragma once

// Integrals over the line and over R^d as integrals over the cube, by a density that is named.
//
//   expectation_under(law, f)   u -> f(x),  x_t = law.quantile(u_t)                       mean over the cube: E f(X)
//   integral_over(law, f)       u -> f(x) / (law.density(x_1) ... law.density(x_d))       mean: the integral of f
//
//   Notation: law = a density on the line with its inverse, the same for each coordinate; x = point of R^d; u = point of the cube.
// What they return goes to function_of_integral, with a Cube where f takes a span, without where it takes a double:
//
//   function_of_integral(expectation_under(densities::Normal{}, f), Cube(4), functions::Log{})
//
// A law of yours has quantile(u), increasing on (0, 1), and density(x).
// The trap: integral of f^2 / density may be infinite though that of f is finite. Then no mean has a variance, the rates that a
// Cube declares do not hold, and a run looks fine until its first large sample. Take a law whose tails fall no faster than f:
// StudentT or Exponential rather than Normal; `survey` shows the decay. f that grows under expectation_under is the same trap: e^x
// has moments under Normal, e^(x^2 / 4) has a mean and no variance. Where a density underflows to 0, f / density is infinite or
// NaN, and the run says so.

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <numbers>
#include <span>
#include <type_traits>
#include <utility>

#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

template <class L>
concept LineLaw = requires(const L& law, double x) {
  { law.quantile(x) } -> std::convertible_to<double>;
  { law.density(x) } -> std::convertible_to<double>;
};

namespace densities {

struct Normal {
  double mean = 0;
  double deviation = 1;  ///< positive
  [[nodiscard]] double quantile(double u) const { return mean + deviation * normal_quantile(u); }
  [[nodiscard]] double density(double x) const {
    const double z = (x - mean) / deviation;
    return std::exp(-0.5 * z * z) / (deviation * std::sqrt(2 * std::numbers::pi));
  }
};

/// On [from, infinity).
struct Exponential {
  double rate = 1;  ///< positive
  double from = 0;
  [[nodiscard]] double quantile(double u) const { return from - std::log1p(-u) / rate; }
  [[nodiscard]] double density(double x) const { return x < from ? 0 : rate * std::exp(-rate * (x - from)); }
};

/// Tails like |x|^-(degrees + 1). One or two degrees take some ns a number, others about a microsecond.
struct StudentT {
  double degrees;
  double location = 0;
  double scale = 1;  ///< positive
  [[nodiscard]] double quantile(double u) const;
  [[nodiscard]] double density(double x) const;
};

}  // namespace densities

namespace detail {

/// f at the quantiles of a point of the cube, divided by the densities there where `weighted`.
template <LineLaw L, class F, bool weighted>
class FromCube {
 public:
  FromCube(L law, F f) : law_(std::move(law)), f_(std::move(f)) {}

  auto operator()(double u) const requires std::invocable<const F&, double> {
    const double x = law_.quantile(u);
    if constexpr (weighted) {
      using V = std::remove_cvref_t<decltype(f_(x))>;
      return debias::scaled(V(f_(x)), 1 / law_.density(x));
    } else {
      return f_(x);
    }
  }

  auto operator()(std::span<const double> u) const requires std::invocable<const F&, std::span<const double>> {
    std::array<double, net_dimensions> numbers;  // not zeroed
    const std::span<double> x = std::span(numbers).first(u.size());
    double density = 1;
    for (std::size_t t = 0; t < u.size(); ++t) {
      x[t] = law_.quantile(u[t]);
      if constexpr (weighted) density *= law_.density(x[t]);
    }
    if constexpr (weighted) {
      using V = std::remove_cvref_t<decltype(f_(std::span<const double>(x)))>;
      return debias::scaled(V(f_(std::span<const double>(x))), 1 / density);
    } else {
      return f_(std::span<const double>(x));
    }
  }

 private:
  L law_;
  F f_;
};

}  // namespace detail

/// The integrand over the cube whose integral is E f(X), the coordinates of X independent and of this law.
template <LineLaw L, class F>
auto expectation_under(L law, F f) {
  return detail::FromCube<L, F, false>(std::move(law), std::move(f));
}

/// The integrand over the cube whose integral is that of f over R^d, or over where the density is positive.
template <LineLaw L, class F>
auto integral_over(L law, F f) {
  return detail::FromCube<L, F, true>(std::move(law), std::move(f));
}

}  // namespace debias

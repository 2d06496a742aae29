#pragma once

// The integral of f from one comb, as a random variable.
//
//   comb_mean = (b - a) / n sum_(i < n) f(a + (b - a) (i + u) / n),  one random offset u
//
// Notation: n = points, [a, b] = [from, to]. Unbiased for any integrable f. Source: Misso et al., ACM TOG 41(4), 2022.

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

namespace detail {
inline void check_interval(const char* name, double from, double to) {
  if (std::isfinite(to - from)) return;
  throw std::invalid_argument(std::string(name) + ": the interval is not finite; substitute the variable");
}
}  // namespace detail

/// The integral of f over [from, to] from one comb of `points` equidistant points with a random offset, as a
/// random variable: what taylor.hpp multiplies.
template <class F>
class CombMean {
 public:
  /// Throws std::invalid_argument unless points >= 1 and the interval is finite.
  CombMean(F f, std::int64_t points, double from, double to)
      : work(static_cast<double>(points)), f_(std::move(f)), points_(points), from_(from), length_(to - from) {
    detail::check_interval("comb_mean", from, to);
    if (points < 1) {
      throw std::invalid_argument("comb_mean: points = " + std::to_string(points) + " (must be at least 1)");
    }
  }

  auto operator()(Stream& rng) const {
    using M = mean_t<std::remove_cvref_t<std::invoke_result_t<const F&, double>>>;
    const double offset = rng.uniform();
    const double step = length_ / work;
    M total(f_(from_ + step * offset));
    for (std::int64_t i = 1; i < points_; ++i) {
      total = debias::sum(std::move(total), M(f_(from_ + step * (static_cast<double>(i) + offset))));
    }
    return debias::scaled(std::move(total), step);
  }

  double work;  ///< look-ups of a draw

 private:
  F f_;
  std::int64_t points_;
  double from_;
  double length_;
};

template <class F>
CombMean<F> comb_mean(F f, std::int64_t points, double from = 0, double to = 1) {
  return {std::move(f), points, from, to};
}

}  // namespace debias

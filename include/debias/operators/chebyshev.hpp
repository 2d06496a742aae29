#pragma once

// Chebyshev coefficients of a function on an interval [a, b] that holds a spectrum.
//
//   f(x) = sum_(k >= 0) c_k T_k(t),  t = (2 x - a - b) / (b - a),  |c_k| ~ q^-k
//   log x     c_0 = 2 ln((sqrt a + sqrt b) / 2), c_k = 2 (-1)^(k+1) q^-k / k,   q = (sqrt(kappa) + 1) / (sqrt(kappa) - 1)
//   1 / x     c_0 = 1 / sqrt(a b), c_k = 2 (-1)^k q^-k / sqrt(a b)
//   sqrt x    (2 k + 3) c_(k+1) + 4 k (a + b)/(b - a) c_k + (2 k - 3) c_(k-1) = 0, downward
//   e^x       c_0 = e^m I_0(h), c_k = 2 e^m I_k(h), m = (a + b)/2, h = (b - a)/2, downward
//   yours     by a discrete cosine transform over 2^m points, as many as f needs
//
//   Notation: kappa = b / a, I_k = modified Bessel function.
// The first four have no last term. Those of a function of yours end where they fall below the rounding of f, 2e-15 of its
// largest coefficient: that much, and no more, is left out. A function that is not analytic on [a, b] has no such end within
// 2^17 points and is refused. Sources: Trefethen, Approximation Theory and Approximation Practice, ch. 3 and 8; the
// recurrence of sqrt from 2 x f' = f.

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <debias/core/rates.hpp>
#include <debias/functions/elementary.hpp>

namespace debias {

/// The coefficients of one function on one interval; copies share them.
class ChebyshevSeries {
 public:
  /// log x, 1 / x, sqrt x. Throw std::invalid_argument unless 0 < a < b.
  static ChebyshevSeries log(double a, double b);
  static ChebyshevSeries inverse(double a, double b);
  static ChebyshevSeries sqrt(double a, double b);
  /// e^x. Throws std::invalid_argument unless a < b, and where e^b overflows.
  static ChebyshevSeries exp(double a, double b);
  /// Throws std::invalid_argument for values of f that are not finite, and an f that is not analytic on [a, b].
  static ChebyshevSeries of(const std::function<double(double)>& f, double a, double b);

  /// c_k.
  double operator()(std::int64_t k) const {
    if (table_) return static_cast<std::size_t>(k) < table_->size() ? (*table_)[static_cast<std::size_t>(k)] : 0;
    if (k == 0) return first_;
    const double size = scale_ * std::exp(-log_q_ * static_cast<double>(k));
    return (k % 2 == 0) == even_positive_ ? size * (logarithmic_ ? 1 / static_cast<double>(k) : 1)
                                          : -size * (logarithmic_ ? 1 / static_cast<double>(k) : 1);
  }

  [[nodiscard]] double lower() const { return a_; }
  [[nodiscard]] double upper() const { return b_; }
  /// How the squares of terms fall whose degree grows by `degrees` a level.
  [[nodiscard]] Rates rates(double degrees) const;
  /// The last coefficient that is not zero, where there is one.
  [[nodiscard]] std::optional<std::int64_t> last() const { return last_; }
  /// The first degree from which on all coefficients are below `share` of the largest one but c_0.
  [[nodiscard]] std::int64_t degree_below(double share) const;

 private:
  ChebyshevSeries(double a, double b) : a_(a), b_(b) {}

  double a_;
  double b_;
  double log_q_ = 0;  // infinite: faster than any power
  double first_ = 0;
  double scale_ = 0;
  bool even_positive_ = false;
  bool logarithmic_ = false;
  std::shared_ptr<const std::vector<double>> table_{};
  std::optional<std::int64_t> last_{};
};

namespace detail {

/// The series of f on [a, b]: in closed form where f is one of functions.hpp that has one.
template <class F>
ChebyshevSeries chebyshev_series(const F& f, double a, double b) {
  return ChebyshevSeries::of([&f](double x) { return static_cast<double>(f(x)); }, a, b);
}
inline ChebyshevSeries chebyshev_series(const functions::Log& /*f*/, double a, double b) {
  return ChebyshevSeries::log(a, b);
}
inline ChebyshevSeries chebyshev_series(const functions::Reciprocal& /*f*/, double a, double b) {
  return ChebyshevSeries::inverse(a, b);
}
inline ChebyshevSeries chebyshev_series(const functions::Sqrt& /*f*/, double a, double b) {
  return ChebyshevSeries::sqrt(a, b);
}
inline ChebyshevSeries chebyshev_series(const functions::Exp& /*f*/, double a, double b) {
  return ChebyshevSeries::exp(a, b);
}

/// Functions that are singular at 0: the spectrum has to be positive.
template <class F>
inline constexpr bool singular_at_zero =
    std::same_as<F, functions::Log> || std::same_as<F, functions::Reciprocal> || std::same_as<F, functions::Sqrt>;
/// Functions of the user, whose coefficients end.
template <class F>
inline constexpr bool is_users_function = !singular_at_zero<F> && !std::same_as<F, functions::Exp>;

}  // namespace detail

}  // namespace debias

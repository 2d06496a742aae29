#pragma once

// 1 / E X, and 1 / (integral of f), by every published method; reciprocal(x) is the one to begin with.
//
//   name                 needs               one sample is                               variance/I^2    work
//   reciprocal           X of one sign       1 / mean of 2^k draws, doubling             least           2^k
//   clamped_reciprocal   X >= 0, zeros too   the same, means below 2^-(k+1) clamped      small           2^k
//   reciprocal_series    |X - a| < a, say    sum of (1 - X/a)^k / a, term by term        the PMF's       1/s
//   reciprocal_trials    0 <= X <= M         trials until u M < X, over M; positive      1 - E X / M     M/E X
//   reciprocal_residual  m <= X <= M         prod (M - X_i) / (M - m) / m; positive      (*), w = 1/M    M/m
//   reciprocal_product   w < 2 E X / E X^2   w prod (1 - w X_i) / P(K), K geometric      (*)             1/(1-s)
//   (*) w^2 (E X)^2 / ((1 - s)(1 - b/s)) - 1, b = E (1 - w X)^2, s = survival (1 - m/M for the residual)
//
// Doubling: D_k = -d^2 / (m (m - d) (m + d)), m = mean, d = half the difference of the halves. Where X has a
// positive density at 0, the q-th moment of I_k is finite only for 2^k > q: start at base_level_for_pole(1).
// Where X is zero with probability p, I_k is infinite with probability p^(2^k), unless it is clamped.
// Throw for a draw outside: clamped (a negative mean), trials, residual (below 0 or above M). Series and product take any
// X for which they converge. X may be the mean over a net, net_mean(f, Cube(d), n): how many points pay is in taylor/sum.hpp;
// trials and residual gain nothing, for their variance is that of a count. A NaN stays one; infinite means have the reciprocal 0, and differences that are NaN.
// Sources: Blanchet & Glynn, WSC 2015; Misso et al. 2022 (combs, clamp); Booth 2007; Zeltner et al. 2020
// (trials); Moka, Kroese & Juneja 2019 (product).

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/text.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/taylor.hpp>

namespace debias {

/// 1 / E X for real X, or an array of them: `x(rng)` draws X.
template <RandomVariable X>
auto reciprocal(X x, const Rates& rates = {2, 1}) {
  if constexpr (RealValue<draw_t<X>>) {
    return debias::function_of_mean(std::move(x), functions::Reciprocal{}, rates);
  } else {
    return debias::function_of_mean(std::move(x), functions::componentwise(functions::Reciprocal{}), rates);
  }
}

/// 1 / (integral of f over [from, to]) for real f: one comb of equidistant points a draw.
template <class F>
auto reciprocal_of_integral(F f, const IntegralOptions& options = {}) {
  return debias::function_of_integral(std::move(f), functions::Reciprocal{}, options);
}

/// The same over a cube, on scrambled nets.
template <CubeIntegrand F>
auto reciprocal_of_integral(F f, const Cube& cube, const CubeOptions& options = {}) {
  return debias::function_of_integral(std::move(f), cube, functions::Reciprocal{}, options);
}

/// 1 / max(m, scale 2^-(level + 1)): the bound vanishes in the limit, so the differences still telescope.
struct ClampedReciprocal {
  double scale;  ///< of the means: small against E X, so that the clamp is rarely met

  /// Throws std::invalid_argument unless the scale is positive and finite.
  explicit ClampedReciprocal(double scale_of_means) : scale(scale_of_means) {
    if (scale > 0 && std::isfinite(scale)) return;
    throw std::invalid_argument("clamped_reciprocal: scale = " + detail::format("%f", scale) +
                                " (must be positive and finite, small against E X)");
  }

  /// Throws std::domain_error for a negative mean: of draws that are at least 0 there is none, and the clamp would hide it.
  double at(std::int64_t level, double m) const {
    if (m < 0) [[unlikely]]
      refuse(level, m);
    const double least = floor(level);
    return 1 / (m < least ? least : m);  // a NaN gets through, as it would not through fmax
  }
  /// at(level, m) - (at(level - 1, m + d) + at(level - 1, m - d)) / 2, without cancellation if nothing is
  /// clamped.
  double gap(std::int64_t level, double m, double d) const {
    if (m - std::abs(d) >= floor(level - 1)) return functions::Reciprocal{}.gap(m, d);
    return at(level, m) - 0.5 * (at(level - 1, m + d) + at(level - 1, m - d));
  }
  /// The same from the halves themselves.
  double gap_of_halves(std::int64_t level, double a, double b) const {
    const double least = floor(level - 1);
    if (a >= least && b >= least) return functions::Reciprocal{}.gap_of_halves(a, b);
    return at(level, a / 2 + b / 2) - 0.5 * (at(level - 1, a) + at(level - 1, b));
  }

 private:
  [[noreturn]] static void refuse(std::int64_t level, double m) {
    throw std::domain_error("clamped_reciprocal: a mean of " + detail::format("%g", m) + " at level " +
                            std::to_string(level) + " (X must be at least 0); reciprocal takes X of one sign, either");
  }
  [[nodiscard]] double floor(std::int64_t level) const {
    return scale * detail::share_of_draw(level < 1000 ? level + 1 : 1000);
  }
};

/// 1 / E X for X >= 0 that may be zero.
template <RandomVariable X>
auto clamped_reciprocal(X x, double scale = 1, const Rates& rates = {2, 1}) {
  return debias::function_of_mean(std::move(x), ClampedReciprocal{scale}, rates);
}
/// 1 / (integral of f) for f >= 0 that may be zero.
template <class F>
auto clamped_reciprocal_of_integral(F f, double scale = 1, const IntegralOptions& options = {}) {
  return debias::function_of_integral(std::move(f), ClampedReciprocal{scale}, options);
}
template <CubeIntegrand F>
auto clamped_reciprocal_of_integral(F f, const Cube& cube, double scale = 1, const CubeOptions& options = {}) {
  return debias::function_of_integral(std::move(f), cube, ClampedReciprocal{scale}, options);
}

/// The terms (1 / a) prod (1 - X_i / a), a a number or a Centre; for roulette [Booth 2007].
template <RandomVariable X, class A>
auto reciprocal_series(X x, const A& a) {
  return debias::taylor(std::move(x), functions::Reciprocal{}, a);
}

/// Counts independent trials with success probability X / majorant until the first success.
template <RandomVariable X>
class ReciprocalTrials {
 public:
  /// Throws std::invalid_argument unless the majorant is positive and finite.
  ReciprocalTrials(X x, double majorant) : x_(std::move(x)), majorant_(majorant) {
    if (majorant > 0 && std::isfinite(majorant)) return;
    throw std::invalid_argument("reciprocal_trials: majorant = " + detail::format("%f", majorant) +
                                " (must be positive and finite, a bound of X); 1 for X in {0, 1}");
  }

  /// Throws std::domain_error for a draw outside [0, majorant], since a clamped one would be a bias, and
  /// std::length_error after 10^9 trials without success.
  Sample<double> operator()(Stream& rng) const {
    for (std::int64_t trials = 1; trials <= most_trials; ++trials) {
      const double x = x_(rng);
      if (!(x >= 0 && x <= majorant_)) refuse(x);
      if (rng.uniform() * majorant_ < x) {
        return {static_cast<double>(trials) / majorant_, static_cast<double>(trials) * detail::work_of(x_), trials};
      }
    }
    throw std::length_error("reciprocal_trials: 10^9 trials and no success (E X is 0, or far below the majorant " +
                            detail::format("%f", majorant_) + ")");
  }
  [[nodiscard]] std::string describe() const {
    return "reciprocal_trials, majorant " + detail::format("%f", majorant_);
  }

 private:
  [[noreturn]] void refuse(double x) const {
    throw std::domain_error("reciprocal_trials: X = " + detail::format("%f", x) + " (must lie in [0, majorant = " +
                            detail::format("%f", majorant_) + "]); take a larger majorant");
  }

  static constexpr std::int64_t most_trials = 1'000'000'000;

  X x_;
  double majorant_;
};

/// 1 / E X from 0 <= X <= majorant; with majorant 1 and X in {0, 1}, from events of unknown probability.
template <RandomVariable X>
ReciprocalTrials<X> reciprocal_trials(X x, double majorant) {
  return {std::move(x), majorant};
}

/// w prod_(i <= K) (1 - w X_i) / P(K), P(K = k) = (1 - s) s^k: one term of the series about 1 / w.
template <RandomVariable X>
class ReciprocalProduct {
 public:
  /// Throws std::invalid_argument unless w != 0 is finite and survival lies in (0, 1); samples throw std::domain_error
  /// for a draw that is NaN.
  ReciprocalProduct(X x, double w, double survival) : x_(std::move(x)), w_(w), survival_(survival) {
    if (w == 0 || !std::isfinite(w)) {
      throw std::invalid_argument("reciprocal_product: w = " + detail::format("%f", w) + " (must be finite and not 0)");
    }
    if (!(survival > 0 && survival < 1)) {
      throw std::invalid_argument("reciprocal_product: survival = " + detail::format("%f", survival) +
                                  " (must lie in (0, 1), above E (1 - w X)^2 for a finite variance)");
    }
  }

  Sample<double> operator()(Stream& rng) const {
    double value = w_ / (1 - survival_);
    std::int64_t draws = 0;
    for (; rng.uniform() < survival_; ++draws) {
      const double x = x_(rng);
      if (!(x >= least_ && x <= largest_)) [[unlikely]]
        refuse(x);
      value *= (1 - w_ * x) / survival_;
    }
    return {value, 1 + static_cast<double>(draws) * detail::work_of(x_), draws};
  }
  [[nodiscard]] std::string describe() const {
    return "reciprocal_product, w " + detail::format("%f", w_) + ", survival " + detail::format("%f", survival_);
  }

  /// The same, for draws in [least, largest] only.
  [[nodiscard]] ReciprocalProduct bounded(double least, double largest) && {
    least_ = least;
    largest_ = largest;
    return std::move(*this);
  }

 private:
  [[noreturn]] void refuse(double x) const {
    throw std::domain_error("reciprocal_product: X = " + detail::format("%g", x) + " (must lie in [" +
                            detail::format("%g", least_) + ", " + detail::format("%g", largest_) +
                            "]); reciprocal_residual needs a majorant of X");
  }

  X x_;
  double w_;
  double survival_;
  double least_ = -std::numeric_limits<double>::infinity();
  double largest_ = std::numeric_limits<double>::infinity();
};

/// The product with the survival sqrt(E (1 - w X)^2) that is best for variance x work, from a pilot run of X.
/// Throws std::invalid_argument where the variance would be infinite, with a w where it is not.
template <RandomVariable X>
ReciprocalProduct<X> reciprocal_product(X x, double w, const Moments& pilot) {
  if (pilot.count < 2) throw std::invalid_argument("reciprocal_product: the pilot has fewer than 2 draws");
  const double square = pilot.mean * pilot.mean + pilot.m2 / static_cast<double>(pilot.count);
  const double b = 1 - 2 * w * pilot.mean + w * w * square;
  if (!(b < 1)) {
    throw std::invalid_argument("reciprocal_product: w = " + detail::format("%f", w) + " (E (1 - w X)^2 = " +
                                detail::format("%f", b) + " must be below 1 for a finite variance); " +
                                detail::format("%f", pilot.mean / square) + " = E X / E X^2 makes it least");
  }
  return {std::move(x), w, std::sqrt(b > 0 ? b : 1e-3)};
}

/// 1 / E X from bounds m <= X <= M, 0 < m < M: the product with w = 1 / M and survival 1 - m / M, whose
/// factors lie in [0, 1]. An m above the minimum of X stays unbiased, of finite variance while E (M - X)^2 <
/// M (M - m). Throws std::invalid_argument unless 0 < minimum < majorant, both finite; samples throw std::domain_error for
/// a draw outside [0, majorant], of which the product may grow without end.
template <RandomVariable X>
ReciprocalProduct<X> reciprocal_residual(X x, double minimum, double majorant) {
  if (!(minimum > 0 && minimum < majorant && std::isfinite(majorant))) {
    throw std::invalid_argument("reciprocal_residual: minimum = " + detail::format("%f", minimum) +
                                ", majorant = " + detail::format("%f", majorant) +
                                " (must be 0 < minimum < majorant); without a positive "
                                "minimum take reciprocal_trials");
  }
  return ReciprocalProduct<X>(std::move(x), 1 / majorant, 1 - minimum / majorant).bounded(0, majorant);
}

// What is no random variable.
template <class X>
requires(!RandomVariable<X>) auto reciprocal(const X& /*x*/, const Rates& /*rates*/ = {}) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}
template <class X>
requires(!RandomVariable<X>) auto clamped_reciprocal(const X& /*x*/, double /*scale*/ = 1,
                                                     const Rates& /*rates*/ = {}) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}
template <class X, class A>
requires(!RandomVariable<X>) auto reciprocal_series(const X& /*x*/, const A& /*a*/) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}
template <class X>
requires(!RandomVariable<X>) auto reciprocal_trials(const X& /*x*/, double /*majorant*/) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}
template <class X, class Pilot>
requires(!RandomVariable<X>) auto reciprocal_product(const X& /*x*/, double /*w*/, const Pilot& /*pilot*/) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}
template <class X>
requires(!RandomVariable<X>) auto reciprocal_residual(const X& /*x*/, double /*minimum*/, double /*majorant*/) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}

}  // namespace debias

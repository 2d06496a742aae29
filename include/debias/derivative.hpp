#pragma once

// Derivatives by finite differences: the step halves from level to level, and the bias goes with it.
//
//   forward   I_k = (f(x + h_k) - f(x)) / h_k                   E D_k^2 ~ 2^(-2 k)    [Misso et al. 2022]
//   central   I_k = (f(x + h_k) - f(x - h_k)) / (2 h_k)         E D_k^2 ~ 2^(-4 k)
//   second    I_k = (f(x + h_k) - 2 f(x) + f(x - h_k)) / h_k^2  E D_k^2 ~ 2^(-4 k)
//
//   Notation: x = at, h_k = first_step 2^-k; f(x), or f(x, stream) for the derivative of x -> E f(x).
// All evaluations of a draw see the same random numbers. The rates hold where f is smooth in every sample.
// Samples with kinks have 2^-k (first derivatives; declare {1, 0}), with jumps E D_k^2 grows: no law helps.
// Rounding: f is off by eps |f|, hence I_k and D_k by 2^k eps |f| / h_0 (second: 4^k eps |f| / h_0^2), and a
// law divides that by p_k. A level at which x + h_k is hardly told from x throws (`last_level`).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

enum class Difference { forward, central, second };

struct DifferenceOptions {
  Difference kind = Difference::forward;
  double first_step = 1.5;  ///< h_0 > 0: about the length over which f changes
};

namespace detail {

template <class F>
concept PlainFunction = requires(const F& f, double x) {
  requires Value<std::remove_cvref_t<decltype(f(x))>>;
};
template <class F>
concept RandomFunction = requires(const F& f, double x, Stream& rng) {
  requires Value<std::remove_cvref_t<decltype(f(x, rng))>>;
};

}  // namespace detail

/// A function of one real parameter, `f(x)`, or a random variable that depends on it, `f(x, rng)`.
template <class F>
concept ParameterFunction = detail::PlainFunction<F> || detail::RandomFunction<F>;

namespace detail {

template <ParameterFunction F>
auto evaluate(const F& f, double x, const Stream& rng) {
  if constexpr (RandomFunction<F>) {
    Stream common = rng;
    return f(x, common);
  } else {
    return f(x);
  }
}

}  // namespace detail

/// A BiasedSequence; the work is the number of evaluations of f. The caller's stream stays where it is.
template <ParameterFunction F>
class FiniteDifference {
 public:
  using value_type = decltype(detail::evaluate(std::declval<const F&>(), 0.0, std::declval<const Stream&>()));

  FiniteDifference(F f, double at, const DifferenceOptions& options, const Rates& declared)
      : rates(declared), f_(std::move(f)), at_(at), kind_(options.kind), first_step_(options.first_step) {
    if (!(first_step_ > 0) || !std::isfinite(std::abs(at) + first_step_)) {
      refuse("both must be finite, the step positive; a backward difference is a forward one of f(-x)");
    }
    // Four neighbours of x are the least that leaves a step two digits; 2^-500 still has a square.
    const double size = std::abs(at);
    const double spacing = std::nextafter(size, std::numeric_limits<double>::infinity()) - size;
    last_level_ = std::ilogb(first_step_) - std::ilogb(std::max(4 * spacing, 0x1p-500));
    if (last_level_ < 0) refuse("the step is lost beside `at`; take a larger one");
  }

  /// I_level and D_level from one set of evaluations. Throws std::length_error above last_level().
  Draw<value_type> operator()(std::int64_t level, const Stream& rng) const {
    const double h = step(level);
    if (kind_ == Difference::central) {
      if (level == 0) return base(central(h, rng), 2);
      const double coarse = step(level - 1);
      return coupled(central(h, rng), central(coarse, rng), 4);
    }
    const value_type here = detail::evaluate(f_, at_, rng);
    const double each = kind_ == Difference::second ? 2 : 1;
    if (level == 0) return base(from(here, h, rng), 1 + each);
    const double coarse = step(level - 1);
    return coupled(from(here, h, rng), from(here, coarse, rng), 1 + 2 * each);
  }

  /// I_level alone. Throws std::length_error above last_level().
  Term<value_type> value_at(std::int64_t level, const Stream& rng) const {
    const double h = step(level);
    if (kind_ == Difference::central) return {central(h, rng), 2};
    return {from(detail::evaluate(f_, at_, rng), h, rng), kind_ == Difference::second ? 3.0 : 2.0};
  }

  /// The deepest level whose step is not lost in the rounding of `at`.
  [[nodiscard]] std::int64_t last_level() const { return last_level_; }

  Rates rates;

 private:
  // The step as it acts: x + h is a number of the machine, and not the one that h = h_0 2^-level asks for.
  [[nodiscard]] double step(std::int64_t level) const {
    if (level > last_level_) step_is_lost(level);
    const double moved = at_ + std::ldexp(first_step_, -static_cast<int>(level));
    return moved - at_;
  }

  value_type central(double h, const Stream& rng) const {
    value_type up = detail::evaluate(f_, at_ + h, rng);
    return over(difference(std::move(up), detail::evaluate(f_, at_ - h, rng)), 2 * h);
  }

  // The quotients that use f(at).
  value_type from(const value_type& here, double h, const Stream& rng) const {
    value_type rise = difference(detail::evaluate(f_, at_ + h, rng), here);
    if (kind_ == Difference::forward) return over(std::move(rise), h);
    const value_type rise_before = difference(value_type(here), detail::evaluate(f_, at_ - h, rng));
    return over(over(difference(std::move(rise), rise_before), h), h);
  }

  // A true quotient is correctly rounded: two levels that are equal in theory are then equal here. A product
  // with 1 / h would leave a residue.
  static value_type over(value_type v, double h) {
    for (std::size_t i = 0; i < component_count(v); ++i) set_component(v, i, component(v, i) / h);
    return v;
  }

  [[noreturn]] void refuse(const char* why) const {
    std::ostringstream text;
    text << "finite_difference: at = " << at_ << ", first_step = " << first_step_ << " (" << why << ")";
    throw std::invalid_argument(text.str());
  }

  [[noreturn]] void step_is_lost(std::int64_t level) const {
    std::ostringstream text;
    text << "finite_difference: level " << level << " needs the step " << first_step_ << " * 2^-" << level
         << ", which is lost in the rounding of at = " << at_ << "; the last level is " << last_level_
         << ": take a law that reaches deep levels less often, or `truncated` with its bias";
    throw std::length_error(text.str());
  }

  F f_;
  double at_;
  Difference kind_;
  double first_step_;
  std::int64_t last_level_ = 0;
};

/// The derivative of f (of E f, when f takes a Stream) at a point: `finite_difference(f, 1.0)`,
/// `finite_difference(f, 1.0, {.kind = Difference::central})`.
/// Throws std::invalid_argument for a step that is not positive and finite, or too small beside `at`.
template <ParameterFunction F>
FiniteDifference<F> finite_difference(F f, double at, const DifferenceOptions& options = {}) {
  const double beta = options.kind == Difference::forward ? 2 : 4;
  return {std::move(f), at, options, {beta, 0}};
}

/// The same where f is not smooth, with rates of its own: {1, 0} for a kink.
template <ParameterFunction F>
FiniteDifference<F> finite_difference(F f, double at, const DifferenceOptions& options, const Rates& rates) {
  return {std::move(f), at, options, rates};
}

}  // namespace debias

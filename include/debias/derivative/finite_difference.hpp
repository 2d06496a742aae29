#pragma once

// The sequence behind derivative.hpp: difference quotients whose step shrinks from level to level.
//
//   I_k = sum_i w_i q(h_(k+i)),  D_k = sum_i w_i (q(h_(k+i)) - q(h_(k+i-1))),  q = forward, central or second quotient
//
// Notation: h_k = first_step ratio^k, w = the weights of Richardson's extrapolation, i = 0 ... extrapolations.
// All evaluations of a draw see the same random numbers. Rates, rounding, and where it fails: derivative.hpp.
// Sources: Richardson 1911; Misso et al., ACM TOG 41(4), 2022.

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/text.hpp>
#include <debias/core/value.hpp>
#include <debias/derivative/bias.hpp>

namespace debias {

enum class Difference { forward, central, second };

/// What a level beyond the last one does: give the last one again, with a difference of 0 and the bias that
/// this means in the result; or throw std::length_error (a run that throws and is repeated is biased, too).
enum class BeyondLast { truncates, throws };

struct DifferenceOptions {
  Difference kind = Difference::forward;
  double first_step = 1.5;  ///< h_0 > 0: about the length over which f changes
  double ratio = 0.5;       ///< of one step to the one before, in (0, 1)
  int extrapolations = 0;   ///< Richardson steps, each with one step more: 0 ... 6
  /// The deepest level; by default where rounding outgrows the difference.
  std::optional<std::int64_t> last_level = std::nullopt;
  BeyondLast beyond = BeyondLast::truncates;
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
    Stream common(rng);
    return f(x, common);
  } else {
    return f(x);
  }
}

}  // namespace detail

/// A BiasedSequence; the work is the number of evaluations of f, but for f(at) where f is not random: that is
/// kept. The caller's stream stays where it is.
template <ParameterFunction F>
class FiniteDifference {
 public:
  using value_type = decltype(detail::evaluate(std::declval<const F&>(), 0.0, std::declval<const Stream&>()));

  FiniteDifference(F f, double at, const DifferenceOptions& options, const Rates& declared)
      : rates(declared), f_(std::move(f)), at_(at), options_(options) {
    if (!(options_.first_step > 0) || !std::isfinite(std::abs(at) + options_.first_step)) {
      refuse("both must be finite, the step positive; a backward difference is a forward one of f(-x)");
    }
    if (!(options_.ratio > 0 && options_.ratio < 1)) refuse("ratio must lie in (0, 1); 0.5 halves the step");
    if (options_.extrapolations < 0 || options_.extrapolations > max_extrapolations) {
      refuse("extrapolations must lie in 0 ... 6; more only amplify rounding");
    }
    set_weights();
    const std::int64_t deepest = deepest_step() - options_.extrapolations;
    if (deepest < 0) refuse("the step is lost beside `at`; take a larger one");
    measure_size();
    const std::int64_t rounded = std::min(deepest, rounding_level());
    if (options_.last_level) {
      if (*options_.last_level < 0 || *options_.last_level > deepest) {
        refuse("last_level must lie in 0 ... " + std::to_string(deepest) + "; beyond, the step is lost beside `at`");
      }
      last_level_ = *options_.last_level;
    } else {
      last_level_ = rounded;
    }
    probed_levels_ = std::min(rounded, std::max(last_level_, fewest_probed));
    for (std::int64_t k = 0; k <= std::min(last_level_ + options_.extrapolations, last_stored_step); ++k) {
      steps_.push_back(step_of(k));
    }
  }

  /// I_level and D_level from one set of evaluations. Above last_level() see BeyondLast.
  Draw<value_type> operator()(std::int64_t level, const Stream& rng) const {
    if (level > last_level_) {
      if (options_.beyond == BeyondLast::throws) beyond_last(level);
      Term<value_type> last = value_at(last_level_, rng);
      value_type nothing = debias::difference(value_type(last.value), last.value);  // zero, unless f is not finite
      return {std::move(last.value), std::move(nothing), last.work};
    }
    if (level == 0) {
      const Term<value_type> first = value_at(0, rng);
      return debias::base(first.value, first.work);
    }
    return draw_of(level, rng);
  }

  /// I_level alone. Above last_level() see BeyondLast.
  Term<value_type> value_at(std::int64_t level, const Stream& rng) const {
    if (level > last_level_) {
      if (options_.beyond == BeyondLast::throws) beyond_last(level);
      level = last_level_;
    }
    const Quotients q(*this, rng);
    value_type value = debias::scaled(q(level), weights_[0]);
    for (int i = 1; i <= options_.extrapolations; ++i)
      value = debias::sum(std::move(value), debias::scaled(q(level + i), weight(i)));
    return {std::move(value), q.work(options_.extrapolations + 1)};
  }

  /// What is not random is the same for all members of a batch.
  static constexpr bool batches = std::same_as<value_type, double> && detail::PlainFunction<F>;
  void values(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    std::fill(out.begin(), out.end(), value_at(level, batch.stream(0)));
  }
  void differences(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    const auto draw = (*this)(level, batch.stream(0));
    std::fill(out.begin(), out.end(), Term<value_type>{draw.difference, draw.work});
  }

  /// The deepest level with a difference of its own.
  [[nodiscard]] std::int64_t last_level() const { return last_level_; }
  /// The deepest level that can be drawn: that one where BeyondLast::throws.
  [[nodiscard]] std::int64_t deepest_level() const {
    return options_.beyond == BeyondLast::throws ? last_level_ : deepest_of_all;
  }

  /// What the levels beyond the last one and rounding may do to the mean. Truncation: the root mean squares
  /// of the levels of the run, continued with the declared rate, and doubled for what is not asymptotic yet;
  /// infinite if that does not fall, or if the levels do not: those of the run or, of an f without noise, which
  /// is evaluated once more, all of them. Rounding: f within eps of f(x (1 + eps)), its size measured at `at`.
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const {
    auto seen = detail::see_differences(levels, last_level_, rates);
    // A level whose draws hit nothing but rounding says nothing of how differences fall.
    std::erase_if(seen.moments, [this](const detail::DifferenceMoment& m) {
      return m.log_square < 2 * std::log(rounding_error(m.level));
    });
    return detail::bound_of_differences(seen, doubt_of(seen.moments), last_level_, rates, rounding_error(last_level_));
  }

  /// How far rounding in f may move I_level.
  [[nodiscard]] double rounding_error(std::int64_t level) const { return rounding_error(level, size_); }

  Rates rates;

 private:
  static constexpr int max_extrapolations = 6;
  static constexpr std::uint64_t size_draws = 32;
  static constexpr std::int64_t last_stored_step = 1023;
  static constexpr std::int64_t fewest_probed = 4;  // levels that show how differences fall
  static constexpr double units_of_noise = 64;      // in the last place, that an f without noise may have
  static constexpr bool is_random = detail::RandomFunction<F>;

  /// Why differences do not fall as they should; empty where they do, or nobody can tell.
  [[nodiscard]] std::string doubt_of(const std::vector<detail::DifferenceMoment>& moments) const {
    if constexpr (is_random) {
      return detail::doubt_of_draws(moments, rates);
    } else {
      return doubt_of_function();
    }
  }

  // How an f without noise falls is seen level by level, over the last levels on which it is above rounding.
  [[nodiscard]] std::string doubt_of_function() const {
    const Stream unused(0, 0);
    std::vector<double> sizes(1);  // of D_k; 0 where it is rounding
    std::int64_t last = 0;
    for (std::int64_t k = 1; k <= probed_levels_; ++k) {
      const auto draw = draw_of(k, unused);
      const double size = std::abs(debias::as_scalar(draw.difference));
      const double here = std::abs(debias::as_scalar(detail::evaluate(f_, at_ + step(k), unused)));
      if (!std::isfinite(size) || !std::isfinite(here)) {
        return "f is not finite at a distance of " + detail::format("%g", step(k));
      }
      const double noise = units_of_noise * (rounding_error(k, std::max(size_, here)) +
                                             epsilon_of<value_type>() * std::abs(debias::as_scalar(draw.value)));
      sizes.push_back(size > noise ? size : 0);
      if (size > noise) last = k;
    }
    return detail::doubt_of_sizes(sizes, last, rates);
  }

  /// How far rounding of numbers of that size may move I_level.
  [[nodiscard]] double rounding_error(std::int64_t level, double size) const {
    double amplified = 0;
    for (int i = 0; i <= options_.extrapolations; ++i) {
      const double h = options_.first_step * std::pow(options_.ratio, static_cast<double>(level + i));
      amplified += std::abs(weight(i)) * (is_second() ? 4 / (h * h) : is_central() ? 1 / h : 2 / h);
    }
    return amplified * epsilon_of<value_type>() * size;
  }

  [[nodiscard]] bool is_central() const { return options_.kind == Difference::central; }
  [[nodiscard]] bool is_second() const { return options_.kind == Difference::second; }
  [[nodiscard]] double weight(int i) const { return weights_[static_cast<std::size_t>(i)]; }

  // The quotients of one draw, f(at) evaluated once: for all draws where f is not random.
  class Quotients {
   public:
    Quotients(const FiniteDifference& d, const Stream& rng) : d_(d), rng_(rng) {
      if (is_random && !d.is_central()) here_ = detail::evaluate(d.f_, d.at_, rng);
    }
    value_type operator()(std::int64_t level) const {
      const double h = d_.step(level);
      value_type up = detail::evaluate(d_.f_, d_.at_ + h, rng_);
      if (d_.is_central()) {
        return over(debias::difference(std::move(up), detail::evaluate(d_.f_, d_.at_ - h, rng_)), 2 * h);
      }
      value_type rise = debias::difference(std::move(up), here());
      if (!d_.is_second()) return over(std::move(rise), h);
      const value_type before = debias::difference(value_type(here()), detail::evaluate(d_.f_, d_.at_ - h, rng_));
      return over(over(debias::difference(std::move(rise), before), h), h);
    }
    [[nodiscard]] double work(int quotients) const {
      return (is_random && !d_.is_central() ? 1.0 : 0.0) +
             quotients * (d_.options_.kind == Difference::forward ? 1.0 : 2.0);
    }

   private:
    [[nodiscard]] const value_type& here() const { return is_random ? *here_ : *d_.here_; }

    const FiniteDifference& d_;
    const Stream& rng_;
    std::optional<value_type> here_;
  };

  // The step as it acts: x + h is a number of the machine, and not the one that h = h_0 ratio^level asks for.
  [[nodiscard]] double step(std::int64_t level) const {
    const auto i = static_cast<std::size_t>(level);
    return i < steps_.size() ? steps_[i] : step_of(level);
  }
  [[nodiscard]] double step_of(std::int64_t level) const {
    const double moved = at_ + options_.first_step * std::pow(options_.ratio, static_cast<double>(level));
    return moved - at_;
  }

  // Four neighbours of x are the least that leaves a step two digits; 2^-500 still has a square.
  [[nodiscard]] std::int64_t deepest_step() const {
    const double size = std::abs(at_);
    const double spacing = std::nextafter(size, std::numeric_limits<double>::infinity()) - size;
    const double room = std::log2(options_.first_step) - std::log2(std::max(4 * spacing, 0x1p-500));
    return static_cast<std::int64_t>(std::floor(room / -std::log2(options_.ratio)));
  }

  // T_0(h) = quotient, T_m(h) = (T_(m-1)(ratio h) - ratio^q_m T_(m-1)(h)) / (1 - ratio^q_m), where q_m is the
  // m-th power of h in the bias: m for forward quotients, 2 m for the symmetric ones.
  void set_weights() {
    weights_[0] = 1;
    for (int m = 1; m <= options_.extrapolations; ++m) {
      const double s = std::pow(options_.ratio, options_.kind == Difference::forward ? m : 2 * m);
      for (auto i = static_cast<std::size_t>(m); i > 0; --i)
        weights_[i] = (weights_[i - 1] - s * weights_[i]) / (1 - s);
      weights_[0] *= -s / (1 - s);
    }
  }

  // Both numbers of a level above 0, whether it is beyond the last one or not.
  Draw<value_type> draw_of(std::int64_t level, const Stream& rng) const {
    const Quotients q(*this, rng);
    value_type previous = q(level - 1);
    value_type finer = q(level);
    value_type value = debias::scaled(finer, weights_[0]);
    value_type change = debias::scaled(debias::difference(value_type(finer), previous), weights_[0]);
    for (int i = 1; i <= options_.extrapolations; ++i) {
      previous = std::move(finer);
      finer = q(level + i);
      value = debias::sum(std::move(value), debias::scaled(finer, weight(i)));
      change =
          debias::sum(std::move(change), debias::scaled(debias::difference(value_type(finer), previous), weight(i)));
    }
    return {std::move(value), std::move(change), q.work(options_.extrapolations + 2)};
  }

  // Root mean squares over a few draws of a seed of their own: of what rounding is relative to, |f(at)| or
  // |at f'|, and of the change of f over the first step.
  void measure_size() {
    double here = 0;
    double change = 0;
    const std::uint64_t draws = is_random ? size_draws : 1;
    for (std::uint64_t i = 0; i < draws; ++i) {
      const Stream rng = split(Stream(0, i), Branch::pilot);
      const value_type f = detail::evaluate(f_, at_, rng);
      if (!is_random) here_ = f;
      const value_type up = detail::evaluate(f_, at_ + options_.first_step, rng);
      double size = debias::as_scalar(f);
      double moved = debias::as_scalar(debias::difference(value_type(up), f));
      if (!is_random && !std::isfinite(size))
        size = moved = debias::as_scalar(up);  // a central quotient does without f(at)
      if (!std::isfinite(size) || !std::isfinite(moved)) continue;
      here += size * size / static_cast<double>(draws);
      change += moved * moved / static_cast<double>(draws);
    }
    change_ = std::sqrt(change);
    size_ = std::max(std::sqrt(here), change_ / options_.first_step * std::abs(at_));
  }

  // The last level at which the difference, if it falls from change / h_0 at the declared rate, is above
  // rounding.
  [[nodiscard]] std::int64_t rounding_level() const {
    if (!(size_ > 0)) return std::numeric_limits<std::int64_t>::max();
    const double power = is_second() ? 2 : 1;
    const double first = (change_ > 0 ? change_ : size_) / std::pow(options_.first_step, power);
    const double meet = std::min(rates.variance_decay / 2, 26.0) - power * std::log2(options_.ratio);
    if (!(meet > 0)) return std::numeric_limits<std::int64_t>::max();
    const double level = std::log2(first / rounding_error(0)) / meet;
    if (!(level < 4000)) return 4000;  // a NaN, too: the first numbers of f are none
    return level > 0 ? static_cast<std::int64_t>(level) : 0;
  }

  // A true quotient is correctly rounded: two levels that are equal in theory are then equal here. A product
  // with 1 / h would leave a residue.
  static value_type over(value_type v, double h) {
    for (std::size_t i = 0; i < component_count(v); ++i) set_component(v, i, component(v, i) / h);
    return v;
  }

  [[noreturn]] void refuse(const std::string& why) const {
    throw std::invalid_argument("finite_difference: at = " + detail::format("%g", at_) +
                                ", first_step = " + detail::format("%g", options_.first_step) +
                                ", ratio = " + detail::format("%g", options_.ratio) + " (" + why + ")");
  }

  [[noreturn]] void beyond_last(std::int64_t level) const {
    const std::string k = std::to_string(level);
    throw std::length_error("finite_difference: at level " + k + " the step " +
                            detail::format("%g", options_.first_step) + " * " + detail::format("%g", options_.ratio) +
                            "^" + k + " beside at = " + detail::format("%g", at_) +
                            " is lost in rounding; the last level is " + std::to_string(last_level_) +
                            ": take a PMF that reaches deep levels less often, or BeyondLast::truncates");
  }

  F f_;
  double at_;
  DifferenceOptions options_;
  std::array<double, max_extrapolations + 1> weights_{};
  std::optional<value_type> here_;  // f(at), where f is not random
  std::vector<double> steps_;
  double size_ = 0;
  double change_ = 0;
  std::int64_t last_level_ = 0;
  std::int64_t probed_levels_ = 0;
};

namespace detail {

inline Rates smooth_rates(const DifferenceOptions& options) {
  const double order = (options.kind == Difference::forward ? 1 : 2) * (options.extrapolations + 1);
  return {-2 * order * std::log2(options.ratio), 0};
}

}  // namespace detail

}  // namespace debias

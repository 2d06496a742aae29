#pragma once

// A posterior expectation without the bias of a burn-in: two chains that meet.
//
//   H = 1/n sum_(t=k)^m f(X_t) + 1/n sum_(t=k+L)^(tau-1) w_t (f(X_t) - f(Y_(t-L))),
//   w_t = floor((t - k) / L) - ceil(max(L, t - m) / L) + 1,  n = m - k + 1
//
//   Notation: k = burn_in, m = length, L = lag; X and Y start alike, Y runs L steps behind, both take coupled steps;
// tau = first t >= L with X_t = Y_(t-L), the meeting time; E H = E f under the invariant law of the kernel, for any k, m, L.
// Assumes that the chains stay together once they have met, that P(tau > t) falls geometrically (a light power will do), and
// more than two moments of f. Variance per step comes near that of a plain long chain where k is a high quantile of tau - L
// and m many k: `advise` (chains/advise.hpp) measures all three. The meeting time is the level of a sample, `work` counts steps
// of the kernel, and nothing is cut: chains that have not met go on.
// Fails in silence where no chain of the run has seen a mode that matters: start both from a law that covers all of them.
// Sources: Jacob, O'Leary, Atchade, JRSS B 82 (2020) (3.1); Biswas, Jacob, Vanetti, NeurIPS 2019 (lag).
//
//   const auto walk = debias::random_walk([](double x) { return -x * x / 2; }, 2.4);
//   const auto start = [](debias::Stream& rng) { return 3 * rng.normal(); };
//   const auto square = [](double x) { return x * x; };
//   std::cout << debias::estimate(debias::coupled_chain(walk, start, square, {.burn_in = 20, .length = 400}));

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/chains/kernel.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

struct ChainOptions {
  std::int64_t burn_in = 0;  ///< k: the first state that is averaged; larger ones need fewer corrections
  std::int64_t length = 0;   ///< m: the last one, at least burn_in; longer chains cost in proportion and average more
  std::int64_t lag = 1;      ///< L: steps that Y is behind; larger ones start closer to the end, and wait for it
  /// Chains that have not met after so many steps are cut, which biases the estimate: the result says so. 0: none is cut.
  std::int64_t limit = 0;
  /// Told, on the thread that draws, of a chain that has not met after 2^16 steps, 2^17, and so on; may throw to give up.
  std::function<void(std::uint64_t index, std::int64_t steps)> progress = {};
};

namespace detail {

/// Throws std::invalid_argument for options that no chain has.
void check_chain(const ChainOptions& options);
std::string describe_chain(const ChainOptions& options);
/// The level of chains that were cut: the first row of the level table beyond the limit.
std::int64_t level_of_cut(std::int64_t limit);
BiasBound bound_of_cut(const LevelTable& levels, std::int64_t limit);

/// A sum of values: numbers begin at zero, others with the first one, which has the shape.
template <Value V>
class ValueSum {
 public:
  [[gnu::always_inline]] void add(V v) {
    if constexpr (at_zero) {
      sum_ = sum_ + v;
    } else if (sum_) {
      sum_ = debias::sum(std::move(*sum_), v);
    } else {
      sum_ = std::move(v);
    }
  }
  [[nodiscard]] bool empty() const {
    if constexpr (at_zero) {
      return false;
    } else {
      return !sum_;
    }
  }
  V value() && {
    if constexpr (at_zero) {
      return sum_;
    } else {
      return std::move(*sum_);
    }
  }

 private:
  static constexpr bool at_zero = RealValue<V> || ComplexValue<V>;
  std::conditional_t<at_zero, V, std::optional<V>> sum_{};
};

/// w_t of the head of this file, step by step from t = k + L on.
class LagWeight {
 public:
  explicit LagWeight(const ChainOptions& o) : lag_(o.lag), up_(o.burn_in + 2 * o.lag), down_(o.length + o.lag + 1) {}
  /// The weight at time t; t rises by one from call to call.
  [[gnu::always_inline]] double at(std::int64_t t) {
    if (t == up_) {  // floor((t - k) / L)
      ++weight_;
      up_ += lag_;
    }
    if (t == down_) {  // ceil((t - m) / L)
      --weight_;
      down_ += lag_;
    }
    return static_cast<double>(weight_);
  }

 private:
  std::int64_t lag_;
  std::int64_t up_;
  std::int64_t down_;
  std::int64_t weight_ = 1;
};

/// The start of a chain: a point, or a law start(rng).
template <class Start>
auto start_point(const Start& start, Stream& rng) {
  if constexpr (std::invocable<const Start&, Stream&>) {
    return start(rng);
  } else {
    return start;
  }
}
template <class Start>
using start_point_t = decltype(start_point(std::declval<const Start&>(), std::declval<Stream&>()));

/// How one sample went.
template <Value V>
struct ChainRun {
  V total;                      ///< the sum of f(X_k) ... f(X_m)
  std::optional<V> correction;  ///< the sum of the weighted differences; none: zero
  std::int64_t meeting = 0;
  bool cut = false;
  bool finite = true;
  std::int64_t steps = 0;   ///< of X
  std::int64_t behind = 0;  ///< of Y
};

}  // namespace detail

template <class K, class Start, class F>
class CoupledChain {
 public:
  using start_type = detail::start_point_t<Start>;
  using state_type = detail::chain_state_t<K, start_type>;
  using point_type =
      std::remove_cvref_t<decltype(detail::point_of(std::declval<const K&>(), std::declval<const state_type&>()))>;
  /// Of what f returns; sums of floats are doubles.
  using value_type = mean_t<std::remove_cvref_t<std::invoke_result_t<const F&, const point_type&>>>;
  static_assert(CoupledKernel<K, state_type>,
                "debias: this is no kernel whose chains meet: step(x, rng) and coupled_step(x, y, rng), both const");
  static_assert(Value<value_type>, "f(point) must return a Value: a double, say; of Eigen an array, not an expression");

  /// Throws std::invalid_argument unless 0 <= burn_in <= length, lag >= 1, and a limit is beyond both.
  CoupledChain(K kernel, Start start, F f, ChainOptions options)
      : kernel_(std::move(kernel)), start_(std::move(start)), f_(std::move(f)), options_(std::move(options)) {
    detail::check_chain(options_);
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    auto run = draw(rng);
    const double share = 1 / static_cast<double>(options_.length - options_.burn_in + 1);
    const auto base_work = static_cast<double>(std::min(options_.length, run.steps));
    const auto work = static_cast<double>(run.steps + run.behind);
    const std::int64_t level = run.cut ? detail::level_of_cut(options_.limit) : run.meeting;
    value_type value = debias::scaled(std::move(run.total), share);
    record.base(0, debias::as_scalar(value), base_work);
    if (run.correction) {
      value_type correction = debias::scaled(std::move(*run.correction), share);
      record.difference(level, debias::as_scalar(correction), work - base_work);
      value = debias::sum(std::move(value), correction);
    } else {
      record.difference(level, 0, work - base_work);
    }
    if (!run.finite) [[unlikely]]
      value = debias::nan_like(std::move(value));
    return {std::move(value), work, level};
  }

  /// One pair of chains, with all that it went through.
  detail::ChainRun<value_type> draw(Stream& rng) const {
    const std::int64_t k = options_.burn_in;
    const std::int64_t m = options_.length;
    const std::int64_t lag = options_.lag;
    detail::ValueSum<value_type> average;
    detail::ValueSum<value_type> correction;
    bool corrected = false;
    bool finite = true;

    state_type x = begin(rng);
    std::int64_t t = 0;
    if (k == 0) average.add(observed(x));
    const auto move_x = [&] {
      kernel_.step(x, rng);
      ++t;
      if constexpr (!detail::ChecksItsPoints<K>) finite = finite && detail::finite_point(point(x));
      if (t >= k && t <= m) average.add(observed(x));
    };
    for (std::int64_t i = 0; i < lag; ++i) move_x();

    state_type y = begin(rng);
    detail::LagWeight weight(options_);
    const auto correct = [&](double w, const value_type& of_x) {
      corrected = true;
      correction.add(debias::scaled(debias::difference(of_x, observed(y)), w));
    };
    std::int64_t pause = options_.limit > 0 ? std::min(options_.limit, first_report) : first_report;
    bool cut = false;
    bool met = detail::same_point(point(x), point(y));
    if (!met && k == 0) correct(weight.at(t), observed(x));
    while (!met && finite) {
      if (t >= pause) [[unlikely]] {
        if (t == options_.limit) {
          cut = true;
          break;
        }
        pause = report(rng, t);
      }
      kernel_.coupled_step(x, y, rng);
      ++t;
      if constexpr (!detail::ChecksItsPoints<K>) {
        finite = finite && detail::finite_point(point(x)) && detail::finite_point(point(y));
      }
      met = detail::same_point(point(x), point(y));
      const bool averages = t >= k && t <= m;
      const double w = !met && t >= k + lag ? weight.at(t) : 0;
      if (averages || w != 0) {
        value_type of_x = observed(x);
        if (w != 0) correct(w, of_x);
        if (averages) average.add(std::move(of_x));
      }
    }
    const std::int64_t meeting = t;
    while (t < m && finite) move_x();
    if (average.empty()) average.add(observed(x));  // a state that is not finite ended the chain before k
    detail::ChainRun<value_type> run{std::move(average).value(), std::nullopt, meeting, cut, finite, t, meeting - lag};
    if (corrected) run.correction.emplace(std::move(correction).value());
    return run;
  }

  [[nodiscard]] const ChainOptions& options() const { return options_; }
  [[nodiscard]] const K& kernel() const { return kernel_; }
  /// The same chains with other options. Throws std::invalid_argument like the constructor.
  [[nodiscard]] CoupledChain with(ChainOptions options) const { return {kernel_, start_, f_, std::move(options)}; }

  [[nodiscard]] SequenceFacts facts() const {
    SequenceFacts facts;
    facts.meeting_times = true;
    if (options_.limit > 0) facts.exact_from = options_.limit;
    return facts;
  }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const {
    return options_.limit > 0 ? detail::bound_of_cut(levels, options_.limit) : BiasBound{};
  }
  [[nodiscard]] std::string describe() const { return detail::describe_chain(options_); }

 private:
  static constexpr std::int64_t first_report = std::int64_t{1} << 16;

  state_type begin(Stream& rng) const { return detail::begin_state(kernel_, detail::start_point(start_, rng)); }
  [[gnu::always_inline]] decltype(auto) point(const state_type& x) const { return detail::point_of(kernel_, x); }
  [[gnu::always_inline]] value_type observed(const state_type& x) const { return value_type(f_(point(x))); }

  // Of a chain that has not met yet; returns the time of the next pause.
  [[gnu::cold, gnu::noinline]] std::int64_t report(const Stream& rng, std::int64_t t) const {
    if (options_.progress) options_.progress(rng.index(), t);
    const std::int64_t next = t < std::numeric_limits<std::int64_t>::max() / 2 ? 2 * t : t;
    return options_.limit > t ? std::min(options_.limit, next) : next;
  }

  K kernel_;
  Start start_;
  F f_;
  ChainOptions options_;
};

/// An estimator of E f under the invariant law of `kernel`. `start` is a point, or start(rng) draws one: X and Y each have one
/// of their own. `f(point)` is a Value. Throws std::invalid_argument unless 0 <= burn_in <= length, lag >= 1, and a limit is
/// beyond length and lag.
template <class K, class Start, class F>
CoupledChain<K, Start, F> coupled_chain(K kernel, Start start, F f, ChainOptions options = {}) {
  return {std::move(kernel), std::move(start), std::move(f), std::move(options)};
}

}  // namespace debias

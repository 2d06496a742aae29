#pragma once

// Paths of a scheme: one alone, or one of each member of a batch side by side; what they leave in a summary.
//
//   step         X <- advance(X, h, dW), the summary sees the step
//   double_step  one step over two increments, as the coarse path of a level makes it                [Giles 2008]
//
// Notation: h = length of a step, dW = increments, u = the number of a bridge. A path that leaves the finite numbers stays
// out of them: its payoff is NaN, whatever a comparison in the payoff makes of it.

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>
#include <debias/sde/dual.hpp>
#include <debias/sde/models.hpp>
#include <debias/sde/summaries.hpp>

namespace debias {

namespace detail {

/// A state of a model, number or vector. What is not finite stays so from step to step: looking at the end is enough.
template <class State>
bool is_finite_state(const State& x) {
  if constexpr (std::is_arithmetic_v<State>) {
    return std::isfinite(static_cast<double>(x));
  } else if constexpr (requires { x.allFinite(); }) {
    return x.allFinite();
  } else {
    return debias::is_finite(x);
  }
}

/// The payoff; NaN where the path has seen numbers that are none, which a comparison in the payoff would hide.
template <class F, class Summary, class State>
[[gnu::always_inline]] inline auto pay(const F& payoff, const Summary& summary, const State& end) {
  bool finite = is_finite_state(end);
  if constexpr (requires {
                  { summary.finite() } -> std::same_as<bool>;
                }) {
    finite = finite && summary.finite();
  }
  if constexpr (std::same_as<Summary, EndOnly>) {
    std::remove_cvref_t<decltype(payoff(end))> value = payoff(end);
    return finite ? value : debias::nan_like(std::move(value));
  } else {
    std::remove_cvref_t<decltype(payoff(summary))> value = payoff(summary);
    return finite ? value : debias::nan_like(std::move(value));
  }
}

/// The steps of a path, on its state and what it leaves behind.
template <class Step, class M, class Summary>
struct Steps {
  using State = state_of<M>;
  static constexpr bool takes_bridges = [] {
    if constexpr (is_number<State>) return BridgeSummary<Summary, BridgeOf<State, time_of<M>>>;
    return false;
  }();
  static constexpr bool draws_bridges = [] {
    if constexpr (takes_bridges) return static_cast<bool>(Summary::uses_number);
    return false;
  }();

  /// One step of length h.
  template <class H, class Noise>
  static void step(const M& model, State& x, Summary& summary, const H& t, const H& h, const Noise& dw, double u) {
    const auto b = Step::diffusion(model, x, t);
    State next = Step::advance(model, x, t, h, b, dw);
    if constexpr (takes_bridges) {
      summary.add(BridgeOf<State, time_of<M>>{x, next, b, h}, u);
    } else {
      summary.add(x, next, h);
    }
    x = std::move(next);
  }

  /// One step over two increments of length h: a summary of bridges sees the middle that they imply.
  template <class H, class Noise>
  static void double_step(const M& model, State& x, Summary& summary, const H& t, const H& h, const Noise& dw1,
                          const Noise& dw2, double u1, double u2) {
    const Noise both = dw1 + dw2;
    if constexpr (takes_bridges) {
      using Bridge = BridgeOf<State, time_of<M>>;
      const State b = Step::diffusion(model, x, t);
      const State next = Step::advance(model, x, t, H(2 * h), b, both);
      const State middle = (x + next + b * (dw1 - dw2)) / 2;
      summary.add(Bridge{x, middle, b, h}, u1);
      summary.add(Bridge{middle, next, b, h}, u2);
      x = next;
    } else {
      step(model, x, summary, t, H(2 * h), both, 0);
    }
  }
};

/// A payoff that knows its expectation over a normal law: sde/payoffs.hpp.
template <class F, class X>
concept KnowsExpectation = requires(const F& payoff, const X& x) {
  payoff.expected(x, x);
};

/// Whether the last step of Smoothed has the skew of Milstein's: its scheme, model and payoff must know of it.
template <class Step, class M, class F>
inline constexpr bool is_skewed = [] {
  if constexpr (Step::has_skew && DifferentiableSde<M>) {
    return requires(const F& p, const state_of<M>& x) { p.expected(x, x, x); };
  } else {
    return false;
  }
}();

/// One path.
template <class Step, class M, class Summary>
class Path : Steps<Step, M, Summary> {
  using Steps = detail::Steps<Step, M, Summary>;

 public:
  Path(const M& model, const Summary& summary) : model_(model), x_(model.start), summary_(summary) {}

  template <class H, class Noise>
  void step(const H& t, const H& h, const Noise& dw, double u) {
    Steps::step(model_, x_, summary_, t, h, dw, u);
  }
  template <class H, class Noise>
  void double_step(const H& t, const H& h, const Noise& dw1, const Noise& dw2, double u1, double u2) {
    Steps::double_step(model_, x_, summary_, t, h, dw1, dw2, u1, u2);
  }
  template <class F>
  auto pay(const F& payoff) const {
    return detail::pay(payoff, summary_, x_);
  }
  /// The expectation over the last step, of length h, of whose increment `dw` is known and `left` is the time of what is not:
  /// over the law of sde/schemes.hpp, Smoothed.
  template <class F, class H>
  auto expect(const F& payoff, const H& t, const H& h, const H& dw, const H& left) const {
    using std::abs;
    using std::exp;
    using std::sqrt;
    using X = state_of<M>;
    const X b = Step::diffusion(model_, x_, t);
    const X still = x_ + model_.drift(x_, t) * h;
    const H root = sqrt(left);
    if constexpr (is_skewed<Step, M, F>) {
      const X slope = model_.diffusion_derivative(x_, t);
      const H passed = h - left;
      const X drawn = dw - slope * passed / 2;
      const X growth = slope * drawn;
      const X mean = still + b * drawn * exp_ratio(growth);
      const X skew = slope * root;
      return finite(
          mean, payoff.expected(mean, X(abs(b) * exp(growth) * root), static_cast<double>(b) < 0 ? X(-skew) : skew));
    } else {
      const X mean = still + b * dw;
      return finite(mean, payoff.expected(mean, X(abs(b) * root)));
    }
  }

 private:
  template <class V>
  static V finite(const state_of<M>& mean, V value) {
    return is_finite_state(mean) ? value : debias::nan_like(std::move(value));
  }

  const M& model_;
  state_of<M> x_;
  Summary summary_;
};

/// What a path of the scheme pays.
template <class Step, class Time, class Path, class F>
auto paid(const Path& path, const F& payoff) {
  if constexpr (Step::is_smoothed) {
    return path.expect(payoff, Time(), Time(), Time(), Time());
  } else {
    return path.pay(payoff);
  }
}

/// One scalar path of each member of a batch, side by side: a step of one need not wait for that of another.
template <class Step, class M, class Summary>
class Paths {
  using Steps = detail::Steps<Step, M, Summary>;

 public:
  Paths(const M& model, const Summary& summary, std::size_t size)
      : model_(model), size_(size), x_(filled(model.start)), summaries_(filled(summary)) {}

  /// dw[b] and u[b] belong to member b.
  void step(double t, double h, const double* dw, const double* u) {
    for (std::size_t b = 0; b < size_; ++b) {
      Steps::step(model_, x_[b], summaries_[b], t, h, dw[b], u == nullptr ? 0 : u[b]);
    }
  }
  void double_step(double t, double h, const double* dw1, const double* dw2, const double* u1, const double* u2) {
    for (std::size_t b = 0; b < size_; ++b) {
      Steps::double_step(model_, x_[b], summaries_[b], t, h, dw1[b], dw2[b], u1 == nullptr ? 0 : u1[b],
                         u2 == nullptr ? 0 : u2[b]);
    }
  }
  template <class F>
  auto pay(const F& payoff, std::size_t b) const {
    return detail::pay(payoff, summaries_[b], x_[b]);
  }

 private:
  template <class T>
  static std::array<T, StreamBatch::capacity> filled(const T& x) {
    return [&]<std::size_t... i>(std::index_sequence<i...>) {
      return std::array<T, StreamBatch::capacity>{((void)i, x)...};
    }
    (std::make_index_sequence<StreamBatch::capacity>{});
  }

  const M& model_;
  std::size_t size_;
  std::array<double, StreamBatch::capacity> x_;
  std::array<Summary, StreamBatch::capacity> summaries_;
};

/// The increments of a batch of paths and, with `bridges`, a uniform number after each, step by step.
template <bool bridges>
class PathNumbers {
 public:
  PathNumbers(StreamBatch& batch, std::int64_t steps, double sqrt_h) : batch_(&batch), left_(steps), sqrt_h_(sqrt_h) {}

  /// To the next step. The numbers of steps 2 i and 2 i + 1 are there together.
  void next() {
    row_ += rows_a_step * batch_->size();
    if (row_ >= end_) fetch();
  }
  [[nodiscard]] const double* increments() const { return &numbers_[row_]; }
  [[nodiscard]] const double* uniforms() const { return bridges ? &numbers_[row_ + batch_->size()] : nullptr; }

 private:
  static constexpr std::size_t rows_a_step = bridges ? 2 : 1;

  void fetch() {
    const std::size_t size = batch_->size();
    const auto fit = static_cast<std::int64_t>(numbers_.size() / (rows_a_step * size)) & ~std::int64_t{1};
    const auto steps = static_cast<std::size_t>(std::min(left_, fit));
    left_ -= static_cast<std::int64_t>(steps);
    row_ = 0;
    end_ = steps * rows_a_step * size;
    const std::span<double> some = std::span(numbers_).first(end_);
    batch_->uniforms(some);
    for (std::size_t i = 0; i < end_; i += rows_a_step * size) {
      const std::span<double> row = bridges ? some.subspan(i, size) : some;
      normal_quantiles(row);
      for (double& z : row) z *= sqrt_h_;
      if (!bridges) break;
    }
  }

  StreamBatch* batch_;
  std::int64_t left_;
  double sqrt_h_;
  std::size_t row_ = 0;
  std::size_t end_ = 0;
  std::array<double, 4 * StreamBatch::capacity> numbers_;
};

}  // namespace detail

}  // namespace debias

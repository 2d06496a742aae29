#pragma once

// A stochastic differential equation dX = a(X, t) dt + b(X, t) dW on [0, T], in 2^k steps at level k.
//
//   euler      X <- X + a h + b dW                                                    [Maruyama 1955]
//   milstein   X <- X + a h + b dW + b b_x (dW^2 - h) / 2                             [Milstein 1974]
//   I_k = payoff(X_T) or payoff(summary of the path); the coarse path adds pairs of increments      [Giles 2008]
//
//   Notation: a = drift, b = diffusion, b_x = diffusion_derivative, T = horizon, h = T 2^-k.
// Lipschitz payoffs of the end, an average or an extreme: E D_k^2 ~ 2^(-2 k) under milstein, 2^(-1.5 k)
// behind a barrier (declare it), 2^-k under euler, where no PMF has finite variance and finite work. With
// additive noise, b_x = 0, the schemes are one: declare {2, 1}. Payoffs that jump: 2^-k and 2^(-k/2).
// Numbers: a path draws increment 0, the number of its bridge if a summary uses one, increment 1, ... As a point of a net
// (estimators/stratified.hpp) it draws the end, midpoints by levels, then the numbers of the bridges in time: sde/brownian.hpp.
// Coefficients must be smooth and of linear growth. While a_x h < -2 a path is unstable: put the base level
// above. A path that leaves the finite numbers makes its sample NaN, whatever the payoff makes of it.
// Sources: Giles, Oper. Res. 56 (2008); Rhee & Glynn, Oper. Res. 63 (2015).

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/text.hpp>
#include <debias/core/value.hpp>
#include <debias/sde/brownian.hpp>
#include <debias/sde/summaries.hpp>

namespace debias {

/// What is to be solved: any struct with `start`, `horizon`, `drift(x, t)` and `diffusion(x, t)`.
template <class M>
concept ScalarSde = requires(const M& m, double x, double t) {
  { m.start } -> std::convertible_to<double>;
  { m.horizon } -> std::convertible_to<double>;
  { m.drift(x, t) } -> std::convertible_to<double>;
  { m.diffusion(x, t) } -> std::convertible_to<double>;
};

/// The same with `diffusion_derivative(x, t)`, the derivative of the diffusion in x.
template <class M>
concept DifferentiableSde = ScalarSde<M> && requires(const M& m, double x, double t) {
  { m.diffusion_derivative(x, t) } -> std::convertible_to<double>;
};

/// dX = growth X dt + volatility X dW.
struct GeometricBrownianMotion {
  double start = 1;
  double growth = 0;
  double volatility = 1;
  double horizon = 1;

  [[nodiscard]] double drift(double x, double /*t*/) const { return growth * x; }
  [[nodiscard]] double diffusion(double x, double /*t*/) const { return volatility * x; }
  [[nodiscard]] double diffusion_derivative(double /*x*/, double /*t*/) const { return volatility; }
};

/// dX = reversion (mean - X) dt + volatility dW.
struct OrnsteinUhlenbeck {
  double start = 0;
  double reversion = 1;
  double mean = 0;
  double volatility = 1;
  double horizon = 1;

  [[nodiscard]] double drift(double x, double /*t*/) const { return reversion * (mean - x); }
  [[nodiscard]] double diffusion(double /*x*/, double /*t*/) const { return volatility; }
  [[nodiscard]] double diffusion_derivative(double /*x*/, double /*t*/) const { return 0; }
};

/// A scheme: how noise is drawn, how a step goes, and what a Bridge needs to know of it.
struct EulerStep {
  static constexpr bool is_antithetic = false;

  template <ScalarSde M>
  static std::int64_t noises(const M& /*model*/) {
    return 1;
  }
  template <ScalarSde M>
  static double increment(std::int64_t /*noises*/, double sqrt_h, Stream& rng) {
    return sqrt_h * rng.normal();
  }
  template <ScalarSde M>
  static double diffusion(const M& model, double x, double t) {
    return model.diffusion(x, t);
  }
  template <ScalarSde M>
  static double advance(const M& model, double x, double t, double h, double b, double dw) {
    return x + model.drift(x, t) * h + b * dw;
  }
};

struct MilsteinStep : EulerStep {
  template <DifferentiableSde M>
  static double advance(const M& model, double x, double t, double h, double b, double dw) {
    return x + model.drift(x, t) * h + b * dw + b * model.diffusion_derivative(x, t) * (dw * dw - h) / 2;
  }
};

namespace detail {

template <class M>
using state_of = std::remove_cvref_t<decltype(std::declval<const M&>().start)>;

/// A state of a model, number or vector. What is not finite stays so from step to step: looking at the end is enough.
template <class State>
bool is_finite_state(const State& x) {
  if constexpr (std::is_arithmetic_v<State>) {
    return std::isfinite(static_cast<double>(x));
  } else {
    return x.allFinite();
  }
}

/// The payoff; NaN where the path has seen numbers that are none, which a comparison in the payoff would hide.
template <class F, class Summary, class State>
auto pay(const F& payoff, const Summary& summary, const State& end) {
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
  static constexpr bool takes_bridges = BridgeSummary<Summary> && std::same_as<State, double>;

  /// One step of length h.
  template <class Noise>
  static void step(const M& model, State& x, Summary& summary, double t, double h, const Noise& dw, double u) {
    const auto b = Step::diffusion(model, x, t);
    State next = Step::advance(model, x, t, h, b, dw);
    if constexpr (takes_bridges) {
      summary.add(Bridge{x, next, b, h}, u);
    } else {
      summary.add(x, next, h);
    }
    x = std::move(next);
  }

  /// One step over two increments of length h: a summary of bridges sees the middle that they imply.
  template <class Noise>
  static void double_step(const M& model, State& x, Summary& summary, double t, double h, const Noise& dw1,
                          const Noise& dw2, double u1, double u2) {
    const Noise both = dw1 + dw2;
    if constexpr (takes_bridges) {
      const double b = Step::diffusion(model, x, t);
      const double next = Step::advance(model, x, t, 2 * h, b, both);
      const double middle = (x + next + b * (dw1 - dw2)) / 2;
      summary.add(Bridge{x, middle, b, h}, u1);
      summary.add(Bridge{middle, next, b, h}, u2);
      x = next;
    } else {
      step(model, x, summary, t, 2 * h, both, 0);
    }
  }
};

/// One path.
template <class Step, class M, class Summary>
class Path : Steps<Step, M, Summary> {
  using Steps = detail::Steps<Step, M, Summary>;

 public:
  Path(const M& model, const Summary& summary) : model_(model), x_(model.start), summary_(summary) {}

  template <class Noise>
  void step(double t, double h, const Noise& dw, double u) {
    Steps::step(model_, x_, summary_, t, h, dw, u);
  }
  template <class Noise>
  void double_step(double t, double h, const Noise& dw1, const Noise& dw2, double u1, double u2) {
    Steps::double_step(model_, x_, summary_, t, h, dw1, dw2, u1, u2);
  }
  template <class F>
  auto pay(const F& payoff) const {
    return detail::pay(payoff, summary_, x_);
  }

 private:
  const M& model_;
  state_of<M> x_;
  Summary summary_;
};

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

/// A BiasedSequence; the work is the number of steps of all paths. A step of the finest path draws its
/// increment, then the number of its bridge, if the summary uses one. An antithetic scheme has a second fine
/// path, with the increments of each pair in reverse order: I_k is the mean of both, and so is the fine part
/// of D_k.
template <class Step, class M, class Summary, class F>
class SdeLevels {
  using Path = detail::Path<Step, M, Summary>;
  struct NoPath {
    NoPath(const M& /*model*/, const Summary& /*summary*/) {}
  };
  using Twin = std::conditional_t<Step::is_antithetic, Path, NoPath>;
  static constexpr bool draws_bridges = [] {
    if constexpr (BridgeSummary<Summary>) return static_cast<bool>(Summary::uses_number);
    return false;
  }();
  using Paths = detail::Paths<Step, M, Summary>;
  using Numbers = detail::PathNumbers<draws_bridges>;
  using NettedNumbers = detail::BridgedPathNumbers<draws_bridges>;

  /// Normals of a standard deviation, one for each Brownian motion.
  struct Normals {
    Stream* rng;
    std::int64_t noises;
    auto operator()(double sd) const { return Step::template increment<M>(noises, sd, *rng); }
  };
  /// Increments in the order of time.
  struct InTime {
    Normals draw;
    double sqrt_h;
    auto next() const { return draw(sqrt_h); }
  };

 public:
  using value_type = std::remove_cvref_t<decltype(std::declval<const Path&>().pay(std::declval<const F&>()))>;
  static constexpr std::int64_t last_level = 62;

  SdeLevels(M model, Summary summary, F payoff, const Rates& declared)
      : rates(declared), model_(std::move(model)), summary_(std::move(summary)), payoff_(std::move(payoff)) {
    if (!(model_.horizon > 0) || !std::isfinite(static_cast<double>(model_.horizon))) {
      throw std::invalid_argument("sde: horizon = " + detail::format("%g", static_cast<double>(model_.horizon)) +
                                  " (must be positive and finite)");
    }
    noises_ = Step::noises(model_);
  }

  /// Throws std::length_error above last_level.
  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    if (level == 0) {
      const Term<value_type> one = value_at(0, rng);
      return debias::base(one.value, one.work);
    }
    return along(steps_of(level), rng,
                 [&](std::int64_t steps, double h, auto&& noise) { return draw_along(steps, h, rng, noise); });
  }

  /// I_level along one path, the fine one of a draw. Throws std::length_error above last_level.
  Term<value_type> value_at(std::int64_t level, Stream& rng) const {
    return along(steps_of(level), rng, [&](std::int64_t steps, double h, auto&& noise) {
      Path path(model_, summary_);
      for (std::int64_t i = 0; i < steps; ++i) {
        const auto dw = noise.next();
        path.step(static_cast<double>(i) * h, h, dw, bridge_number(rng));
      }
      return Term<value_type>{path.pay(payoff_), static_cast<double>(steps)};
    });
  }

  [[nodiscard]] static std::int64_t deepest_level() { return last_level; }

  // ---- many members at once

  static constexpr bool batches = std::same_as<detail::state_of<M>, double> && std::same_as<value_type, double> &&
                                  std::derived_from<Step, EulerStep>;

  void values(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    along(steps_of(level), batch, [&](std::int64_t steps, double h, auto&& numbers) {
      Paths paths(model_, summary_, out.size());
      for (std::int64_t i = 0; i < steps; ++i) {
        numbers.next();
        paths.step(static_cast<double>(i) * h, h, numbers.increments(), numbers.uniforms());
      }
      for (std::size_t b = 0; b < out.size(); ++b) out[b] = {paths.pay(payoff_, b), static_cast<double>(steps)};
    });
  }

  void differences(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    if (level == 0) return values(level, batch, out);
    along(steps_of(level), batch, [&](std::int64_t steps, double h, auto&& numbers) {
      Paths fine(model_, summary_, out.size());
      Paths coarse(model_, summary_, out.size());
      for (std::int64_t i = 0; i < steps; i += 2) {
        const double t = static_cast<double>(i) * h;
        numbers.next();
        const double* const dw1 = numbers.increments();
        const double* const u1 = numbers.uniforms();
        numbers.next();
        fine.step(t, h, dw1, u1);
        fine.step(static_cast<double>(i + 1) * h, h, numbers.increments(), numbers.uniforms());
        coarse.double_step(t, h, dw1, numbers.increments(), u1, numbers.uniforms());
      }
      for (std::size_t b = 0; b < out.size(); ++b) {
        out[b] = {fine.pay(payoff_, b) - coarse.pay(payoff_, b), 1.5 * static_cast<double>(steps)};
      }
    });
  }

  Rates rates;

 private:
  /// `walk(steps, h, noise)` over the increments of the path that a stream has, as the order of its numbers wants it.
  template <class Walk>
  [[gnu::always_inline]] auto along(std::int64_t steps, Stream& rng, const Walk& walk) const {
    const double h = model_.horizon / static_cast<double>(steps);
    if (rng.is_point()) [[unlikely]]
      return along_bridges(steps, h, rng, walk);
    return walk(steps, h, InTime{{&rng, noises_}, std::sqrt(h)});
  }
  // Apart, for its memory: a path in time needs none.
  template <class Walk>
  [[gnu::noinline]] auto along_bridges(std::int64_t steps, double h, Stream& rng, const Walk& walk) const {
    return walk(steps, h, detail::BridgedPath<Normals>({&rng, noises_}, steps, model_.horizon));
  }
  /// The same of a batch.
  template <class Walk>
  [[gnu::always_inline]] void along(std::int64_t steps, StreamBatch& batch, const Walk& walk) const {
    const double h = model_.horizon / static_cast<double>(steps);
    if (batch.is_net()) return along_bridges(steps, h, batch, walk);
    walk(steps, h, Numbers(batch, steps, std::sqrt(h)));
  }
  template <class Walk>
  [[gnu::noinline]] void along_bridges(std::int64_t steps, double h, StreamBatch& batch, const Walk& walk) const {
    walk(steps, h, NettedNumbers(batch, steps, model_.horizon));
  }

  /// A draw of a level above 0 along the increments of a path.
  template <class Noise>
  [[gnu::always_inline]] Draw<value_type> draw_along(std::int64_t steps, double h, Stream& rng, Noise& noise) const {
    Path fine(model_, summary_);
    [[maybe_unused]] Twin twin(model_, summary_);
    Path coarse(model_, summary_);
    for (std::int64_t i = 0; i < steps; i += 2) {
      const double t = static_cast<double>(i) * h;
      const double middle = static_cast<double>(i + 1) * h;
      const auto dw1 = noise.next();
      const double u1 = bridge_number(rng);
      const auto dw2 = noise.next();
      const double u2 = bridge_number(rng);
      fine.step(t, h, dw1, u1);
      fine.step(middle, h, dw2, u2);
      if constexpr (Step::is_antithetic) {
        twin.step(t, h, dw2, u2);
        twin.step(middle, h, dw1, u1);
      }
      coarse.double_step(t, h, dw1, dw2, u1, u2);
    }
    const auto n = static_cast<double>(steps);
    if constexpr (Step::is_antithetic) {
      const value_type mean = debias::scaled(debias::sum(fine.pay(payoff_), twin.pay(payoff_)), 0.5);
      return debias::coupled<value_type>(mean, coarse.pay(payoff_), 2.5 * n);
    } else {
      return debias::coupled<value_type>(fine.pay(payoff_), coarse.pay(payoff_), 1.5 * n);
    }
  }

  static double bridge_number([[maybe_unused]] Stream& rng) {
    if constexpr (draws_bridges) {
      return rng.uniform();
    } else {
      return 0;
    }
  }

  static std::int64_t steps_of(std::int64_t level) {
    if (level > last_level) {
      throw std::length_error("sde: level " + std::to_string(level) + " has 2^" + std::to_string(level) +
                              " steps, more than can be counted; take a PMF that falls faster");
    }
    return std::int64_t{1} << level;
  }

  M model_;
  Summary summary_;
  F payoff_;
  std::int64_t noises_ = 1;
};

/// What is wanted of the path: a Value computed from X_T.
template <class F, class State = double>
concept TerminalPayoff = requires(const F& f, const State& x) {
  requires Value<std::remove_cvref_t<decltype(f(x))>>;
};

/// E payoff(X_T) by Euler's scheme: `euler(OrnsteinUhlenbeck{.reversion = 2}, payoff, {2, 1})`.
/// Throws std::invalid_argument for a horizon that is not positive and finite.
template <ScalarSde M, TerminalPayoff F>
auto euler(M model, F payoff, const Rates& rates = {1, 1}) {
  return SdeLevels<EulerStep, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}

/// E payoff(summary of the path) by Euler's scheme.
template <ScalarSde M, PathSummary<double> Summary, TerminalPayoff<Summary> F>
auto euler(M model, Summary summary, F payoff, const Rates& rates = {1, 1}) {
  return SdeLevels<EulerStep, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff), rates);
}

/// E payoff(X_T) by Milstein's scheme: `milstein(GeometricBrownianMotion{.start = 100}, payoff)`.
/// Throws std::invalid_argument for a horizon that is not positive and finite.
template <DifferentiableSde M, TerminalPayoff F>
auto milstein(M model, F payoff, const Rates& rates = {2, 1}) {
  return SdeLevels<MilsteinStep, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}

/// E payoff(summary of the path) by Milstein's scheme:
/// `milstein(stock, Minimum{}, [](const Minimum& path) { return path.terminal - path.minimum; })`.
template <DifferentiableSde M, PathSummary<double> Summary, TerminalPayoff<Summary> F>
auto milstein(M model, Summary summary, F payoff, const Rates& rates = {2, 1}) {
  return SdeLevels<MilsteinStep, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff), rates);
}

}  // namespace debias

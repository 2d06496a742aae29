#pragma once

// The sequence behind sde.hpp: a payoff of paths in 2^k steps at level k.
//
//   I_k = payoff(path of 2^k steps),  D_k = I_k - payoff(path of half as many, over pairs of the same increments)
//
// Notation: k = level, h = T 2^-k. Rates, and where it fails: sde.hpp. Source: Giles, Oper. Res. 56 (2008).

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
#include <debias/sde/paths.hpp>
#include <debias/sde/schemes.hpp>
#include <debias/sde/summaries.hpp>

namespace debias {

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

}  // namespace debias

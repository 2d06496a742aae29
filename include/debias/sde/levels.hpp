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
#include <debias/sde/models.hpp>
#include <debias/sde/paths.hpp>
#include <debias/sde/schemes.hpp>
#include <debias/sde/summaries.hpp>

namespace debias {

/// A BiasedSequence; the work is the number of steps of all paths, of a tree those of all branches. A step of the finest path draws its
/// increment, then the number of its bridge, if the summary uses one. An antithetic scheme has a second fine
/// path, with the increments of each pair in reverse order: I_k is the mean of both, and so is the fine part
/// of D_k.
template <class Step, class M, class Summary, class F>
class SdeLevels {
  using Time = detail::time_of<M>;
  using Path = detail::Path<Step, M, Summary>;
  struct NoPath {
    NoPath(const M& /*model*/, const Summary& /*summary*/) {}
  };
  using Twin = std::conditional_t<Step::is_antithetic, Path, NoPath>;
  static constexpr bool draws_bridges = detail::Steps<Step, M, Summary>::draws_bridges;
  using Paths = detail::Paths<Step, M, Summary>;
  using Numbers = detail::PathNumbers<draws_bridges>;
  using NettedNumbers = detail::BridgedPathNumbers<draws_bridges>;

  /// Normals of a standard deviation, one for each Brownian motion.
  struct Normals {
    Stream* rng;
    std::int64_t noises;
    auto operator()(const Time& sd) const { return Step::template increment<M>(noises, sd, *rng); }
  };
  /// Increments in the order of time.
  struct InTime {
    Normals draw;
    Time sqrt_h;
    auto next() const { return draw(sqrt_h); }
  };
  /// Increments by bridges over [0, 1], times the root of a horizon that is no plain number.
  struct Stretched {
    struct Unit {
      Stream* rng;
      double operator()(double sd) const { return sd * rng->normal(); }
    };
    detail::BridgedPath<Unit> path;
    Time root;
    auto next() { return root * path.next(); }
  };

 public:
  using value_type =
      std::remove_cvref_t<decltype(detail::paid<Step, Time>(std::declval<const Path&>(), std::declval<const F&>()))>;
  static constexpr std::int64_t last_level = Step::is_branched ? 57 : 62;  ///< its steps can be counted

  SdeLevels(M model, Summary summary, F payoff, const Rates& declared)
      : rates(declared), model_(std::move(model)), summary_(std::move(summary)), payoff_(std::move(payoff)) {
    const auto horizon = static_cast<double>(model_.horizon);
    if (!(horizon > 0) || !std::isfinite(horizon)) {
      throw std::invalid_argument("sde: horizon = " + detail::format("%g", horizon) + " (must be positive and finite)");
    }
    if constexpr (requires { model_.check(); }) model_.check();
    noises_ = Step::noises(model_);
  }

  /// Throws std::length_error above last_level.
  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    if (level == 0) {
      const Term<value_type> one = value_at(0, rng);
      return debias::base(one.value, one.work);
    }
    return along(steps_of(level), rng,
                 [&](std::int64_t steps, const Time& h, auto&& noise) { return draw<Coupled>(steps, h, rng, noise); });
  }

  /// I_level along one path, the fine one of a draw. Throws std::length_error above last_level.
  Term<value_type> value_at(std::int64_t level, Stream& rng) const {
    return along(steps_of(level), rng, [&](std::int64_t steps, const Time& h, auto&& noise) {
      if (level > 0) {
        const Draw<value_type> alone = draw<Alone>(steps, h, rng, noise);
        return Term<value_type>{alone.value, alone.work};
      }
      Path path(model_, summary_);
      if constexpr (Step::is_smoothed) {
        return Term<value_type>{path.expect(payoff_, Time(0), h, Time(0), h), 1};
      } else {
        const auto dw = noise.next();
        path.step(Time(0), h, dw, bridge_number(rng));
        return Term<value_type>{path.pay(payoff_), 1};
      }
    });
  }

  [[nodiscard]] static std::int64_t deepest_level() { return last_level; }

  // ---- many members at once

  static constexpr bool batches = std::same_as<detail::state_of<M>, double> && std::same_as<value_type, double> &&
                                  std::derived_from<Step, EulerStep> && !Step::is_smoothed;

  void values(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    if (level > 0) return draws<PathsAlone>(level, batch, out);
    along(1, batch, [&](std::int64_t /*steps*/, double h, auto&& numbers) {
      Paths paths(model_, summary_, out.size());
      numbers.next();
      paths.step(0.0, h, numbers.increments(), numbers.uniforms());
      for (std::size_t b = 0; b < out.size(); ++b) out[b] = {paths.pay(payoff_, b), 1};
    });
  }

  void differences(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    if (level == 0) return values(level, batch, out);
    draws<PathsCoupled>(level, batch, out);
  }

  Rates rates;

 private:
  /// `walk(steps, h, noise)` over the increments of the path that a stream has, as the order of its numbers wants it. A tree
  /// draws them as it goes, each branch to its end: there is no bridge to its ends.
  template <class Walk>
  [[gnu::always_inline]] auto along(std::int64_t steps, Stream& rng, const Walk& walk) const {
    using std::sqrt;
    const Time h = model_.horizon / static_cast<double>(steps);
    if constexpr (!Step::is_branched) {
      if (rng.is_point()) [[unlikely]]
        return along_bridges(steps, h, rng, walk);
    }
    return walk(steps, h, InTime{{&rng, noises_}, sqrt(h)});
  }
  // Apart, for its memory: a path in time needs none.
  template <class Walk>
  [[gnu::noinline]] auto along_bridges(std::int64_t steps, const Time& h, Stream& rng, const Walk& walk) const {
    if constexpr (std::same_as<Time, double>) {
      return walk(steps, h, detail::BridgedPath<Normals>({&rng, noises_}, steps, model_.horizon));
    } else {
      using std::sqrt;
      return walk(steps, h, Stretched{{{&rng}, steps, 1.0}, sqrt(model_.horizon)});
    }
  }
  /// The same of a batch.
  template <class Walk>
  [[gnu::always_inline]] void along(std::int64_t steps, StreamBatch& batch, const Walk& walk) const {
    const double h = model_.horizon / static_cast<double>(steps);
    if constexpr (Step::is_branched) {
      walk(steps, h, Numbers(batch, static_cast<std::int64_t>(Step::steps_of_tree(steps)), std::sqrt(h)));
    } else {
      if (batch.is_net()) return along_bridges(steps, h, batch, walk);
      walk(steps, h, Numbers(batch, steps, std::sqrt(h)));
    }
  }
  template <class Walk>
  [[gnu::noinline]] void along_bridges(std::int64_t steps, double h, StreamBatch& batch, const Walk& walk) const {
    walk(steps, h, NettedNumbers(batch, steps, model_.horizon));
  }

  /// The paths that share the increments of a draw, two fine steps at a time; and that of I_k alone.
  struct Coupled {
    static constexpr double paths = Step::is_antithetic ? 2.5 : 1.5;
    Path fine;
    [[no_unique_address]] Twin twin;
    Path coarse;

    Coupled(const M& model, const Summary& summary)
        : fine(model, summary), twin(model, summary), coarse(model, summary) {}

    template <class Noise>
    [[gnu::always_inline]] void two_steps(std::int64_t i, const Time& h, const Noise& dw1, const Noise& dw2, double u1,
                                          double u2) {
      const Time t = static_cast<double>(i) * h;
      const Time middle = static_cast<double>(i + 1) * h;
      fine.step(t, h, dw1, u1);
      fine.step(middle, h, dw2, u2);
      if constexpr (Step::is_antithetic) {
        twin.step(t, h, dw2, u2);
        twin.step(middle, h, dw1, u1);
      }
      coarse.double_step(t, h, dw1, dw2, u1, u2);
    }
    Draw<value_type> pay(const F& payoff) const {
      if constexpr (Step::is_antithetic) {
        const value_type mean = debias::scaled(debias::sum(fine.pay(payoff), twin.pay(payoff)), 0.5);
        return debias::coupled<value_type>(mean, coarse.pay(payoff));
      } else {
        return debias::coupled<value_type>(fine.pay(payoff), coarse.pay(payoff));
      }
    }
    /// The last two steps, from step i on, given the first of their increments.
    template <class Noise>
    Draw<value_type> expect(const F& payoff, std::int64_t i, const Time& h, const Noise& dw1) {
      const Time t = static_cast<double>(i) * h;
      fine.step(t, h, dw1, 0);
      return debias::coupled<value_type>(fine.expect(payoff, static_cast<double>(i + 1) * h, h, Time(0), h),
                                         coarse.expect(payoff, t, Time(2 * h), dw1, h));
    }
  };
  struct Alone {
    static constexpr double paths = 1;
    Path fine;

    Alone(const M& model, const Summary& summary) : fine(model, summary) {}

    template <class Noise>
    [[gnu::always_inline]] void two_steps(std::int64_t i, const Time& h, const Noise& dw1, const Noise& dw2, double u1,
                                          double u2) {
      fine.step(static_cast<double>(i) * h, h, dw1, u1);
      fine.step(static_cast<double>(i + 1) * h, h, dw2, u2);
    }
    Draw<value_type> pay(const F& payoff) const { return debias::base<value_type>(fine.pay(payoff)); }
    template <class Noise>
    Draw<value_type> expect(const F& payoff, std::int64_t i, const Time& h, const Noise& dw1) {
      fine.step(static_cast<double>(i) * h, h, dw1, 0);
      return debias::base<value_type>(fine.expect(payoff, static_cast<double>(i + 1) * h, h, Time(0), h));
    }
  };

  /// A draw of a level above 0 along the increments of a path, or of a tree.
  template <class Kin, class Noise>
  [[gnu::always_inline]] Draw<value_type> draw(std::int64_t steps, const Time& h, Stream& rng, Noise& noise) const {
    Kin kin(model_, summary_);
    if constexpr (Step::is_branched) {
      Draw<value_type> sum = grow(kin, 0, steps, h, rng, noise);
      const double leaves = static_cast<double>(steps) / 2;
      return {debias::scaled(std::move(sum.value), 1 / leaves), debias::scaled(std::move(sum.difference), 1 / leaves),
              Kin::paths * Step::steps_of_tree(steps)};
    } else {
      Draw<value_type> draw = end(kin, 0, steps, h, rng, noise);
      draw.work = Kin::paths * static_cast<double>(steps);
      return draw;
    }
  }
  /// To the end, and what it pays.
  template <class Kin, class Noise>
  [[gnu::always_inline]] Draw<value_type> end(Kin& kin, std::int64_t from, std::int64_t steps, const Time& h,
                                              Stream& rng, Noise& noise) const {
    if constexpr (Step::is_smoothed) {
      walk(kin, from, steps - 2, h, rng, noise);
      return kin.expect(payoff_, steps - 2, h, noise.next());
    } else {
      walk(kin, from, steps, h, rng, noise);
      return kin.pay(payoff_);
    }
  }
  template <class Kin, class Noise>
  [[gnu::always_inline]] static void walk(Kin& kin, std::int64_t from, std::int64_t to, const Time& h, Stream& rng,
                                          Noise& noise) {
    for (std::int64_t i = from; i < to; i += 2) {
      const auto dw1 = noise.next();
      const double u1 = bridge_number(rng);
      const auto dw2 = noise.next();
      const double u2 = bridge_number(rng);
      kin.two_steps(i, h, dw1, dw2, u1, u2);
    }
  }
  /// The sum over the leaves of a branch from step `from` on. Half of what remains is its stem, down to the last two steps.
  template <class Kin, class Noise>
  Draw<value_type> grow(Kin& kin, std::int64_t from, std::int64_t steps, const Time& h, Stream& rng,
                        Noise& noise) const {
    const std::int64_t remain = steps - from;
    if (remain == 2) return end(kin, from, steps, h, rng, noise);
    const std::int64_t fork = from + remain / 2;
    walk(kin, from, fork, h, rng, noise);
    Kin other = kin;
    Draw<value_type> one = grow(other, fork, steps, h, rng, noise);
    const Draw<value_type> two = grow(kin, fork, steps, h, rng, noise);
    return {debias::sum(std::move(one.value), two.value), debias::sum(std::move(one.difference), two.difference)};
  }

  /// The same of a batch: its draws of a level above 0, those of I_k alone or of D_k.
  struct PathsAlone {
    static constexpr double paths = 1;
    Paths fine;

    PathsAlone(const M& model, const Summary& summary, std::size_t size) : fine(model, summary, size) {}

    template <class Numbers>
    [[gnu::always_inline]] void two_steps(std::int64_t i, double h, Numbers& numbers) {
      for (const std::int64_t step : {i, i + 1}) {
        numbers.next();
        fine.step(static_cast<double>(step) * h, h, numbers.increments(), numbers.uniforms());
      }
    }
    double pay(const F& payoff, std::size_t b) const { return fine.pay(payoff, b); }
  };
  struct PathsCoupled {
    static constexpr double paths = 1.5;
    Paths fine;
    Paths coarse;

    PathsCoupled(const M& model, const Summary& summary, std::size_t size)
        : fine(model, summary, size), coarse(model, summary, size) {}

    template <class Numbers>
    [[gnu::always_inline]] void two_steps(std::int64_t i, double h, Numbers& numbers) {
      const double t = static_cast<double>(i) * h;
      numbers.next();
      const double* const dw1 = numbers.increments();
      const double* const u1 = numbers.uniforms();
      numbers.next();
      fine.step(t, h, dw1, u1);
      fine.step(static_cast<double>(i + 1) * h, h, numbers.increments(), numbers.uniforms());
      coarse.double_step(t, h, dw1, numbers.increments(), u1, numbers.uniforms());
    }
    double pay(const F& payoff, std::size_t b) const { return fine.pay(payoff, b) - coarse.pay(payoff, b); }
  };
  template <class Kin>
  void draws(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const {
    along(steps_of(level), batch, [&](std::int64_t steps, double h, auto&& numbers) {
      Kin kin(model_, summary_, out.size());
      if constexpr (Step::is_branched) {
        for (auto& term : out) term = {0, Kin::paths * Step::steps_of_tree(steps)};
        grow(kin, 0, steps, h, numbers, out);
        for (auto& term : out) term.value /= static_cast<double>(steps) / 2;
      } else {
        for (std::int64_t i = 0; i < steps; i += 2) kin.two_steps(i, h, numbers);
        for (std::size_t b = 0; b < out.size(); ++b) {
          out[b] = {kin.pay(payoff_, b), Kin::paths * static_cast<double>(steps)};
        }
      }
    });
  }
  template <class Kin, class Numbers>
  void grow(Kin& kin, std::int64_t from, std::int64_t steps, double h, Numbers& numbers,
            std::span<Term<value_type>> out) const {
    const std::int64_t remain = steps - from;
    const std::int64_t fork = remain == 2 ? steps : from + remain / 2;
    for (std::int64_t i = from; i < fork; i += 2) kin.two_steps(i, h, numbers);
    if (fork == steps) {
      for (std::size_t b = 0; b < out.size(); ++b) out[b].value += kin.pay(payoff_, b);
      return;
    }
    Kin other = kin;
    grow(other, fork, steps, h, numbers, out);
    grow(kin, fork, steps, h, numbers, out);
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

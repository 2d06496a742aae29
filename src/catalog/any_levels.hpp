#pragma once

// The levels of any problem, of one type for all that offer the same hooks: the estimators are compiled once for that type
// (any_levels.cpp), not once a problem. A draw is one indirect call, a batch of draws too; its numbers are the sequence's own.
// That costs a few percent of a sample of random numbers, and nearly half of one that takes none and lasts 50 ns
// (`debias_bench --benchmark_filter=plain/catalog`): where it counts, give the sequence itself to an estimator.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <type_traits>

#include <debias/core/bias.hpp>
#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/resonance.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/common.hpp>

#include "../catalog.hpp"

namespace debias::catalog::detail {

/// The optional members of a sequence that change what an estimator does.
struct Hooks {
  bool difference_at = false;
  bool shared = false;
  bool batches = false;         ///< values and differences
  bool batches_shared = false;  ///< shared
  bool missed = false;          ///< points that can be in step with the integrand
};

template <BiasedSequence S>
constexpr Hooks hooks_of() {
  static_assert(!debias::detail::ReportsValues<S>, "no problem reports values beside its differences");
  return {.difference_at = OffersDifferenceAt<S>,
          .shared = OffersSharedBase<S>,
          .batches = BatchesValues<S> && BatchesDifferences<S>,
          .batches_shared = BatchesShared<S>,
          .missed = ChecksPoints<S>};
}

/// One function for each way to draw; those that the sequence lacks are null.
struct LevelCalls {
  using Out = std::span<Term<double>>;
  using SharedOut = std::span<SharedDraw<double>>;
  Draw<double> (*draw)(const void* s, std::int64_t level, Stream& rng) = nullptr;
  Term<double> (*value_at)(const void* s, std::int64_t level, Stream& rng) = nullptr;
  Term<double> (*difference_at)(const void* s, std::int64_t level, Stream& rng) = nullptr;
  SharedDraw<double> (*shared)(const void* s, std::int64_t level, std::int64_t base, Stream& rng) = nullptr;
  void (*values)(const void* s, std::int64_t level, StreamBatch& batch, Out out) = nullptr;
  void (*differences)(const void* s, std::int64_t level, StreamBatch& batch, Out out) = nullptr;
  void (*batch_shared)(const void* s, std::int64_t level, std::int64_t base, StreamBatch& batch,
                       SharedOut out) = nullptr;
  BiasBound (*bias_bound)(const void* s, const LevelTable& levels) = nullptr;
  double (*missed)(const void* s, std::int64_t level, std::int64_t draws, Stream& rng) = nullptr;
};

template <class S>
const S& as(const void* s) {
  return *static_cast<const S*>(s);
}

template <BiasedSequence S>
constexpr LevelCalls level_calls() {
  LevelCalls calls;
  calls.draw = [](const void* s, std::int64_t level, Stream& rng) { return as<S>(s)(level, rng); };
  calls.value_at = [](const void* s, std::int64_t level, Stream& rng) { return value_of(as<S>(s), level, rng); };
  if constexpr (hooks_of<S>().difference_at) {
    calls.difference_at = [](const void* s, std::int64_t level, Stream& rng) {
      return as<S>(s).difference_at(level, rng);
    };
  }
  if constexpr (hooks_of<S>().shared) {
    calls.shared = [](const void* s, std::int64_t level, std::int64_t base, Stream& rng) {
      return as<S>(s).shared(level, base, rng);
    };
  }
  if constexpr (hooks_of<S>().batches) {
    calls.values = [](const void* s, std::int64_t level, StreamBatch& batch, LevelCalls::Out out) {
      as<S>(s).values(level, batch, out);
    };
    calls.differences = [](const void* s, std::int64_t level, StreamBatch& batch, LevelCalls::Out out) {
      as<S>(s).differences(level, batch, out);
    };
  }
  if constexpr (hooks_of<S>().batches_shared) {
    calls.batch_shared = [](const void* s, std::int64_t level, std::int64_t base, StreamBatch& batch,
                            LevelCalls::SharedOut out) { as<S>(s).shared(level, base, batch, out); };
  }
  calls.bias_bound = []([[maybe_unused]] const void* s, [[maybe_unused]] const LevelTable& levels) {
    if constexpr (StatesBias<S>) return as<S>(s).bias_bound(levels);
    return BiasBound{};
  };
  if constexpr (hooks_of<S>().missed) {
    calls.missed = [](const void* s, std::int64_t level, std::int64_t draws, Stream& rng) {
      return static_cast<double>(as<S>(s).missed(level, draws, rng));
    };
  }
  return calls;
}
template <BiasedSequence S>
inline constexpr LevelCalls level_calls_of = level_calls<S>();

/// A run or a trace. Both are asked for in one call: the estimators of a problem are made in one place, once.
struct Task {
  const Plan* plan = nullptr;  ///< of a run; null for a trace
  std::uint64_t seed = 0;
  std::int64_t index = 0;
  Statistics statistics = {};
  Trace<double> trace = {};
};

template <Estimator E>
void carry_out(const E& e, Task& task) {
  if (task.plan != nullptr) {
    task.statistics = estimate(e, *task.plan);
  } else {
    task.trace = debias::trace(e, task.seed, task.index);
  }
}

template <Hooks hooks>
class AnyLevels {
 public:
  template <BiasedSequence S>
  requires(!std::is_same_v<S, AnyLevels>) explicit AnyLevels(const S& sequence)
      : sequence_(std::make_shared<const S>(sequence)),
        calls_(&level_calls_of<S>),
        deepest_(deepest_level_of(sequence)),
        facts_(facts_of(sequence)) {}

  Draw<double> operator()(std::int64_t level, Stream& rng) const { return calls_->draw(sequence_.get(), level, rng); }
  Term<double> value_at(std::int64_t level, Stream& rng) const { return calls_->value_at(sequence_.get(), level, rng); }
  Term<double> difference_at(std::int64_t level, Stream& rng) const requires(hooks.difference_at) {
    return calls_->difference_at(sequence_.get(), level, rng);
  }
  SharedDraw<double> shared(std::int64_t level, std::int64_t base, Stream& rng) const requires(hooks.shared) {
    return calls_->shared(sequence_.get(), level, base, rng);
  }
  void values(std::int64_t level, StreamBatch& batch, LevelCalls::Out out) const requires(hooks.batches) {
    calls_->values(sequence_.get(), level, batch, out);
  }
  void differences(std::int64_t level, StreamBatch& batch, LevelCalls::Out out) const requires(hooks.batches) {
    calls_->differences(sequence_.get(), level, batch, out);
  }
  void shared(std::int64_t level, std::int64_t base, StreamBatch& batch, LevelCalls::SharedOut out) const
      requires(hooks.batches_shared) {
    calls_->batch_shared(sequence_.get(), level, base, batch, out);
  }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const {
    return calls_->bias_bound(sequence_.get(), levels);
  }
  [[nodiscard]] double missed(std::int64_t level, std::int64_t draws, Stream& rng) const requires(hooks.missed) {
    return calls_->missed(sequence_.get(), level, draws, rng);
  }
  [[nodiscard]] std::int64_t deepest_level() const { return deepest_; }
  [[nodiscard]] SequenceFacts facts() const { return facts_; }

  /// By the estimator that a choice names: all but roulette.
  void carry_out(const Choice& choice, Task& task) const;
  [[nodiscard]] LevelRuns runs() const;
  /// Sums of D_level over `draws` draws of the pilot streams of `seed`.
  [[nodiscard]] LevelSums pilot(std::int64_t level, std::int64_t draws, std::uint64_t seed) const;

 private:
  std::shared_ptr<const void> sequence_;
  const LevelCalls* calls_;
  std::int64_t deepest_;
  SequenceFacts facts_;
};

template <BiasedSequence S>
AnyLevels<hooks_of<S>()> any_levels(const S& sequence) {
  return AnyLevels<hooks_of<S>()>(sequence);
}

}  // namespace debias::catalog::detail

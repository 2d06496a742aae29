#pragma once

// The one runner: estimate(estimator, plan) draws the samples of a plan and returns their mean with its doubt.
//
//   mean = 1/N sum_i e(Stream(seed, first + i)),   i = 0 ... N - 1
//
// An estimator in blocks draws `block` samples from one stream, Stream(seed, index / block), and returns their mean.
// Samples run in chunks of 512 absolute indices (about 1024 in blocks); chunk sums combine by a
// fixed binary tree, so the result is the same bits for any number of threads, and results over neighbouring
// ranges merge into the bits of the whole (Chan, Golub, LeVeque 1983 for the merge of moments).
// `trace` draws one sample alone, with its levels.

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <typeinfo>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/plan.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/resonance.hpp>
#include <debias/core/result.hpp>
#include <debias/core/run_state.hpp>
#include <debias/core/stream.hpp>

namespace debias {

/// A callable threw; what() says how to replay the sample, std::rethrow_if_nested gives the original.
class SampleError : public std::runtime_error {
 public:
  SampleError(const std::string& what, std::uint64_t seed, std::int64_t index)
      : std::runtime_error(what), seed_(seed), index_(index) {}
  [[nodiscard]] std::uint64_t seed() const { return seed_; }
  [[nodiscard]] std::int64_t index() const { return index_; }

 private:
  std::uint64_t seed_;
  std::int64_t index_;
};

namespace detail {
using ChunkBody = std::function<void(std::int64_t first, std::int64_t last, Recorder& recorder)>;

/// How the samples of an estimator come: so many from one stream, and so many in a chunk of a run.
struct Pieces {
  std::int64_t block = 1;
  std::int64_t chunk = default_chunk;
};

Statistics run(const Plan& plan, const Identity& identity, const Pieces& pieces, const ChunkBody& body);
/// The plan of a run that goes on from a state.
Plan plan_from(const RunState& state, Plan plan);
/// Says that a run had so many threads, and no more.
Warning fewer_threads_warning(int threads);

template <class E>
Pieces pieces_of(const E& estimator) {
  Pieces pieces;
  if constexpr (StatesBlock<E>) {
    pieces.block = estimator.block();
    pieces.chunk = pieces.block * default_chunk;
  }
  if constexpr (StatesChunk<E>) pieces.chunk = estimator.chunk();
  return pieces;
}

/// Whose results a run of the estimator gives.
template <Estimator E>
Identity identity_of(const E& estimator) {
  Identity identity{.estimator = description(estimator), .type = &typeid(E)};
  if constexpr (HasName<E>) identity.name = estimator.name();
  return identity;
}

Statistics merge(const Statistics& a, const Statistics& b);
/// Those of the levels: a pilot, or points that no state keeps, may have told them, and more samples do not take them back.
std::vector<Warning> lasting(const std::vector<Warning>& warnings);
/// Judges the coupling of the levels, and warns first of all of a wrong one; says where the standard error is below the rounding
/// of the values themselves.
Statistics with_rounding(Statistics statistics, double epsilon);
[[noreturn]] void rethrow_with_sample(std::uint64_t seed, std::int64_t index);
}  // namespace detail

namespace detail {

/// How the streams of a run are drawn from: each once, in the order of a chunk.
struct OneByOne {
  /// Before a run of streams first ... last - 1, or before the pilots of its goal; `in_order` where all of them will come.
  void begin(std::int64_t /*first*/, std::int64_t /*last*/, bool /*in_order*/) const {}
  template <class Draw>
  void chunk(std::int64_t first, std::int64_t last, const Draw& draw, Recorder& recorder) const {
    for (std::int64_t i = first; i < last; ++i) recorder.add(draw(i, recorder));
  }
  /// One of them again, for its value alone.
  template <class Draw>
  auto again(std::int64_t i, const Draw& draw) const {
    NullRecord record;
    return draw(i, record).value;
  }
  /// Something else that draws.
  template <class F>
  auto aside(const F& f) const {
    return f();
  }
};

/// Draws by the index of a stream; those of a pilot have streams of their own.
template <Estimator E>
auto draws_of(const E& estimator, std::uint64_t seed, const bool& pilot) {
  return [&estimator, &pilot, seed](std::int64_t i, auto& record) {
    Stream rng(seed, static_cast<std::uint64_t>(i));
    if (pilot) rng = debias::split(rng, Branch::pilot);
    return debias::draw_sample(estimator, rng, record);
  };
}

/// What a run asks of an estimator, whatever its type. Empty: it has nothing to say there.
struct Drawn {
  Identity identity{};
  Pieces pieces{};
  double epsilon = 0;  ///< of a component of its values
  bool pilot = false;  ///< draws from the streams of a goal's pilot
  ChunkBody body{};
  /// Before a run of streams first ... last - 1, as `OneByOne::begin`.
  std::function<void(std::int64_t first, std::int64_t last, bool in_order)> begin{};
  std::optional<SequenceFacts> facts{};
  std::function<Reach(std::int64_t last_stream)> reach{};
  std::function<BiasBound(const LevelTable& levels)> bias_bound{};
  std::function<double(std::int64_t level)> probability{};
  Missed missed{};
};
/// Warns of a run whose levels are not drawn as often as their probabilities say, which chance does once in 10^9 runs.
void judge_counts(Statistics& statistics);
/// The goal's pilot, the run, and what the levels say.
Statistics drive(Drawn& drawn, const Plan& plan);

/// `estimate` by another way to draw, which sees each sample, or each block, as draw(index of its stream, record); without
/// the mean in the type of the value.
template <Estimator E, class Way>
Statistics statistics_by(Way& way, const E& estimator, const Plan& plan) {
  Drawn drawn{.identity = detail::identity_of(estimator),
              .pieces = detail::pieces_of(estimator),
              .epsilon = epsilon_of<estimate_value_t<E>>()};
  const std::int64_t block = drawn.pieces.block;
  const auto draw = draws_of(estimator, plan.seed, drawn.pilot);
  drawn.body = [&way, &draw, block](std::int64_t first, std::int64_t last, Recorder& recorder) {
    way.chunk(first / block, last / block, draw, recorder);
  };
  drawn.begin = [&way](std::int64_t first, std::int64_t last, bool in_order) { way.begin(first, last, in_order); };
  if constexpr (StatesFacts<E>) drawn.facts = estimator.facts();
  if constexpr (StatesReach<E>) drawn.reach = [&](std::int64_t last) { return estimator.reach(last); };
  if constexpr (StatesBias<E>)
    drawn.bias_bound = [&](const LevelTable& levels) { return estimator.bias_bound(levels); };
  if constexpr (KnowsProbabilities<E>) drawn.probability = [&](std::int64_t k) { return estimator.probability(k); };
  if constexpr (ChecksPoints<E>) {
    drawn.missed = [&](std::int64_t level, std::int64_t draws, Batches which) {
      return way.aside([&] { return detail::missed_of(estimator, level, draws, which, plan.seed); });
    };
  }
  return detail::drive(drawn, plan);
}

template <Estimator E, class Way>
Result<estimate_value_t<E>> estimate_by(Way& way, const E& estimator, const Plan& plan) {
  using V = estimate_value_t<E>;
  Statistics statistics = detail::statistics_by(way, estimator, plan);
  if constexpr (RealValue<V> || ComplexValue<V>) {
    return Result<V>(std::move(statistics), V{});
  } else {  // a value of the right shape: the first sample, drawn again
    const bool pilot = false;
    return Result<V>(std::move(statistics),
                     way.again(plan.first / pieces_of(estimator).block, draws_of(estimator, plan.seed, pilot)));
  }
}

/// What a run says, where nobody asks for its mean in the type of the value: nothing is drawn again for that.
template <Estimator E>
Statistics statistics_of(const E& estimator, const Plan& plan) {
  const OneByOne way;
  return detail::statistics_by(way, estimator, plan);
}

}  // namespace detail

/// Runs the estimator over the samples of the plan, or over as many as its goal asks for.
/// Throws std::invalid_argument for an impossible plan, SampleError when the estimator throws (the one with the
/// smallest index, whatever the threads), Interrupted when the plan's progress callable asks to stop, UndrawableError
/// before anything is drawn where one of the samples is likely to need a level that cannot be drawn (core/reach.hpp).
/// Samples that are not finite make the mean NaN and are counted; nothing is skipped.
template <Estimator E>
Result<estimate_value_t<E>> estimate(const E& estimator, const Plan& plan = {}) {
  const detail::OneByOne way;
  return detail::estimate_by(way, estimator, plan);
}

/// A run that goes on from what it has: all of that counts, samples up to plan.samples or as many as the goal asks for are
/// drawn, with the bits of one run of that size. The goal's pilot has streams of its own, so the samples that came
/// first do not decide how many come, and the mean stays unbiased. Seed and first sample are those of the state.
/// Throws std::invalid_argument for another estimator (another type, description or name), or for fewer samples than the
/// state has. An estimator of the same type over other data looks the same: `named` tells them apart.
template <Estimator E>
Result<estimate_value_t<E>> extend(const E& estimator, const RunState& state, Plan plan) {
  state.identity.demand_same(detail::identity_of(estimator), "extend");
  plan = detail::plan_from(state, std::move(plan));
  return debias::estimate(estimator, plan);
}
/// The same for a result.
template <Estimator E>
Result<estimate_value_t<E>> extend(const E& estimator, const Result<estimate_value_t<E>>& result, Plan plan) {
  auto longer = debias::extend(estimator, result.state, std::move(plan));
  detail::add_new(longer.warnings, detail::lasting(result.warnings));
  return longer;
}

/// The union of two results of one estimator and seed over neighbouring ranges of samples, in either order:
/// the bits of a single run where the ranges meet at a multiple of the chunk.
/// Throws std::invalid_argument for another estimator (another type, description or name), PMF or seed, an overlap, a gap, or
/// a cut chunk. Estimators of one type over different data look the same: `named` tells them apart.
template <Value V>
Result<V> merge(const Result<V>& a, const Result<V>& b) {
  if constexpr (RealValue<V> || ComplexValue<V>) {
    return Result<V>(detail::with_rounding(detail::merge(a, b), epsilon_of<V>()), V{});
  } else {
    return Result<V>(detail::with_rounding(detail::merge(a, b), epsilon_of<V>()), a.mean);
  }
}

/// One level that a traced sample touched, in order.
struct TracedLevel {
  bool is_base = false;
  std::int64_t level = 0;
  double difference = 0;  ///< unweighted; the value, for the base
  double work = 0;
  std::int64_t member = 0;  ///< of the block: 0 ... block - 1
};

/// One sample drawn alone; of an estimator in blocks, the block that it is in, with the levels of all its members.
template <Value V>
struct Trace {
  Sample<V> sample;  ///< of a block, the mean of its members
  std::vector<TracedLevel> levels;
  std::int64_t block = 1;   ///< samples that were drawn together
  std::int64_t first = 0;   ///< index of the first of them
  std::int64_t member = 0;  ///< place of the one that was asked for
};

/// Sample `index` of `seed`, the very one that a run contains, with all levels that it touched.
template <Estimator E>
[[gnu::cold]] Trace<estimate_value_t<E>> trace(const E& estimator, std::uint64_t seed, std::int64_t index) {
  struct TraceRecord {
    std::vector<TracedLevel> levels;
    std::int64_t first = 0;  // of the members that record now, one after the other
    std::int64_t size = 1;
    std::int64_t bases = 0;
    std::int64_t differences = 0;
    void members(std::int64_t first_member, std::int64_t n) {
      first = first_member;
      size = n;
      bases = differences = 0;
    }
    void base(std::int64_t level, double value, double work) { add({true, level, value, work}, bases); }
    void difference(std::int64_t level, double d, double work) { add({false, level, d, work}, differences); }
    void add(TracedLevel l, std::int64_t& count) {
      detail::check_work(l.level, l.work);
      l.member = first + std::min(count++, size - 1);
      levels.push_back(l);
    }
  } record;
  const std::int64_t block = detail::pieces_of(estimator).block;
  Stream rng(seed, static_cast<std::uint64_t>(index / block));
  try {
    auto sample = debias::draw_sample(estimator, rng, record);
    detail::check_work(sample.level, sample.work);
    return {std::move(sample), std::move(record.levels), block, index / block * block, index % block};
  } catch (...) {
    detail::rethrow_with_sample(seed, index);
  }
}

// What is no estimator.
template <class E>
requires(!Estimator<E>) auto estimate(const E& /*estimator*/, const Plan& /*plan*/ = {}) {
  return detail::refuse<detail::mistake_in_estimator<E>(), E>();
}
template <class E, class R>
requires(!Estimator<E>) auto extend(const E& /*estimator*/, const R& /*result*/, const Plan& /*plan*/) {
  return detail::refuse<detail::mistake_in_estimator<E>(), E>();
}
template <class E>
requires(!Estimator<E>) auto trace(const E& /*estimator*/, std::uint64_t /*seed*/, std::int64_t /*index*/) {
  return detail::refuse<detail::mistake_in_estimator<E>(), E>();
}

}  // namespace debias

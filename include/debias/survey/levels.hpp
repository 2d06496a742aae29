#pragma once

// The levels of a sequence behind one call a level, whatever its type: what a survey, a recipe and multilevel draw.
//
//   draw       I_k with its coarse partner and D_k
//   shared     a base I_m and D_k from the same draws: Var I_m, Cov(I_m, D_k), work
//   together   2^j members of one level in strata over the first uniform that they draw: what that leaves of Var D_k
//   nets       V_k(2^j), the variance of the mean of D_k, or of I_k, over 2^j points of a scrambled net, for every j at once
//
//   Notation: k = level, m = base_level, I_k and D_k = value and difference of the sequence.
// Level k of sample i draws from the pilot streams (Branch::pilot): no sample of an estimator ever sees them, so what
// is chosen from these draws biases nothing.
// One pass over R nets of 2^M points gives all V_k: halves of a net are nets, of which neighbours a, b are averaged pair by pair,
// and V(2^j) - V(2^(j+1)) = E |a - b|^2 / 4; V(2^M) is the variance between the nets.
// Fails where the erased type is no BiasedSequence; `shared` and `together` are empty for sequences without the hooks.
// Source: Giles, Acta Numerica 24 (2015), section 3; strata over first uniforms as in core/stream_batch.hpp; nets derived.

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/resonance.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/statistics/evidence.hpp>

namespace debias {

/// A base and a difference that share their draws.
struct SharedMoments {
  double base_variance = 0;  ///< of the base
  double covariance = 0;     ///< of base and difference
  double work = 0;           ///< of a draw
};

/// What is left of the variance of a draw where 1, 2, 4, ... members of a level run together, stratified by their first
/// number: shares of the first entry. Empty where nobody has looked.
struct StrataMoments {
  static constexpr std::int64_t most_members = 1024;
  std::vector<double> base_left;        ///< of I_m, or of the base that is shared
  std::vector<double> difference_left;  ///< of D_k
  double work = 0;                      ///< of all draws
};

/// What nets of 2^M points tell of one level.
struct NetMoments {
  static constexpr int most_octaves = 20;
  std::vector<double> variance;  ///< of a mean over 1, 2, 4, ... 2^M points; falls. Summed over the components
  std::vector<double> mean;      ///< by component
  double second_moment = 0;      ///< of one point: the squared norm
  double hits = 0;               ///< points that make it: their number over the kurtosis
  double points = 0;             ///< of all nets
  double work = 0;               ///< of all points
  double seconds = 0;

  /// Of one point; at least that where all are zero.
  [[nodiscard]] double kurtosis() const { return hits > 0 ? points / hits : points; }
};

/// The erased levels of a sequence.
struct LevelRuns {
  /// Draws plan.samples times (I_k, D_k).
  std::function<Statistics(std::int64_t level, const Plan& plan)> draw;
  /// The last level that can be drawn.
  std::int64_t deepest_level = deepest_of_all;
  /// Beside the numbers of its point a member draws many plain ones (`S::plain_inside`): a mean over ever more points falls
  /// like one over plain members in the end, however it begins.
  bool plain_inside = false;
  /// Mean work of I_k alone and of D_k alone over a few draws.
  std::function<std::pair<double, double>(std::int64_t level, const Plan& plan)> work;
  /// Empty where the sequence has no shared base.
  std::function<SharedMoments(std::int64_t level, std::int64_t base_level, const Plan& plan)> shared;
  /// Draws plan.samples times that many members (a power of two, at most StrataMoments::most_members) of a level, and of
  /// its base. Empty where the members of a stratified block do not run together.
  std::function<StrataMoments(std::int64_t level, std::int64_t base_level, std::int64_t members, const Plan& plan)>
      together;
  /// Draws plan.samples nets of 2^octaves points of a level: of I_k, as the base, or of D_k.
  std::function<NetMoments(std::int64_t level, bool as_base, int octaves, const Plan& plan)> nets;
  SequenceFacts facts{};  ///< what the sequence states of itself
  /// B(level), from so many means in a batch (core/resonance.hpp). Empty where points cannot be in step with the integrand.
  std::function<detail::MissedBatches(std::int64_t level, std::int64_t draws, detail::Batches which,
                                      std::uint64_t seed)>
      missed;
};

namespace detail {

/// Some values and numbers as one value, so that one run gives the moments of each.
template <Value V, std::size_t n>
struct ValueTuple {
  std::array<V, n> parts;
  double flag = 0;

  friend ValueTuple operator+(ValueTuple a, const ValueTuple& b) {
    for (std::size_t i = 0; i < n; ++i) a.parts[i] = debias::sum(std::move(a.parts[i]), b.parts[i]);
    a.flag += b.flag;
    return a;
  }
  friend ValueTuple operator-(ValueTuple a, const ValueTuple& b) {
    for (std::size_t i = 0; i < n; ++i) a.parts[i] = debias::difference(std::move(a.parts[i]), b.parts[i]);
    a.flag -= b.flag;
    return a;
  }
  /// The last of them: a survey keeps the tails of D_k.
  [[nodiscard]] double scalar() const { return debias::as_scalar(parts[n - 1]); }
  friend std::size_t component_count(const ValueTuple& s) { return n * component_count(s.parts[0]) + 1; }
  friend double component(const ValueTuple& s, std::size_t i) {
    const std::size_t each = component_count(s.parts[0]);
    return i / each < n ? component(s.parts[i / each], i % each) : s.flag;
  }
  friend void set_component(ValueTuple& s, std::size_t i, double x) {
    const std::size_t each = component_count(s.parts[0]);
    if (i / each < n) {
      set_component(s.parts[i / each], i % each, x);
    } else {
      s.flag = x;
    }
  }
};

/// I_k, its coarse partner, D_k, and whether D_k is not zero.
template <BiasedSequence S>
struct LevelDraw {
  using V = sequence_value_t<S>;
  const S& sequence;
  std::int64_t level;

  template <Record R>
  Sample<ValueTuple<V, 3>> operator()(Stream& rng, R& record) const {
    Stream own = split_level(split(rng, Branch::pilot), level);
    auto draw = sequence(level, own);
    if (level == 0) check_level_zero(draw.value, draw.difference);
    const double size = debias::as_scalar(draw.difference);
    record.difference(level, size, draw.work);
    V coarse = debias::difference(draw.value, draw.difference);
    return {{{std::move(draw.value), std::move(coarse), std::move(draw.difference)}, size != 0 ? 1.0 : 0.0},
            draw.work,
            level};
  }
};

/// The shared base, D_k, and their sum.
template <BiasedSequence S>
struct SharedLevelDraw {
  using V = sequence_value_t<S>;
  const S& sequence;
  std::int64_t level;
  std::int64_t base_level;

  Sample<ValueTuple<V, 3>> operator()(Stream& rng) const {
    Stream own = split_level(split(rng, Branch::pilot), level);
    auto both = sequence.shared(level, base_level, own);
    V total = debias::sum(both.base, both.difference);
    return {{{std::move(both.base), std::move(both.difference), std::move(total)}, 0}, both.work, level};
  }
};

/// One of the three of a LevelDraw or a SharedLevelDraw.
struct Part {
  std::vector<double> means;  // by component
  double square_of_mean = 0;
  double variance = 0;
};
Part part_of(const Statistics& statistics, std::size_t i);

constexpr std::size_t strata_octaves = std::bit_width(static_cast<std::uint64_t>(StrataMoments::most_members)) - 1;

/// Variances within 1, 2, 4, ... strata, of values in the order of these; a power of two of them, which are lost.
void variances_within_strata(std::span<double> values, std::span<double> variances);
StrataMoments strata_moments(const Statistics& statistics, std::int64_t members);

/// Members of a level that run together: the variances of base and difference within strata.
template <BatchesLevels S>
struct TogetherDraw {
  const S& sequence;
  std::int64_t level;
  std::int64_t base_level;
  std::int64_t members;

  Sample<ValueTuple<double, 2 * strata_octaves>> operator()(Stream& rng) const {
    const Stream own = split(rng, Branch::pilot);
    std::vector<double> bases;
    std::vector<double> differences;
    double work = 0;
    for (std::int64_t j = 0; j < members;) {
      const auto n = static_cast<std::size_t>(std::min<std::int64_t>(members - j, StreamBatch::capacity));
      const auto streams_of = [&](std::int64_t k) {
        return StreamBatch(own, static_cast<std::uint64_t>(j), n, static_cast<std::uint64_t>(k), j, members);
      };
      StreamBatch streams = streams_of(level);
      if constexpr (BatchesShared<S>) {
        std::array<SharedDraw<double>, StreamBatch::capacity> both;
        sequence.shared(level, base_level, streams, std::span(both).first(n));
        for (const SharedDraw<double>& draw : std::span(both).first(n)) {
          bases.push_back(draw.base);
          differences.push_back(draw.difference);
          check_work(level, draw.work);
          work += draw.work;
        }
      } else {
        std::array<Term<double>, StreamBatch::capacity> terms;
        const std::span<Term<double>> some = std::span(terms).first(n);
        StreamBatch base_streams = streams_of(base_level);
        sequence.values(base_level, base_streams, some);
        for (const Term<double>& term : some) {
          bases.push_back(term.value);
          check_work(base_level, term.work);
          work += term.work;
        }
        if (level > 0) sequence.differences(level, streams, some);
        for (const Term<double>& term : some) {
          differences.push_back(term.value);
          if (level == 0) continue;
          check_work(level, term.work);
          work += term.work;
        }
      }
      j += static_cast<std::int64_t>(n);
    }
    ValueTuple<double, 2 * strata_octaves> variances{};
    variances_within_strata(bases, std::span(variances.parts).first(strata_octaves));
    variances_within_strata(differences, std::span(variances.parts).last(strata_octaves));
    return {variances, work, level};
  }
};

/// Means over 1, 2, 4, ... values in a row: those of the last value, and how neighbours differ.
template <Value V>
class Halving {
 public:
  void add(V v) {
    std::size_t j = 0;
    for (; (count_ >> j & 1) != 0; ++j) {
      const V step = debias::difference(v, means_[j]);
      double square = 0;
      for (std::size_t c = 0; c < component_count(step); ++c) square += component(step, c) * component(step, c);
      squares_[j] += square / 4;
      v = debias::scaled(debias::sum(std::move(v), means_[j]), 0.5);
    }
    if (j == means_.size()) {
      means_.push_back(std::move(v));
    } else {
      means_[j] = std::move(v);
    }
    ++count_;
  }
  /// Of all values, a power of two of them.
  [[nodiscard]] const V& mean() const { return means_.back(); }
  /// E |a - b|^2 / 4 of the means a, b of 2^j neighbours each.
  [[nodiscard]] double step(std::size_t j) const {
    const auto pairs = static_cast<double>(count_ >> (j + 1));
    return pairs > 0 ? squares_[j] / pairs : 0;
  }

 private:
  std::uint64_t count_ = 0;
  std::vector<V> means_;
  std::array<double, NetMoments::most_octaves> squares_{};
};

/// One net: its steps, and its mean.
template <Value V>
struct NetSums {
  static constexpr auto octaves = static_cast<std::size_t>(NetMoments::most_octaves);
  std::array<double, octaves> steps;
  V mean;

  friend NetSums operator+(NetSums a, const NetSums& b) {
    for (std::size_t j = 0; j < octaves; ++j) a.steps[j] += b.steps[j];
    a.mean = debias::sum(std::move(a.mean), b.mean);
    return a;
  }
  friend NetSums operator-(NetSums a, const NetSums& b) {
    for (std::size_t j = 0; j < octaves; ++j) a.steps[j] -= b.steps[j];
    a.mean = debias::difference(std::move(a.mean), b.mean);
    return a;
  }
  [[nodiscard]] double scalar() const { return debias::as_scalar(mean); }
  friend std::size_t component_count(const NetSums& s) { return octaves + component_count(s.mean); }
  friend double component(const NetSums& s, std::size_t i) {
    return i < octaves ? s.steps[i] : component(s.mean, i - octaves);
  }
  friend void set_component(NetSums& s, std::size_t i, double x) {
    if (i < octaves) {
      s.steps[i] = x;
    } else {
      set_component(s.mean, i - octaves, x);
    }
  }
};

/// The points of a net of one level, in order: values of the base, or differences.
template <BiasedSequence S>
struct NetDraw {
  using V = sequence_value_t<S>;
  const S& sequence;
  std::int64_t level;
  bool as_base;
  int octaves;

  /// A net is a long sample: each is a piece of its own.
  [[nodiscard]] std::int64_t chunk() const { return 1; }

  template <Record R>
  Sample<NetSums<V>> operator()(Stream& rng, R& record) const {
    const Stream net = split_level(split(rng, Branch::pilot), level);
    const auto size = std::uint64_t{1} << octaves;
    Halving<V> halving;
    double work = 0;
    const auto take = [&](Term<V> term) {
      check_work(level, term.work);
      work += term.work;
      record.difference(level, debias::as_scalar(term.value), term.work);
      halving.add(std::move(term.value));
    };
    if constexpr (BatchesLevels<S> && BatchesValues<S> && BatchesDifferences<S>) {
      std::array<Term<double>, StreamBatch::capacity> terms;
      for (std::uint64_t r = 0; r < size;) {
        const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(size - r, StreamBatch::capacity));
        StreamBatch streams = StreamBatch::points(net, r, n);
        const std::span<Term<double>> some = std::span(terms).first(n);
        as_base ? sequence.values(level, streams, some) : sequence.differences(level, streams, some);
        for (const Term<double>& term : some) take(term);
        r += n;
      }
    } else {
      for (std::uint64_t r = 0; r < size; ++r) {
        Stream point = net.point(r);
        take(as_base ? debias::value_of(sequence, level, point) : debias::difference_of(sequence, level, point));
      }
    }
    Sample<NetSums<V>> sample{{{}, halving.mean()}, work, level};
    for (std::size_t j = 0; j < static_cast<std::size_t>(octaves); ++j) sample.value.steps[j] = halving.step(j);
    return sample;
  }
};

NetMoments net_moments(const Statistics& statistics, int octaves);

constexpr std::int64_t draws_for_work = 16;

template <BiasedSequence S>
std::pair<double, double> mean_work(const S& sequence, std::int64_t level, const Plan& plan) {
  double value = 0;
  double difference = 0;
  for (std::int64_t i = 0; i < draws_for_work; ++i) {
    const Stream sample = split(Stream(plan.seed, static_cast<std::uint64_t>(i)), Branch::pilot);
    Stream one = split_level(sample, level);
    Stream two = split_level(sample, level);
    const double of_value = debias::value_of(sequence, level, one).work;
    const double of_difference = debias::difference_of(sequence, level, two).work;
    check_work(level, of_value);
    check_work(level, of_difference);
    value += of_value;
    difference += of_difference;
  }
  constexpr double n = draws_for_work;
  return {value / n, difference / n};
}

SharedMoments shared_moments(const Statistics& statistics);

/// Levels of doubles behind one indirect call a draw: what draws them for a pilot is compiled once, not for each sequence.
struct PlainLevels {
  std::function<Draw<double>(std::int64_t level, Stream& rng)> draw;
  std::function<Term<double>(std::int64_t level, Stream& rng)> value;
  std::function<Term<double>(std::int64_t level, Stream& rng)> difference;

  Draw<double> operator()(std::int64_t level, Stream& rng) const { return draw(level, rng); }
  [[nodiscard]] Term<double> value_at(std::int64_t level, Stream& rng) const { return value(level, rng); }
  [[nodiscard]] Term<double> difference_at(std::int64_t level, Stream& rng) const { return difference(level, rng); }
};

/// Whether a pilot draws one member at a time, and nothing but values and differences.
template <class S>
inline constexpr bool draws_plainly =
    std::is_same_v<sequence_value_t<S>, double> && !BatchesLevels<S> && !BatchesValues<S> && !BatchesDifferences<S>;

template <class S>
void draw_levels(LevelRuns& runs, const S& sequence) {
  runs.draw = [sequence](std::int64_t level, const Plan& plan) -> Statistics {
    return statistics_of(LevelDraw<S>{sequence, level}, plan);
  };
  runs.work = [sequence](std::int64_t level, const Plan& plan) { return mean_work(sequence, level, plan); };
  runs.nets = [sequence](std::int64_t level, bool as_base, int octaves, const Plan& plan) {
    return net_moments(statistics_of(NetDraw<S>{sequence, level, as_base, octaves}, plan), octaves);
  };
}
extern template void draw_levels(LevelRuns& runs, const PlainLevels& sequence);

}  // namespace detail

/// The erased levels of a sequence, which is copied.
template <BiasedSequence S>
LevelRuns level_runs(const S& sequence) {
  LevelRuns runs;
  runs.deepest_level = deepest_level_of(sequence);
  if constexpr (detail::draws_plainly<S>) {
    const auto shared = std::make_shared<const S>(sequence);
    detail::draw_levels(
        runs, detail::PlainLevels{
                  [shared](std::int64_t level, Stream& rng) { return (*shared)(level, rng); },
                  [shared](std::int64_t level, Stream& rng) { return debias::value_of(*shared, level, rng); },
                  [shared](std::int64_t level, Stream& rng) { return debias::difference_of(*shared, level, rng); }});
  } else {
    detail::draw_levels(runs, sequence);
  }
  runs.facts = facts_of(sequence);
  if constexpr (requires { S::plain_inside; }) runs.plain_inside = S::plain_inside;
  if constexpr (ChecksPoints<S>) {
    runs.missed = [sequence](std::int64_t level, std::int64_t draws, detail::Batches which, std::uint64_t seed) {
      return detail::missed_of(sequence, level, draws, which, seed);
    };
  }
  if constexpr (OffersSharedBase<S>) {
    runs.shared = [sequence](std::int64_t level, std::int64_t base_level, const Plan& plan) {
      return detail::shared_moments(
          detail::statistics_of(detail::SharedLevelDraw<S>{sequence, level, base_level}, plan));
    };
  }
  if constexpr (BatchesLevels<S>) {
    runs.together = [sequence](std::int64_t level, std::int64_t base_level, std::int64_t members, const Plan& plan) {
      return detail::strata_moments(
          detail::statistics_of(detail::TogetherDraw<S>{sequence, level, base_level, members}, plan), members);
    };
  }
  return runs;
}

template <class S>
requires(!BiasedSequence<S>) auto level_runs(const S& /*sequence*/) {
  return detail::refuse<detail::mistake_in_levels<S>(), S>();
}

}  // namespace debias

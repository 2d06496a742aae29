#pragma once

// Strata: blocks of n members whose levels are spread over the PMF, instead of n independent draws of the level.
//
//   Z = (1/n) sum_j z(level_j, stream_j),   E #{j : level_j = k} = n p_k for every k        [Vihola 2018]
//   systematic   level_j = F^-1((j + U) / n), one U for the block
//   uniform      level_j = F^-1((j + U_j) / n)
//   residual     floor(n p_k) copies of level k, the rest drawn from n p_k - floor(n p_k)
//
//   Notation: n = block, F^-1 = pmf.sample, z(k, stream) = estimator.draw(k, stream).
// The variance of choosing the level, sum d_k^2 / p_k - I^2, all but disappears: n Var Z -> sum Var D_k / p_k, the
// efficiency of multilevel Monte Carlo, without its bias. Members are the samples of a run, in whole blocks; blocks are
// independent, so that the standard error, which is of their means, is honest. It takes some hundred of them.
// The members of one level run together where the sequence has batch hooks, and are then stratified once more: over
// the first uniform that they draw, the offset of a comb (core/stream_batch.hpp).
// With Points::nets the N_k members of a level are points 0 ... N_k - 1 of a net of its own in each block (core/points.hpp):
// N_k does not depend on the points, so E Z = I as before, and the variance of a level may fall like N_k^-2 or faster. The gain
// needs N_k that are whole powers of two, the same in all blocks: pmf/dyadic.hpp with residual strata, Base::one_outcome. Members that
// residual strata draw are plain. A sequence gains as far as it draws what matters first, and a fixed count of numbers.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <debias/core/bias.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/points.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/resonance.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/text.hpp>
#include <debias/core/value.hpp>
#include <debias/estimators/common.hpp>

namespace debias {

/// How the levels of a block are drawn. Systematic needs one random number a block and is the quietest as a rule.
enum class Strata { systematic, uniform, residual };

inline const char* name_of(Strata strata) {
  constexpr std::array names = {"systematic", "uniform", "residual"};
  return names[static_cast<std::size_t>(strata)];
}

/// The numbers of the members of a level: plain ones of each, or the points of a net.
enum class Points { plain, nets };

inline const char* name_of(Points points) { return points == Points::plain ? "plain" : "nets"; }

/// An estimator whose level can be drawn from outside: single_term, and roulette and independent_sum with a PMF.
template <class E>
concept StratifiableEstimator = Estimator<E> &&
    requires(const E& e, double u, std::int64_t level, const Stream& rng, NullRecord& record) {
  { e.level_at(u) } -> std::same_as<std::int64_t>;
  { e.probability(level) } -> std::same_as<double>;
  e.draw(level, rng, record);
  { e.pmf().mass(level) } -> std::same_as<double>;
  { e.pmf().tail(level) } -> std::same_as<double>;
};

namespace detail {
template <class E, class R>
concept DrawsMembers = requires(const E& e, std::int64_t level, const Members& members,
                                std::span<Sample<estimate_value_t<E>>> out, R& record) {
  e.draw(level, members, out, record);
};
template <class E, class R>
concept DrawsFromOneStream = requires(const E& e, std::int64_t level, Stream& numbers, R& record) {
  { e.draws_from_one_stream() } -> std::same_as<bool>;
  e.draw_from(level, numbers, record);
};
/// A PMF that is made for blocks of one size: so many copies of each outcome; a size of 0 is that of another PMF.
template <class P>
concept CountsCopies = Pmf<P> && requires(const P& p, std::int64_t j) {
  { p.block() } -> std::same_as<std::int64_t>;
  { p.copies(j) } -> std::same_as<std::int64_t>;
};
}  // namespace detail

/// An estimator in blocks; Sample::value is the mean of a block, Sample::work its total.
template <StratifiableEstimator E>
class Stratified {
 public:
  using value_type = estimate_value_t<E>;

  /// Throws std::invalid_argument for an empty block, residual strata of a PMF with a very slow tail, nets of an estimator whose
  /// samples take several streams, or a block that is not that of a Dyadic PMF.
  Stratified(E estimator, std::int64_t block, Strata strata, Points points)
      : estimator_(std::move(estimator)), block_(block), strata_(strata) {
    if (block < 1) {
      throw std::invalid_argument("stratified: block = " + std::to_string(block) +
                                  " (must be at least 1); 64 is a good start");
    }
    if (strata == Strata::residual) count_copies();
    if (points == Points::nets) take_nets();
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    return block_of(rng, record);
  }

  /// What the difference of a level is divided by, in the sample of a member.
  [[nodiscard]] double probability(std::int64_t level) const { return estimator_.probability(level); }
  [[nodiscard]] const E& estimator() const { return estimator_; }
  [[nodiscard]] std::int64_t block() const { return block_; }
  [[nodiscard]] const std::string& name() const requires HasName<E> { return estimator_.name(); }
  [[nodiscard]] SequenceFacts facts() const requires StatesFacts<E> { return estimator_.facts(); }
  /// Samples of a chunk: about 1024, in whole blocks.
  [[nodiscard]] std::int64_t chunk() const { return detail::chunk_of_blocks(block_); }
  /// Strata change nothing of how likely a member reaches a level.
  [[nodiscard]] Reach reach(std::int64_t last) const requires StatesReach<E> {
    Reach reach = estimator_.reach(last);
    reach.block = block_;
    return reach;
  }
  /// Strata leave the mean of a member where it is.
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const requires StatesBias<E> {
    return estimator_.bias_bound(levels);
  }
  [[nodiscard]] auto missed(std::int64_t level, std::int64_t draws, Stream& rng) const requires ChecksPoints<E> {
    return estimator_.missed(level, draws, rng);
  }

  [[nodiscard]] std::string describe() const {
    return "stratified in blocks of " + std::to_string(block_) + " (" + name_of(strata_) + (nets_ > 0 ? ", nets" : "") +
           "), " + debias::description(estimator_);
  }

 private:
  struct Copies {
    std::int64_t level;
    std::int64_t count;    // floor(n p)
    double residual_tail;  // n p - floor(n p), summed from the deepest level up to this one
  };

  // To a record that asks whose levels come next.
  template <Record R>
  static void tell_members([[maybe_unused]] R& record, [[maybe_unused]] std::int64_t first,
                           [[maybe_unused]] std::int64_t n) {
    if constexpr (requires { record.members(first, n); }) record.members(first, n);
  }
  static Stream member(const Stream& rng, std::int64_t j) { return rng.split(static_cast<std::uint64_t>(j)); }

  [[nodiscard]] double at(std::int64_t j, double shift) const {
    return (static_cast<double>(j) + shift) / static_cast<double>(block_);
  }

  /// Whether the next member begins a run of its own: members that are drawn are no points of the net before them.
  [[nodiscard]] bool ends_nets(std::int64_t next) const { return next == nets_; }

  /// The levels of the members of one block, each asked for once, in order. One type for all strata: the loops over a block
  /// are compiled once.
  class LevelsOfBlock {
   public:
    LevelsOfBlock(const Stratified& strata, const Stream& rng) : all_(strata), rng_(rng) {
      if (all_.strata_ == Strata::systematic) shift_ = split(rng, Branch::pmf).uniform();
    }
    std::int64_t operator()(std::int64_t j) {
      if (all_.strata_ == Strata::systematic) return all_.estimator_.level_at(all_.at(j, shift_));
      return one_by_one(j);
    }

   private:
    [[gnu::noinline]] std::int64_t one_by_one(std::int64_t j) {
      if (all_.strata_ == Strata::residual) {
        for (; row_ < all_.copies_.size(); ++row_, used_ = 0) {
          if (used_++ < all_.copies_[row_].count) return all_.copies_[row_].level;
        }
      }
      const double u = split(member(rng_, j), Branch::pmf).uniform();
      return all_.strata_ == Strata::residual ? all_.residual_level(u) : all_.estimator_.level_at(all_.at(j, u));
    }

    const Stratified& all_;
    const Stream& rng_;
    double shift_ = 0;     // systematic
    std::size_t row_ = 0;  // residual: the copies that come next
    std::int64_t used_ = 0;
  };

  template <Record R>
  Sample<value_type> block_of(const Stream& rng, R& record) const {
    LevelsOfBlock level_of(*this, rng);
    std::int64_t level = level_of(0);
    if constexpr (detail::DrawsMembers<E, R>) {
      Sample<value_type> sample{0, 0, level};
      for (std::int64_t begin = 0; begin < block_;) {  // a run of members of one level
        std::int64_t end = begin + 1;
        std::int64_t next = level;
        while (end < block_ && (next = level_of(end)) == level && !ends_nets(end)) ++end;
        run(level, begin, end, rng, sample, record);
        level = next;
        begin = end;
      }
      sample.value /= static_cast<double>(block_);
      return sample;
    } else {
      std::int64_t begin = 0;  // of the run of members of this level
      tell_members(record, 0, 1);
      auto sample = member_sample(level, 0, begin, rng, record);
      for (std::int64_t j = 1; j < block_; ++j) {
        const std::int64_t last = std::exchange(level, level_of(j));
        if (level != last) begin = j;
        tell_members(record, j, 1);
        auto next = member_sample(level, j, begin, rng, record);
        sample.value = debias::sum(std::move(sample.value), next.value);
        sample.work += next.work;
        sample.level = sample.level > next.level ? sample.level : next.level;
      }
      sample.value = debias::scaled(std::move(sample.value), 1 / static_cast<double>(block_));
      return sample;
    }
  }

  template <Record R>
  auto member_sample(std::int64_t level, std::int64_t j, [[maybe_unused]] std::int64_t begin, const Stream& rng,
                     R& record) const {
    if constexpr (detail::DrawsFromOneStream<E, R>) {
      if (j < nets_) {
        Stream point = split_level(rng, level).point(static_cast<std::uint64_t>(j - begin));
        return estimator_.draw_from(level, point, record);
      }
    }
    return estimator_.draw(level, member(rng, j), record);
  }

  template <Record R>
  void run(std::int64_t level, std::int64_t begin, std::int64_t end, const Stream& rng, Sample<value_type>& sample,
           R& record) const {
    std::array<Sample<value_type>, StreamBatch::capacity> samples;
    for (std::int64_t j = begin; j < end;) {
      const auto n = static_cast<std::size_t>(std::min<std::int64_t>(end - j, StreamBatch::capacity));
      const std::span<Sample<value_type>> some = std::span(samples).first(n);
      tell_members(record, j, static_cast<std::int64_t>(n));
      estimator_.draw(level, detail::Members{rng, j, n, j - begin, end - begin, j < nets_}, some, record);
      for (const Sample<value_type>& s : some) {
        sample.value += s.value;
        sample.work += s.work;
      }
      j += static_cast<std::int64_t>(n);
    }
    sample.level = std::max(sample.level, level);
  }

  void take_nets() {
    bool one_stream = false;
    if constexpr (detail::DrawsFromOneStream<E, NullRecord>) one_stream = estimator_.draws_from_one_stream();
    if (!one_stream) {
      throw std::invalid_argument("stratified: nets with " + debias::description(estimator_) +
                                  " (its samples take the numbers of several streams, and a point is one); take "
                                  "single_term with Base::one_outcome");
    }
    nets_ = block_;
    std::int64_t largest = block_;
    if (strata_ == Strata::residual) {
      nets_ = largest = 0;
      for (const Copies& row : copies_) {
        nets_ += row.count;
        largest = std::max(largest, row.count);
      }
    }
    if (largest > static_cast<std::int64_t>(net_points)) {
      throw std::invalid_argument("stratified: nets of " + std::to_string(largest) + " members of a level (a net has " +
                                  std::to_string(net_points) + " points); take smaller blocks, and more of them");
    }
  }

  // The levels that may have copies, deepest last: n p_k <= n tail(k) falls below 1 for good.
  void count_copies() {
    const auto n = static_cast<double>(block_);
    const std::int64_t first = estimator_.level_at(1);
    if constexpr (detail::CountsCopies<std::remove_cvref_t<decltype(estimator_.pmf())>>) {
      const std::int64_t size = estimator_.pmf().block();
      if (size != 0 && size != block_) {
        throw std::invalid_argument("stratified: block = " + std::to_string(block_) + " (" +
                                    debias::description(estimator_) + " is made for blocks of " + std::to_string(size) +
                                    " members); take pmf.block()");
      }
    }
    std::int64_t levels = 1;
    while (n * estimator_.pmf().tail(levels) >= 1) {
      if (++levels > most_copied_levels) refuse_slow_tail();
    }
    rest_tail_ = n * estimator_.pmf().tail(levels);
    copies_.resize(static_cast<std::size_t>(levels));
    double residual = rest_tail_;
    for (std::int64_t j = levels; j-- > 0;) {
      const double expected = n * estimator_.pmf().mass(j);
      if (!(expected >= 0 && expected <= 2 * n)) refuse_mass(j, expected / n);
      double whole = std::floor(expected);
      double rest = expected - whole;
      if (const std::int64_t stated = stated_copies(j); stated > 0) {  // n p_j may be rounded to less
        whole = static_cast<double>(stated);
        rest = 0;
      }
      residual += rest;
      copies_[static_cast<std::size_t>(j)] = {first + j, static_cast<std::int64_t>(whole), residual};
    }
  }

  /// What the PMF says itself; 0 where it says nothing.
  [[nodiscard]] std::int64_t stated_copies([[maybe_unused]] std::int64_t j) const {
    if constexpr (detail::CountsCopies<std::remove_cvref_t<decltype(estimator_.pmf())>>) {
      return estimator_.pmf().copies(j);
    } else {
      return 0;
    }
  }

  [[noreturn]] void refuse_slow_tail() const {
    throw std::invalid_argument("stratified: residual strata with " + debias::description(estimator_) +
                                " (its tail is not below 1 / " + std::to_string(block_) + " within " +
                                std::to_string(most_copied_levels) +
                                " levels: too slow, or no PMF); take Strata::systematic");
  }

  [[noreturn]] static void refuse_mass(std::int64_t j, double mass) {
    throw std::invalid_argument("stratified: the PMF has the mass " + detail::format("%g", mass) + " at " +
                                std::to_string(j) + " (must lie in [0, 1])");
  }

  [[nodiscard]] std::int64_t residual_level(double u) const {
    const double left = u * copies_.front().residual_tail;
    if (left <= rest_tail_) return estimator_.level_at(left / static_cast<double>(block_));
    std::size_t row = 0;
    while (row + 1 < copies_.size() && left <= copies_[row + 1].residual_tail) ++row;
    return copies_[row].level;
  }

  static constexpr std::int64_t most_copied_levels = std::int64_t{1} << 16;

  E estimator_;
  std::int64_t block_;
  Strata strata_;
  std::vector<Copies> copies_;  // residual only
  double rest_tail_ = 0;        // n P(a level beyond copies_)
  std::int64_t nets_ = 0;       // members of a block that are points of nets, which are the first ones
};

/// Blocks of `block` members: `estimate(stratified(single_term(s, pmf), 64), {.samples = 10'000})` draws 157 of them, 10,048
/// samples.
/// With nets: `stratified(single_term(s, pmf, {.base = Base::one_outcome}), pmf.block(), Strata::residual, Points::nets)`, where
/// `const Dyadic pmf({10, 8, 6, 4}, 1.25)`; 32 blocks or more make an error that can be trusted.
template <StratifiableEstimator E>
Stratified<E> stratified(E estimator, std::int64_t block, Strata strata = Strata::systematic,
                         Points points = Points::plain) {
  return {std::move(estimator), block, strata, points};
}

namespace detail {
template <class E>
constexpr Mistake mistake_in_strata() {
  if constexpr (Estimator<E>) {
    return Mistake::not_stratifiable;
  } else {
    return mistake_in_estimator<E>();
  }
}
}  // namespace detail

template <class E>
requires(!StratifiableEstimator<E>) auto stratified(const E& /*estimator*/, std::int64_t /*block*/,
                                                    Strata /*strata*/ = Strata::systematic,
                                                    Points /*points*/ = Points::plain) {
  return detail::refuse<detail::mistake_in_strata<E>(), E>();
}

}  // namespace debias

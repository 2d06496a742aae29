#pragma once

// Where the doubling of function_of_mean.hpp takes its numbers from: what all kinds of points have in common.
//
//   the 2^k points of level k come in 2^(k-m) groups of 2^m; a draw sums them group by group
//
// Each group alone, all even groups together and all odd ones together are distributed like the points of their own
// level: means of groups are unbiased for it. Numbers are made one by one, or in blocks by batch hooks, from the very
// same random numbers. Independent draws: function_of_mean/independent.hpp; combs and jittered points: intervals.hpp.

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>

namespace debias {

namespace detail {
[[noreturn]] inline void refuse_level(std::int64_t level) {
  if (level < 0) {
    throw std::invalid_argument("doubling: level = " + std::to_string(level) + " (must be at least 0)");
  }
  throw std::length_error("doubling: level " + std::to_string(level) +
                          " needs 2^level draws (beyond int64); choose a PMF with a lighter tail");
}
}  // namespace detail

/// 2^level. Throws std::invalid_argument below level 0 and std::length_error where the number of draws leaves
/// the 64-bit integers (a PMF that gets there has a tail of infinite work).
inline std::int64_t doubled_draws(std::int64_t level) {
  if (level < 0 || level > 62) [[unlikely]]
    detail::refuse_level(level);
  return std::int64_t{1} << level;
}

namespace detail {
/// 2^-level for a level that doubled_draws() takes, without a division.
inline double share_of_draw(std::int64_t level) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(1023 - level) << 52);
}
}  // namespace detail

/// A random variable with a batch hook: `x.draws(rng, out)` makes out.size() draws from the very random
/// numbers of as many calls x(rng), equal to rounding.
template <class X>
concept BatchedVariable = RandomVariable<X> && requires(const X& x, Stream& rng, std::span<double> out) {
  x.draws(rng, out);
};

/// A random variable that draws for many members at once: `x.draws(batch, out)` writes as many draws of each member as
/// fit, out[t * members + b].
template <class X>
concept BatchedOverMembers = RandomVariable<X> && requires(const X& x, StreamBatch& batch, std::span<double> out) {
  x.draws(batch, out);
};

namespace detail {

/// `points(level, group_level, rng)` begins one draw of a level and returns a callable that yields the sums
/// of its groups of 2^group_level points, one after the other. Besides: `scale`, by which means are
/// multiplied, and `extra_work`, what a draw costs beside its points.
template <class P>
concept Points = requires(const P& p, std::int64_t level, Stream& rng) {
  requires Value<std::remove_cvref_t<decltype(p.points(level, level, rng)())>>;
  { p.scale } -> std::convertible_to<double>;
  { p.extra_work } -> std::convertible_to<double>;
};

/// Points that share one random offset: they can be in step with what they look at (core/resonance.hpp).
template <class P>
concept InStep = requires {
  requires P::in_step;
};

/// Sums of groups of `size` numbers, in double precision at least; `group()` begins the next group and returns a
/// callable of its numbers. Inlined by force: large programs have many callers, and a call costs as much as a draw.
template <class Group>
struct GroupSums {
  std::int64_t size;
  Group group;

  [[gnu::always_inline]] auto operator()() {
    auto next = group();
    using M = mean_t<std::remove_cvref_t<decltype(next())>>;
    M total(next());
    for (std::int64_t i = 1; i < size; ++i) total = debias::sum(std::move(total), M(next()));
    return total;
  }
};
template <class Group>
GroupSums(std::int64_t, Group) -> GroupSums<Group>;

inline constexpr std::size_t block_size = 256;

/// Points of many members at once: `points.batch(level, group_level, batch)` returns a callable that writes the sums
/// of the next few groups, sums[r * members + b], and returns how many groups these are: a power of two.
template <class P>
concept BatchedPoints = Points<P> &&
    requires(const P& p, std::int64_t level, StreamBatch& batch, std::span<double, block_size> sums) {
  { p.batch(level, level, batch)(sums) } -> std::same_as<std::int64_t>;
};

/// How many groups of `size` numbers of each member fit a block: a power of two, at most `groups`, at least one.
inline std::int64_t groups_in_block(std::int64_t size, std::int64_t groups, std::size_t members) {
  const std::size_t fit = block_size / std::bit_ceil(members);
  const std::int64_t some = size < static_cast<std::int64_t>(fit) ? static_cast<std::int64_t>(fit) / size : 1;
  return std::min(some, groups);
}

/// Sums of every second number, in eight lanes.
struct EvenOdd {
  std::array<double, 8> lanes{};
  void add(std::span<const double> x) {  // an even number of them
    std::array<double, 8> sums = lanes;  // in registers
    std::size_t i = 0;
    for (; i + 8 <= x.size(); i += 8) {
      for (std::size_t j = 0; j < 8; ++j) sums[j] += x[i + j];
    }
    for (; i < x.size(); ++i) sums[i % 8] += x[i];
    lanes = sums;
  }
  [[nodiscard]] double even() const { return (lanes[0] + lanes[2]) + (lanes[4] + lanes[6]); }
  [[nodiscard]] double odd() const { return (lanes[1] + lanes[3]) + (lanes[5] + lanes[7]); }
};

/// Numbers made in blocks: `fill(out)` makes the next out.size() of `count`. Each call sums the next `size`
/// of them.
template <class Fill>
class Blocks {
 public:
  Blocks(Fill fill, std::int64_t count, std::int64_t size) : fill_(std::move(fill)), left_(count), size_(size) {}

  double operator()() {
    if (size_ == 1) return take(1).front();
    EvenOdd sums;
    for (std::int64_t missing = size_; missing > 0;) {
      const std::span<const double> some = take(missing);
      sums.add(some);
      missing -= static_cast<std::int64_t>(some.size());
    }
    return sums.even() + sums.odd();
  }

  /// The sums over the even and the odd ones of all numbers.
  EvenOdd halves() {
    EvenOdd sums;
    while (left_ > 0) sums.add(take(left_));
    return sums;
  }

 private:
  /// At least one and at most `most` of the next numbers.
  std::span<const double> take(std::int64_t most) {
    if (next_ == end_) {
      end_ = static_cast<std::size_t>(std::min<std::int64_t>(left_, block_size));
      fill_(std::span(numbers_).first(end_));
      left_ -= static_cast<std::int64_t>(end_);
      next_ = 0;
    }
    const auto n = static_cast<std::size_t>(std::min(most, static_cast<std::int64_t>(end_ - next_)));
    next_ += n;
    return std::span(numbers_).subspan(next_ - n, n);
  }

  Fill fill_;
  std::int64_t left_;
  std::int64_t size_;
  std::size_t next_ = 0;
  std::size_t end_ = 0;
  std::array<double, block_size> numbers_;  // not zeroed
};

}  // namespace detail

}  // namespace debias

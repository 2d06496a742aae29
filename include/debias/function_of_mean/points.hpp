#pragma once

// Where the doubling of function_of_mean.hpp takes its numbers from: independent draws, combs, jittered
// points.
//
//   comb      a + (b - a) (i + u) / 2^k, one random offset u: the error of a mean falls like 2^-k (bent f)
//   jittered  a + (b - a) (i + u_i) / 2^k, an offset for each part: like 2^(-1.5 k)
//
// The 2^k points of a level come in 2^(k-m) groups of 2^m. Each group alone, all even groups together and all
// odd ones together are distributed like the points of their own level: means of groups are unbiased for it.
// Batch hooks (BatchedVariable, BatchedIntegrand) make many numbers at once from the very same random
// numbers. Sources: Misso et al., ACM TOG 41(4), 2022 (combs); Owen 1995 (nested scrambling, for the groups
// of jittered ones).

#include <algorithm>
#include <array>
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
#include <debias/core/value.hpp>

namespace debias {

namespace detail {
[[noreturn]] inline void refuse_level(std::int64_t level) {
  if (level < 0) {
    throw std::invalid_argument("doubling: level = " + std::to_string(level) + " (must be at least 0)");
  }
  throw std::length_error("doubling: level " + std::to_string(level) +
                          " needs 2^level draws (beyond int64); choose a law with a lighter tail");
}
}  // namespace detail

/// 2^level. Throws std::invalid_argument below level 0 and std::length_error where the number of draws leaves
/// the 64-bit integers (a law that gets there has a tail of infinite work).
inline std::int64_t doubled_draws(std::int64_t level) {
  if (level < 0 || level > 62) [[unlikely]]
    detail::refuse_level(level);
  return std::int64_t{1} << level;
}

/// A random variable with a batch hook: `x.draws(rng, out)` makes out.size() draws from the very random
/// numbers of as many calls x(rng), equal to rounding.
template <class X>
concept BatchedVariable = RandomVariable<X> && requires(const X& x, Stream& rng, std::span<double> out) {
  x.draws(rng, out);
};

/// An integrand with a batch hook: `f(at, out)` beside f(x), over spans of at most 256 numbers.
template <class F>
concept BatchedIntegrand = requires(const F& f, std::span<const double> at, std::span<double> out) {
  f(at, out);
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

/// The sum of `size` numbers, in double precision at least.
template <class Next>
auto sum_of(std::int64_t size, Next&& next) {
  using M = mean_t<std::remove_cvref_t<decltype(next())>>;
  M total(next());
  for (std::int64_t i = 1; i < size; ++i) total = sum(std::move(total), M(next()));
  return total;
}

inline constexpr std::size_t block_size = 256;

/// Sums of every second number, in eight lanes.
struct EvenOdd {
  std::array<double, 8> lanes{};
  void add(std::span<const double> x) {  // an even number of them
    std::size_t i = 0;
    for (; i + 8 <= x.size(); i += 8) {
      for (std::size_t j = 0; j < 8; ++j) lanes[j] += x[i + j];
    }
    for (; i < x.size(); ++i) lanes[i % 8] += x[i];
  }
  [[nodiscard]] double even() const { return (lanes[0] + lanes[2]) + (lanes[4] + lanes[6]); }
  [[nodiscard]] double odd() const { return (lanes[1] + lanes[3]) + (lanes[5] + lanes[7]); }
};

/// Numbers made in blocks: `fill(out)` makes the next out.size() of `count`. Each call sums the next `size`
/// of them.
template <class Fill>
class Blocks {
 public:
  Blocks(Fill fill, std::int64_t count, std::int64_t size)
      : fill_(std::move(fill)), left_(count), size_(size) {}

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

/// Independent draws of X: groups are consecutive ones.
template <RandomVariable X>
struct IndependentPoints {
  X x;
  static constexpr double scale = 1;
  static constexpr double extra_work = 0;

  auto points(std::int64_t level, std::int64_t group_level, Stream& rng) const {
    const std::int64_t size = doubled_draws(group_level);
    if constexpr (BatchedVariable<X>) {
      return Blocks([this, &rng](std::span<double> out) { x.draws(rng, out); }, doubled_draws(level), size);
    } else {
      return [this, &rng, size] { return sum_of(size, [this, &rng] { return x(rng); }); };
    }
  }
};

/// f at positions in units of the interval's 2^level parts, which `Positions(level, group_level, rng)` gives
/// group by group: next_group() returns a callable of the positions in a group.
template <class F, class Positions>
struct IntervalPoints {
  F f;
  double from;
  double scale;  // the length of the interval
  static constexpr double extra_work = 0;

  auto points(std::int64_t level, std::int64_t group_level, Stream& rng) const {
    const std::int64_t size = doubled_draws(group_level);
    const double step = scale / static_cast<double>(doubled_draws(level));
    Positions positions(level, group_level, rng);
    if constexpr (BatchedIntegrand<F>) {
      const auto fill = [this, start = from, step, positions, size, left = std::int64_t{0},
                         group = typename Positions::Group{}](std::span<double> out) mutable {
        const double a = start;
        const double h = step;
        std::array<double, block_size> at;
        for (std::size_t made = 0; made < out.size();) {
          if (left == 0) {
            group = positions.next_group();
            left = size;
          }
          const auto n = std::min(static_cast<std::int64_t>(out.size() - made), left);
          group.fill(std::span(at).subspan(made, static_cast<std::size_t>(n)));
          left -= n;
          made += static_cast<std::size_t>(n);
        }
        for (std::size_t i = 0; i < out.size(); ++i) at[i] = a + h * at[i];
        f(std::span<const double>(at).first(out.size()), out);
      };
      return Blocks(fill, doubled_draws(level), size);
    } else {
      return [this, step, positions, size]() mutable {
        return sum_of(size, [this, step, group = positions.next_group()]() mutable {
          return f(from + step * group());
        });
      };
    }
  }
};

/// One random offset for all parts. Group r has the parts r, r + groups, ...: a coarser comb.
class CombPositions {
 public:
  CombPositions(std::int64_t level, std::int64_t group_level, Stream& rng)
      : groups_(doubled_draws(level - group_level)), offset_(rng.uniform()) {}

  class Group {
   public:
    Group() = default;
    Group(std::int64_t first, std::int64_t stride, double offset)
        : part_(first), stride_(stride), offset_(offset) {}
    double operator()() {
      const double at = static_cast<double>(part_) + offset_;
      part_ += stride_;
      return at;
    }
    void fill(std::span<double> at) {
      const auto first = static_cast<double>(part_);  // whole numbers below 2^53: sums and products are exact
      const auto stride = static_cast<double>(stride_);
      const double offset = offset_;  // not the member: the loop writes doubles
      const int n = static_cast<int>(at.size());
      for (int i = 0; i < n; ++i) at[static_cast<std::size_t>(i)] = (first + stride * i) + offset;
      part_ += n * stride_;
    }

   private:
    std::int64_t part_ = 0;
    std::int64_t stride_ = 0;
    double offset_ = 0;
  };
  Group next_group() { return {group_++, groups_, offset_}; }

 private:
  std::int64_t groups_;
  double offset_;
  std::int64_t group_ = 0;
};

/// A uniform point in each part. Group r takes one part out of each of the 2^group_level coarse ones,
/// uniformly and independently, and of each pair of neighbouring parts one belongs to an even group and one
/// to an odd one.
class JitteredPositions {
 public:
  JitteredPositions(std::int64_t level, std::int64_t group_level, Stream& rng)
      : rng_(&rng),
        choices_(rng),
        pairs_(doubled_draws(level - group_level) / 2),
        masked_(group_level > 0 && pairs_ > 1) {}

  class Group {
   public:
    Group() = default;
    Group(JitteredPositions* positions, std::int64_t group) : positions_(positions), group_(group) {}
    double operator()() { return positions_->position(group_, coarse_++); }
    void fill(std::span<double> at) {
      for (double& x : at) x = (*this)();
    }

   private:
    JitteredPositions* positions_ = nullptr;
    std::int64_t group_ = 0;
    std::int64_t coarse_ = 0;
  };
  Group next_group() { return {this, group_++}; }

 private:
  static constexpr std::uint64_t mask_branch = std::uint64_t{1} << 62;
  static constexpr std::uint64_t swap_branch = std::uint64_t{1} << 63;

  double position(std::int64_t group, std::int64_t coarse) {
    if (pairs_ == 0) return static_cast<double>(coarse) + rng_->uniform();  // one group: all parts in order
    std::int64_t pair = group / 2;
    if (masked_) pair ^= static_cast<std::int64_t>(bits(mask_branch, coarse)) & (pairs_ - 1);
    pair += coarse * pairs_;
    const bool swap = (bits(swap_branch, pair / 64) >> (pair % 64) & 1U) != 0;
    const bool odd = (group & 1) != 0;
    return static_cast<double>(2 * pair + (odd != swap ? 1 : 0)) + rng_->uniform();
  }

  std::uint64_t bits(std::uint64_t branch, std::int64_t i) {
    const std::uint64_t tag = branch + static_cast<std::uint64_t>(i);
    if (tag != last_tag_) {
      last_tag_ = tag;
      last_bits_ = choices_.split(tag).bits();
    }
    return last_bits_;
  }

  Stream* rng_;
  Stream choices_;
  std::int64_t pairs_;
  bool masked_;
  std::int64_t group_ = 0;
  std::uint64_t last_tag_ = 0;
  std::uint64_t last_bits_ = 0;
};

}  // namespace detail

}  // namespace debias

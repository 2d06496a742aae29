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

/// Draws one after the other from the stream of each member: groups are consecutive draws.
template <class X>
class DrawsBatch {
 public:
  DrawsBatch(const X& x, std::int64_t size, std::int64_t groups, StreamBatch& batch)
      : x_(&x), batch_(&batch), size_(size), groups_(groups_in_block(size, groups, batch.size())) {
    if constexpr (!BatchedOverMembers<X>) {
      for (std::size_t b = 0; b < batch.size(); ++b) streams_[b].emplace(batch.stream(b));
    }
  }

  std::int64_t operator()(std::span<double, block_size> sums) {
    const std::size_t members = batch_->size();
    const std::span<double> out = sums.first(static_cast<std::size_t>(groups_) * members);
    if constexpr (BatchedOverMembers<X>) {
      const auto fit = static_cast<std::int64_t>(block_size / std::bit_ceil(members));
      std::array<double, block_size> draws;
      std::fill(out.begin(), out.end(), 0.0);
      for (std::int64_t done = 0; done < size_; done += fit) {
        const std::int64_t rows = std::min(size_ - done, fit);  // of each group; all of them if there are several
        const std::span<double> some = std::span(draws).first(static_cast<std::size_t>(groups_ * rows) * members);
        x_->draws(*batch_, some);
        const double* row = some.data();
        for (std::size_t r = 0; r < static_cast<std::size_t>(groups_); ++r) {
          for (std::int64_t q = 0; q < rows; ++q, row += members) {
            for (std::size_t b = 0; b < members; ++b) out[r * members + b] += row[b];
          }
        }
      }
    } else {
      for (std::size_t r = 0; r < static_cast<std::size_t>(groups_); ++r) {
        for (std::size_t b = 0; b < members; ++b) {
          double sum = 0;
          for (std::int64_t q = 0; q < size_; ++q) sum += static_cast<double>((*x_)(*streams_[b]));
          out[r * members + b] = sum;
        }
      }
    }
    return groups_;
  }

 private:
  struct None {};

  const X* x_;
  StreamBatch* batch_;
  std::int64_t size_;
  std::int64_t groups_;  // in a call
  [[no_unique_address]] std::conditional_t<BatchedOverMembers<X>, None,
                                           std::array<std::optional<Stream>, StreamBatch::capacity>>
      streams_;
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
      return GroupSums{size, [this, &rng] { return [this, &rng] { return x(rng); }; }};
    }
  }

  auto batch(std::int64_t level, std::int64_t group_level, StreamBatch& members) const requires RealValue<draw_t<X>> {
    return DrawsBatch<X>(x, doubled_draws(group_level), doubled_draws(level - group_level), members);
  }
};

/// The values of f on the combs of many members, one offset each.
template <class F>
class CombBatch {
 public:
  CombBatch(const F& f, double from, double step, std::int64_t size, std::int64_t groups, StreamBatch& batch)
      : f_(&f),
        from_(from),
        step_(step),
        size_(size),
        groups_(groups),
        in_block_(groups_in_block(size, groups, batch.size())),
        members_(batch.size()) {
    batch.uniforms(std::span(offsets_).first(members_));
  }

  std::int64_t operator()(std::span<double, block_size> sums) {
    const std::size_t row = static_cast<std::size_t>(in_block_) * members_;  // of one point of each group
    const std::span<double> out = sums.first(row);
    std::fill(out.begin(), out.end(), 0.0);
    const auto fit = static_cast<std::int64_t>(block_size / row);
    for (std::int64_t q = 0; q < size_; q += fit) {
      const std::int64_t rows = std::min(fit, size_ - q);
      std::array<double, block_size> at;
      std::array<double, block_size> values;
      const std::size_t n = static_cast<std::size_t>(rows) * row;
      for (std::int64_t i = 0; i < rows; ++i) place(group_ + (q + i) * groups_, &at[static_cast<std::size_t>(i) * row]);
      if constexpr (BatchedIntegrand<F>) {
        (*f_)(std::span<const double>(at).first(n), std::span(values).first(n));
      } else {
        for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<double>((*f_)(at[i]));
      }
      for (std::size_t i = 0; i < n; i += row) {
        for (std::size_t j = 0; j < row; ++j) out[j] += values[i + j];
      }
    }
    group_ += in_block_;
    return in_block_;
  }

 private:
  // The positions of the parts first, first + 1, ..., one for each group of a call, by member.
  void place(std::int64_t first, double* at) const {
    const double from = from_;  // not the members: the loops write doubles
    const double step = step_;
    const auto part = static_cast<double>(first);
    if (members_ == 1) {
      const double offset = offsets_[0];
      const int n = static_cast<int>(in_block_);
      for (int r = 0; r < n; ++r) at[r] = from + step * ((part + r) + offset);
      return;
    }
    for (std::int64_t r = 0; r < in_block_; ++r) {
      const double here = part + static_cast<double>(r);
      for (std::size_t b = 0; b < members_; ++b) at[b] = from + step * (here + offsets_[b]);
      at += members_;
    }
  }

  const F* f_;
  double from_;
  double step_;
  std::int64_t size_;      // points in a group
  std::int64_t groups_;    // in all
  std::int64_t in_block_;  // in a call
  std::size_t members_;
  std::int64_t group_ = 0;
  std::array<double, StreamBatch::capacity> offsets_;
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
    const double step = scale * share_of_draw(level);
    Positions positions(level, group_level, rng);
    if constexpr (BatchedIntegrand<F>) {
      const auto fill = [this, start = from, step, positions](std::span<double> out) mutable {
        const double a = start;  // not the members: the loop writes doubles
        const double h = step;
        std::array<double, block_size> numbers;
        const std::span<double> at = std::span(numbers).first(out.size());
        positions.fill(at);
        for (double& x : at) x = a + h * x;
        f(std::span<const double>(at), out);
      };
      return Blocks(fill, doubled_draws(level), size);
    } else {
      return GroupSums{size, [this, step, positions]() mutable {
                         return [this, step, position = positions.next_group()]() mutable {
                           return f(from + step * position());
                         };
                       }};
    }
  }

  auto batch(std::int64_t level, std::int64_t group_level, StreamBatch& members) const
      requires(Positions::one_offset) &&
      RealValue<std::remove_cvref_t<std::invoke_result_t<const F&, double>>> {
    return CombBatch<F>(f, from, scale * share_of_draw(level), doubled_draws(group_level),
                        doubled_draws(level - group_level), members);
  }
};

/// One random offset for all parts. Group r has the parts r, r + groups, ...: a coarser comb.
class CombPositions {
 public:
  static constexpr bool one_offset = true;

  CombPositions(std::int64_t level, std::int64_t group_level, Stream& rng)
      : groups_(doubled_draws(level - group_level)), size_(doubled_draws(group_level)), offset_(rng.uniform()) {}

  auto next_group() {
    return [part = group_++, stride = groups_, offset = offset_]() mutable {
      const double at = static_cast<double>(part) + offset;
      part += stride;
      return at;
    };
  }

  void fill(std::span<double> at) {
    if (size_ == 1) {  // groups of one part: all parts in order
      write(at, group_, 1);
      group_ += static_cast<std::int64_t>(at.size());
      return;
    }
    for (std::size_t made = 0; made < at.size();) {
      const auto n = std::min(static_cast<std::int64_t>(at.size() - made), size_ - within_);
      write(at.subspan(made, static_cast<std::size_t>(n)), group_ + within_ * groups_, groups_);
      made += static_cast<std::size_t>(n);
      within_ += n;
      if (within_ == size_) {
        within_ = 0;
        ++group_;
      }
    }
  }

 private:
  void write(std::span<double> at, std::int64_t first_part, std::int64_t parts_apart) const {
    const auto first = static_cast<double>(first_part);  // whole numbers below 2^53: sums and products are exact
    const auto stride = static_cast<double>(parts_apart);
    const double offset = offset_;  // not the member: the loop writes doubles
    const int n = static_cast<int>(at.size());
    for (int i = 0; i < n; ++i) at[static_cast<std::size_t>(i)] = (first + stride * i) + offset;
  }

  std::int64_t groups_;
  std::int64_t size_;
  double offset_;
  std::int64_t group_ = 0;
  std::int64_t within_ = 0;  // parts of the group that are written
};

/// A uniform point in each part. Group r takes one part out of each of the 2^group_level coarse ones,
/// uniformly and independently, and of each pair of neighbouring parts one belongs to an even group and one
/// to an odd one.
class JitteredPositions {
 public:
  static constexpr bool one_offset = false;

  JitteredPositions(std::int64_t level, std::int64_t group_level, Stream& rng)
      : rng_(&rng),
        choices_(rng),
        size_(doubled_draws(group_level)),
        pairs_(doubled_draws(level - group_level) / 2),
        masked_(group_level > 0 && pairs_ > 1) {}

  auto next_group() {
    return [this, group = group_++, coarse = std::int64_t{0}]() mutable { return position(group, coarse++); };
  }

  void fill(std::span<double> at) {
    for (double& x : at) {
      x = position(group_, within_++);
      if (within_ == size_) {
        within_ = 0;
        ++group_;
      }
    }
  }

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
  std::int64_t size_;
  std::int64_t pairs_;
  bool masked_;
  std::int64_t group_ = 0;
  std::int64_t within_ = 0;  // points of the group that fill() has written
  std::uint64_t last_tag_ = 0;
  std::uint64_t last_bits_ = 0;
};

}  // namespace detail

}  // namespace debias

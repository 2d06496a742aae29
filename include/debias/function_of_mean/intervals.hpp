#pragma once

// Points of an interval for the doubling of function_of_mean.hpp: combs and jittered points.
//
//   comb      a + (b - a) (i + u) / 2^k, one random offset u: the error of a mean falls like 2^-k (bent f)
//   jittered  a + (b - a) (i + u_i) / 2^k, an offset for each part: like 2^(-1.5 k)
//
// Which is the default, and its price. Combs are: nothing comes near them on a smooth periodic f, and a comb in step with f is
// warned of (core/resonance.hpp). No other number of points mends that. Combs of 3 2^k or 11 2^k points are as good as others of
// their size, and in step with what has 3 or 11 times a power of two periods; their lowest level takes 3 or 11 look-ups. Odd
// numbers drawn afresh for each sample are in step now and then (704 periods, 8 to 16 points: 3 times the variance of independent
// draws), and their halves are no combs. Jittered points have no period: take them (function_of_jittered_integral) where f may
// repeat itself at a scale that nobody knows, or does not continue periodically. Variance x look-ups:
//
//   f                       256 independent   256 comb   192 comb   176 comb   256 jittered
//   e^x                               .25      9.5e-4     1.3e-3     1.4e-3         4.1e-6
//   x (1 - x)                      5.5e-3     3.4e-10    7.9e-10     1.0e-9         4.3e-7
//   e^cos(2 pi x)                     .70       5e-30      5e-30      3e-30         4.1e-5
//   1 for x < .3                      .20      6.4e-4     1.2e-3     9.1e-4         6.1e-4
//   1.9 cos(2 pi 192 x)              1.85           0        344          0           1.60
//   1.9 cos(2 pi 704 x)              1.75           0          0        314           1.84     a comb of 64: 116
//
// Notation and groups: function_of_mean/points.hpp. Group r of a comb has the parts r, r + groups, ...
// Sources: Misso et al., ACM TOG 41(4), 2022 (combs); Owen 1995 (nested scrambling, for the groups of jittered ones).

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>
#include <debias/function_of_mean/points.hpp>

namespace debias {

/// An integrand with a batch hook: `f(at, out)` beside f(x), over spans of at most 256 numbers.
template <class F>
concept BatchedIntegrand = requires(const F& f, std::span<const double> at, std::span<double> out) {
  f(at, out);
};

namespace detail {

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
  static constexpr bool in_step = Positions::one_offset;

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

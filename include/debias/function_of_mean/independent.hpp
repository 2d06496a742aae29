#pragma once

// Independent draws for the doubling of function_of_mean.hpp: groups are consecutive draws of one stream.
//
//   sum of group r = X_(r n) + ... + X_((r + 1) n - 1),  n = 2^group_level
//
// Batch hooks (BatchedVariable, BatchedOverMembers) make the same draws many at a time. Of many members, each has its own
// stream. Notation and groups: function_of_mean/points.hpp.

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>
#include <debias/function_of_mean/points.hpp>

namespace debias::detail {

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

}  // namespace debias::detail

#pragma once

// Which chunks a rank gets next: half of an even share of what is left, as an aligned power of two, so that a
// finished group is one node of RunState's tree; single chunks at the end (guided self-scheduling,
// Polychronopoulos & Kuck 1987).

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <debias/core/result.hpp>

namespace debias::mpi {

class Groups {
 public:
  Groups(std::vector<RunState::Range> samples, std::int64_t chunk) : samples_(std::move(samples)), chunk_(chunk) {
    for (const auto& [first, last] : samples_) left_ += chunks_of(first, last);
  }

  /// In the order of the samples; empty at the end. A rank with several threads gets a chunk for each as long
  /// as it can.
  RunState::Range next(std::int64_t ranks, std::int64_t threads) {
    while (at_ < samples_.size() && samples_[at_].first == samples_[at_].second) ++at_;
    if (at_ == samples_.size()) return {0, 0};
    auto& [first, last] = samples_[at_];
    const std::int64_t chunk = first / chunk_;
    std::int64_t size = std::min(std::max(left_ / (2 * ranks), threads), chunks_of(first, last));
    size = std::int64_t{1} << (std::bit_width(static_cast<std::uint64_t>(size)) - 1);
    if (chunk > 0) size = std::min(size, std::int64_t{1} << std::countr_zero(static_cast<std::uint64_t>(chunk)));
    left_ -= size;
    const std::int64_t begin = first;
    first = last / chunk_ < chunk + size ? last : (chunk + size) * chunk_;
    return {begin, first};
  }

 private:
  [[nodiscard]] std::int64_t chunks_of(std::int64_t first, std::int64_t last) const {
    return first < last ? (last - 1) / chunk_ - first / chunk_ + 1 : 0;
  }

  std::vector<RunState::Range> samples_;
  std::size_t at_ = 0;
  std::int64_t chunk_;
  std::int64_t left_ = 0;  // chunks
};

}  // namespace debias::mpi

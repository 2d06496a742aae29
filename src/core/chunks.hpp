#pragma once

// Samples that wait to be drawn, in pieces of whole chunks: the one queue of a run. Threads take a chunk at a time; the
// leading one of several ranks gives each as many as its share, an aligned power of two of chunks, so that what a rank has
// finished is one node of RunState's tree.

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <utility>

#include <debias/core/run_state.hpp>

namespace debias::detail {

class Chunks {
 public:
  using Range = RunState::Range;

  explicit Chunks(std::int64_t chunk) : chunk_(chunk) {}

  /// Samples behind all that were given before.
  void give(const Range& samples) {
    if (samples.first >= samples.second) return;
    samples_.push_back(samples);
    left_ += chunks_of(samples);
  }
  [[nodiscard]] bool empty() const { return samples_.empty(); }
  /// Chunks; one that is cut counts as one.
  [[nodiscard]] std::int64_t left() const { return left_; }
  /// The first sample that is left, where there is one.
  [[nodiscard]] std::int64_t next() const { return samples_.front().first; }

  /// The next samples, of at most so many chunks, in order; none at the end.
  Range take(std::int64_t most = 1) {
    if (samples_.empty()) return {0, 0};
    auto& [first, last] = samples_.front();
    const std::int64_t chunk = first / chunk_;
    std::int64_t size = std::min(most, chunks_of(samples_.front()));
    size = std::int64_t{1} << (std::bit_width(static_cast<std::uint64_t>(size)) - 1);
    if (chunk > 0) size = std::min(size, std::int64_t{1} << std::countr_zero(static_cast<std::uint64_t>(chunk)));
    left_ -= size;
    const std::int64_t begin = first;
    first = last / chunk_ < chunk + size ? last : (chunk + size) * chunk_;
    const std::int64_t end = first;
    if (first == last) samples_.pop_front();
    return {begin, end};
  }
  /// What one of so many ranks gets: half of an even share of what is left, at first; single chunks at the end (guided
  /// self-scheduling, Polychronopoulos & Kuck 1987). A rank with several threads gets a chunk for each as long as it can.
  Range take_share(std::int64_t ranks, std::int64_t threads) {
    return take(std::max({left_ / (2 * ranks), threads, std::int64_t{1}}));
  }

 private:
  [[nodiscard]] std::int64_t chunks_of(const Range& samples) const {
    return (samples.second - 1) / chunk_ - samples.first / chunk_ + 1;
  }

  std::int64_t chunk_;
  std::deque<Range> samples_;
  std::int64_t left_ = 0;
};

}  // namespace debias::detail

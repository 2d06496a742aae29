#pragma once

// Mean, error, tails and verdict of numbers that come one by one, in one pass and bounded memory.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/diagnostics.hpp>

#include "commands.hpp"

namespace debias::cli {

/// Everything that is remembered of the values, in blocks.
class Sums {
 public:
  /// `row` numbers the rows of the file from 1.
  void add(double x, std::int64_t row) {
    if (filled_ == block_.size() || row != first_row_ + static_cast<std::int64_t>(filled_)) flush();
    if (filled_ == 0) first_row_ = row;
    block_[filled_++] = x;
    blocks_.add(x);
  }
  void finish(Diagnosis& d) {
    flush();
    d.moments = moments_;
    d.running = std::move(running_);
    const bool at_the_end = !d.running.empty() && d.running.back().count == moments_.count;
    if (!at_the_end && moments_.count > 0) d.running.push_back(moments_);
    d.upper_tail = extremes_.upper_tail();
    d.lower_tail = extremes_.lower_tail();
    d.largest = extremes_.largest();
    d.nonfinite = extremes_.nonfinite();
    d.first_nonfinite = extremes_.first_nonfinite();
    d.block_means = blocks_.means();
    d.block_length = blocks_.length();
  }

 private:
  void flush() {
    std::span<const double> values = std::span(block_).first(filled_);
    extremes_.add(values, std::span(no_levels_).first(filled_), first_row_);
    while (!values.empty()) {  // stop at each doubling
      const auto room = static_cast<std::size_t>(next_ - moments_.count);
      const auto part = values.first(std::min(values.size(), room));
      moments_.merge(Moments::of(part));
      values = values.subspan(part.size());
      if (moments_.count < next_) continue;
      running_.push_back(moments_);
      next_ *= 2;
    }
    filled_ = 0;
  }

  std::array<double, 256> block_;
  std::array<std::int64_t, 256> no_levels_{};
  std::size_t filled_ = 0;
  std::int64_t first_row_ = 0;
  std::int64_t next_ = 2;
  Moments moments_;
  std::vector<Moments> running_;
  Extremes extremes_;
  BlockMeans blocks_;
};

/// Intervals, verdict and warnings from what Sums::finish left.
void conclude(Diagnosis& diagnosis);

}  // namespace debias::cli

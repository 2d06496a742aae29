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
  }
  void add(std::span<const double> values, std::int64_t first_row) {
    for (const double x : values) add(x, first_row++);
  }
  void finish(Diagnosis& d);

 private:
  void flush();
  void choose_scale(std::span<const double> values);

  std::array<double, 256> block_;
  std::array<std::int64_t, 256> no_levels_{};
  std::size_t filled_ = 0;
  std::int64_t first_row_ = 0;
  std::int64_t next_ = 2;
  int scale_ = 0;       // moments and block means are of x 2^-scale
  double largest_ = 0;  // in magnitude, of the finite values
  Moments moments_;
  std::vector<RunningMean> running_;
  Extremes extremes_;
  BlockMeans blocks_;
};

/// Intervals, verdict and warnings from what Sums::finish left.
void conclude(Diagnosis& diagnosis);

}  // namespace debias::cli

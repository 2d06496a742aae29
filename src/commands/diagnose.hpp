#pragma once

// Mean, error, tails and verdict of numbers that come one by one, in one pass and bounded memory.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/diagnostics.hpp>

#include "fields.hpp"

namespace debias::commands {

struct BadRow {
  std::int64_t row = 0;
  std::string reason;
};

/// Rows are numbered from 1, header and bad ones included.
struct Diagnosis {
  std::string file;
  std::string column;        ///< its name in the header, if there is one
  std::string unit = "row";  ///< what the values are counted by
  Moments moments;
  Interval interval;
  std::vector<double> block_means;
  std::int64_t block_length = 1;
  Interval block_interval;
  BiasedEstimate robust;         ///< no groups: too few values
  std::vector<Moments> running;  ///< after 2, 4, 8, ... values, and at the end
  std::vector<double> upper_tail;
  std::vector<double> lower_tail;
  std::vector<LargeSample> largest;  ///< the index is a row
  RunVerdict verdict;
  std::int64_t nonfinite = 0;
  std::int64_t first_nonfinite = 0;
  std::int64_t bad_rows = 0;
  std::vector<BadRow> first_bad_rows;
  std::vector<std::string> warnings;
};

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
/// The share of a value in the sum of squares about the mean.
double square_share(const Diagnosis& diagnosis, double value);

void print(std::ostream& out, const Diagnosis& diagnosis);
Fields fields(const Diagnosis& diagnosis);

}  // namespace debias::commands

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
#include "numbers/numbers.hpp"

namespace debias::commands {

/// Mean and standard error of the first values.
struct RunningMean {
  std::int64_t count = 0;
  double mean = 0;
  double standard_error = 0;  ///< NaN of one value
};

/// The report.
struct Diagnosis {
  std::string file;
  numbers::Report read;      ///< by default an array of doubles
  std::string unit = "row";  ///< what the values are counted by
  /// Moments, tails and block means are those of the values times 2^-scale: no square over- or underflows. All else is
  /// in the unit of the values.
  int scale = 0;
  Moments moments;
  std::vector<double> upper_tail;
  std::vector<double> lower_tail;
  double mean = 0;
  double standard_error = 0;  ///< allows for values that depend on their neighbours; NaN of one value
  Interval interval;
  double interval_degrees = 0;  ///< of its Student's t; 0 without an interval
  std::vector<double> block_means;
  std::int64_t block_length = 1;
  Interval block_interval;
  BiasedEstimate robust;             ///< no groups: too few values
  std::vector<RunningMean> running;  ///< after 2, 4, 8, ... values, and at the end
  std::vector<LargeSample> largest;  ///< the index is a row
  RunVerdict verdict;
  std::int64_t nonfinite = 0;
  std::int64_t first_nonfinite = 0;
  std::vector<Warning> warnings;
};

/// The interval of a diagnosis at another level, from its mean, standard_error and interval_degrees.
Interval interval_at(double confidence, double mean, double error, double degrees);

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
void judge(Diagnosis& diagnosis);
/// The share of a value in the sum of squares about the mean.
double square_share(const Diagnosis& diagnosis, double value);

/// Anyone's numbers, and how they are written.
struct DiagnoseRequest {
  numbers::Bytes bytes;
  numbers::Request reading = {};
};
/// Without a value there is nothing to diagnose. Throws numbers::Error.
Diagnosis diagnose(const DiagnoseRequest& request);

/// Brief, or all of it.
void print(std::ostream& out, const Diagnosis& diagnosis, bool full = false);
Fields fields(const Diagnosis& diagnosis);

}  // namespace debias::commands

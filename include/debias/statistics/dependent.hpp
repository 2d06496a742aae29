#pragma once

// The error of a mean of values that depend on their neighbours, from the means of consecutive blocks.
//
//   tau = 1 + 2 sum_(k <= w) r_k over the block means, w the first k >= 6 max(tau, 1)      [Sokal's window]
//   error of tau = tau sqrt(2 (2 w + 1) / blocks)
//   se^2 = Var(block mean) tau / blocks,  time = se^2 n / Var(value),  effective = n / time
//
//   Notation: r_k = autocorrelation of the block means at distance k, n = number of values.
// Where blocks are longer than the dependence, tau is 1 and the blocks have taken it in; where they are shorter, tau
// does. A time below 1 belongs to values that alternate. Fails where n is not many times the dependence: below an
// effective 50 values the error is itself uncertain, mostly too small.
// Source: Sokal, Monte Carlo methods in statistical mechanics (1997), section 3.

#include <cstdint>
#include <limits>
#include <span>

#include <debias/core/accumulator.hpp>
#include <debias/core/result.hpp>

namespace debias {

struct Dependence {
  double time = 1;                                           ///< integrated autocorrelation time, in values
  double time_error = 0;                                     ///< its standard error, relative
  double effective = 0;                                      ///< independent values that would be worth as much
  double standard_error = 0;                                 ///< of the mean
  double degrees = std::numeric_limits<double>::infinity();  ///< of Student's t

  /// Fewer than 50 effective values, the time being one error longer, leave the error itself unknown, mostly too small.
  [[nodiscard]] bool known() const { return effective >= 50 * (1 + time_error); }
  /// Beyond what chance does to the error: by half, or to two thirds.
  [[nodiscard]] bool matters() const { return time > 2.25 || time < 1 / 2.25; }
};

/// Blocks of equal length, at least 32 of them; fewer say that nothing depends.
Dependence dependence_of(std::span<const double> block_means, std::int64_t block_length, const Moments& values);

/// Mean -+ t quantile x error, for degrees that need not be whole.
Interval interval_with(double mean, double standard_error, double degrees, double confidence = 0.95);

}  // namespace debias

#pragma once

// What is left out beyond the last level of finite differences, seen from the levels of a run.
//
//   bound = 2 max_k rms(D_k) 2^(-r (K + 1 - k)) / (1 - 2^-r) + rounding,  r = variance_decay / 2
//
// Notation: K = last level, rms(D_k) = root mean square of the differences of level k. Assumes that differences go on
// falling at the declared rate; where they do not fall even so far, the bound is infinite and says why.
// Source: the geometric series of the differences that are left out; twice it, for what is not asymptotic yet.

#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/rates.hpp>

namespace debias::detail {

/// E D_k^2 of a level of a run.
struct DifferenceMoment {
  std::int64_t level;
  double log_square;
  double variance;  // of log_square
};

/// The differences of a run up to the last level.
struct DifferencesSeen {
  double truncation = 0;  ///< the largest root mean square, continued to the first level that is left out
  bool any = false;
  bool finite = true;
  std::vector<DifferenceMoment> moments;  ///< of levels with enough draws to know them
};
DifferencesSeen see_differences(const LevelTable& levels, std::int64_t last_level, const Rates& rates);

/// Why differences do not fall as they should; empty where they do, or nobody can tell: of a run, and of an f without
/// noise with the sizes of its differences, 0 where that is rounding, `last` the last that is not.
std::string doubt_of_draws(const std::vector<DifferenceMoment>& moments, const Rates& rates);
std::string doubt_of_sizes(const std::vector<double>& sizes, std::int64_t last, const Rates& rates);

BiasBound bound_of_differences(const DifferencesSeen& seen, const std::string& doubt, std::int64_t last_level,
                               const Rates& rates, double rounding);

}  // namespace debias::detail

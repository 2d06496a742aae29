#pragma once

// Validation: every estimator that applies to a problem, held against the exact value.
//
//   z = (mean - truth) / max(standard error, rounding bound)
//
// A family of n cells passes below the two-sided normal quantile with false-alarm rate 1e-6 for the whole
// (Sidak); a bias of (threshold + 2.33) standard errors is detected with 99 % power. Baselines that are not
// meant to pass are `biased`; where no PMF has finite variance and finite work the cell is `refused`; where the
// level moments say, before the run, that the samples cannot see the answer it is `underpowered`.

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "catalog.hpp"

namespace debias::validation {

using catalog::Choice;
using catalog::Method;
using catalog::Problem;
using catalog::Special;

enum class Status { pass, fail, biased, refused, underpowered };
std::string_view name_of(Status status);

struct Cell {
  const Problem* problem = nullptr;
  Choice choice;
  bool has_run = false;  ///< false for refused cells: the figures below are not there
  Statistics statistics;
  double z = 0;
  double detectable_bias = 0;  ///< found with 99 % power
  Status status = Status::refused;
  std::string reason;
};

struct Report {
  std::vector<Cell> cells;
  std::int64_t passed = 0;
  std::int64_t failed = 0;
  double max_abs_z = 0;  ///< over the cells that were judged
  double threshold = 0;
  /// The smallest bias that every judged cell would have caught, in standard deviations of one sample.
  double smallest_detectable_bias = 0;
};

/// The choices that validation runs for a problem, with the PMF its rates ask for, and one in blocks of nets; empty PMF:
/// refused.
std::vector<Choice> choices(const Problem& problem);

/// The standard error of a run, or what rounding may do to its mean, whichever is larger: where all samples agree,
/// rounding is what is left of the error.
double believed_error(const Statistics& statistics, double truth);

/// |z| at which one of `cells` right cells is rejected by chance once in a million validations.
double family_threshold(std::int64_t cells);

/// Runs all choices of the problems; `progress` sees each cell as it ends, of how many, and `prepare` its plan before.
/// plan.progress may interrupt (Interrupted).
Report validate(const std::vector<const Problem*>& problems, const Plan& plan,
                const std::function<void(const Cell&, std::int64_t done, std::int64_t total)>& progress = {},
                const std::function<void(const Problem&, const Choice&, Plan&)>& prepare = {});

}  // namespace debias::validation

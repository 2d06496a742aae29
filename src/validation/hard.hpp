#pragma once

// Hard cases: what rounding, thick media, cancellation and deep levels do to an estimate, and whether its result
// says so.
//
//   wrong   |mean - truth| > threshold x max(standard error, rounding bound) + stated bias bound
//   said    wrong, and the result says why not to trust it: a non-finite count, a warning, or a verdict that is
//           not `finite` on the variance or on the fourth moment
//   fail    wrong, and nothing says so: a defect of the library
//
// digits lost = log10 of the relative error max(|error|, standard error, rounding) / |truth|, over that of the
// first case of the group.

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <debias/core/result.hpp>

namespace debias::validation {

struct HardCase {
  std::string group;      ///< what is estimated, and how
  std::string parameter;  ///< what makes it hard
  double truth = 0;
  std::function<Statistics(const Plan&)> run;
};

enum class HardStatus { pass, said, refused, fail };
std::string_view name_of(HardStatus status);

struct HardCell {
  std::string group;
  std::string parameter;
  double truth = 0;
  HardStatus status = HardStatus::refused;
  bool has_run = false;  ///< false for refused cells: the figures below are not there
  Statistics statistics;
  double error = 0;  ///< mean - truth
  double digits_lost = 0;
  std::string says;  ///< what the result has against itself, in short; the refusal
};

struct HardReport {
  std::vector<HardCell> cells;
  std::int64_t failed = 0;
  double threshold = 0;
};

const std::vector<HardCase>& hard_cases();

/// What a result says against itself, each in a few words; empty when it has no doubt.
std::string doubts_of(const Statistics& statistics);

/// Runs the cases; `progress` sees each cell as it ends. plan.progress may interrupt (Interrupted).
HardReport validate(const std::vector<HardCase>& cases, const Plan& plan,
                    const std::function<void(const HardCell&)>& progress = {});

}  // namespace debias::validation

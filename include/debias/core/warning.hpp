#pragma once

// A doubt of a result, for programs and for people: a code to branch on, and a sentence to read.
//
//   for (const Warning& w : result.warnings) if (w.code == WarningCode::coupling) ...
//
// The text may change with any version; the names of the codes do not (they stand in JSON and in Python).

#include <iosfwd>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace debias {

enum class WarningCode {
  // of samples
  nonfinite_samples,  ///< some are no finite numbers, so there is no mean
  one_sample,         ///< which has no standard error
  mean_overflow,      ///< the sum of the samples
  square_overflow,    ///< of the samples: no standard error
  square_underflow,   ///< of their deviations: too small a standard error
  equal_samples,      ///< all of them, so that the standard error says nothing
  dominant_sample,    ///< one carries much of the variance
  uncertain_error,    ///< the standard error is itself known badly
  single_precision,   ///< whose rounding is coarser than the standard error
  // of a sequence and its levels
  coupling,             ///< a coarse partner has not the mean of the level below: every estimate is biased
  wrong_masses,         ///< a level is not drawn as often as the PMF says: every estimate is biased
  coupling_unchecked,   ///< values without mean or variance
  zero_differences,     ///< all are exactly zero, though numbers were drawn
  base_level,           ///< below it moments are infinite
  unexplained_time,     ///< a draw of a deep level takes longer than the work that it states
  declared_rates,       ///< which the levels contradict
  no_second_moment,     ///< of some levels, perhaps
  aliased_differences,  ///< they vanish while the value still varies
  unstated_end,         ///< zeros that the sequence has not announced
  unsettled_levels,     ///< rarity or decay still changes with the level
  few_levels,           ///< are known
  few_draws,            ///< of a level, beside its kurtosis
  rates_unknown,        ///< no line through the moments of the levels
  scattered_moments,    ///< of the levels, about that line
  shallow_levels,       ///< are not yet asymptotic, and left out of the rates
  rounding,             ///< drowns the differences of deep levels
  exact_end,            ///< the differences are zero from some level on
  fast_decay,           ///< beyond any power
  deepest_level,        ///< the PMF gives way to the deepest level that can be drawn
  // of anyone's numbers
  dependence,      ///< between neighbours: the standard error is too small
  alternation,     ///< about the mean: the standard error is too large
  missing_values,  ///< masked or not available, and left out
  reading,         ///< of a file, in doubt
  // of the run
  threads,     ///< fewer than asked for; the numbers are the same
  interrupted  ///< before all levels were drawn
};

/// "coupling", "few_draws", ...: the name of the enumerator.
const char* name_of(WarningCode code);
/// The code of such a name. Throws std::invalid_argument.
WarningCode warning_named(std::string_view name);

/// True for what an answer has taken into account already (a fall beyond any power, levels that a fit leaves out): a brief
/// report is silent about it.
bool is_note(WarningCode code);

struct Warning {
  WarningCode code{};
  std::string text;
};

inline bool operator==(const Warning& a, const Warning& b) { return a.code == b.code && a.text == b.text; }

namespace detail {
/// Those whose code `warnings` has not.
void add_new(std::vector<Warning>& warnings, const std::vector<Warning>& doubts);
}  // namespace detail

/// The text alone.
std::ostream& operator<<(std::ostream& out, const Warning& warning);

}  // namespace debias

#pragma once

// Reports as pictures, what debias.plot draws in Python: levels of a survey, PMFs of a sweep, a run as its samples grow.

#include <cstdint>
#include <string>
#include <vector>

#include "run.hpp"
#include "survey.hpp"
#include "tradeoff.hpp"

namespace debias::commands {

/// What the first samples of a run said.
struct Prefix {
  std::int64_t samples = 0;
  double mean = 0;  ///< of the first component
  double standard_error = 0;
};

/// A half, a quarter, ... of the samples of a run, at least 16 blocks of them, and all: the smaller first. Draws half of the
/// samples again. Throws what `watch` asks for (Interrupted).
std::vector<Prefix> prefixes(const RunRequest& request, const RunReport& report, const Watch& watch = {});

/// As SVG. Giles' four panels; variance x work over the exponent; mean and standard error over the samples.
std::string picture(const SurveyReport& report);
std::string picture(const TradeoffReport& report);
std::string picture(const RunReport& report, const std::vector<Prefix>& prefixes);

}  // namespace debias::commands

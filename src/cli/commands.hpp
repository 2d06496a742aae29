#pragma once

// The commands of the program; each returns its exit code. What they throw is turned into one in main.cpp.

#include <cstdint>
#include <string>

#include <debias/core/estimate.hpp>
#include <debias/diagnostics.hpp>

#include "../catalog.hpp"
#include "../catalog/validation.hpp"
#include "arguments.hpp"

namespace debias::cli {

int list(const Arguments& arguments);
int run(const Arguments& arguments);
int replay(const Arguments& arguments);
int validate(const Arguments& arguments);

/// All that `run` has to say.
struct Run {
  const catalog::Problem* problem;
  catalog::Choice choice;
  Statistics statistics;
  Interval interval;
  Verdict verdict;
  double z;
};

/// All that `replay` has to say.
struct Replay {
  const catalog::Problem* problem;
  catalog::Choice choice;
  std::uint64_t seed;
  std::int64_t index;
  Trace<double> trace;
};

/// All that `validate` has to say.
struct Validation {
  catalog::Report report;
  std::int64_t samples;
  std::uint64_t seed;
  double seconds;
};

/// The cells that were not judged.
struct Counts {
  std::int64_t biased = 0;
  std::int64_t refused = 0;
  std::int64_t underpowered = 0;
};
Counts count(const catalog::Report& report);

/// The law as the command line spells it; empty for an estimator without one.
std::string law_text(const catalog::Choice& choice);

}  // namespace debias::cli

#pragma once

// The biased baseline that everyone knows, with a driver of its own: a target error instead of samples.

#include <cstdint>
#include <iosfwd>

#include <debias/multilevel.hpp>

#include "fields.hpp"
#include "run.hpp"
#include "store.hpp"

namespace debias::commands {

struct MultilevelRequest {
  const catalog::Problem* problem = nullptr;
  double error = 0;  ///< root mean square, bias included
  std::uint64_t seed = 1;
  int threads = 0;
  Ranks ranks = {};
};

struct MultilevelReport {
  const catalog::Problem* problem;
  MultilevelStatistics statistics;
};

/// The request of a run whose estimator is to be multilevel. Throws BadRequest for what that does not have.
MultilevelRequest multilevel_of(const RunRequest& request);

/// Keeps the draws of each level.
MultilevelReport multilevel(const MultilevelRequest& request, const Caller& caller = {});

/// Brief, or all of it.
void print(std::ostream& out, const MultilevelReport& report, bool full = false);
Fields fields(const MultilevelReport& report);

}  // namespace debias::commands

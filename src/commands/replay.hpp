#pragma once

// One sample of a run again, with every level that it touched.

#include <cstdint>
#include <iosfwd>

#include <debias/core/estimate.hpp>

#include "fields.hpp"
#include "request.hpp"

namespace debias::commands {

struct ReplayRequest {
  const catalog::Problem* problem = nullptr;
  Shape shape = {};
  std::uint64_t seed = 1;
  std::int64_t sample = 0;  ///< its index
};

struct ReplayReport {
  const catalog::Problem* problem;
  catalog::Choice choice;
  std::uint64_t seed;
  std::int64_t index;
  Trace<double> trace;
};

/// Throws BadRequest for a PMF by recipe: a replay needs the PMF itself.
ReplayReport replay(const ReplayRequest& request);

void print(std::ostream& out, const ReplayReport& report);
Fields fields(const ReplayReport& report);

}  // namespace debias::commands

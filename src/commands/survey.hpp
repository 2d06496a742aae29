#pragma once

// The levels of a problem, measured: decay, growth, and whether a PMF exists.

#include <cstdint>
#include <iosfwd>

#include <debias/survey.hpp>

#include "fields.hpp"
#include "request.hpp"

namespace debias::commands {

struct SurveyRequest {
  const catalog::Problem* problem = nullptr;
  std::int64_t first = 0;
  std::int64_t levels = 10;       ///< first ... first + levels - 1
  std::int64_t samples = 10'000;  ///< draws of each level
  std::uint64_t seed = 1;
  int threads = 0;
};

struct SurveyReport {
  const catalog::Problem* problem;
  std::int64_t samples;
  Survey survey;
};

/// The levels that are complete, where `watch` ends it.
SurveyReport survey(const SurveyRequest& request, const Watch& watch = {});

/// Brief, or all of it.
void print(std::ostream& out, const SurveyReport& report, bool full = false);
Fields fields(const SurveyReport& report);

}  // namespace debias::commands

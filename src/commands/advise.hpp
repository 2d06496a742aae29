#pragma once

// What a pilot would choose: base level, PMF and strata, and what they are worth.

#include <iosfwd>

#include <debias/recipe.hpp>

#include "fields.hpp"
#include "request.hpp"

namespace debias::commands {

struct AdviseRequest {
  const catalog::Problem* problem = nullptr;
  Shape shape = {};  ///< what it gives is not left to the pilot; it gives no PMF
  Sampling sampling = {};
};

struct AdviceReport {
  const catalog::Problem* problem;
  Advice advice;
};

AdviceReport advise(const AdviseRequest& request, const Watch& watch = {});

/// Brief, or all of it.
void print(std::ostream& out, const AdviceReport& report, bool full = false);
Fields fields(const AdviceReport& report);

}  // namespace debias::commands

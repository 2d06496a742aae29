#pragma once

// Results of the library as fields of a report.

#include <debias/core/no_pmf.hpp>
#include <debias/core/result.hpp>
#include <debias/core/verdict.hpp>
#include <debias/recipe.hpp>
#include <debias/survey.hpp>

#include "catalog.hpp"
#include "fields.hpp"

namespace debias::commands {

/// Which problem, estimator, PMF, base level and block; a problem of the user's own has no id.
Fields describe(const catalog::Problem& problem, const catalog::Choice& choice);
Fields describe(const catalog::Problem& problem);
Fields describe(const Interval& interval);
Fields describe(const LevelRow& row);
Fields describe(const RunVerdict& verdict);
Fields describe(const Coupling& coupling);
/// A value that is not finite: faster than any rate, as `kind` says, or not known.
Fields describe(const MeasuredRates& rates);
Fields describe(const Advice& advice);
/// What a refusal rests on; an error that is not known is null.
Fields describe(const NoPmfError& refusal);

}  // namespace debias::commands

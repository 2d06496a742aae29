#pragma once

// What an advice says in words.

#include <vector>

#include <debias/recipe.hpp>

namespace debias {

/// Puts the sentences and warnings of an advice with a PMF, or of one without, into it.
void describe(Advice& advice);
void describe_none(Advice& advice);
/// The warnings of an advice that its result has not.
std::vector<Warning> doubts_beside(const Advice& advice, const Statistics& result);

}  // namespace debias

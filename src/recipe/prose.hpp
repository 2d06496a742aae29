#pragma once

// What an advice says in words.

#include <debias/recipe.hpp>

namespace debias {

/// Puts the sentences and warnings of an advice with a PMF, or of one without, into it.
void describe(Advice& advice);
void describe_none(Advice& advice);
/// Takes back a pilot's doubt of the second moments that the samples have answered.
void drop_answered(Statistics& statistics, const RunVerdict& verdict);

}  // namespace debias

#pragma once

// What an advice says in words.

#include <debias/recipe.hpp>

namespace debias {

/// Puts the sentences and warnings of an advice with a PMF, or of one without, into it.
void describe(Advice& advice);
void describe_none(Advice& advice);

}  // namespace debias

#pragma once

#include <debias/recipe.hpp>

#include "catalog.hpp"

namespace debias::testing {

/// The run of a problem of the catalogue that follows an advice on that plan.
inline Statistics run_by(const Advice& advice, const catalog::Problem& p, const Plan& plan) {
  const auto method =
      advice.base == Base::every_sample ? catalog::Method::single_term : catalog::Method::single_term_outcome;
  return p.run({method, advice.pmf, advice.base_level, "", advice.block, advice.points}, detail::plan_of(plan, advice));
}

}  // namespace debias::testing

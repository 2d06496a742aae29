#pragma once

// From a choice to the estimator that it names.

#include <stdexcept>

#include <debias/core/sequence.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/estimators/truncated.hpp>

#include "../catalog.hpp"

namespace debias::catalog::detail {

/// Calls `use` with the estimator that a choice names.
template <BiasedSequence S, class Use>
void with_estimator(const S& sequence, const Choice& c, const Use& use) {
  switch (c.method) {
    case Method::single_term:
    case Method::single_term_outcome: {
      const Base base = c.method == Method::single_term ? Base::every_sample : Base::one_outcome;
      const auto member = single_term(sequence, c.pmf, {.base_level = c.base_level, .base = base});
      const bool counts = c.points == Points::nets && c.pmf.block() > 0;
      return c.block > 1 ? use(stratified(member, c.block, counts ? Strata::residual : Strata::systematic, c.points))
                         : use(member);
    }
    case Method::independent_sum:
      return use(independent_sum(sequence, c.pmf, {.base_level = c.base_level}));
    case Method::roulette:
      throw std::invalid_argument(
          "roulette: this problem has levels, not terms in order (roulette needs a series); try independent_sum");
    case Method::truncated:
      break;
  }
  return use(truncated(sequence, c.base_level));
}

}  // namespace debias::catalog::detail

#pragma once

// The estimators that are wrong on purpose (catalog/wrong.hpp) with what tests of estimators claim of them.

#include <cmath>
#include <cstdint>
#include <utility>

#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/sequence.hpp>

#include "catalog/wrong.hpp"
#include "estimators/sequences.hpp"
#include "laws/estimator_laws.hpp"

namespace debias::trial {

/// A shared base made of one residue of the comb only: its offset is not uniform.
struct OneResidue : Comb {
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    Stream copy(rng);
    SharedDraw<double> draw = Comb::shared(level, base_level, rng);
    draw.base = residue(copy.uniform(), std::int64_t{1} << level, std::int64_t{1} << (level - base_level), 0);
    return draw;
  }
};

/// The estimator scaled by three times the smallest bias that the plan shows at `z_limit` standard errors.
template <Estimator E>
Scaled<E> scaled_detectably(const E& estimator, double truth, const Plan& plan, double z_limit) {
  const double detectable = z_limit * estimate(estimator, plan).standard_error;
  return {estimator, 1 + 3 * detectable / truth};
}

/// Does the law suite see that it is biased?
template <Estimator E>
bool rejected(const E& wrong, double truth) {
  return laws::names(laws::estimator_laws(wrong, truth, {.repeats = 0}), "unbiased");
}

/// The claim that a run has this variance, at 4.5 standard errors.
inline bool has_variance(const Statistics& s, double exact) {
  const double error = exact * std::sqrt((s.moments.kurtosis() - 1) / static_cast<double>(s.samples));
  return std::abs(s.moments.variance() - exact) <= 4.5 * error;
}

}  // namespace debias::trial

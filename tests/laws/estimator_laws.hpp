#pragma once

// What every estimator must satisfy, as a list of the claims that failed:
//
//   CHECK(laws::estimator_laws(e, truth) == laws::Failures{});
//
//   replay     the same sample gives the same bits, and trace gives those of a run
//   record     work is positive and the sum over what a sample reports, its level the deepest of it
//   unbiased   |mean - truth| is within z_limit standard errors
//   honest     over many seeds, z = (mean - truth) / standard error has mean 0 and standard deviation 1; this
//              takes a fourth moment, and enough samples for the standard error to settle
//
// Where the standard error is below rounding (an estimator without variance), rounding takes its place.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/value.hpp>

#include "failures.hpp"

namespace debias::laws {

struct EstimatorLawOptions {
  std::int64_t samples = 1 << 16;
  std::uint64_t seed = 1;
  double z_limit = 4.5;
  std::int64_t repeats = 200;  ///< seeds for the honesty of the standard error
  std::int64_t samples_per_repeat = 1024;
  double spread_tolerance = 0.225;  ///< of the standard deviation of z: 4.5 / sqrt(2 x 200)
  double rounding = 1e-13;          ///< relative to the truth
};

namespace detail {

template <Value V>
std::vector<double> components_of(const V& v) {
  std::vector<double> all(component_count(v));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = component(v, i);
  return all;
}

/// A sample, whatever its type of value.
struct TracedSample {
  std::vector<double> value;
  double work = 0;
  std::int64_t level = 0;
  std::vector<TracedLevel> levels;
};

/// An estimator of any type: the laws are compiled once.
struct AnyEstimator {
  std::int64_t block = 1;
  std::function<Statistics(const Plan& plan)> run;
  std::function<TracedSample(std::uint64_t seed, std::int64_t index)> trace;
};

Failures estimator_laws(const AnyEstimator& estimator, const std::vector<double>& truth,
                        const EstimatorLawOptions& options);

}  // namespace detail

/// Every broken law in words; empty when all are kept.
template <Estimator E>
Failures estimator_laws(const E& e, const estimate_value_t<E>& truth, const EstimatorLawOptions& options = {}) {
  const auto traced = [&e](std::uint64_t seed, std::int64_t index) {
    auto one = trace(e, seed, index);
    return detail::TracedSample{detail::components_of(one.sample.value), one.sample.work, one.sample.level,
                                std::move(one.levels)};
  };
  return detail::estimator_laws(
      {debias::detail::pieces_of(e).block,
       [&e](const Plan& plan) -> Statistics { return debias::detail::statistics_of(e, plan); }, traced},
      detail::components_of(truth), options);
}

}  // namespace debias::laws

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

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include <debias/core/accumulator.hpp>
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

template <Estimator E>
class EstimatorLaws {
 public:
  using V = estimate_value_t<E>;

  EstimatorLaws(const E& estimator, const V& truth, const EstimatorLawOptions& options)
      : estimator_(estimator), truth_(truth), options_(options), block_(debias::detail::pieces_of(estimator).block) {}

  Failures check() {
    replay();
    unbiased();
    honest();
    return std::move(failures_);
  }

 private:
  template <class... Parts>
  void fail(const Parts&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    failures_.push_back(text.str());
  }

  void replay() {
    for (std::int64_t i = 0; i < 64; ++i) {
      const auto one = trace(estimator_, options_.seed, i * block_);
      const auto two = trace(estimator_, options_.seed, i * block_);
      const auto run = estimate(estimator_, {.samples = 1, .seed = options_.seed, .first = i * block_, .threads = 1});
      for (std::size_t c = 0; c < component_count(one.sample.value); ++c) {
        const auto bits = [c](const V& v) { return std::bit_cast<std::uint64_t>(component(v, c)); };
        if (bits(one.sample.value) != bits(two.sample.value)) return fail("replay: sample ", i, " has other bits");
        if (component(one.sample.value, c) != run.components[c].mean) {
          return fail("replay: trace and a run differ at sample ", i);
        }
      }
      if (one.sample.level != two.sample.level) return fail("replay: sample ", i, " has another level");
      const double work = one.sample.work;
      if (!(work > 0) || !std::isfinite(work)) return fail("record: the work of sample ", i, " is ", work);
      if (one.levels.empty()) continue;  // an estimator may keep no record
      std::int64_t deepest = 0;
      double recorded = 0;
      for (const TracedLevel& level : one.levels) {
        deepest = std::max(deepest, level.level);
        recorded += level.work;
      }
      if (deepest != one.sample.level) return fail("record: the level of sample ", i, " is not the deepest");
      if (std::abs(recorded - work) > 1e-12 * work)
        return fail("record: the levels of sample ", i, " add up to another work");
    }
  }

  /// (mean - truth) / standard error; 0 when the difference is rounding.
  double z(const Result<V>& result, std::size_t c) const {
    const ComponentEstimate& e = result.components[c];
    const double truth = component(truth_, c);
    return (e.mean - truth) / std::max(e.standard_error, options_.rounding * std::abs(truth));
  }

  void unbiased() {
    const Result<V> result = estimate(estimator_, {.samples = options_.samples * block_, .seed = options_.seed});
    for (std::size_t c = 0; c < component_count(truth_); ++c) {
      if (std::abs(z(result, c)) <= options_.z_limit) continue;
      fail("unbiased: component ", c, " is ", result.components[c].mean, ", ", z(result, c), " standard errors from ",
           component(truth_, c));
    }
  }

  void honest() {
    std::vector<std::vector<double>> columns(component_count(truth_));
    for (std::int64_t r = 1; r <= options_.repeats; ++r) {
      const std::uint64_t seed = options_.seed + static_cast<std::uint64_t>(r);
      const Result<V> result = estimate(estimator_, {.samples = options_.samples_per_repeat * block_, .seed = seed});
      for (std::size_t c = 0; c < columns.size(); ++c) {
        if (result.components[c].standard_error > options_.rounding * std::abs(component(truth_, c))) {
          columns[c].push_back(z(result, c));
        } else if (std::abs(z(result, c)) > 1) {
          return fail("honest: no standard error, but component ", c, " is wrong at seed ", seed);
        }
      }
    }
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (columns[c].empty()) continue;
      const Moments m = Moments::of(columns[c]);
      const double centre_limit = options_.z_limit / std::sqrt(static_cast<double>(m.count));
      if (!(std::abs(m.mean) <= centre_limit)) fail("honest: z of component ", c, " has mean ", m.mean);
      const double spread = std::sqrt(m.variance());
      if (!(std::abs(spread - 1) <= options_.spread_tolerance)) {
        fail("honest: z of component ", c, " has standard deviation ", spread);
      }
    }
  }

  const E& estimator_;
  const V& truth_;
  EstimatorLawOptions options_;
  std::int64_t block_;  // the options count blocks
  Failures failures_;
};

}  // namespace detail

/// Every broken law in words; empty when all are kept.
template <Estimator E>
Failures estimator_laws(const E& estimator, const estimate_value_t<E>& truth, const EstimatorLawOptions& options = {}) {
  return detail::EstimatorLaws<E>(estimator, truth, options).check();
}

}  // namespace debias::laws

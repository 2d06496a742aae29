#include "laws/estimator_laws.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>

#include <debias/core/accumulator.hpp>

namespace debias::laws::detail {
namespace {

class EstimatorLaws {
 public:
  EstimatorLaws(const AnyEstimator& estimator, const std::vector<double>& truth, const EstimatorLawOptions& options)
      : estimator_(estimator), truth_(truth), options_(options), block_(estimator.block) {}

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
      const TracedSample one = estimator_.trace(options_.seed, i * block_);
      const TracedSample two = estimator_.trace(options_.seed, i * block_);
      const Statistics run = estimator_.run({.samples = 1, .seed = options_.seed, .first = i * block_, .threads = 1});
      for (std::size_t c = 0; c < one.value.size(); ++c) {
        const auto bits = [c](const TracedSample& s) { return std::bit_cast<std::uint64_t>(s.value[c]); };
        if (bits(one) != bits(two)) return fail("replay: sample ", i, " has other bits");
        if (one.value[c] != run.components[c].mean) return fail("replay: trace and a run differ at sample ", i);
      }
      if (one.level != two.level) return fail("replay: sample ", i, " has another level");
      if (!(one.work > 0) || !std::isfinite(one.work)) {
        return fail("record: the work of sample ", i, " is ", one.work);
      }
      if (one.levels.empty()) continue;  // an estimator may keep no record
      std::int64_t deepest = 0;
      double recorded = 0;
      for (const TracedLevel& level : one.levels) {
        deepest = std::max(deepest, level.level);
        recorded += level.work;
      }
      if (deepest != one.level) return fail("record: the level of sample ", i, " is not the deepest");
      if (std::abs(recorded - one.work) > 1e-12 * one.work) {
        return fail("record: the levels of sample ", i, " add up to another work");
      }
    }
  }

  /// (mean - truth) / standard error; 0 when the difference is rounding.
  double z(const Statistics& run, std::size_t c) const {
    const ComponentEstimate& e = run.components[c];
    return (e.mean - truth_[c]) / std::max(e.standard_error, options_.rounding * std::abs(truth_[c]));
  }

  void unbiased() {
    const Statistics run = estimator_.run({.samples = options_.samples * block_, .seed = options_.seed});
    for (std::size_t c = 0; c < truth_.size(); ++c) {
      if (std::abs(z(run, c)) <= options_.z_limit) continue;
      fail("unbiased: component ", c, " is ", run.components[c].mean, ", ", z(run, c), " standard errors from ",
           truth_[c]);
    }
  }

  void honest() {
    std::vector<std::vector<double>> columns(truth_.size());
    for (std::int64_t r = 1; r <= options_.repeats; ++r) {
      const std::uint64_t seed = options_.seed + static_cast<std::uint64_t>(r);
      const Statistics run = estimator_.run({.samples = options_.samples_per_repeat * block_, .seed = seed});
      for (std::size_t c = 0; c < columns.size(); ++c) {
        if (run.components[c].standard_error > options_.rounding * std::abs(truth_[c])) {
          columns[c].push_back(z(run, c));
        } else if (std::abs(z(run, c)) > 1) {
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

  const AnyEstimator& estimator_;
  const std::vector<double>& truth_;
  EstimatorLawOptions options_;
  std::int64_t block_;  // the options count blocks
  Failures failures_;
};

}  // namespace

Failures estimator_laws(const AnyEstimator& estimator, const std::vector<double>& truth,
                        const EstimatorLawOptions& options) {
  return EstimatorLaws(estimator, truth, options).check();
}

}  // namespace debias::laws::detail

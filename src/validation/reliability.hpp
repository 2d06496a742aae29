#pragma once

// The figures by which an unbiased estimator is trusted, measured: each with the threshold that it must keep.
//
// A figure that could not fail says nothing, so estimators that are wrong on purpose are among them, and must be
// rejected. Thresholds: the family-wise rate of validation.hpp for z; exact binomial bands at 1e-6 for shares; 4.5 standard
// errors for a single claim.

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include <debias/core/result.hpp>
#include <debias/pmf/any.hpp>

#include "catalog.hpp"

namespace debias::validation {

struct Figure {
  std::string name;
  std::string measured;
  std::string demanded;  ///< empty: reported, not judged
  bool holds = true;
};

struct ReliabilityPlan {
  std::int64_t samples = 1'000'000;    ///< of each cell of the catalogue
  std::int64_t replications = 10'000;  ///< of each regime
  std::uint64_t seed = 1;              ///< published
  std::uint64_t fresh_seed = 20261125;
  int threads = 0;
  std::function<bool(std::string_view what)> progress = {};  ///< false ends it (Interrupted)
};

/// All figures that one process can measure; `show` sees each as it is known.
std::vector<Figure> reliability(const ReliabilityPlan& plan, const std::function<void(const Figure&)>& show = {});

/// P(the largest distance of the empirical distribution is larger), Kolmogorov's series, of numbers that should be
/// uniform on (0, 1).
double kolmogorov_smirnov(std::vector<double> uniforms);
/// The standard normal distribution function.
double normal_cdf(double x);

/// The geometric PMF rho = beta / (2 (1 - index)) under which differences with E D^2 ~ 2^(-beta k) that scale give
/// samples with this tail index.
AnyPmf pmf_with_tail_index(const catalog::Problem& problem, double index);

/// What intervals at 95 % did over replications.
struct Coverage {
  std::int64_t replications = 0;
  std::int64_t low = 0;   ///< intervals below the truth
  std::int64_t high = 0;  ///< above
  double mean_z = 0;
  double spread_z = 0;  ///< standard deviation of (mean - truth) / standard error
  [[nodiscard]] double covered() const {
    return 1 - static_cast<double>(low + high) / static_cast<double>(replications);
  }
};
/// Runs once for each seed 1 ... replications, on all cores; `run` must be safe to call at once.
Coverage coverage(const std::function<Statistics(std::uint64_t seed)>& run, double truth, std::int64_t replications,
                  int threads = 0);

/// Estimators that are wrong in one way each, and the right ones beside them.
struct Suspect {
  std::string name;
  bool wrong = true;
  double truth = 0;
  std::function<Statistics(const Plan&)> run;
};
const std::vector<Suspect>& suspects();

/// What estimators do with values that are not finite, denormal, or thrown: the claims that failed.
std::vector<std::string> failures_on_nonfinite_values();

}  // namespace debias::validation

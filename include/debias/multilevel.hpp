#pragma once

// Multilevel Monte Carlo, the biased baseline that everyone knows: fixed levels 0 ... L, as many draws of each as a
// target error asks for, and one more level as long as the remaining bias is too large.
//
//   estimate = sum_l mean(D_l),  N_l = sqrt(V_l / C_l) sum_k sqrt(V_k C_k) / ((1 - s) error^2)
//   bias     = min_k (|m_(L-k)| + 2 se) 2^(-alpha k) / (2^alpha - 1) <= sqrt(s) error, m_l = mean(D_l), k = 0, 1, 2
//              but no less than the same with - 2 se for any k
//
//   Notation: V = variance, C = work of a draw of D_l; s = bias_share; alpha, beta = decay of |E D_l| and V_l.
// A pilot of each level, of samples of its own, runs until 32 effective hits or until it costs as much as the run; the
// N_l are fixed from its variances (1 + 2 / sqrt(hits)) and drawn afresh. alpha comes from the last four levels and lies
// in [1/2, 1], or below half of a declared beta. Met only if root mean square of bias and error are within the goal,
// with at least four levels, all of which have shown their variance. It knows nothing of levels that it has not seen. The
// estimator of choice where beta <= gamma.
// Source: Giles, Acta Numerica 24 (2015), with the constants of its reference driver.

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/survey/levels.hpp>

namespace debias {

struct MultilevelOptions {
  double bias_share = 0.25;         ///< of the squared error
  std::int64_t first_draws = 1000;  ///< of the pilot of a new level
  std::int64_t most_levels = 24;    ///< fewer where the sequence cannot draw so many
};

/// One level of a finished run.
struct MultilevelRow {
  std::int64_t level = 0;
  std::int64_t draws = 0;
  double difference = 0;  ///< mean D_l; by norm, for a value with several components
  double variance = 0;    ///< of D_l; the sum over components
  double work = 0;        ///< of a draw
};

struct MultilevelStatistics {
  std::vector<ComponentEstimate> components;  ///< mean and standard error; no variance of one sample
  double goal = 0;                            ///< the error that was asked for
  double bias = 0;                            ///< estimated size of what is left out
  bool converged = false;                     ///< false: the goal is missed, or a level has not shown its variance
  double alpha = 0;
  double beta = 0;
  double work = 0;  ///< of pilots and run
  double seconds = 0;
  double pilot_work = 0;  ///< of `work`, the pilots, which the draws of the run are planned from; no part of the mean
  double pilot_seconds = 0;  ///< of `seconds`
  std::uint64_t seed = 0;
  std::vector<Warning> warnings;
  std::vector<MultilevelRow> rows;

  /// Root of variance and squared bias together; its norm, for several components.
  [[nodiscard]] double error() const;
  /// That is at most the goal, with the levels that it takes.
  [[nodiscard]] bool goal_met() const { return converged && error() <= goal; }
};

/// Mean, bias, goal, work, seconds and warnings; the levels, too, by `full` (core/report.hpp).
std::ostream& operator<<(std::ostream& out, const MultilevelStatistics& statistics);
void print_full(std::ostream& out, const MultilevelStatistics& statistics);

/// A root mean square error of `error`, by draws from the pilot streams of plan.seed; plan.samples is not used.
/// Throws std::invalid_argument unless error and options are positive, or for draws that are not finite, and what the
/// sequence throws (SampleError).
MultilevelStatistics multilevel(const LevelRuns& runs, double error, const Plan& plan = {},
                                const MultilevelOptions& options = {});

template <BiasedSequence S>
MultilevelStatistics multilevel(const S& sequence, double error, const Plan& plan = {},
                                const MultilevelOptions& options = {}) {
  return debias::multilevel(debias::level_runs(sequence), error, plan, options);
}

template <class S>
requires(!BiasedSequence<S>) auto multilevel(const S& /*sequence*/, double /*error*/, const Plan& /*plan*/ = {},
                                             const MultilevelOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_levels<S>(), S>();
}

}  // namespace debias

#pragma once

// What a run answers: the mean with its own doubt.
//
//   standard error = sqrt(variance / samples), efficiency = 1 / (variance x seconds per sample)
//
//   Notation: a block is the samples that an estimator draws from one stream (stratified), 1 for most; blocks are
//   independent, and their means are what moments, tails and the standard error are of.
//
// Assumes a finite variance: without it the mean is still unbiased, but the standard error, the interval and
// the efficiency are not to be trusted, and too small most of the time. `verdict` says whether it is; a warning
// names a single sample that dominates, or a sample variance that is itself too uncertain.

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/coupling.hpp>
#include <debias/core/plan.hpp>
#include <debias/core/report.hpp>
#include <debias/core/run_state.hpp>
#include <debias/core/value.hpp>
#include <debias/core/verdict.hpp>
#include <debias/core/warning.hpp>

namespace debias {

struct Interval {
  double low = 0;
  double high = 0;
  double confidence = 0.95;
};

/// What a run knows of one level, or of the octave [level, last_level] beyond level 63.
struct LevelRow {
  std::int64_t level = 0;
  std::int64_t last_level = 0;
  bool is_base = false;
  std::int64_t count = 0;
  double mean = 0;           ///< of the unweighted difference (of the value, for the base)
  double second_moment = 0;  ///< E D^2
  double kurtosis = 0;       ///< E D^4 / (E D^2)^2
  double work = 0;           ///< per draw
  /// What the estimator divides a difference of this level by; 0 for the base, an octave, or where unknown.
  double probability = 0;
};

/// One component of the estimate.
struct ComponentEstimate {
  double mean = 0;
  double variance = 0;  ///< of one sample; in blocks, that of the mean of a block times its samples
  double standard_error = 0;
};

/// Everything about a run that does not depend on the type of its values.
struct Statistics {
  std::string estimator;
  std::string name;  ///< that `named` gave the estimator; empty where it has none
  std::uint64_t seed = 0;
  std::int64_t first = 0;
  std::int64_t samples = 0;  ///< blocks x block
  std::int64_t blocks = 0;
  std::int64_t block = 1;  ///< samples of a block
  std::vector<ComponentEstimate> components;
  Moments moments;     ///< of the scalar of a sample, or of the mean of a block: the value itself, or its norm
  double work = 0;     ///< total, the pilot's too
  double seconds = 0;  ///< likewise
  std::vector<LevelRow> levels;
  std::vector<LargeSample> largest;  ///< by magnitude, at most 32
  std::vector<double> upper_tail;    ///< at most 4096, descending
  std::vector<double> lower_tail;    ///< at most 4096, ascending
  std::int64_t nonfinite = 0;        ///< samples, or blocks of them
  std::int64_t first_nonfinite = -1;
  BiasBound bias_bound;  ///< stated by a sequence that ends somewhere; size 0 for an unbiased estimator
  Coupling coupling;     ///< of the levels, where their draws have values
  std::vector<Warning> warnings;
  int fewer_threads = 0;     ///< that drew, where as many as asked for could not be had; else 0
  Goal goal;                 ///< that was asked for
  double pilot_work = 0;     ///< of `work`, what a pilot took that chose the estimator or its samples
  double pilot_seconds = 0;  ///< of `seconds`
  RunState state;
  Masses masses;                         ///< of the levels, where the estimator knows them
  std::vector<LevelFacts> pilot_levels;  ///< what a pilot saw of the same sequence; speaks for the verdict only
  SequenceFacts sequence;                ///< what the sequence states of itself

  /// Two-sided interval of Student's t, widened by what levels with a mass but hardly a draw may add. Throws std::invalid_argument unless 0 < confidence < 1.
  [[nodiscard]] Interval interval(double confidence = 0.95, std::size_t component = 0) const {
    return interval(verdict(), confidence, component);
  }
  /// The same by a verdict of this result that one has: each takes milliseconds.
  [[nodiscard]] Interval interval(const RunVerdict& verdict, double confidence = 0.95, std::size_t component = 0) const;
  /// Standard error of the mean; its norm, for a value with several components.
  [[nodiscard]] double total_error() const;
  /// Norm of the mean.
  [[nodiscard]] double norm() const;
  /// Standard error and stated bias together, sqrt(total_error()^2 + bias_bound.size^2): what a goal is judged by.
  [[nodiscard]] double goal_error() const;
  /// Whether a warning says that the mean is biased: by levels that do not fit together, or draws that do not follow their PMF.
  [[nodiscard]] bool has_wrong_mean() const;
  /// False when a goal was asked for and missed, the mean is biased, or there is no number to judge.
  [[nodiscard]] bool goal_met() const;
  /// 1 / (variance x seconds per sample), the pilot's seconds among them, with the sum of the variances of all components; infinite for an
  /// estimator without variance.
  [[nodiscard]] double efficiency() const;
  /// Is the variance finite, and can the interval be trusted? From the levels and the largest samples of this run.
  [[nodiscard]] RunVerdict verdict() const { return judge(*this); }
  /// Of the samples alone, without the pilot.
  [[nodiscard]] double work_per_sample() const { return (work - pilot_work) / static_cast<double>(samples); }
};

/// The answer of `estimate`.
template <Value V>
struct Result : Statistics {
  Result(Statistics statistics, const V& shape)
      : Statistics(std::move(statistics)), mean(as_mean(shape)), standard_error(as_mean(shape)) {
    for (std::size_t i = 0; i < components.size(); ++i) {
      set_component(mean, i, components[i].mean);
      set_component(standard_error, i, components[i].standard_error);
    }
  }

  mean_t<V> mean;
  mean_t<V> standard_error;  ///< of each component

 private:
  static mean_t<V> as_mean(const V& shape) {
    if constexpr (RealValue<V> || ComplexValue<V>) {
      return {};
    } else {
      return shape;
    }
  }
};

}  // namespace debias

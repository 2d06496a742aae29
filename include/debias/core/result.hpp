#pragma once

// What is asked of a run (Plan) and what it answers (Result): the mean with its own doubt.
//
//   standard error = sqrt(variance / samples), efficiency = 1 / (variance x seconds per sample)
//
// Assumes a finite variance: without it the mean is still unbiased, but the standard error, the interval and
// the efficiency are not to be trusted, and too small most of the time. `verdict` says whether it is; a warning
// names a single sample that dominates, or a sample variance that is itself too uncertain.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <typeinfo>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/coupling.hpp>
#include <debias/core/report.hpp>
#include <debias/core/value.hpp>
#include <debias/core/verdict.hpp>
#include <debias/core/warning.hpp>

namespace debias {

class RunState;
namespace detail {
class Ranks;  // src/core/ranks.hpp
}

/// What was drawn to choose an estimator or its samples: it counts in the work and the seconds of the result, not in its
/// mean.
struct PilotCost {
  double work = 0;
  double seconds = 0;

  PilotCost& operator+=(const PilotCost& other) {
    work += other.work;
    seconds += other.seconds;
    return *this;
  }
};

/// A wish that a pilot, on streams of its own, turns into a number of samples before the run starts: at most one of
/// the three. A run that stopped when its error looks small would stop just before the rare large sample.
struct Goal {
  double error = 0;  ///< root of squared standard error and squared stated bias; its norm, for several components
  double relative_error = 0;  ///< the same, in units of the mean
  double seconds = 0;         ///< of pilot and run together

  /// Aimed at, in units of the wish, so that noise does not miss it.
  static constexpr double aim = 0.95;

  [[nodiscard]] bool asked() const { return error != 0 || relative_error != 0 || seconds != 0; }
};

/// Which samples to run: [first, first + samples) of `seed`. Threads change nothing but the time.
struct Plan {
  std::int64_t samples = std::int64_t{1} << 16;
  std::uint64_t seed = 1;
  std::int64_t first = 0;
  int threads = 0;  ///< 0: as many as the machine has
  /// Called on the calling thread with the number of finished samples; return false to give up (Interrupted).
  std::function<bool(std::int64_t done)> progress = {};
  Goal goal = {};  ///< takes the place of `samples`, which then says how long its first pilot is: 1/8, 64 to 1024
  /// Called on the calling thread about once a second, where the run ends and where it is interrupted, with the sums of
  /// the finished chunks and the plan that they belong to: what a later run with `earlier` goes on from.
  std::function<void(const RunState& finished, const Plan& plan)> save = {};
  /// Chunks that are not drawn again. Throws std::invalid_argument where they are not among the samples of the plan, or of
  /// another estimator.
  std::shared_ptr<const RunState> earlier = {};
  /// Spent before this run, by a recipe: counted in the result.
  PilotCost pilot = {};
  /// Samples of the run that these are a part of, a shard: they decide whether it can be drawn. 0: `samples`.
  std::int64_t whole = 0;
  detail::Ranks* ranks = nullptr;  ///< processes that share the samples, see mpi.hpp
};

/// Thrown when Plan::progress asks to stop: a part of a run whose end depended on the clock is not a result.
struct Interrupted : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A callable threw; what() says how to replay the sample, std::rethrow_if_nested gives the original.
class SampleError : public std::runtime_error {
 public:
  SampleError(const std::string& what, std::uint64_t seed, std::int64_t index)
      : std::runtime_error(what), seed_(seed), index_(index) {}
  [[nodiscard]] std::uint64_t seed() const { return seed_; }
  [[nodiscard]] std::int64_t index() const { return index_; }

 private:
  std::uint64_t seed_;
  std::int64_t index_;
};

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
  double variance = 0;  ///< of one sample
  double standard_error = 0;
};

/// Whose sums they are. Within a process an estimator is known by its type, everywhere by what it calls itself and by the
/// name that `named` gave it. Equal types over different data cannot be told apart: give them names.
struct Identity {
  std::string estimator = {};            ///< its description; empty where nothing is known
  std::string name = {};                 ///< empty where it was given none
  const std::type_info* type = nullptr;  ///< never in a file, nor sent to another rank

  [[nodiscard]] bool known() const { return !estimator.empty(); }
  /// Throws std::invalid_argument, with `who` in front, where `other` is known to be another estimator.
  void demand_same(const Identity& other, const std::string& who) const;
};

/// The sums of a run as the open nodes of a binary tree over its chunks of samples (absolute index): what two
/// results need in order to merge into the bits that one run would have given.
class RunState {
 public:
  /// Throws std::invalid_argument unless `chunk` is a power of two.
  explicit RunState(std::int64_t chunk);
  RunState() : RunState(default_chunk) {}

  /// Samples of a chunk.
  [[nodiscard]] std::int64_t chunk() const { return chunk_; }
  /// Adds the sums over samples [first, last) of one chunk, or of a part of it.
  void add_chunk(std::int64_t first, std::int64_t last, const Accumulator& sums);
  /// Adds another state. Throws std::invalid_argument where both hold the same samples, or are of two estimators.
  void merge(const RunState& other);

  [[nodiscard]] std::int64_t first() const;
  [[nodiscard]] std::int64_t last() const;
  /// True when [first, last) has no hole and no cut inside a chunk.
  [[nodiscard]] bool contiguous() const;
  [[nodiscard]] Accumulator total() const;
  using Range = std::pair<std::int64_t, std::int64_t>;
  /// The samples [first, second) that it does not hold, of `range`, a cut chunk counted as not held.
  [[nodiscard]] std::vector<Range> missing(Range range) const;
  /// Takes out the sums of the last chunk where it is cut before `end`, so that it can be drawn again; returns its end. The
  /// extremes keep its samples.
  std::int64_t reopen(std::int64_t end);

  Identity identity;
  Extremes extremes;
  double seconds = 0;  ///< of the runs that these sums are from, without their pilots
  PilotCost pilot;     ///< of these runs

 private:
  friend struct detail::Codec;
  struct Node {
    std::int64_t last = 0;
    std::int64_t chunks = 0;  // a power of two; 0 for a chunk that is not complete
    Accumulator sums;
  };
  void insert(std::int64_t first, Node node);

  std::int64_t chunk_;
  std::map<std::int64_t, Node> nodes_;  // by first sample
};

/// Everything about a run that does not depend on the type of its values.
struct Statistics {
  std::string estimator;
  std::string name;  ///< that `named` gave the estimator; empty where it has none
  std::uint64_t seed = 0;
  std::int64_t first = 0;
  std::int64_t samples = 0;
  std::vector<ComponentEstimate> components;
  Moments moments;     ///< of the scalar of a sample: the value itself, or its norm
  double work = 0;     ///< total, the pilot's too
  double seconds = 0;  ///< likewise
  std::vector<LevelRow> levels;
  std::vector<LargeSample> largest;  ///< by magnitude, at most 32
  std::vector<double> upper_tail;    ///< at most 4096, descending
  std::vector<double> lower_tail;    ///< at most 4096, ascending
  std::int64_t nonfinite = 0;
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
  [[nodiscard]] Interval interval(double confidence = 0.95, std::size_t component = 0) const;
  /// Standard error of the mean; its norm, for a value with several components.
  [[nodiscard]] double total_error() const;
  /// Norm of the mean.
  [[nodiscard]] double size() const;
  /// Standard error and stated bias together, sqrt(total_error()^2 + bias_bound.size^2): what a goal is judged by.
  [[nodiscard]] double goal_error() const;
  /// False when a goal was asked for and missed, or there is no number to judge.
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

#pragma once

// What is asked of a run: which samples, how many of them or how good an answer (Goal), and who is told while it goes on.
//
//   samples [first, first + samples) of `seed`; a Goal takes the place of their number
//
// Threads, ranks and interruptions change nothing but the time. Fails where a plan asks for what no run has: estimate
// throws std::invalid_argument before anything is drawn.

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <vector>

#include <debias/core/ranks.hpp>
#include <debias/statistics/evidence.hpp>

namespace debias {

class RunState;

/// What was drawn to choose an estimator or its samples: it counts in the work and the seconds of the result, and in what is
/// known of the levels, not in the mean.
struct PilotRun {
  double work = 0;
  double seconds = 0;
  std::vector<LevelFacts> levels;
  SequenceFacts sequence;  ///< what the sequence states of itself

  // In the library: inlined into a caller's temporary Plan, g++ 12 takes their vector for uninitialised.
  PilotRun();
  PilotRun(double work, double seconds, std::vector<LevelFacts> levels = {}, const SequenceFacts& sequence = {});
  PilotRun(const PilotRun& other);
  PilotRun(PilotRun&& other) noexcept;
  PilotRun& operator=(const PilotRun& other);
  PilotRun& operator=(PilotRun&& other) noexcept;
  ~PilotRun();

  PilotRun& operator+=(const PilotRun& other);
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

/// Which samples to run: [first, first + samples) of `seed`. Threads change nothing but the time. Where an estimator draws
/// its samples in blocks (`stratified`, recipes), these count samples too: `samples` is rounded up to whole blocks, `first`
/// is the first sample of a block.
struct Plan {
  std::int64_t samples = std::int64_t{1} << 16;
  std::uint64_t seed = 1;
  std::int64_t first = 0;  ///< throws std::invalid_argument inside a block
  int threads = 0;         ///< 0: as many as the machine has
  /// Called on the calling thread with the number of finished samples; return false to give up (Interrupted).
  std::function<bool(std::int64_t done)> progress = {};
  /// Takes the place of `samples`, which then says how long its first pilot is: 1/8 of them, 64 to 1024 blocks.
  Goal goal = {};
  /// Called on the calling thread about once a second, where the run ends and where it is interrupted, with the sums of
  /// the finished chunks and the plan that they belong to: what a later run with `earlier` goes on from.
  std::function<void(const RunState& finished, const Plan& plan)> save = {};
  /// Chunks that are not drawn again. Throws std::invalid_argument where they are not among the samples of the plan, or of
  /// another estimator.
  std::shared_ptr<const RunState> earlier = {};
  /// Spent before this run, by a recipe: counted in the result.
  PilotRun pilot = {};
  /// Samples of the run that these are a part of, a shard: they decide whether it can be drawn. 0: `samples`.
  std::int64_t whole = 0;
  Ranks ranks = {};  ///< the processes that share the samples: this one alone, or those of mpi.hpp
};

/// Thrown when Plan::progress asks to stop: a part of a run whose end depended on the clock is not a result.
struct Interrupted : std::runtime_error {
  using std::runtime_error::runtime_error;
};

namespace detail {
/// Throw std::invalid_argument for what no run has.
void check_plan(const Plan& plan);
void check_goal(const Goal& goal);
/// So many samples in whole blocks, rounded up; as they are where there are none, or too many for 64 bits.
std::int64_t whole_blocks(std::int64_t samples, std::int64_t block);
/// The plan with its samples in whole blocks.
Plan in_blocks(Plan plan, std::int64_t block);
/// Throws std::invalid_argument for a plan that begins or ends inside a block.
void check_blocks(const Plan& plan, std::int64_t block);
}  // namespace detail

}  // namespace debias

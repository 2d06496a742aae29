#pragma once

// One problem estimated, and the same run taken up later: longer, to a tighter goal, or joined from shards.

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/result.hpp>
#include <debias/diagnostics.hpp>
#include <debias/recipe.hpp>

#include "fields.hpp"
#include "request.hpp"

namespace debias::commands {

/// The i-th of so many parts of the samples: whole chunks of the estimator, the end of the run to the last one.
struct Shard {
  std::int64_t index = 1;
  std::int64_t of = 1;

  static constexpr std::int64_t most = 1 << 20;
};

struct RunRequest {
  const catalog::Problem* problem = nullptr;
  Shape shape = {};
  Sampling sampling = {};
  double confidence = 0.95;  ///< of the interval
  std::optional<Shard> shard = {};
  Goal served = {};                  ///< the goal whose pilot has fixed the samples, which the report names
  std::vector<Warning> doubts = {};  ///< of the recipe that has chosen the rest, which the report repeats
};

struct RunReport {
  const catalog::Problem* problem;
  catalog::Choice choice;
  std::optional<Advice> advice;  ///< that the choice follows
  Statistics statistics;
  RunVerdict evidence;  ///< on the variance, from what was drawn
  Interval interval;
  DeclaredFiniteness verdict;  ///< on the PMF, from the declared rates
  double z;                    ///< of the exact answer
};

/// What an earlier run has left: its sums, and the samples that it was asked for.
struct Earlier {
  std::shared_ptr<const RunState> sums = {};
  std::int64_t samples = 0;
};

/// Sees the sums as they grow, and the request that they answer: of the very run, its PMF and its samples.
using SaveRun = std::function<void(const RunRequest& now, const RunState& sums)>;

/// Throws BadRequest, what `watch` asks for (Interrupted), and what the sequence throws (SampleError).
RunReport run(const RunRequest& request, const Watch& watch = {}, const Earlier& earlier = {},
              const SaveRun& save = {});

/// The request with nothing left open but what a pilot chooses. Throws BadRequest as `run`.
RunRequest settled(const RunRequest& request);

/// A run that was kept.
struct KeptRun {
  RunRequest request;
  std::shared_ptr<const RunState> sums = {};  ///< null: no sample was finished
};

/// To go on with a run: as it was asked for, with more samples, or to another goal.
struct ResumeRequest {
  KeptRun kept;
  std::optional<std::int64_t> samples = {};  ///< in all, those that are kept included
  Goal goal = {};
  int threads = 0;
  Ranks ranks = {};
};
/// The request that `run` goes on with, from what is kept. Throws BadRequest.
std::pair<RunRequest, Earlier> extended(const ResumeRequest& request);

/// Shards, each with the name that a complaint calls it by.
struct MergeRequest {
  std::vector<std::pair<std::string, KeptRun>> shards;
  /// Whether two requests ask for the same run.
  std::function<bool(const RunRequest&, const RunRequest&)> same;
};
/// The whole. Throws BadPart where the shards are not all of one run.
KeptRun merged(const MergeRequest& request);

/// Brief, or all of it.
void print(std::ostream& out, const RunReport& report, bool full = false);
Fields fields(const RunReport& report);

}  // namespace debias::commands

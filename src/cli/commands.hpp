#pragma once

// The commands of the program; each returns its exit code. What they throw is turned into one in main.cpp.

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/diagnostics.hpp>
#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>
#include <debias/survey.hpp>

#include "../catalog.hpp"
#include "../catalog/validation.hpp"
#include "../numbers/numbers.hpp"
#include "arguments.hpp"

namespace debias::cli {

int list(const Arguments& arguments);
int run(const Arguments& arguments);
int resume(const Arguments& arguments);
int merge(const Arguments& arguments);
int replay(const Arguments& arguments);
int validate(const Arguments& arguments);
int validate_hard(const Arguments& arguments);
int validate_report(const Arguments& arguments);
int survey(const Arguments& arguments);
int tradeoff(const Arguments& arguments);
int diagnose(const Arguments& arguments);
int render_transmittance(const Arguments& arguments);
int render_photons(const Arguments& arguments);

// What a command finds out, for whoever wants to know: the program prints it, Python keeps it.

/// Sees what is being done and how much of how much (0: unknown); false ends it.
using Watch = std::function<bool(std::string_view what, double done, double total)>;

/// All that `run` has to say.
struct Run {
  const catalog::Problem* problem;
  catalog::Choice choice;
  std::optional<Advice> advice;  ///< that the choice follows
  Statistics statistics;
  Interval interval;
  Verdict verdict;
  double z;
};

/// All that `run --estimator multilevel` has to say.
struct MultilevelRun {
  const catalog::Problem* problem;
  MultilevelStatistics statistics;
};

/// All that a recipe has to say.
struct AdviceOn {
  const catalog::Problem* problem;
  Advice advice;
};

/// All that `replay` has to say.
struct Replay {
  const catalog::Problem* problem;
  catalog::Choice choice;
  std::uint64_t seed;
  std::int64_t index;
  Trace<double> trace;
};

/// All that `validate` has to say.
struct Validation {
  catalog::Report report;
  std::int64_t samples;
  std::uint64_t seed;
  double seconds;
};

/// One law of a sweep.
struct TradeoffPoint {
  AnyPmf law;
  MeasuredVerdict verdict;
  VarianceAndWork predicted;  ///< of one member
  bool measured = false;      ///< not where the work is infinite, or may be
  double variance = 0;        ///< of one member, measured
  double work = 0;
  double efficiency = 0;
};

/// All that `tradeoff` has to say.
struct Tradeoff {
  const catalog::Problem* problem = nullptr;
  Survey survey;
  Setup setup;
  bool shares_base = false;  ///< base and difference are made of the same draws
  std::int64_t samples = 0;
  std::vector<TradeoffPoint> points;
  std::size_t best = 0;  ///< of the points; their number where none is finite
  double optimum = 0;    ///< means nothing, as does the bound, where no law exists
  double bound = 0;
};

/// One image of `render`.
struct Picture {
  std::string name;
  std::string description;
  bool biased = false;
  std::int64_t samples = 0;  ///< of a pixel, or passes
  double work = 0;           ///< look-ups, or photons
  double seconds = 0;
  double mean = 0;   ///< over the image
  double error = 0;  ///< root mean square against the reference, relative to its mean; NaN without one
  std::string verdict;
};

/// All that `render` has to say.
struct Pictures {
  std::string scene;
  std::string work_unit;
  int width = 0;
  int height = 0;
  std::uint64_t seed = 0;
  bool complete = true;
  std::vector<Picture> pictures;
};

/// All that `survey` has to say.
struct SurveyOf {
  const catalog::Problem* problem;
  std::int64_t samples;  ///< draws of each level
  Survey survey;
};

/// Mean and standard error of the first values.
struct RunningMean {
  std::int64_t count = 0;
  double mean = 0;
  double standard_error = 0;  ///< NaN of one value
};

/// All that `diagnose` has to say.
struct Diagnosis {
  std::string file;
  numbers::Report read;      ///< by default an array of doubles
  std::string unit = "row";  ///< what the values are counted by
  /// Moments, tails and block means are those of the values times 2^-scale: no square over- or underflows. All else is
  /// in the unit of the values.
  int scale = 0;
  Moments moments;
  std::vector<double> upper_tail;
  std::vector<double> lower_tail;
  double mean = 0;
  double standard_error = 0;  ///< NaN of one value
  Interval interval;
  std::vector<double> block_means;
  std::int64_t block_length = 1;
  Interval block_interval;
  BiasedEstimate robust;             ///< no groups: too few values
  std::vector<RunningMean> running;  ///< after 2, 4, 8, ... values, and at the end
  std::vector<LargeSample> largest;  ///< the index is a row
  RunVerdict verdict;
  std::int64_t nonfinite = 0;
  std::int64_t first_nonfinite = 0;
  std::vector<std::string> warnings;
};

Run run_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch);
/// The same; `prepare` has the last word on the plan, once the estimator is chosen, by an advice or else by the words.
Run prepared_run_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch,
                    const std::function<void(const catalog::Choice&, const Advice*, Plan&)>& prepare);
/// Prints the result; the exit code.
int finish(const Run& run, const Arguments& arguments, class Output& out);
/// `run` without `--checkpoint` or `--shard`, and `run --estimator multilevel`.
int run_at_once(const Arguments& arguments);
int run_multilevel(const Arguments& arguments);
MultilevelRun multilevel_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch);
/// The same; `prepare` has the last word on the plan of the draws of a level.
MultilevelRun prepared_multilevel_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch,
                                     const std::function<void(std::int64_t level, Plan&)>& prepare);
AdviceOn advice_on(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch);
Replay replay_of(const catalog::Problem& problem, const Arguments& arguments);
SurveyOf survey_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch);
/// What is complete, where `watch` ends it.
Tradeoff tradeoff_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch);
/// The same; `prepare` has the last word on the plan of a law.
Tradeoff prepared_tradeoff_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch,
                              const std::function<void(const AnyPmf& law, Plan&)>& prepare);

void print(std::ostream& out, const Run& run);
void print(std::ostream& out, const MultilevelRun& run);
void print(std::ostream& out, const AdviceOn& advice);
void print(std::ostream& out, const Replay& replay);
void print(std::ostream& out, const SurveyOf& survey);
void print(std::ostream& out, const Tradeoff& tradeoff);
void print(std::ostream& out, const Diagnosis& diagnosis);

/// The share of a value in the sum of squares about the mean.
double square_share(const Diagnosis& diagnosis, double value);

/// The cells that were not judged.
struct Counts {
  std::int64_t biased = 0;
  std::int64_t refused = 0;
  std::int64_t underpowered = 0;
};
Counts count(const catalog::Report& report);

/// "A10 square-of-mean: formula"; a problem of the user's own has no id, and may have no formula.
std::string title(const catalog::Problem& problem);

/// The law as the command line spells it; empty for an estimator without one.
std::string law_text(const catalog::Choice& choice);

}  // namespace debias::cli

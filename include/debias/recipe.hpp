#pragma once

// From a sequence and nothing else to the best unbiased estimator for it, or a clear no.
//
//   auto result = estimate(recipe(sequence), {.samples = 1'000'000});
//
//   pilot -> posterior of the moments of the levels -> base level, base form, PMF, strata -> run
//   variance x work >= (sum_k sqrt(Var D_k work_k))^2, k from the base level on, D_m read as I_m   [bound]
//
//   Notation: m = base level, p = PMF, members = samples of the single-term estimator, in blocks.
// The pilot draws from streams of its own, so the run knows nothing of it. It draws levels with equal work each, 2^14
// draws of the base in all at first, then four times as much, and stops at a yes: shown, or likely after a tenth of the
// run's work. While the answer is open it goes on to the run's own work and no further, and the run goes on: the pilot's
// levels and its own then widen its interval. Levels that were hardly seen get the mass that the posterior asks for,
// never less. Throws only where a no is shown or likely (statistics/evidence.hpp says what no rule decides).
// Once levels are known it measures, by a few scrambled nets a level, how the variance of a mean falls with the points, and
// takes blocks of nets where they promise a quarter less work than plain numbers (recipe/nets.hpp): 32 blocks at least, their
// number fixed before the run. Such pilots aim at a tenth of the run, those of a short one at a quarter of it, 2e4 draws of the
// base at most; what an open answer, or the strata of a choice, draw comes on top.
// Sources: Rhee & Glynn, Oper. Res. 63 (2015), the PMF; Vihola, Oper. Res. 66 (2018), strata; the rest derived.

#include <cmath>
#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/no_pmf.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/pmf/any.hpp>
#include <debias/recipe/model.hpp>
#include <debias/recipe/terms.hpp>
#include <debias/survey.hpp>

namespace debias {

/// What is not left to the pilot.
struct RecipeOptions {
  std::int64_t lowest_base = 0;              ///< below it a level has no finite moments
  std::optional<std::int64_t> base_level{};  ///< this very one
  std::optional<Base> base{};                ///< this very form
  std::optional<Rates> rates{};              ///< declared, in place of those of the sequence: a prior of the pilot
  std::optional<double> budget{};            ///< of the pilot, in work: more, where the answer is open or the run long
  /// Of the members of a level: points of nets, or plain numbers; left to the pilot: what it finds better. Nets take
  /// Base::one_outcome and a decay like a power of 2: std::invalid_argument where they are asked for without.
  std::optional<Points> points{};
};

/// What the pilot found and chose, in numbers and in words.
struct Advice {
  Survey survey;
  SequenceFacts facts;  ///< what the sequence, or the caller, states
  double pilot_work = 0;
  double pilot_seconds = 0;
  std::int64_t base_level = 0;
  Base base = Base::one_outcome;
  bool shares_base = false;    ///< base and difference come from one draw
  bool runs_together = false;  ///< the members of a level, which are then stratified over their first uniform too
  AnyPmf pmf = AnyPmf(Geometric(0.5));
  TailExponent exponent{};  ///< of the PMF
  std::int64_t block = 1;   ///< members of a block, with systematic strata; of nets, residual ones
  Points points = Points::plain;
  std::string why_points;     ///< in one line
  std::int64_t members = 0;   ///< of the run, a multiple of the block
  VarianceAndWork predicted;  ///< of one member
  double bound = 0;           ///< of variance x work, for draws that share nothing
  double highest_moment = 0;  ///< moments of a sample are finite below this order
  /// Of variance x work, for a PMF that falls faster than the best one since levels beyond the deepest cannot be drawn
  /// (core/reach.hpp); 1 where the best one does.
  double price = 1;
  std::int64_t deepest_level = deepest_of_all;  ///< that the sequence can draw
  std::vector<std::string> sentences;           ///< what was chosen, and why: the first says whether a PMF exists
  std::vector<Warning> warnings;  ///< doubts: a wrong coupling, a deepest level, a time that work does not explain

  /// False where a no is shown or likely; an open answer runs, with an honest interval.
  [[nodiscard]] bool usable() const;
};

/// Whether a PMF exists, which was chosen, what it costs, and doubts; all sentences by `full` (core/report.hpp).
std::ostream& operator<<(std::ostream& out, const Advice& advice);
void print_full(std::ostream& out, const Advice& advice);

/// Runs the pilot and chooses. The plan's samples are members; a goal of the plan chooses them.
Advice advise(const LevelRuns& runs, const Plan& plan, const RecipeOptions& options = {});

/// The description of an estimate that chooses its own estimator.
template <BiasedSequence S>
struct Recipe {
  S sequence;
  RecipeOptions options;
};

namespace detail {
template <class S>
inline constexpr bool is_recipe<Recipe<S>> = true;
}  // namespace detail

template <BiasedSequence S>
Recipe<S> recipe(S sequence, const RecipeOptions& options = {}) {
  return {std::move(sequence), options};
}

namespace detail {
/// Which points were drawn, and why, in one line.
void print_points(std::ostream& out, const Advice& advice);
/// All of it but the doubts, which the result has.
void print_chosen(std::ostream& out, const Advice& advice);
}  // namespace detail

/// A result with the advice that it followed.
template <Value V>
struct RecipeResult : Result<V> {
  Advice advice;
};

template <Value V>
std::ostream& operator<<(std::ostream& out, const RecipeResult<V>& result) {
  out << static_cast<const Statistics&>(result);
  detail::print_points(out, result.advice);
  return out;
}
template <Value V>
void print_full(std::ostream& out, const RecipeResult<V>& result) {
  print_full(out, static_cast<const Statistics&>(result));
  detail::print_chosen(out, result.advice);
}

/// The estimator that an advice names; `trace` replays the block of a sample.
template <BiasedSequence S>
auto estimator_of(const S& sequence, const Advice& advice) {
  return debias::stratified(
      debias::single_term(sequence, advice.pmf, {.base_level = advice.base_level, .base = advice.base}), advice.block,
      advice.points == Points::nets ? Strata::residual : Strata::systematic, advice.points);
}

namespace detail {
/// The plan of the run, with the pilot that it took. Throws NoPmfError where no PMF has finite variance and finite
/// work.
Plan plan_of(const Plan& plan, const Advice& advice);
/// Goal of the whole, and the doubts of its advice, for the result of that run.
void follow(Statistics& statistics, const Advice& advice, const Goal& goal);
}  // namespace detail

/// Pilot, choice and run. Plan::samples is rounded up to whole blocks.
/// The pilot counts in the work and the seconds of the result.
/// Throws NoPmfError, with the reasons, where it is shown or likely that no PMF has finite variance and finite work,
/// UndrawableError where none of them can be drawn so often, and what the sequence throws (SampleError).
template <BiasedSequence S>
RecipeResult<sequence_value_t<S>> estimate(const Recipe<S>& recipe, const Plan& plan = {}) {
  Advice advice = debias::advise(debias::level_runs(recipe.sequence), plan, recipe.options);
  auto result = debias::estimate(debias::estimator_of(recipe.sequence, advice), detail::plan_of(plan, advice));
  detail::follow(result, advice, plan.goal);
  return {std::move(result), std::move(advice)};
}

template <class S>
requires(!BiasedSequence<S> &&
         !(TermSequence<S> && DeclaresRates<S>)) auto recipe(const S& /*sequence*/,
                                                             const RecipeOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_levels<S>(), S>();
}

}  // namespace debias

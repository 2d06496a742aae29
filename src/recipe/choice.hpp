#pragma once

// The single term with the least variance x work that the levels of a pilot allow, in plain numbers: base level, base form,
// PMF and strata.
//
//   Notation: m = base level, p = PMF, members = samples of the single-term estimator, in blocks.

#include <optional>

#include <debias/recipe.hpp>
#include <debias/recipe/model.hpp>

namespace debias {

/// What a choice is made from.
struct TermQuestion {
  const LevelRuns& runs;
  const LevelModel& model;  ///< of advice.survey
  const Plan& plan;
  const RecipeOptions& options;
  bool has_goal = false;
};

/// The form with the least variance x work for advice.members in blocks of advice.block. Nothing where no level has values that
/// are finite numbers, of finite variance.
[[nodiscard]] std::optional<SingleTermForm> choose_term(const TermQuestion& question, Advice& advice);
/// The advice for that form: its PMF, and what it costs. `finally` draws all that it can for that.
void take_term(const TermQuestion& question, const SingleTermForm& form, bool finally, Advice& advice);

/// Blocks that a run has at least, where it can have them.
double fewest_blocks_of(const Advice& advice);
/// A block for that many members, and the members in whole blocks.
void set_members(Advice& advice, double members);
/// Those that the plan, or its goal, asks for.
double wanted_members(const Advice& advice, const Plan& plan);
/// Whether a run of the members of the advice may take the PMF, see core/reach.hpp.
bool is_drawable(const Advice& advice, std::int64_t deepest_level, bool has_goal);
/// Moments of a sample are finite below this order, with a PMF of this tail.
double highest_moment_of(const Survey& survey, double exponent);
/// An exponent of a tail for the rates that the levels show, made right for what is declared, too: they may only not be there yet.
/// `best` gives the exponent for the slower decay and the faster growth of both. Left as it is where these are no others than
/// shown, or leave no room for a PMF, or the levels end.
double right_for_declared(double exponent, const Advice& advice, const Rates& shown, double (*best)(const Rates&));

/// Throws for a goal that nobody will pay for.
[[noreturn]] void refuse_cost(const Advice& advice, double members, const Goal& goal);
inline constexpr double most_affordable = 0x1p46;  ///< members of a goal

/// No masses have a smaller product of variance and work; 0 where a negative part leaves no bound.
double least_product(const TermMoments& moments);

}  // namespace debias

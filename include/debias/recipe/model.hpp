#pragma once

// From the table of a survey to what PMFs are chosen for.
//
//   E D_k^2   the posterior of the pilot's levels: measured, between measured ones, and beyond them
//   block     of n members, n p_k at level k: Var D_k(n p_k) + (E D_k)^2 min(1, 1 / (4 n p_k))
//   bound     variance x work >= (sum_k sqrt(Var D_k work_k))^2, k from the base level on, D_m read as I_m
//
//   Notation: p = PMF, n = block, Var D_k(c) = variance within c strata of the first uniform of a draw.
// Levels that were hardly seen get what the posterior asks for, never less. Fails where the levels that were reached are
// not yet typical of the deeper ones. The bound is for draws that share nothing and are not stratified themselves.
// Sources: Rhee & Glynn, Oper. Res. 63 (2015), the PMF; Vihola, Oper. Res. 66 (2018), strata; the rest derived.

#include <cstddef>
#include <cstdint>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/rates.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/any.hpp>
#include <debias/recipe/optimal_pmf.hpp>
#include <debias/survey.hpp>

namespace debias {

/// Moments of level after level: the measured ones, and the deeper ones that the posterior predicts. Level 0 is the value
/// I_0.
struct LevelModel {
  std::vector<double> variance;     ///< Var D_k
  std::vector<double> mean_square;  ///< (E D_k)^2
  std::vector<double> work;         ///< of D_k alone
  std::vector<Believed> posterior;  ///< of E D_k^2

  [[nodiscard]] std::size_t size() const { return work.size(); }
};

/// The first `levels` levels, whether the survey has seen them or not; 0 stands for as many as matter to a PMF.
LevelModel model_of(const Survey& survey, std::int64_t levels = 0);

/// A single-term estimator, but for its PMF.
struct SingleTermForm {
  std::int64_t base_level = 0;
  Base base = Base::one_outcome;
  std::int64_t block = 1;

  /// The level of the first outcome of the PMF.
  [[nodiscard]] std::int64_t first_level() const { return base_level + (base == Base::every_sample ? 1 : 0); }
};

/// What its PMF is chosen for, one entry for each outcome that the model has. A shared base is measured, in this share of
/// the draws of the survey, and so is what is left of a variance where the members of a level run together.
TermMoments term_moments(const LevelRuns& runs, const Survey& survey, const LevelModel& model,
                         const SingleTermForm& form, const Plan& plan, double share = 1);

/// What a PMF gives, over the outcomes of the model.
VarianceAndWork predict(const TermMoments& moments, const AnyPmf& pmf);

/// The bound of variance x work for that base level.
double bound_of(const Survey& survey, const LevelModel& model, std::int64_t base_level);

/// The exponent of a PMF's tail beyond the levels that were measured: the best, (beta + gamma) / 2, or halfway to
/// beta4 / 3 where the fourth moment can be finite.
double tail_exponent_for(const Survey& survey);

}  // namespace debias

#pragma once

// The table of a sequence, level by level, and what it says: how fast do differences decay and does work grow?
//
//   per level   mean and variance of I_k and D_k, E D_k^2, kurtosis E D_k^4 / (E D_k^2)^2, work, seconds
//   z           E[I_k - D_k] = E[I_(k-1)], from independent draws, in standard errors: 0 +- 1 for a right coupling
//   rates       weighted regression of log2 E D_k^2, |E D_k|, E D_k^4, work on k (or on log2(k + 1))
//   answer      a PMF with finite variance and work exists: yes or no, shown or likely, or open (statistics/evidence.hpp)
//
//   Notation: alpha, beta, beta4, gamma = MeasuredRates::mean, variance, fourth, work.
// The rates are a report: a level takes part with ten times its kurtosis in draws, and shallow levels leave the fit until
// chi-square passes. The answer is by the evidence alone, with the declared rates as a prior. Fails, as any extrapolation
// does, when the levels that were drawn are not yet asymptotic: it then says so.
// Sources: Giles, Acta Numerica 24 (2015), section 3 (table and consistency check); the rest derived here.

#include <cstdint>
#include <iosfwd>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/statistics/evidence.hpp>
#include <debias/survey/levels.hpp>

namespace debias {

/// "geometric", "polynomial", "exact zero", "super-exponential".
const char* name_of(RateKind kind);

/// What was measured of one level. Of a value with several components: means by norm, variances by sum.
struct SurveyRow {
  std::int64_t level = 0;
  std::int64_t draws = 0;
  double mean = 0;      ///< of I_k
  double variance = 0;  ///< of I_k
  double mean_error = 0;
  double difference = 0;  ///< E D_k
  double difference_error = 0;
  double difference_variance = 0;
  double second_moment = 0;  ///< E D_k^2
  double second_moment_error = 0;
  double kurtosis = 0;                      ///< E D_k^4 / (E D_k^2)^2; 0 where no difference was seen
  double nonzero = 0;                       ///< share of the draws with a difference that is not zero
  double consistency = 0;                   ///< z of E[I_k - D_k] = E[I_(k-1)]; 0 at the first level
  double tail_index = LevelFacts::unknown;  ///< Pareto k of the largest |D_k|
  double tail_error = LevelFacts::unknown;
  double difference_work = 0;               ///< of a draw of D_k
  double value_work = 0;                    ///< of a draw of I_k alone
  double seconds = 0;                       ///< of a draw of both, on one thread or all
  bool usable = false;                      ///< draws >= 10 x kurtosis, and not all of them zero
  bool fitted = false;                      ///< takes part in the fitted rates
  int fewer_threads = 0;                    ///< as of Statistics
  std::vector<ComponentEstimate> values{};  ///< of I_k, by component
  std::vector<ComponentEstimate> coarse{};  ///< of its coarse partner, I_k - D_k
};

struct Survey {
  std::vector<SurveyRow> rows;
  MeasuredRates rates;
  Answer pmf_exists = Answer::open;
  Grade grade = Grade::open;     ///< of the answer
  Evidence evidence;             ///< that it is drawn from
  std::vector<Warning> remarks;  ///< pre-asymptotic levels, exact zeros, a coupling that is wrong
  std::uint64_t seed = 0;
  double work = 0;     ///< of all draws
  double seconds = 0;  ///< of all draws

  /// Null where the level was not drawn.
  [[nodiscard]] const SurveyRow* row_at(std::int64_t level) const;
};

/// The levels, the answer and its doubts.
std::ostream& operator<<(std::ostream& out, const Survey& survey);
/// Also the moments of the levels, the fitted rates and all remarks: std::cout << full(survey).
void print_full(std::ostream& out, const Survey& survey);

/// One row; its consistency is left at 0.
SurveyRow survey_level(const LevelRuns& runs, std::int64_t level, const Plan& plan);
/// The same from draws of LevelRuns::draw, with the mean work of I_k alone and of D_k alone.
SurveyRow row_of(const Statistics& draws, std::int64_t level, const std::pair<double, double>& work);

/// The rates, the answer and the remarks that rows in order of their levels give, with their consistency.
/// `budget_spent`: nothing more will be drawn, so that a no may be said.
Survey survey_of(std::vector<SurveyRow> rows, std::uint64_t seed, const SequenceFacts& sequence = {},
                 bool budget_spent = true);

/// Levels first ... first + levels - 1, plan.samples draws of each.
/// Throws std::invalid_argument for fewer than two levels or draws, and what the sequence throws (SampleError).
/// Interrupted by plan.progress, it returns the levels that are complete, if there are any, and says so.
Survey survey(const LevelRuns& runs, std::int64_t levels = 8, const Plan& plan = {.samples = 4096},
              std::int64_t first = 0);

template <BiasedSequence S>
Survey survey(const S& sequence, std::int64_t levels = 8, const Plan& plan = {.samples = 4096},
              std::int64_t first = 0) {
  return debias::survey(debias::level_runs(sequence), levels, plan, first);
}

template <class S>
requires(!BiasedSequence<S>) auto survey(const S& /*sequence*/, std::int64_t /*levels*/ = 8, const Plan& /*plan*/ = {},
                                         std::int64_t /*first*/ = 0) {
  return detail::refuse<detail::mistake_in_levels<S>(), S>();
}

/// As many of the levels 0 ... 23 as `work` pays for, each with about the same share of it and at least 64 draws; of those above
/// 8 four an octave where the work hardly grows. plan.samples is not used. Stops before a level that the sequence refuses
/// (std::length_error).
Survey survey_within(const LevelRuns& runs, double work, const Plan& plan = {});

}  // namespace debias

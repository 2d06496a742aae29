#pragma once

// What levels that were drawn say of those that were not: one rule set for survey, recipe, verdict and interval.
//
//   S = sum_k sqrt(E D_k^2 w_k) < infinity  iff some PMF has finite variance and finite work; S^2 is its price
//   U = the part of S in levels that nobody has seen; b_k = log2 E D_k^2
//
//   usable     a level speaks with its effective hits n / kappa, kappa = E D^4 / (E D^2)^2, and with no more than its
//              neighbours' kappa leaves it: one that missed its tail inherits their rarity. With 8 hits it is usable.
//   posterior  b is a local linear trend over k, and over log2(k + 1), seen with error (Kalman filter, a grid of
//              tau, omega, q); the slope in the limit is free by 1 / K more, K = usable levels
//   declared   rates are a prior on that slope, and stand for two levels, but never show anything: what is shown with them is
//              likely without them; dropped where the levels contradict them
//   zeros      count where the trend of the non-zero share promised 14 hits; an end is shown, likely, or open
//   answer     yes: P(S diverges) and U are small; no: both are large and no veto holds; else open
//   PMF        finite iff sum_k E D_k^2 / p_k converges, by the same posterior
//
// Grades: shown (wrong once in 200), likely (once in 10), open. What no rule decides: a change beyond the last level
// seen ("as far as level K"); |beta - gamma| < 2.6 / K ("declare the rates if you know them"); a lognormal against a
// power; a rate below 1 / n ("a value rarer than 3 / n would not have been seen"); a slow exponential against a power;
// an end against a pause (state `exact_from`). Pure functions of their arguments: same input, same bits.
// Sources: Harvey, Forecasting, structural time series models (1989), trend; the rest derived here.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <debias/core/rates.hpp>
#include <debias/core/warning.hpp>

namespace debias {

/// Does a PMF with finite variance and finite work exist? `open`: the levels seen do not say.
enum class Answer { yes, no, open };
/// "yes", "no", "open".
const char* name_of(Answer answer);

/// How far an answer is to be trusted.
enum class Grade { open, likely, shown };
/// "open", "likely", "shown".
const char* name_of(Grade grade);

/// What was measured of one level, all in one unit.
struct LevelFacts {
  static constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

  std::int64_t level = 0;
  std::int64_t draws = 0;
  double mean = 0;                  ///< E D_k
  double second_moment = 0;         ///< E D_k^2
  double kurtosis = 0;              ///< kappa = E D_k^4 / (E D_k^2)^2
  double nonzero = unknown;         ///< share of draws with a difference; unknown: all, if any
  double work = 1;                  ///< of a draw of D_k
  double value_variance = unknown;  ///< Var I_k
  double value_square = unknown;    ///< E I_k^2 + E I_(k-1)^2, beside which rounding counts
  double tail_index = unknown;      ///< Pareto k of the largest |D_k|
  double tail_error = unknown;
  bool is_base = false;  ///< the value I_m instead of a difference: speaks for no decay
};

/// The facts of both, level by level, in order: of a pilot and of a run. Their tail index is that of the more draws.
std::vector<LevelFacts> together(std::span<const LevelFacts> a, std::span<const LevelFacts> b);

/// The second moment of a level, by its largest values: finite; not cleared of being infinite; infinite.
enum class LevelTail { light, unclear, heavy };

/// What a level says.
struct LevelVoice {
  std::int64_t level = 0;
  double raw_hits = 0;                                     ///< n / kappa
  double hits = 0;                                         ///< of these, the honest ones
  double log2_second = 0;                                  ///< b_k; -infinity: zeros only; NaN: not finite
  double log2_rarity = 0;                                  ///< log2 kappa
  double error = std::numeric_limits<double>::infinity();  ///< of b_k in octaves; infinite: not usable
  LevelTail tail = LevelTail::light;

  [[nodiscard]] bool usable() const { return error < std::numeric_limits<double>::infinity(); }
};

enum class End {
  none,
  stated,    ///< by the sequence, or zero in every level seen of it
  rounding,  ///< two voting levels fell into rounding
  zeros,     ///< levels of zeros that should have shown differences
  aliased    ///< such levels, while the value still varies: its points miss what varies
};

/// log2 of a second moment as it should be believed, and its standard deviation in octaves.
struct Believed {
  double log2_second = -std::numeric_limits<double>::infinity();
  double error = 0;
};

/// Quantiles of U at 0.5 %, 50 %, 99.5 %.
struct Unseen {
  double low = 0;
  double median = 0;
  double high = 1;
};

/// One way in which the levels may go on, by the posterior: b_k beyond the last usable level.
struct Course {
  double at_last = 0;      ///< b of the last usable level
  double slope = 0;        ///< there, as a fall in octaves a level (or an octave of the level)
  double limit = 0;        ///< the slope of deep levels
  double limit_error = 0;  ///< of `limit`, given `slope`
  double scatter = 0;      ///< omega, of single levels about the trend
  bool polynomial = false;
};

struct Contradiction {
  double declared = 0;
  double shown = 0;
  double error = 0;
};

/// All that the levels say.
struct Evidence {
  std::vector<LevelFacts> facts;   ///< in order of the levels, as given
  std::vector<LevelVoice> voices;  ///< of the same levels
  std::vector<Course> courses;     ///< equally likely; empty: fewer than three usable levels
  std::vector<Course> unaided;     ///< the same without declared rates; empty where these change nothing
  Answer answer = Answer::open;
  Grade grade = Grade::open;
  double diverges = 0.5;  ///< P(no PMF has finite variance and work)
  Unseen unseen;
  End end = End::none;
  std::int64_t last_difference = 0;  ///< deepest level with differences that are not zero
  std::int64_t first_usable = -1;
  std::int64_t last_usable = -1;
  int known = 0;                 ///< usable levels with an error of at most half an octave
  int known_by_rates = 0;        ///< levels that declared rates are worth, for what is likely
  std::int64_t lowest_base = 0;  ///< below it levels have no second moment
  bool missing_moments = false;  ///< in some level, and not only in the first ones
  bool polynomial = false;       ///< the decay, more likely than not
  FittedRate decay;              ///< beta in the unit of `polynomial`: in the limit, with its sd
  bool exponential_work = false;
  FittedRate work;       ///< gamma, in the unit of `exponential_work`
  bool changes = false;  ///< rarity that falls, a decay that steepens, ...: no trend to speak of a no
  std::optional<Contradiction> contradiction;  ///< of the declared rates
  std::optional<Rates> not_there;              ///< declared rates that the levels do not follow, or not yet
  std::vector<Warning> reasons;                ///< for the long report
};

/// Weighs the facts of levels. `budget_spent`: nothing more can be drawn, so that a no may be said.
Evidence weigh(std::vector<LevelFacts> facts, const SequenceFacts& sequence = {}, bool budget_spent = true);

/// Second moments of the levels 0 ... last: measured, between measured ones, and beyond them. Levels of zeros get the
/// rule of three: with 95 % confidence a difference as large as before is no more frequent than 3 / n.
std::vector<Believed> believed(const Evidence& evidence, std::int64_t last);

/// log2 of the mean of E D_k^2 by the posterior, at most one standard deviation up; beyond the largest level that was seen no
/// doubt adds more than two octaves.
double upper(const Evidence& evidence, const Believed& level);

/// log2 of the work of a draw, measured or continued.
double log2_work(const Evidence& evidence, std::int64_t level);

/// The masses of a PMF, level by level: what a verdict and an interval need of it.
struct Masses {
  std::int64_t first_level = 1;
  std::vector<double> mass;  ///< beyond the last one it goes on as it ends

  [[nodiscard]] bool empty() const { return mass.empty(); }
};

/// R10: is sum_k E D_k^2 / p_k finite?
struct SumConvergence {
  enum class Value { finite, infinite, open } value = Value::open;
  Grade grade = Grade::open;
  double diverges = 0.5;  ///< probability
  double unseen = 1;      ///< at most this part of the variance is in levels that nobody has seen, at 99.5 %
  double growth = 0;      ///< of E D_k^2 / p_k in octaves a level (or an octave of the level), in the limit
};
SumConvergence judge(const Evidence& evidence, const Masses& masses);
/// P(sum_k E D_k^4 / p_k^3 is infinite): where it is, the variance of a run is known slowly.
double fourth_moment_diverges(const Evidence& evidence, const Masses& masses);
/// rho of the masses near that level: they fall like 2^(-rho k), or like k^(-rho).
double exponent_of(const Masses& masses, std::int64_t level, bool& polynomial);

/// R9: the variance of the mean of N members that the run has not shown, and how well the rest is known.
struct Doubt {
  double unseen = 0;   ///< sum of E D_k^2 / (p_k N) over levels with a mass that have not shown 8 honest hits
  double undrawn = 0;  ///< the same of levels that have, in a pilot, but of which the run expects less than 8
  double seen = 0;     ///< the same of the others
  double degrees = std::numeric_limits<double>::infinity();  ///< of Student's t, for the root of both
  double mu =
      0;  ///< for `part_in_variance`: where differences are not random, D / p comes near it, and no level matters
  std::vector<std::int64_t> levels;  ///< of `unseen` and `undrawn`: the variance of the run does not speak for them

  /// At most half of the variance unseen, and eight degrees.
  [[nodiscard]] bool reliable() const { return unseen <= seen + undrawn && degrees >= 8; }
};
Doubt doubt_of(const Evidence& evidence, const Masses& masses, double members);

/// The part of one level in the variance of a sample of a single term: p E (D / p - mu)^2, mu the sum of all E D.
inline double part_in_variance(double second_moment, double mean, double p, double mu) {
  return std::max(0.0, second_moment / p - 2 * mu * mean + mu * mu * p);
}

}  // namespace debias

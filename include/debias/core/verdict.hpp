#pragma once

// Is the variance of a run finite, and can its interval be trusted? From its levels, its largest values, or both.
//
//   levels   sum_k E D_k^2 / p_k by the posterior of statistics/evidence.hpp, from the pilot and the run together;
//            declared rates are a prior of it where the last levels follow them
//   tails    Pareto k of the largest values of either side (core/tail_index.hpp): where there are no levels, or a base
//            that is heavier than they can tell. Infinite: k - 1.5 se > 1/2 in the full and the half tail and k > .4 in
//            the quarter, and no more than likely: a lognormal looks the same
//   chains   coupled ones (chains/coupled_chain.hpp) have no p_k: the tails of the samples and of the meeting times, which are
//            their levels, both have to be light (statistics/meeting.hpp), and the answer is likely at best
//   interval se^2 + (what levels with a mass but hardly a draw may add), Student's t; reliable iff the variance is
//            finite, it has eight degrees, and at most half of it was not seen
//
//   Notation: p_k = LevelRow::probability, D_k = difference, xi = tail index = 1 - beta / (2 rho) for 2^(-beta k) under
// 2^(-rho k) (power laws: (rho - beta/2) / (rho - 1)).
// Fails where deeper levels do not go on like those seen; what no rule decides is listed in statistics/evidence.hpp. A
// roulette policy has no p_k: tails decide, and numbers without levels are "finite as far as these values reach".
// Source: derived here; Rhee & Glynn, Oper. Res. 63 (2015), section 3, for the levels.

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/tail_index.hpp>
#include <debias/core/warning.hpp>
#include <debias/statistics/evidence.hpp>
#include <debias/statistics/meeting.hpp>

namespace debias {

struct Statistics;

enum class Finiteness { finite, infinite, undecided };
/// "finite", "infinite", "undecided".
const char* name_of(Finiteness finiteness);

/// What the levels say of the weighted differences.
struct LevelEvidence {
  bool available = false;  ///< at least three usable levels, or all deeper differences are zero
  std::int64_t usable_levels = 0;
  bool ends = false;      ///< the differences are zero, or rounding, beyond some level
  double tail_index = 0;  ///< xi; -infinity where they end, or fall by powers of 2 beside a PMF that is a power
  double error = 0;
  double beta = 0;  ///< of E D_k^2 in the limit, in the unit of the PMF: 2^(-beta k) or k^(-beta)
  double beta_error = 0;
  double rho = 0;  ///< of p_k
  bool polynomial = false;
  bool contradicted = false;     ///< deeper levels, too rare to be usable, are larger than the posterior allows
  std::int64_t first_level = 0;  ///< the usable levels
  std::int64_t last_level = 0;
  double diverges = 0.5;  ///< P(the variance is infinite)
  double growth = 0;      ///< of E D_k^2 / p_k, in octaves a level (polynomial: an octave of the level)
  Finiteness fourth_moment = Finiteness::undecided;
  Finiteness work = Finiteness::undecided;
};

/// What one can say of the moments of samples. `samples`, moments and extremes are those that were seen.
struct RunVerdict {
  Finiteness variance = Finiteness::undecided;
  Grade grade = Grade::open;                         ///< of the variance: open iff undecided
  Finiteness fourth_moment = Finiteness::undecided;  ///< of a sample; where it is infinite, errors are known slowly
  Finiteness work = Finiteness::undecided;
  double tail_index = 0;  ///< of levels and tails together; -infinity: bounded
  double error = std::numeric_limits<double>::infinity();
  LevelEvidence levels;
  TailIndex upper;
  TailIndex lower;
  MeetingTail meeting;  ///< of coupled chains; without chains for all others
  std::int64_t samples = 0;
  double kurtosis = 0;
  double unseen_variance = 0;  ///< of the mean, that levels with a mass but hardly a draw may add to the one measured
  double unseen_share = 0;     ///< of the squared error, all of what those levels add
  /// Of Student's t, as the parts of the variance are known; two at most where it is infinite.
  double degrees = std::numeric_limits<double>::infinity();
  double largest_share = 0;          ///< of the sum of squares about the mean, by the largest sample
  std::int64_t deepest_level = 0;    ///< that any sample reached
  double samples_needed = 0;         ///< for a useful mean at this tail index; see samples_for_mean
  double rate = 0;                   ///< the error of the mean falls like samples^-rate
  bool wrong_mean = false;           ///< as a warning says: of the coupling of the levels, or of their masses
  double bias = 0;                   ///< as stated (core/bias.hpp), in standard errors; no part of the interval
  std::vector<LargeSample> largest;  ///< what to replay, at most 3
  std::vector<Warning> reasons;      ///< what else the levels say, for a long report

  static constexpr double most_bias = 0.5;  ///< of an interval that is reliable
  [[nodiscard]] bool interval_reliable() const;
  /// The whole in one sentence, for a brief report.
  [[nodiscard]] std::string sentence() const;
  /// One sentence each: the first is on the variance, with its grade; others only where there is something to do.
  [[nodiscard]] std::vector<std::string> sentences() const;
};

/// The verdict on a run.
RunVerdict judge(const Statistics& statistics);

/// The verdict on numbers whose levels are not known: the largest in descending order and the smallest in
/// ascending order, at least tail_size(moments.count) + 1 of each.
RunVerdict judge(const Moments& moments, std::span<const double> upper, std::span<const double> lower);

}  // namespace debias

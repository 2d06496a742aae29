#pragma once

// Is the variance of a run finite? From its levels, its largest values, or both; never from a declaration.
//
//   levels   a_k = E D_k^2 / p_k ~ 2^(-(beta - rho) k): finite iff beta > rho; xi = 1 - beta / (2 rho)
//            (power laws: k^(-(beta - rho)), finite iff beta > rho + 1; xi = (rho - beta/2) / (rho - 1))
//   tails    Pareto k of the largest values of either side (core/tail_index.hpp)
//   both     xi of the levels, averaged with k where both exceed 1/2; decided at two standard errors from 1/2
//
//   Notation: p_k = LevelRow::probability, beta, rho = slopes of -log2 E D_k^2 and -log2 p_k, xi = tail
// index. A level votes with 4 x kurtosis draws; `finite` needs four votes, and no deeper level that
// contradicts them. Assumes that deeper levels go on like those seen: where the first ones mislead, the
// verdict does. Light tails prove nothing beside levels: no sample may have reached the heavy ones. A
// roulette policy has no p_k: tails decide. Kurtosis speaks for the error bar only: the fourth moment may be
// infinite (xi >= 1/4) while the variance is finite. Source: derived here; Rhee & Glynn, Oper. Res. 63
// (2015), section 3, for the levels.

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/tail_index.hpp>

namespace debias {

struct Statistics;

enum class Finiteness { finite, infinite, undecided };
/// "finite", "infinite", "undecided".
const char* name_of(Finiteness finiteness);

/// What the rows of a level table say of the weighted differences.
struct LevelEvidence {
  bool available = false;  ///< at least two levels could vote, or all deeper differences are exactly zero
  std::int64_t votes = 0;  ///< levels in the fit; two or three may say infinite, never finite
  double tail_index = 0;   ///< xi; -infinity where the differences end
  double error = 0;
  double beta = 0;  ///< of E D_k^2, in the unit of the law: 2^(-beta k) or k^(-beta)
  double beta_error = 0;
  double rho = 0;  ///< of p_k
  bool polynomial = false;
  bool contradicted = false;     ///< deeper levels, too rare to vote, are larger than the fit
  std::int64_t first_level = 0;  ///< the levels that voted
  std::int64_t last_level = 0;
  Finiteness fourth_moment = Finiteness::undecided;
  Finiteness work = Finiteness::undecided;
};

/// What one can say of the moments of samples. `samples`, moments and extremes are those that were seen.
struct RunVerdict {
  Finiteness variance = Finiteness::undecided;
  Finiteness fourth_moment = Finiteness::undecided;  ///< unless finite, the interval is unreliable
  Finiteness work = Finiteness::undecided;
  double tail_index = 0;  ///< of levels and tails together; -infinity: bounded
  double error = std::numeric_limits<double>::infinity();
  LevelEvidence levels;
  TailIndex upper;
  TailIndex lower;
  std::int64_t samples = 0;
  double kurtosis = 0;
  double largest_share = 0;          ///< of the sum of squares about the mean, by the largest sample
  std::int64_t deepest_level = 0;    ///< that any sample reached
  double samples_needed = 0;         ///< for a useful mean at this tail index; see samples_for_mean
  double rate = 0;                   ///< the error of the mean falls like samples^-rate
  std::vector<LargeSample> largest;  ///< what to replay, at most 3

  [[nodiscard]] bool interval_reliable() const { return fourth_moment == Finiteness::finite; }
  /// One sentence each: number, threshold, consequence, advice. The first is on the variance.
  [[nodiscard]] std::vector<std::string> sentences() const;
};

/// The verdict on a run.
RunVerdict judge(const Statistics& statistics);

/// The verdict on numbers whose levels are not known: the largest in descending order and the smallest in
/// ascending order, at least tail_size(moments.count) + 1 of each.
RunVerdict judge(const Moments& moments, std::span<const double> upper, std::span<const double> lower);

}  // namespace debias

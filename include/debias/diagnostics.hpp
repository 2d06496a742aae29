#pragma once

// Is it finite? The verdict on a PMF from the rates of its sequence, before a run; and what is left if not.
//
//   E D_k^2 ~ 2^(-beta k), work_k ~ 2^(gamma k), p_k ~ 2^(-rho k):
//   variance finite iff rho < beta;  work finite iff rho > gamma;  fourth moment finite iff 3 rho < beta4
//   P(|Z| > t) ~ t^(-1/xi) with xi = 1 - beta / (2 rho), so E|Z|^q is finite iff q < 1 / xi
//
//   Notation: beta, gamma = Rates; rho = TailExponent; xi = DeclaredFiniteness::tail_index (0: every moment is finite).
// xi assumes that |D|^q scales like (E D^2)^(q/2), deterministic differences included: kinks and rare events
// have heavier tails than xi says, though the verdict on the variance stands, and that on the fourth moment
// where beta4 is measured. Polynomial rates: see core/rates.hpp; there xi = (rho - beta/2) / (rho - 1).
// The verdict from a run is in core/verdict.hpp. Sources: derived here; Rhee & Glynn, Oper. Res. 63 (2015),
// section 3, for variance and work; Lugosi & Mendelson, Found. Comput. Math. 19 (2019), theorem 2, for the
// median of means.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <debias/core/rates.hpp>
#include <debias/core/result.hpp>
#include <debias/core/verdict.hpp>

namespace debias {

struct DeclaredFiniteness {
  bool finite_variance = false;
  /// False where differences and PMF both fall faster than any rate: finite_variance is then true only if the
  /// differences end, or fall faster than the root of the PMF.
  bool decided = true;
  bool finite_work = false;
  double tail_index = 0;       ///< xi; the variance is finite below 1/2, the mean of |Z| below 1
  double work_tail_index = 0;  ///< of the work of a sample: its variance is finite below 1/2
  std::string sentence;        ///< number, threshold, consequence, advice

  /// E|Z|^q is finite for q below it; infinity when all moments are.
  [[nodiscard]] double highest_moment() const { return 1 / tail_index; }
};

/// The verdict on a PMF of tail `pmf` for a sequence of rates `rates`. For a sum: judge(rates_of_sum(rates), PMF).
DeclaredFiniteness judge(const Rates& rates, const TailExponent& pmf);

/// The rates with which `judge`, `finite_exponents` and `default_exponent` speak of a sum over all levels up to a random
/// one, `roulette` or `independent_sum`. Level k is drawn with probability P(N >= k), so that power laws cost the sum of
/// the work up to the last level: finite iff rho > gamma + 2. The variance, with differences of one sign, is finite where
/// that of a single term is. Geometric rates are the same for both.
inline Rates rates_of_sum(Rates rates) {
  if (rates.decay == Decay::polynomial) rates.work_growth += 1;
  return rates;
}

/// As above from rates that carry their errors: undecided within two of them of the border, never a guess.
struct MeasuredFiniteness {
  Finiteness variance = Finiteness::undecided;
  Finiteness work = Finiteness::undecided;
  Finiteness fourth_moment = Finiteness::undecided;
  double tail_index = 0;
  double error = 0;  ///< of the tail index
  std::string sentence;
};
MeasuredFiniteness judge(const MeasuredRates& rates, const TailExponent& pmf);

/// Means of consecutive blocks of equal length, in memory that does not grow: where the blocks become too
/// many, pairs of them join. What is left over at the end belongs to no block.
class BlockMeans {
 public:
  void add(double x) {
    sum_ += x;
    if (++filled_ == length_) close();
  }
  /// As if every value had been multiplied by 2^exponent.
  void scale(int exponent);
  /// Values in a block, a power of two.
  [[nodiscard]] std::int64_t length() const { return length_; }
  /// 512 to 1023 of them, or as many as there are values.
  [[nodiscard]] const std::vector<double>& means() const { return means_; }

 private:
  void close();

  std::vector<double> means_;
  std::int64_t length_ = 1;
  std::int64_t filled_ = 0;
  double sum_ = 0;
};

/// An estimate that is biased for skewed values, and must never be used as an unbiased one or averaged with
/// one.
struct BiasedEstimate {
  double value = 0;
  std::int64_t groups = 0;
};

/// The median of the means of k = ceil(8 ln(1 / delta)) groups of consecutive values, or of their block
/// means. It assumes a finite variance, and values in independent order; a group has equally many of them,
/// the last few are left out. Its error stays below sigma sqrt(32 ln(1/delta) / n) with probability 1 -
/// delta, where the mean has no such bound. It estimates the median of a group mean: for skewed values that
/// is biased, by up to sigma sqrt(k / n). NaN where a value is not finite. Throws std::invalid_argument unless
/// 0 < delta < 1 and there are at least k values.
BiasedEstimate median_of_means(std::span<const double> values, double delta = 0.05);

/// Mean -+ t quantile x standard error, with one degree of freedom less than there are values.
/// Throws std::invalid_argument unless 0 < confidence < 1 and there are at least two values.
Interval interval_of(const Moments& moments, double confidence = 0.95);

/// The same of batch means: for values that depend on their neighbours, and for few blocks. Assumes batches that
/// are nearly independent and normal.
Interval batch_interval(std::span<const double> batch_means, double confidence = 0.95);

}  // namespace debias

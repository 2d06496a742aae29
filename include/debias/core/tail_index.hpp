#pragma once

// How heavy is a tail? The shape k of a generalised Pareto law, P(X - u > x) = (1 + k x / sigma)^(-1/k),
// fitted to the largest values: moments below 1/k are finite, so the variance is finite iff k < 1/2.
//
//   theta_j = 1/x_T + (1 - sqrt(M / (j - 1/2))) / (3 x*), k(theta) = mean log(1 - theta x), M = 30 +
// floor(sqrt T)
//   theta = sum w_j theta_j, w_j ~ profile likelihood, k = k(theta), then (T k + 5) / (T + 10) (weak prior)
//
//   Notation: T = TailIndex::values, u = cutoff, x = exceedances in ascending order, x* = their first
// quartile. Deterministic differences give few values, each many times: plain k reads 0.34 where the truth is
// 0.56. Values that tie are spread down to the next one as a Pareto law would lie there; without ties nothing
// moves. Fails, as any tail estimate, when samples have not reached the levels that make the tail (below four
// steps of a lattice k may be off by 0.1), and when values come in clusters that are no ties: then `error` is
// large. Sources: Zhang & Stephens, Technometrics 51 (2009); Vehtari et al., Pareto smoothed importance
// sampling (prior, tail size); Hill 1975; Dekkers, Einmahl, de Haan 1989; Pickands 1975. Spreading: derived
// here.

#include <cstdint>
#include <limits>
#include <span>

namespace debias {

/// Shape and scale of a generalised Pareto law.
struct ParetoFit {
  double k = 0;
  double sigma = 0;
};

/// The fit of Zhang and Stephens, without a prior, to at least 5 positive numbers in ascending order.
/// Throws std::invalid_argument for fewer, or when the first quartile is not positive.
ParetoFit fit_pareto(std::span<const double> exceedances);

/// The number of largest values that speak for the tail of `samples`: floor(3 sqrt samples), a fifth below
/// 226, at least 5, at most half of them.
std::int64_t tail_size(std::int64_t samples);

enum class TailState {
  fitted,
  bounded,  ///< the largest value is too common for a tail beyond it
  too_few   ///< less than five values, or only one, above the most common one: no shape
};

struct TailIndex {
  TailState state = TailState::too_few;
  double k = -std::numeric_limits<double>::infinity();  ///< -infinity unless fitted
  double error = 0;  ///< (1 + k) / sqrt(values), and how far k depends on where the tail begins
  double plain = -std::numeric_limits<double>::infinity();  ///< k without spreading the ties, -infinity: no fit
  std::int64_t values = 0;
  double cutoff = 0;
  bool ties = false;
  // For comparison, over the same values: at a lattice they swing, and they depend on the origin of the
  // numbers.
  double hill = 0;
  double moment = 0;  ///< Dekkers, Einmahl, de Haan
  double pickands = 0;
};

/// The index of the upper tail of `samples` numbers from the largest of them in descending order, of which at
/// least tail_size(samples) + 1 should be there; `center` is a typical value, the mean say, from which sizes
/// count. For the lower tail negate the numbers.
TailIndex tail_index(std::span<const double> descending, std::int64_t samples, double center);

/// The sample size from which a mean of numbers with tail index k is useful: 10^(1 / (1 - max(0, k))).
double samples_for_mean(double k);

/// The largest k at which a mean of that many samples is useful: min(1 - 1 / log10 samples, 0.7).
double usable_tail_index(std::int64_t samples);

/// The error of a mean falls like samples^-(rate / 2): 1 for light tails, 0 from k = 1 on.
double convergence_rate(double k, std::int64_t samples);

}  // namespace debias

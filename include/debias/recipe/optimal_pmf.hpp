#pragma once

// PMFs from measured level moments: the masses, or the survival probabilities, with the least variance x work.
//
//   single term   minimise (v + sum_k b_k p_k + sum_k a_k / p_k) (c + sum_k w_k p_k), sum_k p_k = 1
//                 with b = c = 0: p_k ~ sqrt(a_k / (w_k + kappa)), kappa = -v C / V at the optimum; sqrt(a / w)
//                 where the base is evaluated in every sample
//   sums          minimise (sum_k nu_k / q_k) (sum_k w_k q_k), q falling, q_0 = 1: q_k = sqrt(theta_k / theta_0)
//                 with theta the slopes of the lower convex hull of the tail sums of nu over those of w
//
//   Notation: a = second moment of a difference, w = work, v = fixed_variance, c = fixed_work, b = base_variance.
// In blocks of n stratified members a_k = Var D_k + (E D_k)^2 min(1, 1 / (4 n p_k)): sqrt(Var D / w) alone starves
// levels that are nearly deterministic. Where the n p_k members of a level run together, stratified by their first
// number too, Var D_k falls with n p_k as well; a mass is then worth more where it takes more of its variance away.
// Sources: Rhee & Glynn, Oper. Res. 63 (2015); Kahale, Oper. Res. 2023 (arXiv 1909.02876), hull; rest derived.

#include <cstdint>
#include <span>
#include <vector>

namespace debias {

/// What a PMF of single terms is chosen for; the three vectors have one entry for each outcome of the PMF.
struct TermMoments {
  std::vector<double> variance;       ///< Var D_k
  std::vector<double> mean_square;    ///< (E D_k)^2
  std::vector<double> work;           ///< of one draw
  std::vector<double> base_variance;  ///< added p_k times: that of a base made of the draws of the level; or empty
  std::vector<double> covariance;     ///< of that base and the difference, twice added; or empty
  /// The shares of variance[k] and base_variance[k] that are left where 1, 2, 4, ... members of a level run together, which
  /// fall; an empty one, and an empty list, stand for all.
  std::vector<std::vector<double>> variance_left;
  std::vector<std::vector<double>> base_left;
  double fixed_variance = 0;  ///< what no PMF changes; may be negative
  double fixed_work = 0;
  std::int64_t block = 1;  ///< members of a stratified block; 1: independent members
};

struct VarianceAndWork {
  double variance = 0;  ///< of one member
  double work = 0;      ///< of one member
  [[nodiscard]] double product() const { return variance * work; }
};

/// What a PMF with these masses gives.
VarianceAndWork predict(const TermMoments& moments, std::span<const double> masses);

/// The best masses, which sum to 1. Throws std::invalid_argument for vectors of different lengths, or unless every
/// second moment and work is positive and finite (a level without a mass is missing from the estimate).
std::vector<double> best_masses(const TermMoments& moments);

/// The best survival probabilities q_0 = 1 >= q_1 >= ... for increments nu_k of the squared distance to the limit
/// (single ones may be negative) and work of the levels. Throws std::invalid_argument as above.
std::vector<double> best_tails(std::span<const double> increments, std::span<const double> work);

}  // namespace debias

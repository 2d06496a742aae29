#pragma once

// Bounds of the spectrum of a symmetric operator: what is proved, by what, and what can only be refuted.
//
//   Gershgorin   every eigenvalue lies within sum_(j != i) |a_ij| of some a_ii: proved, for entries that can be read
//   Lanczos      k products with a random vector give Ritz values theta_1 <= ... <= theta_k inside the spectrum: they
//                refute bounds that cut it off, and prove none; within the residual of a Ritz value lies some
//                eigenvalue, maybe not the last one
//   a bound      lambda_max - theta_k <= eps (lambda_max - lambda_min) with probability 1 - 1e-6,
//                eps = (ln(1.648 sqrt(n) 1e6) / (2 k - 1))^2            [Kuczynski & Wozniakowski 1992, theorem 3.2]
//
// The upper bound is Gershgorin's, or the larger of theta_k + its residual and that bound where this is lower: true but for
// one matrix in 1e6. The lower one of log, inverse and square root has to come from the user (nugget, shift) or from
// Gershgorin: eps is a share of the largest eigenvalue, and says nothing of small ones. A lower bound that is wrong, and that
// Lanczos does not refute, leaves estimates unbiased (the series converges for every eigenvalue in (0, a + b)), but their
// terms fall more slowly than declared, which recipes say.
// Sources: Parlett, The Symmetric Eigenvalue Problem (residuals); Kuczynski & Wozniakowski, SIAM J. Matrix Anal. Appl. 13
// (1992).

#include <cstddef>
#include <iosfwd>
#include <limits>
#include <optional>
#include <string>

namespace debias {

/// What is known of the spectrum. A bound that is left out is computed where one can be (see above).
struct SpectrumBounds {
  std::optional<double> lower{};  ///< no eigenvalue lies below: the nugget of a kernel, the shift of a Laplacian
  std::optional<double> upper{};  ///< no eigenvalue lies above
  int steps = 40;                 ///< of Lanczos: products that the check costs, and how sharp the upper bound is
};

/// An interval that the spectrum lies in, and what spoke for it.
struct Spectrum {
  double lower = 0;
  double upper = 0;
  double lowest_ritz = 0;   ///< some eigenvalue lies at or below
  double highest_ritz = 0;  ///< some eigenvalue lies at or above
  double residual = 0;      ///< within this of the highest Ritz value lies an eigenvalue
  std::string lower_by;
  std::string upper_by;

  /// Of the interval: upper / lower, infinite unless lower is positive.
  [[nodiscard]] double condition() const { return lower > 0 ? upper / lower : std::numeric_limits<double>::infinity(); }
};

std::ostream& operator<<(std::ostream& out, const Spectrum& spectrum);

namespace detail {

/// Extreme Ritz values of a Lanczos run, with the residual of the highest.
struct RitzValues {
  double lowest = 0;
  double highest = 0;
  double residual = 0;
};
/// The share of its spread that a spectrum may have beyond the Ritz values of so many steps, but for a probability of 1e-6;
/// 1 where that says nothing.
double unseen_spread(std::size_t rows, int steps);

struct Interval {
  double lower;
  double upper;
};

/// The interval from all that is known; `gershgorin` where the entries can be read, `positive` where f needs 0 < lower.
/// Throws std::invalid_argument where bounds are refuted or missing.
Spectrum judge_bounds(const char* name, const SpectrumBounds& bounds, const std::optional<Interval>& gershgorin,
                      const RitzValues& ritz, double unseen, bool positive);

}  // namespace detail

}  // namespace debias

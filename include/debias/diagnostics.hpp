#pragma once

// Is it finite? The verdict on a law before a run, from the rates of the sequence.
//
//   E D_k^2 ~ 2^(-beta k), work_k ~ 2^(gamma k), p_k ~ 2^(-rho k):
//   variance finite iff rho < beta;  work finite iff rho > gamma;
//   P(|Z| > t) ~ t^(-1/xi) with xi = 1 - beta / (2 rho), so E|Z|^q is finite iff q < 1 / xi
//
//   Notation: beta, gamma = Rates; rho = TailExponent; xi = Verdict::tail_index (0: every moment is finite).
// Assumes that |D|^q scales like (E D^2)^(q/2): kinks and rare events have heavier tails than xi says, though
// the verdict on the variance stands. Polynomial rates: see core/rates.hpp; there xi = (rho - beta/2) / (rho - 1).
// Source: derived here; Rhee & Glynn, Oper. Res. 63 (2015), section 3, for variance and work.

#include <string>

#include <debias/core/rates.hpp>

namespace debias {

struct Verdict {
  bool finite_variance = false;
  bool finite_work = false;
  double tail_index = 0;  ///< xi; the variance is finite below 1/2, the mean of |Z| below 1
  std::string sentence;   ///< number, threshold, consequence, advice
};

/// The verdict on a law of tail `law` for a sequence of rates `rates`.
Verdict judge(const Rates& rates, const TailExponent& law);

}  // namespace debias

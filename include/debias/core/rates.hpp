#pragma once

// Rates: how the differences of a sequence decay and how its work grows, and what that asks of a PMF.
//
//   geometric:   E D_k^2 ~ 2^(-beta k),  work_k ~ 2^(gamma k),  p_k ~ 2^(-rho k)
//                variance finite iff rho < beta, work finite iff rho > gamma, best rho = (beta + gamma) / 2
//   polynomial:  E D_k^2 ~ k^(-beta),    work_k ~ k^gamma,      p_k ~ k^(-rho)
//                variance finite iff rho < beta - 1, work finite iff rho > gamma + 1, best rho as above
//
//   Notation: beta = Rates::variance_decay, gamma = Rates::work_growth, rho = TailExponent::exponent.
//   The fourth moment needs sum E D_k^4 / p_k^3 < infinity; with E D^4 ~ (E D^2)^2, 3 rho < 2 beta (geometric).
// Assumes exact power laws from some level on. Kinks and rare events break E D^4 ~ (E D^2)^2 and with it the
// statement on the fourth moment, not the one on the variance.
// Source: Rhee & Glynn, Oper. Res. 63 (2015), section 3; fourth moment derived here.

#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>

namespace debias {

/// How a quantity depends on the level k: 2^(-+ exponent k), or k^(-+ exponent).
enum class Decay { geometric, polynomial };

/// beta and gamma of a sequence. An infinite `variance_decay` stands for differences that are zero or fall faster
/// than any such rate.
struct Rates {
  double variance_decay;
  double work_growth;
  Decay decay = Decay::geometric;

  static constexpr double faster_than_any = std::numeric_limits<double>::infinity();
};

/// What a sequence states of itself.
struct SequenceFacts {
  std::optional<Rates> declared{};
  std::optional<std::int64_t> exact_from{};  ///< D_k = 0 for k > exact_from
  bool constant_limit = false;               ///< I_k tends to one number, not to a random one
  bool meeting_times = false;  ///< a level is the time when two chains met; beyond exact_from: had not met
};

/// A sequence that states all of it at once, or an estimator that knows it of its sequence: a verdict on its runs heeds it.
template <class T>
concept StatesFacts = requires(const T& t) {
  { t.facts() } -> std::same_as<SequenceFacts>;
};

/// What a measurement of level moments can say of their decay: a power of 2 or of the level, differences that are
/// exactly zero from some level on, or a fall faster than any power.
enum class RateKind { geometric, polynomial, exact_zero, super_exponential };

/// An exponent with its standard error.
struct FittedRate {
  double value = 0;
  double error = 0;
};

/// Rates as measured from the moments of levels, in the unit of `kind`: 2^(-value k), or k^(-value). Where the
/// differences are exactly zero, or fall faster than any power, the decays are infinite.
struct MeasuredRates {
  RateKind kind = RateKind::geometric;
  FittedRate mean_decay;      ///< alpha: |E D_k| ~ 2^(-alpha k)
  FittedRate variance_decay;  ///< beta: E D_k^2 ~ 2^(-beta k)
  FittedRate fourth_decay;    ///< beta4: E D_k^4 ~ 2^(-beta4 k); 2 beta unless rare events carry the differences
  FittedRate work_growth;     ///< gamma: work_k ~ 2^(+gamma k)
};

/// The rates without their errors.
inline Rates rates_of(const MeasuredRates& m) {
  return {m.variance_decay.value, m.work_growth.value,
          m.kind == RateKind::polynomial ? Decay::polynomial : Decay::geometric};
}

/// rho of a PMF: its masses fall like 2^(-exponent j), or j^(-exponent). Infinite: faster than any such rate.
struct TailExponent {
  double exponent;
  Decay decay = Decay::geometric;
};

/// The open interval of rho with finite variance and finite work; empty (low >= high) when no PMF has both.
struct ExponentRange {
  double low;
  double high;
};
ExponentRange finite_exponents(const Rates& rates);

/// True when some PMF has finite variance and finite work.
bool pmf_exists(const Rates& rates);

/// The rho to take when nothing but the rates is known: the best one for variance x work, but a tail index of 1/7 is
/// enough (1/4 has an infinite fourth moment), or whatever half-way from the bound of the work to that of the fourth
/// moment gives, if these lie 0.2 apart. So the standard error can be trusted, and a long run can tell.
/// Throws NoPmfError when no PMF has finite variance and finite work, std::invalid_argument for rates that are no numbers.
double default_exponent(const Rates& rates);

/// The same from measured rates, with the measured decay of the fourth moment, E D_k^4 ~ 2^(-beta4 k): its bound is
/// 3 rho < beta4.
double default_exponent(const MeasuredRates& rates);

}  // namespace debias

#pragma once

// The Poisson law, for differences that fall like those of an exponential series.
//
//   p_j = exp(-lambda) lambda^j / j!,  P(J >= j) = sum_(i>=j) p_i
//
// With E D_j^2 ~ c^j / j!^2 any lambda gives finite variance, and work ~ 2^(gamma j) a finite mean for any
// gamma. Fails for differences that only fall like 2^(-beta j): masses fall faster, the variance is infinite.
// Masses come one by one in log space, tails are sums of masses from the deep end, both tabulated over every
// level that matters: from lambda - 9 sqrt(lambda), above which tails are 1 to rounding, to where masses
// underflow, about 46 sqrt(lambda) levels. Deeper ones have mass and tail 0: no Stream gets there.
// Source: Georgiev et al., ACM TOG 38(6), 2019 (Poisson orders of transmittance series).

#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/pmf.hpp>

namespace debias {

class Poisson {
 public:
  /// Throws std::invalid_argument unless lambda lies in (0, 10^6].
  explicit Poisson(double lambda);

  double mass(std::int64_t j) const;
  double tail(std::int64_t j) const;
  /// Throws std::length_error where the level is too deep for its tail to be a double, u < 10^-307.
  std::int64_t sample(double u) const;

  TailExponent tail_exponent() const { return {Rates::faster_than_any}; }
  std::string spec() const;

 private:
  double lambda_;
  std::int64_t first_;  // level of the first entry
  std::vector<double> masses_;
  std::vector<double> tails_;
};

}  // namespace debias

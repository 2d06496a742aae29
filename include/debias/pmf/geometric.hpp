#pragma once

// The geometric PMF, the default for differences and work that are powers of 2.
//
//   p_j = r (1-r)^j,  P(J >= j) = (1-r)^j,  mean 1/r - 1,  p_j ~ 2^(-theta j) with theta = -log2(1-r)
//
// With E D_j^2 ~ 2^(-beta j) and work ~ 2^(gamma j), a single-term estimator has finite variance exactly when
// theta < beta and finite expected work exactly when theta > gamma; the least product of both is at
// theta = (beta + gamma) / 2. beta <= gamma: no theta gives both.
// The PMF is the double r. Tails are within a few ulp for every r and level, 1 - r is never rounded away.
// Fails for r < 2^-40: with a mean level of 10^12, levels outgrow what a double counts exactly.
// Sources: Rhee & Glynn, Oper. Res. 63 (2015); Blanchet & Glynn, WSC 2015 (theta = 3/2).

#include <array>
#include <cassert>
#include <cstdint>
#include <string>

#include <debias/core/pmf.hpp>
#include <debias/core/tail_search.hpp>

namespace debias {

class Geometric {
 public:
  /// r = P(J = 0). Throws std::invalid_argument unless r lies in [2^-40, 1).
  explicit Geometric(double r);

  /// The PMF whose masses fall like 2^(-theta j): r = 1 - 2^-theta, rounded. Throws std::invalid_argument
  /// unless theta lies in (0, 53] and r in the range above.
  static Geometric with_exponent(double theta);

  double mass(std::int64_t j) const { return j < 0 ? 0.0 : r_ * tail(j); }

  double tail(std::int64_t j) const {
    const auto i = static_cast<std::uint64_t>(j);
    return i < tails_.size() ? tails_[i] : power(j);
  }

  std::int64_t sample(double u) const {
    assert(u > 0 && u <= 1);
    return u > tails_.back() ? search_tails(tails_, u) : deep_sample(u);
  }

  TailExponent tail_exponent() const;
  std::string spec() const;

 private:
  double power(std::int64_t j) const;  // (1-r)^j
  std::int64_t deep_sample(double u) const;

  double r_;
  double q_;           // 1 - r as a double
  double correction_;  // log((1-r) / q), what the rounding of q left out
  std::array<double, 32> tails_{};
};

}  // namespace debias

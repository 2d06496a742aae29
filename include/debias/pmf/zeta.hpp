#pragma once

// The zeta PMF, for differences and work that are powers of the level.
//
//   p_j = (j+1)^-s / zeta(s),  P(J >= j) = zeta(s, j+1) / zeta(s),  zeta(s, a) = sum_(k>=0) (a+k)^-s
//
// With E D_j^2 ~ j^(-beta) and work ~ j^gamma, a single-term estimator has finite variance exactly when
// s < beta - 1 and finite expected work exactly when s > gamma + 1; s > 1 in any case, and the mean level is
// finite for s > 2 only. Tails are Hurwitz zeta functions by Euler-Maclaurin summation, within 1e-14.
// Fails for s near 1: at s = 1.1, P(J >= 2^62) is 1.3 %, and such a level does not fit 64 bits; sampling it throws,
// since a cut would be a bias, and a run that is likely to need one is refused (core/reach.hpp).
// Sources: NIST DLMF 25.11.1 and 2.10.1 (Euler-Maclaurin).

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <string>

#include <debias/core/pmf.hpp>
#include <debias/core/tail_search.hpp>

namespace debias {

class Zeta {
 public:
  /// Throws std::invalid_argument unless s > 1 is finite.
  explicit Zeta(double s);

  double mass(std::int64_t j) const {
    const auto i = static_cast<std::uint64_t>(j);
    return i < table_size ? masses_[i] : deep_mass(j);
  }

  double tail(std::int64_t j) const {
    const auto i = static_cast<std::uint64_t>(j);
    return i < table_size ? tails_[i] : deep_tail(j);
  }

  /// Throws std::length_error for a level of 2^62 or more.
  std::int64_t sample(double u) const {
    assert(u > 0 && u <= 1);
    return u > tails_.back() ? search_tails(tails_, u) : deep_sample(u);
  }

  TailExponent tail_exponent() const { return {s_, Decay::polynomial}; }
  std::string spec() const;

 private:
  double deep_mass(std::int64_t j) const;
  double deep_tail(std::int64_t j) const;
  std::int64_t deep_sample(double u) const;

  static constexpr std::size_t table_size = 64;

  double s_;
  double zeta_;  // zeta(s)
  std::array<double, table_size> masses_{};
  std::array<double, table_size> tails_{};
};

}  // namespace debias

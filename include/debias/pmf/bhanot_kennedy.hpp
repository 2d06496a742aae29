#pragma once

// The order PMF of Bhanot & Kennedy, for sums of series whose terms fall like c^k / k!.
//
//   P(J = 0) = zero; otherwise J >= first, and from i - 1 to i it goes on with probability min(1, c / i), i >
// first
//   P(J >= j) = (1 - zero) prod_(first < i <= j) min(1, c / i) for j >= first, 1 - zero for 0 < j < first
//
// A large `zero` is the aggressive form: most samples stop at term 0, where a good pivot leaves little to do.
// With zero = 0, first = K terms are always there, and the rest is decided term by term.
// For sums only: masses below `first` (and while c >= i) are zero, so a single term weighted by its mass
// would never see some of them. Terms that fall only like a power of a ratio have infinite variance under it.
// Sources: Bhanot & Kennedy, Phys. Lett. B 157 (1985); Kettunen, d'Eon, Pantaleoni, Novak, ACM TOG 40(4),
// 2021 (zero = 0.9, first = 2, c = 2).

#include <cassert>
#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/pmf.hpp>

namespace debias {

class BhanotKennedy {
 public:
  /// Throws std::invalid_argument unless zero lies in [0, 1), first in [1, 10^6] and c in (0, 10^6].
  BhanotKennedy(double zero, std::int64_t first, double c);

  double mass(std::int64_t j) const;
  double tail(std::int64_t j) const;
  /// Throws std::length_error where the level is too deep for its tail to be a double, u < 10^-300.
  std::int64_t sample(double u) const;

  /// Expected order.
  double mean() const;

  TailExponent tail_exponent() const { return {Rates::faster_than_any}; }
  std::string spec() const;

 private:
  double zero_;
  std::int64_t first_;
  double c_;
  std::vector<double> tails_;  // of the levels first, first + 1, ...
};

}  // namespace debias

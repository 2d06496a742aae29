#pragma once

// Any PMF: masses that you name, then a geometric tail for ever.
//
//   p_j = w_j / W for j < n,  p_(n-1+i) = w_(n-1) q^i / W,  W = w_0 + ... + w_(n-1) + w_(n-1) q / (1-q)
//
// The w_j = masses need not be normalised, q = tail_ratio. This is the PMF of a pilot: the optimal masses
// sqrt(E D_j^2 / work_j) where they were measured, the fitted rate q = 2^-theta beyond.
// Every w_j and q must be positive: a PMF that ends is a truncation, and its estimates are biased. As with a
// geometric PMF, finite variance needs theta < beta and finite expected work theta > gamma.

#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/pmf.hpp>

namespace debias {

class Tabulated {
 public:
  /// Throws std::invalid_argument unless all masses are positive and finite, none of them underflows against
  /// their sum, and tail_ratio lies in (0, 1 - 2^-40].
  Tabulated(std::vector<double> masses, double tail_ratio);

  double mass(std::int64_t j) const;
  double tail(std::int64_t j) const;
  std::int64_t sample(double u) const;

  TailExponent tail_exponent() const;
  std::string spec() const;

 private:
  double beyond(const std::vector<double>& table, std::int64_t j) const;
  std::int64_t deep_sample(double u) const;

  std::vector<double> weights_;  // as given: spec() has to name this very PMF
  std::vector<double> masses_;   // of the weights' levels and some levels of the tail
  std::vector<double> tails_;
  double tail_ratio_;
};

}  // namespace debias

#pragma once

// The PMF of a radius that shrinks: masses like the steps of r^2 ~ (j+1)^(alpha-1), 0 < alpha < 1.
//
//   p_j = (j+1)^(alpha-1) - (j+2)^(alpha-1),  P(J >= j) = (j+1)^(alpha-1),  p_j ~ j^(alpha-2)
//
// Under it the means of all weighted differences of a photon density are the same. The tail is the heaviest of all
// PMFs here: the mean level is infinite, and of 10^6 samples one does not fit 64 bits at alpha = 2/3: sampling it
// throws, and runs that may need it are refused. Source: Misso et al., ACM TOG 41(4), 2022.

#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include <debias/core/pmf.hpp>
#include <debias/core/text.hpp>

namespace debias {

class RadiusPmf {
 public:
  /// Throws std::invalid_argument unless alpha lies in (0, 1).
  explicit RadiusPmf(double alpha) : alpha_(alpha) {
    if (alpha > 0 && alpha < 1) return;
    throw std::invalid_argument("RadiusPmf: alpha = " + detail::format("%f", alpha) +
                                " (must lie in (0, 1); 2/3 is usual)");
  }
  [[nodiscard]] double tail(std::int64_t j) const { return std::pow(static_cast<double>(j) + 1, alpha_ - 1); }
  [[nodiscard]] double mass(std::int64_t j) const {
    return -tail(j) * std::expm1((alpha_ - 1) * std::log1p(1 / (static_cast<double>(j) + 1)));
  }
  /// Throws std::length_error for a level of 2^62 or more.
  [[nodiscard]] std::int64_t sample(double u) const {
    const double guess = std::pow(u, 1 / (alpha_ - 1)) - 1;
    if (!(guess < 0x1p62)) throw std::length_error("RadiusPmf: a level beyond int64 (a cut would be a bias)");
    const auto j = static_cast<std::int64_t>(guess);
    // Beyond 2^50 neighbouring tails are equal doubles, and a search among them has no end.
    return guess > 0x1p50 ? j : invert_tail([this](std::int64_t i) { return tail(i); }, u, j);
  }
  [[nodiscard]] TailExponent tail_exponent() const { return {2 - alpha_, Decay::polynomial}; }
  [[nodiscard]] std::string spec() const { return "radius:alpha=" + detail::format("%f", alpha_); }

 private:
  double alpha_;
};

}  // namespace debias

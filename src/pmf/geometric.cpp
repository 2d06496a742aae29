#include <debias/pmf/geometric.hpp>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <stdexcept>

#include "core/text.hpp"

namespace debias {

Geometric::Geometric(double r) : r_(r), q_(1 - r), correction_(std::log1p(((1 - q_) - r) / q_)) {
  if (!(r >= 0x1p-40 && r < 1)) {
    throw std::invalid_argument("Geometric: r = " + to_text(r) +
                                " (must lie in [2^-40, 1)); r is the probability of level 0, "
                                "and 1 - 2^-theta of masses that fall like 2^(-theta j)");
  }
  for (std::size_t j = 0; j < tails_.size(); ++j) tails_[j] = power(static_cast<std::int64_t>(j));
}

Geometric Geometric::with_exponent(double theta) {
  if (!(theta > 0 && theta <= 53)) {
    throw std::invalid_argument("Geometric: theta = " + to_text(theta) +
                                " (must lie in (0, 53], beyond it r = 1 - 2^-theta rounds to 1); "
                                "(beta + gamma) / 2 is the best choice");
  }
  return Geometric(-std::expm1(-theta * std::numbers::ln2));
}

double Geometric::power(std::int64_t j) const {
  if (j < 0) return 1.0;
  // pow is good to an ulp in q^j; the factor exp restores 1 - r, of which a small r loses digits.
  const auto n = static_cast<double>(j);
  return std::pow(q_, n) * std::exp(n * correction_);
}

std::int64_t Geometric::deep_sample(double u) const {
  const double guess = std::log(u) / std::log1p(-r_);
  if (!(guess < 0x1p62)) {
    throw std::length_error("Geometric: the level at u = " + to_text(u) + " does not fit 64 bits");
  }
  return invert_tail([this](std::int64_t j) { return tail(j); }, u, static_cast<std::int64_t>(guess));
}

TailExponent Geometric::tail_exponent() const { return {-std::log1p(-r_) / std::numbers::ln2}; }

std::string Geometric::spec() const { return "geometric:r=" + to_text(r_); }

}  // namespace debias

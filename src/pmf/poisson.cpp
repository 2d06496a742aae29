#include <debias/pmf/poisson.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

#include <boost/math/special_functions/gamma.hpp>

#include <debias/core/tail_search.hpp>

#include "core/text.hpp"

namespace debias {
namespace {

/// exp(-lambda) lambda^j / j!, which is the derivative of the incomplete gamma function.
double poisson_mass(double lambda, std::int64_t j) {
  return boost::math::gamma_p_derivative(static_cast<double>(j) + 1, lambda);
}

}  // namespace

Poisson::Poisson(double lambda) : lambda_(lambda), first_(0) {
  if (!(lambda > 0 && lambda <= 1e6)) {
    throw std::invalid_argument("Poisson: lambda = " + to_text(lambda) +
                                " (must lie in (0, 1e6]); lambda is the mean level");
  }
  if (lambda < std::numeric_limits<double>::min()) {
    throw std::invalid_argument("Poisson: lambda = " + to_text(lambda) +
                                " (no double holds the mass of level 1 in full, and the PMF ends before it)");
  }
  // P(J < lambda - 9 sqrt(lambda)) < exp(-81 / 2) = 3e-18 by Chernoff: there, tails are 1 to rounding.
  first_ = static_cast<std::int64_t>(std::max(0.0, lambda - 9 * std::sqrt(lambda)));
  for (std::int64_t j = first_;; ++j) {
    const double mass = poisson_mass(lambda, j);
    if (mass < std::numeric_limits<double>::min() && static_cast<double>(j) > lambda) break;
    masses_.push_back(mass);
  }
  tails_.resize(masses_.size());
  long double tail = 0;
  for (std::size_t i = masses_.size(); i-- > 0;) {
    tail += masses_[i];
    tails_[i] = static_cast<double>(tail);
  }
  for (double& t : tails_) t = static_cast<double>(t / tail);  // the masses sum to 1 up to their rounding
}

double Poisson::mass(std::int64_t j) const {
  if (j < 0) return 0.0;
  if (j < first_) return poisson_mass(lambda_, j);
  const auto i = static_cast<std::size_t>(j - first_);
  return i < masses_.size() ? masses_[i] : 0.0;
}

double Poisson::tail(std::int64_t j) const {
  if (j < first_) return 1.0;
  const auto i = static_cast<std::size_t>(j - first_);
  return i < tails_.size() ? tails_[i] : 0.0;
}

std::int64_t Poisson::sample(double u) const {
  assert(u > 0 && u <= 1);
  if (u > tails_.back()) return first_ + search_tails(tails_, u);
  throw std::length_error("Poisson: lambda = " + to_text(lambda_) + ": at u = " + to_text(u) + " the tail underflows");
}

std::string Poisson::spec() const { return "poisson:lambda=" + to_text(lambda_); }

}  // namespace debias

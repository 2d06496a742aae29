#include <debias/pmf/dyadic.hpp>

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <utility>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr int most = 40;

std::int64_t block_of(const std::vector<int>& log2_counts) {
  if (log2_counts.empty()) {
    throw std::invalid_argument("Dyadic: no levels (at least one is needed); Geometric is the PMF that is all tail");
  }
  std::int64_t n = 1;
  for (std::size_t k = 0; k < log2_counts.size(); ++k) {
    if (log2_counts[k] < 0 || log2_counts[k] > most) {
      throw std::invalid_argument("Dyadic: m_" + std::to_string(k) + " = " + std::to_string(log2_counts[k]) +
                                  " (must lie in [0, 40]); level k gets 2^(m_k) members of a block");
    }
    n += std::int64_t{1} << log2_counts[k];
    if (n > std::int64_t{1} << 52) {
      throw std::invalid_argument("Dyadic: a block of " + std::to_string(n) +
                                  " members or more (at most 2^52); take smaller blocks, and more of them");
    }
  }
  return n;
}

// The tail weighs 1 beside 2^(m_k): its first level has 1 - q, and (1 - q) / (1 - q) is 1 without rounding.
Tabulated table_of(const std::vector<int>& log2_counts, double theta) {
  if (!(theta >= 0x1p-40 && theta <= 53)) {
    throw std::invalid_argument("Dyadic: theta = " + to_text(theta) +
                                " (must lie in [2^-40, 53]); masses of the tail fall like 2^(-theta j), "
                                "dyadic_exponent(rates) is a good one");
  }
  std::vector<double> weights;
  for (const int m : log2_counts) weights.push_back(std::ldexp(1.0, m));
  const double q = std::exp2(-theta);
  weights.push_back(1 - q);
  return {std::move(weights), q};
}

}  // namespace

Dyadic::Dyadic(std::vector<int> log2_counts, double theta)
    : log2_counts_(std::move(log2_counts)),
      theta_(theta),
      block_(block_of(log2_counts_)),
      table_(table_of(log2_counts_, theta)) {}

std::string Dyadic::spec() const {
  std::string text = "dyadic:";
  for (const int m : log2_counts_) text += std::to_string(m) + ',';
  text.back() = ';';
  return text + "theta=" + to_text(theta_);
}

double dyadic_exponent(const Rates& rates) {
  if (rates.decay != Decay::geometric) {
    throw std::invalid_argument(
        "dyadic_exponent: the differences decay like a power of the level (a tail that falls like "
        "2^(-theta j) gives them infinite variance); nets need a geometric decay");
  }
  const double otherwise = default_exponent(rates);  // throws where there is none
  const double gamma = rates.work_growth;
  const double bound = 2 * rates.variance_decay / 3;
  if (std::isinf(bound)) return otherwise;
  constexpr double room = 1.05;
  return bound > room * gamma ? gamma + 0.75 * (bound - gamma) : (rates.variance_decay + gamma) / 2;
}

}  // namespace debias

#include <debias/pmf/bhanot_kennedy.hpp>

#include <algorithm>
#include <cstddef>
#include <stdexcept>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr double smallest_tail = 1e-300;

void refuse(const std::string& what) { throw std::invalid_argument("BhanotKennedy: " + what); }

}  // namespace

BhanotKennedy::BhanotKennedy(double zero, std::int64_t first, double c) : zero_(zero), first_(first), c_(c) {
  if (!(zero >= 0 && zero < 1)) {
    refuse("zero = " + to_text(zero) + " (must lie in [0, 1)); it is the probability of order 0");
  }
  if (first < 1 || first > 1'000'000) {
    refuse("first = " + std::to_string(first) + " (must lie in [1, 10^6]); it is the lowest order above 0");
  }
  if (!(c > 0 && c <= 1e6)) {
    refuse("c = " + to_text(c) + " (must lie in (0, 10^6]); order i - 1 goes on to i with probability c / i");
  }
  double tail = 1 - zero;
  for (std::int64_t i = first; tail >= smallest_tail;) {
    tails_.push_back(tail);
    ++i;
    tail *= std::min(1.0, c / static_cast<double>(i));
  }
}

double BhanotKennedy::tail(std::int64_t j) const {
  if (j <= 0) return 1.0;
  if (j <= first_) return 1 - zero_;
  const auto i = static_cast<std::size_t>(j - first_);
  return i < tails_.size() ? tails_[i] : 0.0;
}

double BhanotKennedy::mass(std::int64_t j) const {
  if (j == 0) return zero_;
  if (j < first_) return 0.0;
  return tail(j) * (1 - std::min(1.0, c_ / (static_cast<double>(j) + 1)));
}

std::int64_t BhanotKennedy::sample(double u) const {
  assert(u > 0 && u <= 1);
  if (u > 1 - zero_) return 0;
  if (!(u > tails_.back())) {
    throw std::length_error("BhanotKennedy: c = " + to_text(c_) + ": at u = " + to_text(u) + " the tail underflows");
  }
  const auto above = std::partition_point(tails_.begin(), tails_.end(), [u](double t) { return u <= t; });
  return first_ + (above - tails_.begin()) - 1;
}

double BhanotKennedy::mean() const {
  double sum = (1 - zero_) * static_cast<double>(first_);
  for (std::size_t i = 1; i < tails_.size(); ++i) sum += tails_[i];
  return sum;
}

std::string BhanotKennedy::spec() const {
  return "bhanot-kennedy:zero=" + to_text(zero_) + ",first=" + std::to_string(first_) + ",c=" + to_text(c_);
}

}  // namespace debias

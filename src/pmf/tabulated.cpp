#include <debias/pmf/tabulated.hpp>

#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

#include <debias/core/tail_search.hpp>

#include "core/text.hpp"

namespace debias {

Tabulated::Tabulated(std::vector<double> masses, double tail_ratio)
    : weights_(std::move(masses)), masses_(weights_), tails_(weights_.size()), tail_ratio_(tail_ratio) {
  const auto refuse = [](const std::string& problem) { throw std::invalid_argument("Tabulated: " + problem); };
  if (weights_.empty()) refuse("no masses (at least one is needed); Geometric is the PMF that is all tail");
  if (tail_ratio == 0) {
    refuse(
        "tail = 0 (a PMF that ends leaves out every deeper level, and the estimate is biased); "
        "give the ratio of neighbouring masses beyond the table, 2^-theta");
  }
  if (!(tail_ratio > 0 && tail_ratio <= 1 - 0x1p-40)) {
    refuse("tail = " + to_text(tail_ratio) +
           " (must lie in (0, 1 - 2^-40]); "
           "it is the ratio of neighbouring masses beyond the table, 2^-theta");
  }
  double total = weights_.back() / (1 - tail_ratio);
  for (std::size_t j = weights_.size(); j-- > 0;) {
    if (!(weights_[j] > 0 && std::isfinite(weights_[j]))) {
      refuse("mass " + std::to_string(j) + " = " + to_text(weights_[j]) +
             " (must be positive and finite: what a PMF never draws is missing from the estimate)");
    }
    if (j + 1 < weights_.size()) total += weights_[j];
    tails_[j] = total;
  }
  for (std::size_t j = 0; j < weights_.size(); ++j) {
    masses_[j] = weights_[j] / total;
    tails_[j] /= total;
    if (!(masses_[j] >= std::numeric_limits<double>::min())) {
      refuse("mass " + std::to_string(j) + " = " + to_text(weights_[j]) + " of a sum of " + to_text(total) +
             " (under- or overflows as a probability); scale the masses, or cut the table earlier");
    }
  }
  constexpr std::size_t spare = 32;  // levels of the tail that need no pow and no log
  for (std::size_t i = 0; i < spare; ++i) {
    const auto j = static_cast<std::int64_t>(masses_.size());
    masses_.push_back(beyond(masses_, j));
    tails_.push_back(beyond(tails_, j));
  }
}

/// The mass or tail at level j of the geometric part, from the entry of the last weight.
double Tabulated::beyond(const std::vector<double>& table, std::int64_t j) const {
  const std::size_t last = weights_.size() - 1;
  return table[last] * std::pow(tail_ratio_, static_cast<double>(j - static_cast<std::int64_t>(last)));
}

double Tabulated::mass(std::int64_t j) const {
  if (j < 0) return 0.0;
  const auto i = static_cast<std::size_t>(j);
  return i < masses_.size() ? masses_[i] : beyond(masses_, j);
}

double Tabulated::tail(std::int64_t j) const {
  if (j < 0) return 1.0;
  const auto i = static_cast<std::size_t>(j);
  return i < tails_.size() ? tails_[i] : beyond(tails_, j);
}

std::int64_t Tabulated::sample(double u) const {
  assert(u > 0 && u <= 1);
  return u > tails_.back() ? search_tails(tails_, u) : deep_sample(u);
}

std::int64_t Tabulated::deep_sample(double u) const {
  const std::size_t last = weights_.size() - 1;
  const double guess = static_cast<double>(last) + std::log(u / tails_[last]) / std::log(tail_ratio_);
  if (!(guess < 0x1p62)) {
    throw std::length_error("Tabulated: the level at u = " + to_text(u) + " does not fit 64 bits");
  }
  return invert_tail([this](std::int64_t j) { return tail(j); }, u, static_cast<std::int64_t>(guess));
}

TailExponent Tabulated::tail_exponent() const { return {-std::log2(tail_ratio_)}; }

std::string Tabulated::spec() const {
  std::string text = "tabulated:";
  for (const double weight : weights_) text += to_text(weight) + ',';
  text.back() = ';';
  return text + "tail=" + to_text(tail_ratio_);
}

}  // namespace debias

#pragma once

// Sampling a PMF from a table of its tails: the hot path of every PMF, a few ns for a mean level about 1.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

namespace debias {

/// The largest j with u <= tails[j], for falling tails with tails[0] >= u > tails.back().
inline std::int64_t search_tails(std::span<const double> tails, double u) {
  if (u > tails[1]) return 0;  // most draws of a steep PMF: this branch is worth its misses
  // The next levels are counted without a branch: which of them it is, no branch predictor can know.
  const std::size_t counted = std::min<std::size_t>(tails.size(), 8);
  std::size_t j = 0;
  for (std::size_t k = 1; k < counted; ++k) j += std::size_t{u <= tails[k]};
  if (j + 1 == counted) {
    const auto begin = tails.begin() + static_cast<std::ptrdiff_t>(counted);
    const auto above = std::partition_point(begin, tails.end(), [u](double tail) { return u <= tail; });
    j += static_cast<std::size_t>(above - begin);
  }
  return static_cast<std::int64_t>(j);
}

}  // namespace debias

#pragma once

// The whole state of a result as 64-bit words, so that `==` asks for equal bits: counts, means, every moment,
// the level table, tails, largest samples and what is not finite. Time is not part of the answer, nor is the work of what each
// part of a run looks into for itself (core/resonance.hpp).

#include <bit>
#include <cstdint>
#include <vector>

#include <debias/core/result.hpp>

namespace debias::validation {

inline std::vector<std::uint64_t> bits_of(const Statistics& s) {
  std::vector<std::uint64_t> words;
  const auto number = [&words](double x) { words.push_back(std::bit_cast<std::uint64_t>(x)); };
  const auto count = [&words](std::int64_t n) { words.push_back(static_cast<std::uint64_t>(n)); };
  words.push_back(s.seed);
  count(s.first);
  count(s.samples);
  for (const ComponentEstimate& c : s.components) {
    number(c.mean);
    number(c.variance);
    number(c.standard_error);
  }
  count(s.moments.count);
  for (const double x : {s.moments.mean, s.moments.m2, s.moments.m3, s.moments.m4}) number(x);
  number(s.state.total().work);
  for (const LevelRow& row : s.levels) {
    count(row.level);
    count(row.last_level);
    count(row.is_base ? 1 : 0);
    count(row.count);
    for (const double x : {row.mean, row.second_moment, row.kurtosis, row.work, row.probability}) number(x);
  }
  for (const LargeSample& large : s.largest) {
    count(large.index);
    count(large.level);
    number(large.value);
  }
  for (const double x : s.upper_tail) number(x);
  for (const double x : s.lower_tail) number(x);
  count(static_cast<std::int64_t>(s.coupling.state));
  count(s.coupling.level);
  number(s.coupling.z);
  number(s.coupling.threshold);
  count(s.nonfinite);
  count(s.first_nonfinite);
  return words;
}

}  // namespace debias::validation

#pragma once

// Multilevel with nets as the literature writes it [Giles & Waterhouse, Radon Ser. Comp. Appl. Math. 8 (2009)]: R random shifts
// (here scrambles) of a net a level; the level with the largest variance for its work gets twice the points until the variance of
// the sum is half of error^2; a level more while |mean of the last| / (2^alpha - 1) exceeds error / sqrt(2). Biased.

#include <cmath>
#include <cstdint>
#include <vector>

#include <debias/core/plan.hpp>
#include <debias/survey/levels.hpp>

namespace debias::bench::plain {

struct NetsAnswer {
  double value = 0;
  double work = 0;  ///< of all nets, the smaller ones that larger ones replaced too
};

inline NetsAnswer multilevel_nets(const LevelRuns& runs, std::int64_t lowest, double error, double alpha,
                                  std::uint64_t seed) {
  constexpr std::int64_t scrambles = 32;
  constexpr int first_octaves = 3;
  struct Level {
    int octaves;
    double mean;
    double variance;
    double work;
  };
  NetsAnswer answer;
  std::vector<Level> levels;
  const auto measure = [&](std::size_t l, int octaves) {
    const Plan plan{.samples = scrambles, .seed = seed + 1'000'000 * static_cast<std::uint64_t>(octaves), .threads = 1};
    const NetMoments m = runs.nets(lowest + static_cast<std::int64_t>(l), l == 0, octaves, plan);
    answer.work += m.work;
    return Level{octaves, m.mean.front(), m.variance.back() / static_cast<double>(scrambles), m.work};
  };
  for (;;) {
    levels.push_back(measure(levels.size(), first_octaves));
    for (;;) {
      double variance = 0;
      std::size_t worst = 0;
      for (std::size_t l = 0; l < levels.size(); ++l) {
        variance += levels[l].variance;
        if (levels[l].variance / levels[l].work > levels[worst].variance / levels[worst].work) worst = l;
      }
      if (variance <= error * error / 2 || levels[worst].octaves == NetMoments::most_octaves) break;
      levels[worst] = measure(worst, levels[worst].octaves + 1);
    }
    const double last = std::abs(levels.back().mean) / (std::exp2(alpha) - 1);
    if (levels.size() >= 3 && last <= error / std::sqrt(2)) break;
  }
  for (const Level& level : levels) answer.value += level.mean;
  return answer;
}

}  // namespace debias::bench::plain

#pragma once

// Multilevel Monte Carlo as anybody writes it: the driver of Giles (Acta Numerica 24, 2015) around a function that
// draws one coupled pair, one draw after the other from one stream.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <debias/core/stream.hpp>

namespace debias::bench::plain {

struct MultilevelAnswer {
  double value = 0;
  double work = 0;
};

/// `difference(level, rng)` is one draw of D_level, `work(level)` what it costs. Exponents alpha, beta of the bias and
/// the variance are given, and the work doubles with the level: nothing is left to a regression.
template <class Difference, class Work>
MultilevelAnswer multilevel(const Difference& difference, const Work& work, double error, double alpha, double beta,
                            Stream rng) {
  constexpr double bias_share = 0.25;
  struct Level {
    double n = 0;
    double sum = 0;
    double squares = 0;
    double wanted = 1000;
    double mean = 0;
    double variance = 0;
  };
  std::vector<Level> levels(3);
  for (;;) {
    for (std::size_t l = 0; l < levels.size(); ++l) {
      Level& at = levels[l];
      for (auto missing = static_cast<std::int64_t>(at.wanted - at.n); missing > 0; --missing) {
        const double d = difference(static_cast<int>(l), rng);
        at.sum += d;
        at.squares += d * d;
        ++at.n;
      }
      at.mean = std::abs(at.sum / at.n);
      at.variance = std::max(at.squares / at.n - at.mean * at.mean, 0.0);
      if (l >= 2) {
        at.mean = std::max(at.mean, 0.5 * levels[l - 1].mean * std::exp2(-alpha));
        at.variance = std::max(at.variance, 0.5 * levels[l - 1].variance * std::exp2(-beta));
      }
    }
    double total = 0;
    for (std::size_t l = 0; l < levels.size(); ++l) total += std::sqrt(levels[l].variance * work(static_cast<int>(l)));
    bool enough = true;
    for (std::size_t l = 0; l < levels.size(); ++l) {
      Level& at = levels[l];
      const double best = std::sqrt(at.variance / work(static_cast<int>(l))) * total;
      at.wanted = std::ceil(best / ((1 - bias_share) * error * error));
      enough = enough && at.wanted <= 1.01 * at.n;
    }
    if (!enough) continue;
    double bias = 0;
    const std::size_t last = levels.size() - 1;
    for (std::size_t k = 0; k < 3; ++k) {
      bias = std::max(bias, levels[last - k].mean * std::exp2(-alpha * static_cast<double>(k)));
    }
    if (bias / (std::exp2(alpha) - 1) <= std::sqrt(bias_share) * error) break;
    levels.emplace_back();
    levels.back().variance = levels[last].variance * std::exp2(-beta);
  }
  MultilevelAnswer answer;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    answer.value += levels[l].sum / levels[l].n;
    answer.work += levels[l].n * work(static_cast<int>(l));
  }
  return answer;
}

}  // namespace debias::bench::plain

#include <debias/recipe/nets.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr double least_lambda = 1;           // plain numbers have it
constexpr double most_lambda = 3;            // of a scrambled net [Owen 1997]
constexpr int most_octaves = 26;             // of a level: a net has 2^27 points
constexpr double octaves_known = 0.6;        // to that a variance of 12 nets is known
constexpr double seen_in_blocks = 1.0 / 64;  // the mass of a tail level that a run of 32 blocks or so is likely to see
constexpr int most_steps = 3;                // octaves at once: a net may gain by the second of two

// lambda over the upper half of the octaves.
double lambda_of(const std::vector<double>& variance, double doubts) {
  const std::size_t last = variance.size() - 1;
  double xy = 0;
  double xx = 0;
  const double centre = static_cast<double>(last + last / 2) / 2;
  for (std::size_t j = last / 2; j <= last; ++j) {
    if (!(variance[j] > 0)) return least_lambda;
    const double x = static_cast<double>(j) - centre;
    xy += x * std::log2(variance[j]);
    xx += x * x;
  }
  return xx > 0 ? std::clamp(-xy / xx - doubts * octaves_known / std::sqrt(xx), least_lambda, most_lambda)
                : least_lambda;
}

// What a draw of the tail adds where it begins at a level.
struct Tail {
  double variance = 0;
  double work = 0;
};

std::vector<Tail> tails_of(const std::vector<NetLevel>& levels, double theta) {
  const double q = std::exp2(-theta);
  std::vector<Tail> tails(levels.size() + 1);
  for (std::size_t k = levels.size(); k-- > 0;) {
    const Tail& beyond = tails[k + 1];
    const bool ends = !(beyond.variance > 0);  // 0 / q, with a q that may be 0
    tails[k] = {levels[k].second_moment / (1 - q) + (ends ? 0 : beyond.variance / q),
                (1 - q) * levels[k].work + q * beyond.work};
  }
  return tails;
}

// E (D / p)^4 of a draw of the tail from a level on, as far as one in so many blocks sees it, over the square of a variance.
double fourth_of_tail(const std::vector<NetLevel>& levels, std::size_t first, double theta, double variance) {
  const double q = std::exp2(-theta);
  double fourth = 0;
  double mass = 1 - q;
  for (std::size_t k = first; k < levels.size() && mass >= seen_in_blocks; ++k, mass *= q) {
    fourth += levels[k].kurtosis * std::pow(levels[k].second_moment / variance, 2) / std::pow(mass, 3);
  }
  return fourth;
}

}  // namespace

double NetLevel::variance_of(int octaves, double doubts) const {
  const int last = static_cast<int>(variance.size()) - 1;
  if (octaves <= last) return variance[static_cast<std::size_t>(octaves)];
  const double lambda = plain_beyond ? least_lambda : lambda_of(variance, doubts);
  return variance.back() * std::exp2(-lambda * (octaves - last));
}

double NetBlock::members() const {
  double n = 1;
  for (const int m : log2_counts) n += std::exp2(m);
  return n;
}

std::vector<NetBlock> net_blocks(const std::vector<NetLevel>& levels, double theta,
                                 const std::function<bool(const NetBlock&)>& enough) {
  if (levels.empty() || !(theta > 0)) {
    throw std::invalid_argument("net_blocks: " + std::to_string(levels.size()) + " levels, theta = " + to_text(theta) +
                                " (at least one level, and a tail that falls)");
  }
  const std::vector<Tail> tails = tails_of(levels, theta);
  std::vector<NetBlock> blocks;
  std::vector<int> head = {0};
  for (;;) {
    const Tail& tail = tails[head.size()];
    NetBlock block{head, tail.variance, tail.work};
    for (std::size_t k = 0; k < head.size(); ++k) {
      block.variance += levels[k].variance_of(head[k]);
      block.work += std::exp2(head[k]) * levels[k].work;
    }
    block.kurtosis = 3;
    if (block.variance > 0) {
      block.kurtosis += fourth_of_tail(levels, head.size(), theta, block.variance);
      for (std::size_t k = 0; k < head.size(); ++k) {
        const double share = levels[k].variance_of(head[k]) / block.variance;
        block.kurtosis += share * share * levels[k].kurtosis / std::exp2(head[k]);
      }
    }
    blocks.push_back(block);
    if (enough(block)) return blocks;
    // One level more, or more points of one.
    const std::size_t next = head.size();
    double best = 0;
    std::size_t which = next;
    if (next < levels.size()) {
      const double less = tails[next].variance - tails[next + 1].variance - levels[next].variance_of(0);
      best = less / (levels[next].work + tails[next + 1].work - tails[next].work);
    }
    for (std::size_t k = 0; k < next; ++k) {
      for (int s = 1; s <= most_steps && head[k] + s <= most_octaves; ++s) {
        const double less = levels[k].variance_of(head[k]) - levels[k].variance_of(head[k] + s);
        const double gain = less / (levels[k].work * (std::exp2(head[k] + s) - std::exp2(head[k])));
        if (gain > best) {
          best = gain;
          which = k;
        }
      }
    }
    if (!(best > 0)) return blocks;
    which == next ? head.push_back(0) : static_cast<void>(++head[which]);
  }
}

}  // namespace debias

#pragma once

// Blocks of nets from the variances of their levels: how many points a level gets, and where the tail begins.
//
//   variance of a block  =  sum_(k < K) V_k(2^(m_k))   +  sum_j E D_(K+j)^2 / p_j
//   work of a block      =  sum_(k < K) 2^(m_k) work_k +  sum_j p_j work_(K+j),           p_j = (1 - q) q^j, q = 2^-theta
//   kurtosis of it       =  3 + [sum_k V_k(2^(m_k))^2 kappa_k / 2^(m_k) + sum_j kappa_(K+j) (E D_(K+j)^2)^2 / p_j^3] / variance^2
//
//   Notation: V_k(n) = variance of a mean over n points of level k, kappa_k = E D_k^4 / (E D_k^2)^2, m = log2_counts, K = m.size(),
//   theta = exponent of the tail; of its fourth moments those count that a run of blocks is likely to see.
// With V_k ~ N^-lambda the best N_k are (V_k / work_k)^(1 / (1 + lambda)). Lambda is another one for each level, and powers of two
// are wanted, so the blocks grow greedily instead: by whatever takes most variance for its work, 2, 4 or 8 times the points of one
// level, or one level more with a single point. A draw of the tail counts with its whole second moment: its level is random.
// Beyond the largest net that was measured V_k goes on like over its upper half, with lambda in [1, 3].
// Fails where a level has shown no V_k that holds (rare values): the caller has to see that it has.
// Source: derived; Giles & Waterhouse 2009 double greedily, too, in multilevel.

#include <functional>
#include <vector>

namespace debias {

/// A level as blocks of nets are chosen for it: the base's value, then differences.
struct NetLevel {
  std::vector<double> variance;  ///< V(1), V(2), V(4), ...; not empty, falls
  double second_moment = 0;      ///< E D^2
  double work = 1;               ///< of a point
  double kurtosis = 3;           ///< of a point: E D^4 / (E D^2)^2
  bool plain_beyond = false;     ///< lambda is 1 beyond what was measured

  /// V(2^octaves). Beyond the measured octaves lambda is one fitted to a few nets: `doubts` of its standard errors are taken from
  /// it, so that a block whose gain is hoped for only shows it.
  [[nodiscard]] double variance_of(int octaves, double doubts = 0) const;
};

struct NetBlock {
  std::vector<int> log2_counts;  ///< m_k of the head
  double variance = 0;
  double work = 0;      ///< expected
  double kurtosis = 3;  ///< of a block's mean, from independent levels

  /// Members: all points, and the draw of the tail.
  [[nodiscard]] double members() const;
};

/// Blocks in the order of their growth, until one is `enough` or nothing is gained by another. Levels beyond the list count
/// for nothing. Throws std::invalid_argument unless there is a level, and theta > 0.
std::vector<NetBlock> net_blocks(const std::vector<NetLevel>& levels, double theta,
                                 const std::function<bool(const NetBlock&)>& enough);

}  // namespace debias

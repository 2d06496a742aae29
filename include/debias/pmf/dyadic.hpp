#pragma once

// The PMF of blocks of nets: whole powers of two of members at the first levels, then one draw of a geometric tail.
//
//   n = 2^(m_0) + ... + 2^(m_(K-1)) + 1
//   p_k = 2^(m_k) / n for k < K,   p_(K+i) = (1 - q) q^i / n,  q = 2^-theta
//
//   Notation: m = log2_counts, n = block(). Residual strata of n members give level k < K exactly 2^(m_k) of them, each of
//   weight 2^-(m_k), and draw the one that is left from the tail.
// A net needs whole powers of two: with a count that varies from block to block by one, d_k^2 / (n p_k)^2 of it stays as
// variance, d_k = E D_k, and nothing is gained. As with a geometric PMF finite variance needs theta < beta and finite expected
// work theta > gamma; blocks have a fourth moment only where 3 theta < 2 beta.
// Fails (no gain) where K is so small that the tail holds most of the variance: take levels until E D_K^2 is small.
// Source: derived; compare Vihola, Oper. Res. 66 (2018), residual sampling.

#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/pmf.hpp>
#include <debias/core/rates.hpp>
#include <debias/pmf/tabulated.hpp>

namespace debias {

class Dyadic {
 public:
  /// Throws std::invalid_argument unless there is at least one level, every m_k lies in [0, 40] and theta in [2^-40, 53].
  Dyadic(std::vector<int> log2_counts, double theta);

  double mass(std::int64_t j) const { return table_.mass(j); }
  double tail(std::int64_t j) const { return table_.tail(j); }
  std::int64_t sample(double u) const { return table_.sample(u); }

  /// Members of a block.
  [[nodiscard]] std::int64_t block() const { return block_; }
  /// Members of a block that draw outcome j without chance: 2^(m_j), or none in the tail.
  [[nodiscard]] std::int64_t copies(std::int64_t j) const {
    return j >= 0 && j < static_cast<std::int64_t>(log2_counts_.size())
               ? std::int64_t{1} << log2_counts_[static_cast<std::size_t>(j)]
               : 0;
  }

  TailExponent tail_exponent() const { return {theta_}; }
  std::string spec() const;  ///< `dyadic:10,8,5;theta=1.25`, with the m_k

 private:
  std::vector<int> log2_counts_;
  double theta_;
  std::int64_t block_;
  Tabulated table_;
};

/// The theta to take: three quarters of the way from gamma, where the work becomes infinite, to 2 beta / 3, where the fourth
/// moment of a block does: 1.25 for beta = 2, 2.25 for beta = 4. Where there is no room, (beta + gamma) / 2: variance and work
/// are finite, the fourth moment is not.
/// Throws std::invalid_argument where no PMF has finite variance and finite work, or where the decay is not geometric.
double dyadic_exponent(const Rates& rates);

}  // namespace debias

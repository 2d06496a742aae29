#include <debias/recipe/optimal_pmf.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr double half_octave = 1.4142135623730951;
constexpr double least_left = 1e-9;  // of a variance: a level without any is still drawn
constexpr double tolerance = 1e-9;   // of the price
constexpr double block_tolerance =
    1e-4;  // the same in blocks, where each price takes longer and the product is as flat

[[noreturn]] void refuse(const std::string& function, const std::string& problem) {
  throw std::invalid_argument(function + ": " + problem);
}

void check_size(const std::string& function, std::size_t size, std::size_t expected) {
  if (size == expected && size > 0) return;
  refuse(function, std::to_string(size) + " entries where " + std::to_string(expected) +
                       " levels are (one for each level, at least one)");
}

void check_positive(const std::string& function, const char* what, std::size_t k, double x) {
  if (x > 0 && std::isfinite(x)) return;
  refuse(function, std::string(what) + " of level " + std::to_string(k) + " = " + to_text(x) +
                       " (must be positive and finite); take an upper bound where none was seen");
}

// What is left of a variance where `members` run together; it falls like a power between entries, and beyond them like
// over the last ones.
double left_at(const std::vector<std::vector<double>>& shares, std::size_t k, double members) {
  if (shares.empty() || shares[k].empty() || !(members > 1)) return 1;
  const std::vector<double>& share = shares[k];
  const std::size_t last = share.size() - 1;
  const double octave = std::log2(members);
  const auto i = std::min(static_cast<std::size_t>(octave), last);
  const double beyond = octave - static_cast<double>(i);
  if (share[i] == 0) return 0;
  if (i < last) return share[i] * std::pow(share[i + 1] / share[i], beyond);
  const std::size_t before = last > 2 ? last - 2 : 0;
  return last == 0 ? share[0]
                   : share[last] * std::pow(share[last] / share[before], beyond / static_cast<double>(last - before));
}

double members_at(const TermMoments& m, double p) { return static_cast<double>(m.block) * p; }

double base_variance(const TermMoments& m, std::size_t k, double p) {
  return m.base_variance.empty() ? 0 : m.base_variance[k] * left_at(m.base_left, k, members_at(m, p));
}

// a_k as it acts at mass p.
double square_at(const TermMoments& m, std::size_t k, double p) {
  if (m.block <= 1) return m.variance[k] + m.mean_square[k];
  const double n = members_at(m, p);
  return m.variance[k] * std::max(least_left, left_at(m.variance_left, k, n)) +
         m.mean_square[k] * std::min(1.0, 1 / (4 * n));
}

// (1 + e) a_k where a_k falls like p^-e: what counts for the best p, where a_k / p + price p is least.
double square_of_best(const TermMoments& m, std::size_t k, double p) {
  const double a = square_at(m, k, p);
  if (m.block <= 1) return a;
  const double after = square_at(m, k, p * half_octave);
  if (!(after > 1e-290)) return a;  // digits are lost there
  return a * (1 + std::log2(square_at(m, k, p / half_octave) / after));
}

// The p with the least sum_k p_k (b_k + s w_k) + a_k / p_k on the simplex: p_k = sqrt(a_k / (b_k + s w_k + t)).
std::vector<double> best_at_price(const std::vector<double>& a, const std::vector<double>& price) {
  const double least = *std::min_element(price.begin(), price.end());
  // Newton's method on S(t)^-2 = 1, S = sum_k p_k: that is concave, a mean of order -1/2 of the prices, so it comes
  // from below and never passes the root.
  double t = 0;  // S >= 1 here: the cheapest level alone asks for that much
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (price[k] == least) t = std::max(t, a[k]);
  }
  for (int i = 0; i < 100; ++i) {
    double total = 0;
    double slope = 0;  // of S, times -2
    for (std::size_t k = 0; k < a.size(); ++k) {
      const double excess = price[k] - least + t;
      const double term = std::sqrt(a[k] / excess);
      total += term;
      slope += term / excess;
    }
    const double next = t + total * (total * total - 1) / slope;
    if (!(next > t * (1 + 1e-15))) break;
    t = next;
  }
  std::vector<double> p(a.size());
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += p[k] = std::sqrt(a[k] / (price[k] - least + t));
  for (double& x : p) x /= sum;
  return p;
}

}  // namespace

VarianceAndWork predict(const TermMoments& m, std::span<const double> masses) {
  check_size("predict", m.variance.size(), masses.size());
  VarianceAndWork result{m.fixed_variance, m.fixed_work};
  for (std::size_t k = 0; k < masses.size(); ++k) {
    const double p = masses[k];
    result.variance += base_variance(m, k, p) * p + square_at(m, k, p) / p;
    if (!m.covariance.empty()) {
      const double n = members_at(m, p);
      result.variance += 2 * m.covariance[k] * std::sqrt(left_at(m.base_left, k, n) * left_at(m.variance_left, k, n));
    }
    result.work += m.work[k] * p;
  }
  // Deterministic terms can cancel the squared limit exactly: what is left then is rounding.
  const double rounding = 64 * std::numeric_limits<double>::epsilon() * std::abs(m.fixed_variance);
  if (std::abs(result.variance) <= rounding) result.variance = 0;
  return result;
}

std::vector<double> best_masses(const TermMoments& m) {
  const std::size_t n = m.work.size();
  check_size("best_masses", m.variance.size(), n);
  check_size("best_masses", m.mean_square.size(), n);
  if (!m.base_variance.empty()) check_size("best_masses", m.base_variance.size(), n);
  std::vector<double> a(n);
  for (std::size_t k = 0; k < n; ++k) {
    a[k] = m.variance[k] + m.mean_square[k];
    check_positive("best_masses", "the second moment", k, a[k]);
    check_positive("best_masses", "the work", k, m.work[k]);
  }
  // At a price s of work, the problem is convex. The product is least where s is the variance for a unit of work
  // at the p that belongs to s; variance / work grows with s, but more slowly.
  std::vector<double> p(n, 1 / static_cast<double>(n));
  std::vector<double> price(n);
  const auto solve_at = [&](double s) {
    for (int i = 0; i < (m.block > 1 ? 6 : 1); ++i) {  // strata: a depends on p, and falls up to twice as fast
      double sum = 0;
      for (std::size_t k = 0; k < n; ++k) {
        a[k] = square_of_best(m, k, p[k]);
        price[k] = base_variance(m, k, p[k]) + s * m.work[k];
      }
      const std::vector<double> next = best_at_price(a, price);
      for (std::size_t k = 0; k < n; ++k) sum += p[k] = m.block > 1 ? std::sqrt(p[k] * next[k]) : next[k];
      for (double& x : p) x /= sum;
    }
    const VarianceAndWork now = predict(m, p);
    return now.variance / now.work;
  };
  const double start = std::max(solve_at(1), std::numeric_limits<double>::min());
  double low = start;
  double high = start;
  for (int i = 0; i < 100 && solve_at(low) < low && low > 1e-290; ++i) low /= 8;
  for (int i = 0; i < 100 && solve_at(high) > high && high < 1e290; ++i) high *= 8;
  while (high > low * (1 + (m.block > 1 ? block_tolerance : tolerance))) {
    const double middle = std::sqrt(low) * std::sqrt(high);
    if (!(middle > low && middle < high)) break;
    (solve_at(middle) > middle ? low : high) = middle;
  }
  return p;
}

std::vector<double> best_tails(std::span<const double> increments, std::span<const double> work) {
  check_size("best_tails", increments.size(), work.size());
  // The hull by pooling: a block takes in what follows as long as that would fall more slowly.
  struct Block {
    double increment;
    double work;
    std::size_t levels;
    [[nodiscard]] double slope() const { return std::max(increment, 0.0) / work; }
  };
  std::vector<Block> blocks;
  for (std::size_t k = 0; k < work.size(); ++k) {
    check_positive("best_tails", "the work", k, work[k]);
    Block block{increments[k], work[k], 1};
    while (!blocks.empty() && block.slope() >= blocks.back().slope()) {
      block.increment += blocks.back().increment;
      block.work += blocks.back().work;
      block.levels += blocks.back().levels;
      blocks.pop_back();
    }
    blocks.push_back(block);
  }
  std::vector<double> q;
  const double steepest = blocks.front().slope();
  check_positive("best_tails", "the increment", 0, steepest);
  for (const Block& block : blocks) {
    q.insert(q.end(), block.levels, std::sqrt(block.slope() / steepest));
  }
  return q;
}

}  // namespace debias

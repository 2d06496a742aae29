#include <debias/recipe/optimal_pmf.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <boost/math/tools/toms748_solve.hpp>

#include "core/text.hpp"
#include "recipe/choice.hpp"

namespace debias {
namespace {

constexpr double half_octave = 1.4142135623730951;
constexpr double least_left = 1e-9;  // of a variance: a level without any is still drawn
constexpr double tolerance = 1e-9;   // of the price
constexpr double block_tolerance =
    1e-4;                               // the same in blocks, where each price takes longer and the product is as flat
constexpr double settled = 1e-7;        // masses that move no more
constexpr double log_step = 2;          // of the price, where its bracket is sought
constexpr double most_log_price = 667;  // 10^290

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

// What is left of a variance where members run together; it falls like a power between entries, and beyond them like over
// the last ones. In logarithms, since a search asks for thousands of them.
class Left {
 public:
  explicit Left(const std::vector<double>& shares) {
    for (const double share : shares) log2_.push_back(std::log2(share));
  }
  /// Of so many members.
  [[nodiscard]] double at(double members) const {
    if (log2_.empty() || !(members > 1)) return 1;
    const double octave = std::log2(members);
    const std::size_t last = log2_.size() - 1;
    const auto i = std::min(static_cast<std::size_t>(octave), last);
    const double beyond = octave - static_cast<double>(i);
    if (!(beyond > 0) || std::isinf(log2_[i])) return std::exp2(log2_[i]);
    const std::size_t from = i < last || last == 0 ? i : last > 2 ? last - 2 : 0;
    const std::size_t to = std::min(i + 1, last);
    const double slope = to > from ? (log2_[to] - log2_[from]) / static_cast<double>(to - from) : 0;
    return std::exp2(log2_[i] + slope * beyond);
  }

 private:
  std::vector<double> log2_;
};

// The moments of each level as they act at a mass.
class Levels {
 public:
  explicit Levels(const TermMoments& m) : m_(m) {
    const auto first_of = [n = m.work.size()](const std::vector<std::vector<double>>& shares) {
      const auto end = shares.begin() + static_cast<std::ptrdiff_t>(std::min(n, shares.size()));
      return std::vector<Left>(shares.begin(), end);
    };
    variance_left_ = first_of(m.variance_left);
    base_left_ = first_of(m.base_left);
  }

  [[nodiscard]] double base_variance(std::size_t k, double p) const {
    return m_.base_variance.empty() ? 0 : m_.base_variance[k] * left(base_left_, k, members_at(p));
  }

  // a_k
  [[nodiscard]] double square(std::size_t k, double p) const { return square_of(k, members_at(p)); }

  // (1 + e) a_k where a_k falls like p^-e: what counts for the best p, where a_k / p + price p is least.
  [[nodiscard]] double square_of_best(std::size_t k, double p) const {
    const double n = members_at(p);
    const double a = square_of(k, n);
    if (m_.block <= 1) return a;
    const double after = square_of(k, n * half_octave);
    if (!(after > 1e-290)) return a;  // digits are lost there
    return a * (1 + std::log2(square_of(k, n / half_octave) / after));
  }

  [[nodiscard]] VarianceAndWork predict(std::span<const double> masses) const {
    VarianceAndWork result{m_.fixed_variance, m_.fixed_work};
    for (std::size_t k = 0; k < masses.size(); ++k) {
      const double p = masses[k];
      result.variance += base_variance(k, p) * p + square(k, p) / p;
      if (!m_.covariance.empty()) {
        const double n = members_at(p);
        result.variance += 2 * m_.covariance[k] * std::sqrt(left(base_left_, k, n) * left(variance_left_, k, n));
      }
      result.work += m_.work[k] * p;
    }
    // Deterministic terms can cancel the squared limit exactly: what is left then is rounding.
    const double rounding = 64 * std::numeric_limits<double>::epsilon() * std::abs(m_.fixed_variance);
    if (std::abs(result.variance) <= rounding) result.variance = 0;
    return result;
  }

 private:
  // Nothing is said of it where nothing runs together.
  static double left(const std::vector<Left>& left, std::size_t k, double members) {
    return left.empty() ? 1 : left[k].at(members);
  }
  [[nodiscard]] double members_at(double p) const { return static_cast<double>(m_.block) * p; }
  [[nodiscard]] double square_of(std::size_t k, double members) const {
    if (m_.block <= 1) return m_.variance[k] + m_.mean_square[k];
    return m_.variance[k] * std::max(least_left, left(variance_left_, k, members)) +
           m_.mean_square[k] * std::min(1.0, 1 / (4 * members));
  }

  const TermMoments& m_;
  std::vector<Left> variance_left_;
  std::vector<Left> base_left_;
};

// The p with the least sum_k p_k (b_k + s w_k) + a_k / p_k on the simplex: p_k = sqrt(a_k / (b_k + s w_k + t)). The search for t
// goes on from where the last one ended.
std::vector<double> best_at_price(const std::vector<double>& a, const std::vector<double>& price, double& t) {
  const double least = *std::min_element(price.begin(), price.end());
  double lowest = 0;  // S >= 1 here: the cheapest level alone asks for that much
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (price[k] == least) lowest = std::max(lowest, a[k]);
  }
  t = std::max(t, lowest);
  // Newton's method on S(t)^-2 = 1, S = sum_k p_k: that is concave, a mean of order -1/2 of the prices, so that after a first
  // step it comes from below and never passes the root.
  constexpr double close = 1e-8;  // whose square is left behind such a step
  for (int i = 0; i < 100; ++i) {
    double total = 0;
    double slope = 0;  // of S, times -2
    for (std::size_t k = 0; k < a.size(); ++k) {
      const double excess = price[k] - least + t;
      const double term = std::sqrt(a[k] / excess);
      total += term;
      slope += term / excess;
    }
    const double next = std::max(lowest, t + total * (total * total - 1) / slope);
    const bool settles = !(std::abs(next - t) > close * t);
    t = next;
    if (settles) break;
  }
  std::vector<double> p(a.size());
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += p[k] = std::sqrt(a[k] / (price[k] - least + t));
  for (double& x : p) x /= sum;
  return p;
}

// The same moments of values that are near 1: those of tiny ones would lose their digits.
TermMoments in_own_unit(TermMoments m) {
  double largest = 0;
  for (const std::vector<double>* squares : {&m.variance, &m.mean_square}) {
    for (const double x : *squares) largest = std::isfinite(x) ? std::max(largest, x) : largest;
  }
  const int octaves = largest > 0 ? -std::ilogb(largest) : 0;
  for (std::vector<double>* squares : {&m.variance, &m.mean_square, &m.base_variance, &m.covariance}) {
    for (double& x : *squares) x = std::ldexp(x, octaves);
  }
  m.fixed_variance = std::ldexp(m.fixed_variance, octaves);
  return m;
}

}  // namespace

VarianceAndWork predict(const TermMoments& m, std::span<const double> masses) {
  check_size("predict", m.variance.size(), masses.size());
  return Levels(m).predict(masses);
}

double least_product(const TermMoments& m) {
  // Cauchy and Schwarz; a level alone has all members, and then its least variance.
  const Levels levels(m);
  double base = m.base_variance.empty() ? 0 : std::numeric_limits<double>::infinity();
  double root = 0;
  for (std::size_t k = 0; k < m.work.size(); ++k) {
    if (!m.base_variance.empty()) base = std::min(base, levels.base_variance(k, 1));
    root += std::sqrt(levels.square(k, 1) * m.work[k]);
  }
  const double fixed = m.fixed_variance + base;
  if (!(fixed >= 0) || !m.covariance.empty()) return 0;
  root += std::sqrt(fixed * m.fixed_work);
  return root * root;
}

std::vector<double> best_masses(const TermMoments& moments) {
  const TermMoments m = in_own_unit(moments);
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
  const Levels levels(m);
  std::vector<double> p(n, 1 / static_cast<double>(n));
  std::vector<double> price(n);
  double t = 0;
  const auto solve_at = [&](double s) {
    double moved = 1;
    const int rounds = m.block > 1 ? 6 : 1;  // strata: a depends on p, and falls up to twice as fast
    for (int i = 0; i < rounds && moved > settled; ++i) {
      double sum = 0;
      for (std::size_t k = 0; k < n; ++k) {
        a[k] = levels.square_of_best(k, p[k]);
        price[k] = levels.base_variance(k, p[k]) + s * m.work[k];
      }
      std::vector<double> next = best_at_price(a, price, t);
      for (std::size_t k = 0; k < n; ++k) sum += next[k] = m.block > 1 ? std::sqrt(p[k] * next[k]) : next[k];
      moved = 0;
      for (std::size_t k = 0; k < n; ++k) {
        next[k] /= sum;
        moved = std::max(moved, std::abs(next[k] / p[k] - 1));
      }
      p = std::move(next);
    }
    const VarianceAndWork now = levels.predict(p);
    return now.variance / now.work;
  };
  // ln of both sides: the difference falls, and its root is bracketed before it is sought.
  const auto excess = [&](double log_price) {
    const double found = solve_at(std::exp(log_price));
    return found > 0 ? std::log(found) - log_price : -most_log_price;
  };
  // From even masses, whose price has the units of the problem: none has a part in what is found.
  const VarianceAndWork even = levels.predict(p);
  const double start = std::log(std::max(even.variance / even.work, std::numeric_limits<double>::min()));
  const double at_start = excess(start);
  const double step = at_start > 0 ? log_step : -log_step;
  double here = start;
  double at_here = at_start;
  double before = here;
  double at_before = at_here;
  while (at_here != 0 && (at_here > 0) == (at_start > 0) && std::abs(here) < most_log_price) {
    before = here;
    at_before = at_here;
    here += step;
    at_here = excess(here);
  }
  if ((at_here > 0) == (at_before > 0)) return p;  // no variance at any price
  const double close = m.block > 1 ? block_tolerance : tolerance;
  std::uintmax_t most_steps = 100;
  const auto is_close = [close](double x, double y) { return std::abs(x - y) <= close; };
  const auto [low, high] =
      step > 0 ? boost::math::tools::toms748_solve(excess, before, here, at_before, at_here, is_close, most_steps)
               : boost::math::tools::toms748_solve(excess, here, before, at_here, at_before, is_close, most_steps);
  solve_at(std::exp((low + high) / 2));
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

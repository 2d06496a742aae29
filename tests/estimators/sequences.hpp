#pragma once

// Sequences whose moments are known exactly, for the tests of the estimators.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <debias/core/sequence.hpp>

namespace debias::trial {

inline double power(double x, std::int64_t k) { return std::pow(x, static_cast<double>(k)); }

/// 1 + q + q^2 + ... without noise; level k costs k + 1.
struct GeometricSeries {
  double q = 0.25;

  Draw<double> operator()(std::int64_t level, Stream&) const {
    return {partial(level), power(q, level), static_cast<double>(level) + 1};
  }
  double partial(std::int64_t level) const { return (1 - power(q, level + 1)) / (1 - q); }
  double truth() const { return 1 / (1 - q); }
};

/// (E X)^2 = 1 with X exponential: I_k is the square of the mean of 2^k draws, the coarse partner the average of
/// the squares of the means of the two halves (A10). Costs its draws.
struct SquaredMean {
  static constexpr Rates rates{2, 1};

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const std::vector<double> x = draws(level, rng);
    return {block_average(x, x.size()), difference(x), static_cast<double>(x.size())};
  }
  double truth() const { return 1; }

  // n = 2^level draws for the value, n / 2 for each half.
  static double value_mean(std::int64_t level) { return 1 + power(2, -level); }
  static double value_variance(std::int64_t level) {
    const double n = power(2, level);
    return (n + 1) * (n + 2) * (n + 3) / (n * n * n) - value_mean(level) * value_mean(level);
  }
  static double difference_mean(std::int64_t level) { return -power(2, -level); }
  static double difference_square(std::int64_t level) {
    const double half = power(2, level - 1);
    return 0.75 * (half + 1) / (half * half * half);
  }

 protected:
  static std::vector<double> draws(std::int64_t level, Stream& rng) {
    std::vector<double> x(std::size_t{1} << level);
    for (double& v : x) v = rng.exponential();
    return x;
  }
  /// The average over all blocks of `size` draws of the square of the block's mean.
  static double block_average(const std::vector<double>& x, std::size_t size) {
    double average = 0;
    for (std::size_t i = 0; i < x.size(); i += size) {
      double sum = 0;
      for (std::size_t k = i; k < i + size; ++k) sum += x[k];
      const double mean = sum / static_cast<double>(size);
      average += mean * mean * static_cast<double>(size) / static_cast<double>(x.size());
    }
    return average;
  }
  static double difference(const std::vector<double>& x) {
    const double fine = block_average(x, x.size());
    return x.size() == 1 ? fine : fine - block_average(x, x.size() / 2);
  }
};

/// The same, with the base averaged over every block of the draws of the level.
struct SharingSquaredMean : SquaredMean {
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    const std::vector<double> x = draws(level, rng);
    return {block_average(x, std::size_t{1} << base_level), difference(x), static_cast<double>(x.size())};
  }
};

/// A uniform at every level: the differences are zero.
struct Steady {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double u = rng.uniform();
    return level == 0 ? base(u) : Draw<double>{u, 0, 1};
  }
  double truth() const { return 0.5; }
};

/// exp(-integral of 2x over [0, 1]) = 1 / e from combs of 2^k equidistant points with one random offset; the
/// coarse partner is the average over the even and the odd points, the shared base that over all residues (B02).
struct Comb {
  static constexpr Rates rates{4, 1};

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double offset = rng.uniform();
    const std::int64_t n = std::int64_t{1} << level;
    return {transmittance(offset, n, 1), difference(offset, n), static_cast<double>(n)};
  }
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    const double offset = rng.uniform();
    const std::int64_t n = std::int64_t{1} << level;
    return {transmittance(offset, n, std::int64_t{1} << (level - base_level)), difference(offset, n),
            static_cast<double>(n)};
  }
  double truth() const { return std::exp(-1.0); }

 protected:
  /// exp(-S) over the points (offset + r + i stride) / n of one residue r.
  static double residue(double offset, std::int64_t n, std::int64_t stride, std::int64_t r) {
    double sum = 0;
    for (std::int64_t i = r; i < n; i += stride) sum += 2 * (offset + static_cast<double>(i)) / static_cast<double>(n);
    return std::exp(-sum * static_cast<double>(stride) / static_cast<double>(n));
  }
  static double transmittance(double offset, std::int64_t n, std::int64_t stride) {
    double average = 0;
    for (std::int64_t r = 0; r < stride; ++r) average += residue(offset, n, stride, r) / static_cast<double>(stride);
    return average;
  }
  static double difference(double offset, std::int64_t n) {
    const double fine = transmittance(offset, n, 1);
    return n == 1 ? fine : fine - transmittance(offset, n, 2);
  }
};

/// The terms of GeometricSeries.
struct GeometricTerms {
  double q = 0.25;
  auto operator()(Stream&) const {
    return [term = 1.0, ratio = q]() mutable {
      const double now = term;
      term *= ratio;
      return Term<double>{now};
    };
  }
  double truth() const { return 1 / (1 - q); }
};

/// 1 / E X = 4/3 with 1 - X = U / 2: terms are products of independent 1 - X.
struct ReciprocalTerms {
  auto operator()(Stream& rng) const {
    return [&rng, term = 1.0]() mutable {
      const double now = term;
      term *= rng.uniform() / 2;
      return Term<double>{now, 2};
    };
  }
  double truth() const { return 4.0 / 3; }
  /// ||I - I_(k-1)||^2 - ||I - I_k||^2: E (1 - X)^2 = 1/12, and the rest from any term on has E = 20/11.
  static double coupled_square(std::int64_t k) { return 5.0 / 3 * power(12, -k); }
};

/// A uniform, then zeros.
struct SteadyTerms {
  auto operator()(Stream& rng) const {
    return [u = rng.uniform(), k = 0]() mutable { return Term<double>{k++ == 0 ? u : 0.0}; };
  }
  double truth() const { return 0.5; }
};

}  // namespace debias::trial

#pragma once

// Power series of the functions of functions.hpp about a point a, coefficient by coefficient.
//
//   g(a + h) = sum_k C_k (h / scale)^k for |h| < radius;  the k-th call returns C_(k-1), each from the one
// before
//
//   exponential  C_k = C_0 (+-scale)^k / k!   binomial  C_k = C_0 p (p - 1) ... (p - k + 1) / k!
//   logarithm    C_k = -(-1)^k / k            logistic  (k + 1) u_(k+1) = ([k = 0] - sum_j u_j u_(k-j)) / 2
//
// The scales are such that no coefficient overflows: about a large a those of exp are Poisson masses.
// Logistic: u = tanh(x / 2) = 2 g - 1 has poles at +-i pi, +-3 i pi, ...; beyond k = 63 the residues of the
// nearest ones are u_k.

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

namespace debias::functions {

/// C_0 e^(+-h): `sign` is that of the exponent.
class ExponentialSeries {
 public:
  ExponentialSeries(double value, double sign, double centre)
      : scale(std::max(1.0, std::abs(centre))), step_(sign * scale), next_(value) {}
  double operator()() {
    const double now = next_;
    next_ *= step_ / ++k_;
    return now;
  }

  double scale;
  static constexpr double radius = std::numeric_limits<double>::infinity();

 private:
  double step_;
  double next_;
  double k_ = 0;
};

/// C_0 (1 + h / distance)^exponent, `distance` from the singularity to the centre.
class BinomialSeries {
 public:
  BinomialSeries(double value, double exponent, double distance)
      : scale(distance), radius(std::abs(distance)), exponent_(exponent), next_(value) {}
  double operator()() {
    const double now = next_;
    next_ *= (exponent_ - k_) / (k_ + 1);
    ++k_;
    return now;
  }

  double scale;
  double radius;

 private:
  double exponent_;
  double next_;
  double k_ = 0;
};

/// log a + log(1 + h / a).
class LogSeries {
 public:
  explicit LogSeries(double a) : scale(a), radius(a), next_(std::log(a)) {}
  double operator()() {
    const double now = next_;
    ++k_;
    sign_ = -sign_;
    next_ = sign_ / k_;
    return now;
  }

  double scale;
  double radius;

 private:
  double next_;
  double sign_ = -1;
  double k_ = 0;
};

/// A polynomial of degree 2 about the centre; zero from there on.
class QuadraticSeries {
 public:
  QuadraticSeries(double c0, double c1, double c2) : next_{c0, c1, c2} {}
  double operator()() { return k_ < next_.size() ? next_[k_++] : 0.0; }

  static constexpr double scale = 1;
  static constexpr double radius = std::numeric_limits<double>::infinity();

 private:
  std::array<double, 3> next_;
  std::size_t k_ = 0;
};

/// 1 / (1 + e^-x) about a.
class LogisticSeries {
 public:
  explicit LogisticSeries(double a) : scale(std::hypot(a, std::numbers::pi)), radius(scale), centre_(a) {}

  double operator()() {
    const std::size_t k = k_++;
    double u = 0;
    if (k == 0) {
      u = std::tanh(centre_ / 2);
    } else if (k < known_.size()) {
      double sum = k == 1 ? -1.0 : 0.0;  // u_j u_(k-1-j) over j, less [k = 1]
      for (std::size_t j = 0; j < k; ++j) sum += known_[j] * known_[k - 1 - j];
      u = -0.5 * scale * sum / static_cast<double>(k);
    } else {
      u = 2 * of_the_poles(static_cast<double>(k));
    }
    if (k < known_.size()) known_[k] = u;
    return k == 0 ? 1 / (1 + std::exp(-centre_)) : 0.5 * u;
  }

  double scale;
  double radius;

 private:
  /// sum over the poles p of -scale^k / (p - a)^(k+1), all with residue 1.
  [[nodiscard]] double of_the_poles(double k) const {
    double sum = 0;
    for (int n = 0;; ++n) {
      const std::complex<double> to_pole(-centre_, (2 * n + 1) * std::numbers::pi);
      const double size = 2 * std::pow(scale / std::abs(to_pole), k) / std::abs(to_pole);
      sum -= size * std::cos((k + 1) * std::arg(to_pole));
      if (n > 0 && size < 1e-17 * 2 / scale) return sum;
    }
  }

  double centre_;
  std::size_t k_ = 0;
  std::array<double, 64> known_{};
};

}  // namespace debias::functions

#pragma once

// Matrices with known spectra.

#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Sparse>

namespace debias::testing {

using Sparse = Eigen::SparseMatrix<double>;

/// M08: tridiagonal(-1, 2 + shift, -1), eigenvalues 2 + shift - 2 cos(k pi / (n + 1)).
inline Sparse chain(Eigen::Index n, double shift) {
  std::vector<Eigen::Triplet<double>> entries;
  for (Eigen::Index i = 0; i < n; ++i) {
    entries.emplace_back(i, i, 2 + shift);
    if (i > 0) entries.emplace_back(i, i - 1, -1.0);
    if (i + 1 < n) entries.emplace_back(i, i + 1, -1.0);
  }
  Sparse a(n, n);
  a.setFromTriplets(entries.begin(), entries.end());
  return a;
}

/// log det of the chain: (n + 1) t + log1p(-e^(-2 (n + 1) t)) - ln(2 sinh t), 2 cosh t = 2 + shift.
inline double log_det_of_chain(double n, double shift) {
  const double t = 2 * std::asinh(std::sqrt(shift) / 2);
  return (n + 1) * t + std::log1p(-std::exp(-2 * (n + 1) * t)) - std::log(2 * std::sinh(t));
}

/// The Laplacian of a square grid with zero boundary, and a shift.
inline Sparse grid(Eigen::Index side, double shift) {
  Sparse a(side * side, side * side);
  a.reserve(Eigen::VectorXi::Constant(side * side, 5));
  for (Eigen::Index y = 0; y < side; ++y) {
    for (Eigen::Index x = 0; x < side; ++x) {
      const Eigen::Index here = y * side + x;
      if (y > 0) a.insert(here - side, here) = -1;
      if (x > 0) a.insert(here - 1, here) = -1;
      a.insert(here, here) = 4 + shift;
      if (x + 1 < side) a.insert(here + 1, here) = -1;
      if (y + 1 < side) a.insert(here + side, here) = -1;
    }
  }
  a.makeCompressed();
  return a;
}

/// Its log det: a chain for each eigenvalue of the other direction.
inline double log_det_of_grid(Eigen::Index side, double shift) {
  double sum = 0;
  for (Eigen::Index k = 1; k <= side; ++k) {
    const double half = std::sin(std::numbers::pi * static_cast<double>(k) / (2 * static_cast<double>(side + 1)));
    sum += log_det_of_chain(static_cast<double>(side), shift + 4 * half * half);
  }
  return sum;
}

/// A kernel matrix exp(-(i - j)^2 / (2 length^2)) + nugget on the identity: a few eigenvalues stick out.
inline Eigen::MatrixXd kernel(Eigen::Index n, double length, double nugget) {
  Eigen::MatrixXd k(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const double d = static_cast<double>(i - j) / length;
      k(i, j) = std::exp(-d * d / 2) + (i == j ? nugget : 0);
    }
  }
  return k;
}

// Factorisations, compiled once (matrices.cpp).

/// tr f(A) by eigenvalues.
double trace_by_eigenvalues(const Eigen::MatrixXd& a, const std::function<double(double)>& f);
/// f(A) by eigenvectors.
Eigen::MatrixXd function_by_eigenvalues(const Eigen::MatrixXd& a, const std::function<double(double)>& f);
double largest_eigenvalue(const Eigen::MatrixXd& a);
Eigen::MatrixXd inverse_of(const Eigen::MatrixXd& a);
/// A^-1 b.
Eigen::VectorXd solved(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

}  // namespace debias::testing

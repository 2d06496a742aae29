#pragma once

// The checks of an operator before its first term: symmetric, finite, and inside its bounds (operators/bounds.hpp says what
// Gershgorin and Lanczos prove, and what they can only refute).

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include <debias/operators/bounds.hpp>
#include <debias/operators/symmetric.hpp>

namespace debias {

namespace detail {

template <SymmetricOperator A>
RitzValues lanczos(const char* name, const HeldOperator<A>& a, int steps) {
  if (steps < 2) refuse_operator(name, "steps = " + std::to_string(steps) + " (Lanczos takes 2 or more)");
  std::vector<double> q = setup_vector(a.rows(), 3);
  std::vector<double> previous(a.rows());
  std::vector<double> scratch(HeldOperator<A>::fused ? 0 : a.rows());
  std::vector<double> diagonal;
  std::vector<double> beside;
  double length = std::sqrt(dot(q, q));
  double scale = 0;
  for (int k = 0; k < steps; ++k) {
    for (double& x : q) x /= length;
    const double before = k == 0 ? 0 : beside.back();
    // previous <- A q - before previous, then less its part along q: the next direction
    const double along = a.step(q, previous, 1, 0, -before, scratch).cross;
    if (!std::isfinite(along)) refuse_operator(name, "A times a finite vector is not finite");
    for (std::size_t i = 0; i < q.size(); ++i) previous[i] -= along * q[i];
    length = std::sqrt(dot(previous, previous));
    diagonal.push_back(along);
    beside.push_back(length);
    scale = std::max({scale, std::abs(along), length});
    q.swap(previous);
    if (!(length > 1e-14 * scale)) break;  // an invariant subspace: the Ritz values are eigenvalues
  }
  const auto n = static_cast<Eigen::Index>(diagonal.size());
  const Eigen::Map<const Eigen::VectorXd> d(diagonal.data(), n);
  const Eigen::Map<const Eigen::VectorXd> b(beside.data(), n - 1);  // the last entry leads out of the matrix
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(d, b, Eigen::ComputeEigenvectors);
  if (solver.info() != Eigen::Success) refuse_operator(name, "products of A overflow");
  return {solver.eigenvalues()[0], solver.eigenvalues()[n - 1],
          beside.back() * std::abs(solver.eigenvectors()(n - 1, n - 1))};
}

template <SymmetricOperator A>
std::optional<Interval> gershgorin(const HeldOperator<A>& a) {
  if constexpr (HeldOperator<A>::entries) {
    std::vector<double> centre(a.rows());
    std::vector<double> radius(a.rows());
    a.for_each_entry(
        [&](std::size_t i, std::size_t j, double x) { (i == j ? centre[i] : radius[i]) += i == j ? x : std::abs(x); });
    Interval bounds{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
    for (std::size_t i = 0; i < a.rows(); ++i) {
      bounds.lower = std::min(bounds.lower, centre[i] - radius[i]);
      bounds.upper = std::max(bounds.upper, centre[i] + radius[i]);
    }
    return bounds;
  } else {
    return std::nullopt;
  }
}

/// Checks the operator, and the bounds by Lanczos. `positive`: f is log, 1 / x or sqrt, or asks for a positive interval.
template <SymmetricOperator A>
Spectrum checked_spectrum(const char* name, const HeldOperator<A>& a, const SpectrumBounds& bounds, bool positive) {
  check_symmetric(name, a);
  RitzValues ritz = lanczos(name, a, bounds.steps);
  if constexpr (HeldOperator<A>::entries) {  // e_i^T A e_i refutes, too
    for (std::size_t i = 0; i < a.rows(); ++i) ritz.lowest = std::min(ritz.lowest, a.entry(i, i));
  }
  return judge_bounds(name, bounds, gershgorin(a), ritz, unseen_spread(a.rows(), bounds.steps), positive);
}

}  // namespace detail

/// The interval that log, inverse and square root of A would work on, with what speaks for it. Costs the steps of Lanczos.
/// Throws std::invalid_argument for an operator that is not symmetric, not finite or not positive definite, and for bounds that
/// the steps refute or that nothing gives.
template <SymmetricOperator A>
Spectrum spectrum_of_spd(A a, const SpectrumBounds& bounds = {}) {
  const detail::HeldOperator<A> held("spectrum_of_spd", std::move(a));
  return detail::checked_spectrum("spectrum_of_spd", held, bounds, true);
}

}  // namespace debias

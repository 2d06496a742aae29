#pragma once

// Series of linear operators: systems x = A x + b and traces of functions of A, without factoring A.
//
//   neumann           x = b + A b + A^2 b + ..., whole or as <c, x>                 one A v a term
//   neumann_walk      <c, x> along a random walk i -> j, p_ij = |a_ij| / r_i, W <- W a_ij / p_ij:
//                     term k = W_k b_(i_k)                     [Forsythe & Leibler 1950]  one a_ij a term
//   trace_of_function tr f(A) = sum_k f_k E[z^T A^k z], z of random signs           [Hutchinson 1990]
//   log_determinant   log det(I - A) = -sum_(k >= 1) tr(A^k) / k
//
//   Notation: r_i = sum_j |a_ij|, rho(A) = spectral radius, f_k = coefficient(k).
// Terms fall like rho^k; rho >= 1 (or the radius of convergence of f) is refused, with the estimate. The walk
// needs more, rho(M) < 1 with M_ij = a_ij^2 / p_ij = |a_ij| r_i: it fails on matrices that the series solves.
// What breaks rates: A far from normal, whose powers grow before they fall; declare a base level beyond that.
// All are TermSequences: for `roulette`, or as `levels_of`. Memory: A and two vectors; the walk copies A
// once.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/text.hpp>
#include <debias/series.hpp>

namespace debias {

/// Anything square with `rows()` and `apply(x)` -> A x.
template <class A>
concept MatrixFree = requires(const A& a, const Eigen::VectorXd& x) {
  { a.rows() } -> std::convertible_to<Eigen::Index>;
  { a.apply(x) } -> std::convertible_to<Eigen::VectorXd>;
};

/// A square matrix of Eigen, dense or sparse, or an operator of yours.
template <class A>
concept LinearOperator = MatrixFree<A> ||
    (std::derived_from<A, Eigen::EigenBase<A>>&& requires { requires std::same_as<typename A::Scalar, double>; });

namespace detail {

template <LinearOperator A>
Eigen::VectorXd apply(const A& a, const Eigen::VectorXd& x) {
  if constexpr (MatrixFree<A>) {
    return a.apply(x);
  } else {
    return a * x;
  }
}

[[noreturn]] inline void refuse_operator(const char* name, const std::string& why) {
  throw std::invalid_argument(std::string(name) + ": " + why);
}

template <LinearOperator A>
void check_square(const char* name, const A& a, Eigen::Index size) {
  if constexpr (!MatrixFree<A>) {
    if (a.rows() != a.cols()) refuse_operator(name, "the matrix is not square");
  }
  if (a.rows() != size) {
    refuse_operator(name, "the operator has " + std::to_string(a.rows()) + " rows, the vector " + std::to_string(size) +
                              " (must be equal)");
  }
}

}  // namespace detail

/// The spectral radius by power iteration: the mean growth of a random vector over the second half of
/// `steps`. An estimate: low by a factor 1 - O(1 / steps) where many eigenvalues have nearly the same
/// modulus, 0 for a nilpotent operator. Costs `steps` applications; the same number every time.
template <LinearOperator A>
double spectral_radius(const A& a, int steps = 400) {
  Eigen::VectorXd x(a.rows());
  Stream rng = split(Stream(0, 0), Branch::pilot);
  for (Eigen::Index i = 0; i < x.size(); ++i) x[i] = rng.normal();
  double log_growth = 0;
  for (int k = 0; k < steps; ++k) {
    const double before = x.norm();
    if (before == 0) return 0;
    x = detail::apply(a, Eigen::VectorXd(x / before));
    const double growth = x.norm();
    if (growth == 0) return 0;
    if (!std::isfinite(growth)) return std::numeric_limits<double>::infinity();
    if (k >= steps / 2) log_growth += std::log(growth);
  }
  return std::exp(log_growth / (steps - steps / 2));
}

namespace detail {

/// The estimated radius, refused unless below `limit`.
template <LinearOperator A>
double radius_below(const char* name, const A& a, double limit, const char* advice) {
  const double radius = debias::spectral_radius(a);
  if (!(radius < limit)) {
    refuse_operator(name, "estimated spectral radius = " + format("%g", radius) + " (must be below " +
                              format("%g", limit) + "); " + advice);
  }
  return radius;
}

/// Vectors of a system: a walk would meet a component that is not finite in few samples only.
inline void check_finite(const char* name, const char* what, const Eigen::VectorXd& v) {
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    if (!std::isfinite(v[i])) {
      refuse_operator(name, std::string(what) + "[" + std::to_string(i) + "] = " + detail::format("%g", v[i]) +
                                " (must be finite)");
    }
  }
}

constexpr const char* precondition = "the series diverges: precondition, or scale the system";

template <LinearOperator A, class Read>
auto powers(A a, Eigen::VectorXd b, Read read) {
  detail::check_square("neumann", a, b.size());
  detail::check_finite("neumann", "b", b);
  const Rates rates = geometric_terms(detail::radius_below("neumann", a, 1, precondition));
  const auto matrix = std::make_shared<const A>(std::move(a));
  const auto start = [first = std::make_shared<const Eigen::VectorXd>(std::move(b))](Stream&) { return *first; };
  const auto advance = [matrix](const Eigen::VectorXd& x, Stream&) { return detail::apply(*matrix, x); };
  return debias::path_series(start, advance, std::move(read), rates);
}

}  // namespace detail

/// The solution x of x = A x + b, all components.
/// Throws std::invalid_argument for sizes that do not fit, vectors that are not finite, and when A^k b does not fall.
template <LinearOperator A>
auto neumann(A a, Eigen::VectorXd b) {
  return detail::powers(std::move(a), std::move(b), [](const Eigen::VectorXd& x) { return x; });
}

/// The functional <c, x> of the solution of x = A x + b.
/// Throws std::invalid_argument for sizes that do not fit, vectors that are not finite, and when A^k b does not fall.
template <LinearOperator A>
auto neumann(A a, Eigen::VectorXd b, Eigen::VectorXd c) {
  detail::check_square("neumann", a, c.size());
  detail::check_finite("neumann", "c", c);
  const auto functional = std::make_shared<const Eigen::VectorXd>(std::move(c));
  return detail::powers(std::move(a), std::move(b),
                        [functional](const Eigen::VectorXd& x) { return functional->dot(x); });
}

namespace detail {

/// A row-major matrix with the sums of |a_ij| along each row: what a walk needs to take its next step.
class WalkMatrix {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  explicit WalkMatrix(Matrix a) : matrix_(std::move(a)) {
    matrix_.makeCompressed();
    running_.resize(static_cast<std::size_t>(matrix_.nonZeros()));
    for (Eigen::Index i = 0; i < matrix_.rows(); ++i) {
      double total = 0;
      for (Eigen::Index k = begin(i); k < begin(i + 1); ++k) {
        total += std::abs(matrix_.valuePtr()[k]);
        running_[static_cast<std::size_t>(k)] = total;
      }
    }
  }

  [[nodiscard]] Eigen::Index rows() const { return matrix_.rows(); }
  /// Applies M, M_ij = a_ij^2 / p_ij = |a_ij| r_i: how E W^2 grows from step to step.
  [[nodiscard]] Eigen::VectorXd apply(const Eigen::VectorXd& x) const {
    Eigen::VectorXd y = matrix_.cwiseAbs() * x;
    for (Eigen::Index i = 0; i < y.size(); ++i) y[i] *= row_sum(i);
    return y;
  }

  [[nodiscard]] double row_sum(Eigen::Index i) const {
    return begin(i) == begin(i + 1) ? 0 : running_[static_cast<std::size_t>(begin(i + 1) - 1)];
  }

  struct Step {
    Eigen::Index to;
    double factor;  // a_ij / p_ij
  };
  /// From i by a uniform number; with factor 0 where the row is empty.
  [[nodiscard]] Step step(Eigen::Index i, double u) const {
    const Eigen::Index first = begin(i);
    const Eigen::Index last = begin(i + 1) - 1;  // rounding must not lead beyond the row
    if (last < first) return {i, 0};
    const double total = running_[static_cast<std::size_t>(last)];
    Eigen::Index k = first;
    if (last - first < 8) {
      for (Eigen::Index j = first; j < last; ++j) k += running_[static_cast<std::size_t>(j)] < u * total ? 1 : 0;
    } else {
      k = std::lower_bound(running_.begin() + first, running_.begin() + last, u * total) - running_.begin();
    }
    return {matrix_.innerIndexPtr()[k], std::copysign(total, matrix_.valuePtr()[k])};
  }

 private:
  [[nodiscard]] Eigen::Index begin(Eigen::Index row) const { return matrix_.outerIndexPtr()[row]; }

  Matrix matrix_;
  std::vector<double> running_;
};

}  // namespace detail

/// The functional <c, x> of the solution of x = A x + b by the random walk of Ulam and von Neumann: it starts
/// at i with probability |c_i| / |c|_1 and leaves i for j with p_ij = |a_ij| / sum_j |a_ij|.
/// Throws std::invalid_argument for sizes that do not fit, b or c that are not finite, c = 0, and when no PMF has a finite variance: when
/// the spectral radius of a_ij^2 / p_ij is not below 1.
template <LinearOperator A>
requires(!MatrixFree<A>) auto neumann_walk(const A& a, Eigen::VectorXd b, const Eigen::VectorXd& c) {
  detail::check_square("neumann_walk", a, b.size());
  detail::check_square("neumann_walk", a, c.size());
  detail::check_finite("neumann_walk", "b", b);
  detail::check_finite("neumann_walk", "c", c);
  struct State {
    Eigen::Index at;
    double weight;
  };
  detail::WalkMatrix::Matrix rows;
  if constexpr (std::derived_from<A, Eigen::SparseMatrixBase<A>>) {
    rows = a;
  } else {
    rows = a.sparseView();
  }
  const auto walk = std::make_shared<const detail::WalkMatrix>(std::move(rows));
  const double radius = detail::radius_below(
      "neumann_walk", *walk, 1, "the weights of the walk have infinite variance: take `neumann`, or precondition");
  std::vector<double> running;  // of |c_i| over the indices where c is not zero
  std::vector<State> starts;
  double total = 0;
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    if (c[i] == 0) continue;
    total += std::abs(c[i]);
    running.push_back(total);
    starts.push_back({i, c[i]});
  }
  if (starts.empty()) detail::refuse_operator("neumann_walk", "c = 0 (nothing to estimate)");
  for (State& s : starts) s.weight = std::copysign(total, s.weight);

  const auto start = [running = std::move(running), starts = std::move(starts)](Stream& rng) {
    const double u = rng.uniform() * running.back();
    return starts[static_cast<std::size_t>(std::lower_bound(running.begin(), running.end() - 1, u) - running.begin())];
  };
  const auto advance = [walk](const State& s, Stream& rng) -> State {
    const auto step = walk->step(s.at, rng.uniform());
    return {step.to, s.weight * step.factor};  // of weight 0 once a walk has ended
  };
  const auto read = [b = std::make_shared<const Eigen::VectorXd>(std::move(b))](const State& s) {
    return s.weight * (*b)[s.at];
  };
  return debias::path_series(start, advance, read, Rates{-std::log2(radius), 0});
}

/// tr f(A) for f(x) = sum_k coefficient(k) x^k, which converges for |x| < `radius_of_convergence` (may be
/// infinite). Term k is coefficient(k) z^T A^k z with one vector z of random signs for the path.
/// Throws std::invalid_argument when the estimated spectral radius of A is not below it.
template <LinearOperator A, class Coefficient, std::convertible_to<double> Radius>  // not {}: those are SpectrumBounds
auto trace_of_function(A a, Coefficient coefficient, Radius radius_of_convergence) {
  detail::check_square("trace_of_function", a, a.rows());
  const double radius =
      detail::radius_below("trace_of_function", a, radius_of_convergence, "the series diverges: scale the operator");
  const Rates rates =
      std::isinf(radius_of_convergence) ? factorial_terms : geometric_terms(radius / radius_of_convergence);
  struct State {
    Eigen::VectorXd signs;
    Eigen::VectorXd power;  // A^k signs
    std::int64_t k;
  };
  const auto matrix = std::make_shared<const A>(std::move(a));
  const auto start = [matrix](Stream& rng) -> State {
    Eigen::VectorXd z(matrix->rows());
    std::uint64_t bits = 0;
    for (Eigen::Index i = 0; i < z.size(); ++i, bits >>= 1) {
      if (i % 64 == 0) bits = rng.bits();
      z[i] = (bits & 1) != 0 ? 1 : -1;
    }
    return {z, z, 0};
  };
  const auto advance = [matrix](State s, Stream&) -> State {
    s.power = detail::apply(*matrix, s.power);
    ++s.k;
    return s;
  };
  const auto read = [coefficient](const State& s) -> double { return coefficient(s.k) * s.signs.dot(s.power); };
  return debias::path_series(start, advance, read, rates);
}

/// log det(I - A). Throws std::invalid_argument when the estimated spectral radius of A is not below 1.
template <LinearOperator A>
auto log_determinant(A a) {
  return debias::trace_of_function(
      std::move(a), [](std::int64_t k) { return k == 0 ? 0.0 : -1 / static_cast<double>(k); }, 1.0);
}

}  // namespace debias

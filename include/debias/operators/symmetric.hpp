#pragma once

// Symmetric operators: all that the terms of f(A) ask of a matrix is y = A x.
//
//   an Eigen matrix, sparse or dense          its product is fused with the recurrence of the terms
//   rows(), apply(x, y)                       y = A x on spans of doubles; nothing is allocated
//   rows(), apply(x) -> A x                   on an Eigen vector (linear_operators.hpp); allocates what it returns
//   symmetric_operator(rows, f)               f(x, y) on spans, a lambda
//
// A has to be symmetric: z^T A z and the three-term recurrence see nothing else. Entries of an Eigen matrix are compared
// with those of its transpose, each of them; an operator is asked for <u, A v> = <v, A u> on random vectors, which shows
// an asymmetry of the whole and not that of one entry among millions. Both refuse with a sentence.
// Operators are called by all threads at once: apply has to be const and without hidden state.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <debias/core/stream.hpp>
#include <debias/core/text.hpp>
#include <debias/linear_operators.hpp>

namespace debias {

/// `rows()`, and `apply(x, y)`: y = A x, x and y of that size and apart from each other.
template <class A>
concept SpanOperator = requires(const A& a, std::span<const double> x, std::span<double> y) {
  { a.rows() } -> std::convertible_to<std::int64_t>;
  a.apply(x, y);
};

/// A symmetric matrix of Eigen, dense or sparse, or an operator of yours.
template <class A>
concept SymmetricOperator = SpanOperator<A> || LinearOperator<A>;

/// An operator from `f(x, y)`, which writes A x to y.
template <class F>
requires std::invocable<const F&, std::span<const double>, std::span<double>>
class FunctionOperator {
 public:
  FunctionOperator(std::int64_t rows, F f) : rows_(rows), f_(std::move(f)) {
    if (rows <= 0) {
      throw std::invalid_argument("symmetric_operator: rows = " + std::to_string(rows) + " (must be positive)");
    }
  }
  [[nodiscard]] std::int64_t rows() const { return rows_; }
  void apply(std::span<const double> x, std::span<double> y) const { f_(x, y); }

 private:
  std::int64_t rows_;
  F f_;
};

/// Throws std::invalid_argument unless rows is positive.
template <class F>
FunctionOperator<F> symmetric_operator(std::int64_t rows, F f) {
  return {rows, std::move(f)};
}

namespace detail {

/// y^T x and y^T y of the step that made y.
struct StepProducts {
  double cross = 0;
  double square = 0;
};

inline double dot(std::span<const double> x, std::span<const double> y) {
  constexpr std::size_t block = 512;  // sums of blocks: rounding grows with their number, not with that of the rows
  double total = 0;
  for (std::size_t first = 0; first < x.size(); first += block) {
    const std::size_t last = std::min(x.size(), first + block);
    double sum = 0;
    for (std::size_t i = first; i < last; ++i) sum += x[i] * y[i];
    total += sum;
  }
  return total;
}

/// y <- scale (A x)_i + shift x_i + keep y_i, row by row, with both products of the new y on the way.
template <class Row>
StepProducts step_rows(std::size_t rows, const double* x, double* y, double scale, double shift, double keep,
                       const Row& row) {
  constexpr std::size_t block = 512;
  StepProducts all;
  for (std::size_t first = 0; first < rows; first += block) {
    const std::size_t last = std::min(rows, first + block);
    StepProducts part;
    for (std::size_t i = first; i < last; ++i) {
      const double next = scale * row(i) + shift * x[i] + keep * y[i];
      y[i] = next;
      part.cross += next * x[i];
      part.square += next * next;
    }
    all.cross += part.cross;
    all.square += part.square;
  }
  return all;
}

template <class A>
struct StoredOperator {
  using type = A;
};
template <LinearOperator A>
requires(!MatrixFree<A>) struct StoredOperator<A> {
  using type = typename A::PlainObject;
};

template <class A>
inline constexpr bool is_sparse = std::derived_from<A, Eigen::SparseMatrixBase<A>>;

template <class A>
constexpr bool by_columns_of() {
  if constexpr (is_sparse<A>) return !A::IsRowMajor;
  return false;
}
template <class A>
inline constexpr bool stored_by_columns = by_columns_of<A>();

/// Whether the entries can be read, not only the products.
template <class A>
inline constexpr bool has_entries = LinearOperator<A> && !MatrixFree<A> && !SpanOperator<A>;

/// An operator as the terms hold it: shared by their copies, and known to be square and not empty.
template <SymmetricOperator A>
class HeldOperator {
 public:
  using Stored = typename StoredOperator<A>::type;
  static constexpr bool entries = has_entries<A>;
  static constexpr bool sparse = is_sparse<Stored>;
  static constexpr bool by_columns = stored_by_columns<Stored>;
  /// Whether a step takes no vector beside those two that it works on.
  static constexpr bool fused = sparse;

  HeldOperator(const char* name, A a) : a_(hold(std::move(a))) {
    if constexpr (entries) {
      if (a_->rows() != a_->cols()) {
        refuse_operator(name, "the matrix has " + std::to_string(a_->rows()) + " rows and " +
                                  std::to_string(a_->cols()) + " columns (must be square)");
      }
    }
    if (!(a_->rows() > 0)) refuse_operator(name, "the operator has no rows (nothing to estimate)");
    rows_ = static_cast<std::size_t>(a_->rows());
  }

  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] const Stored& matrix() const requires entries { return *a_; }

  void apply(std::span<const double> x, std::span<double> y) const {
    if constexpr (SpanOperator<Stored>) {
      a_->apply(x, y);
    } else if constexpr (MatrixFree<Stored>) {
      const Eigen::VectorXd product = a_->apply(Eigen::VectorXd(vector(x)));
      if (product.size() != static_cast<Eigen::Index>(rows_)) {
        refuse_operator("apply", "a product of " + std::to_string(product.size()) + " components (A has " +
                                     std::to_string(rows_) + " rows)");
      }
      std::copy(product.data(), product.data() + rows_, y.begin());
    } else if constexpr (sparse) {
      const auto row = rows_of_sparse(x.data());
      for (std::size_t i = 0; i < rows_; ++i) y[i] = row(i);
    } else {
      Eigen::Map<Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(rows_)).noalias() = *a_ * vector(x);
    }
  }

  /// y <- scale A x + shift x + keep y, with y^T x and y^T y of the new y. `scratch` has `rows` numbers unless `fused`.
  StepProducts step(std::span<const double> x, std::span<double> y, double scale, double shift, double keep,
                    [[maybe_unused]] std::span<double> scratch) const {
    if constexpr (fused) {
      return step_rows(rows_, x.data(), y.data(), scale, shift, keep, rows_of_sparse(x.data()));
    } else {
      apply(x, scratch);
      return step_rows(rows_, x.data(), y.data(), scale, shift, keep, [&](std::size_t i) { return scratch[i]; });
    }
  }

  /// Calls visit(row, column, entry) for each entry that is stored.
  template <class Visit>
  void for_each_entry(const Visit& visit) const requires entries {
    if constexpr (sparse) {
      for (std::size_t i = 0; i < rows_; ++i) {
        for (auto k = a_->outerIndexPtr()[i]; k < a_->outerIndexPtr()[i + 1]; ++k) {
          visit(i, static_cast<std::size_t>(a_->innerIndexPtr()[k]), a_->valuePtr()[k]);
        }
      }
    } else {
      for (std::size_t i = 0; i < rows_; ++i) {
        for (std::size_t j = 0; j < rows_; ++j) visit(i, j, entry(i, j));
      }
    }
  }

  /// In the order of for_each_entry, whose rows are columns where columns are stored.
  [[nodiscard]] double entry(std::size_t i, std::size_t j) const requires entries {
    if constexpr (by_columns) std::swap(i, j);
    return a_->coeff(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }

 private:
  static Eigen::Map<const Eigen::VectorXd> vector(std::span<const double> x) {
    return {x.data(), static_cast<Eigen::Index>(x.size())};
  }

  static std::shared_ptr<const Stored> hold(A a) {
    auto stored = std::make_shared<Stored>(std::move(a));
    if constexpr (entries && is_sparse<Stored>) stored->makeCompressed();
    return stored;
  }

  // Rows of a symmetric matrix are its columns, so either order of storage will do.
  auto rows_of_sparse(const double* x) const {
    return [outer = a_->outerIndexPtr(), inner = a_->innerIndexPtr(), values = a_->valuePtr(), x](std::size_t i) {
      double sum = 0;
      for (auto k = outer[i]; k < outer[i + 1]; ++k) sum += values[k] * x[inner[k]];
      return sum;
    };
  }

  std::shared_ptr<const Stored> a_;
  std::size_t rows_ = 0;
};

/// The vectors that setups draw: of a stream of their own, the same every time.
inline std::vector<double> setup_vector(std::size_t rows, std::uint64_t which) {
  Stream rng = split(Stream(0, which), Branch::pilot);
  std::vector<double> z(rows);
  for (double& x : z) x = rng.normal();
  return z;
}

/// Refuses an operator that is not symmetric, or has entries or products that are not finite.
template <SymmetricOperator A>
void check_symmetric(const char* name, const HeldOperator<A>& a) {
  if constexpr (HeldOperator<A>::entries) {
    a.for_each_entry([&](std::size_t i, std::size_t j, double x) {
      const auto place = [&](std::size_t r, std::size_t c, double value) {
        if (HeldOperator<A>::by_columns) std::swap(r, c);
        return "A(" + std::to_string(r) + ", " + std::to_string(c) + ") = " + format("%g", value);
      };
      if (!std::isfinite(x)) refuse_operator(name, place(i, j, x) + " (must be finite)");
      if (i == j) return;
      const double other = a.entry(j, i);
      const double size = std::abs(x) + std::abs(other) + std::sqrt(std::abs(a.entry(i, i) * a.entry(j, j)));
      if (std::abs(x - other) <= 1e-12 * size) return;
      refuse_operator(name, "the matrix is not symmetric (" + place(i, j, x) + ", " + place(j, i, other) + ")" +
                                (x == 0 || other == 0 ? "; where one triangle is stored, fill both"
                                                      : "; did you mean "
                                                        "(A + A^T) / 2?"));
    });
  } else {
    const std::vector<double> u = setup_vector(a.rows(), 1);
    const std::vector<double> v = setup_vector(a.rows(), 2);
    std::vector<double> au(a.rows());
    std::vector<double> av(a.rows());
    a.apply(u, au);
    a.apply(v, av);
    const double one = dot(u, av);
    const double two = dot(v, au);
    const double size = std::sqrt(dot(u, u) * dot(av, av)) + std::sqrt(dot(v, v) * dot(au, au));
    if (!std::isfinite(size)) refuse_operator(name, "A times a finite vector is not finite");
    if (!(std::abs(one - two) <= 1e-10 * size)) {
      refuse_operator(name, "the operator is not symmetric (<u, A v> = " + format("%.10g", one) +
                                ", <v, A u> = " + format("%.10g", two) + " for random u and v)");
    }
  }
}

}  // namespace detail

}  // namespace debias

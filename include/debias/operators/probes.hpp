#pragma once

// Probes: random vectors z with E z z^T = I, so that E z^T f(A) z = tr f(A).
//
//   RandomSigns{}             z_i = +-1; variance 2 sum_(i != j) f_ij^2, f_ij the entries of f(A)     [Hutchinson 1990]
//   UnitVectors{}             z = sqrt(n) e_i, i uniform; variance n sum_i f_ii^2 - (tr f)^2: none of the entries beside
//                             the diagonal counts, all that differs on it does
//   Coloured{.distance = d}   signs on one colour at a time, nodes of equal colour more than d edges apart: what is left
//                             is 2 sum of f_ij^2 over pairs of one colour          [Tang & Saad 2012, with random signs]
//   Colours{of}               the same by colours of yours, for operators without entries
//   HutchPlusPlus{.vectors = m}  the trace over an m-dimensional space Q that holds what sticks out of f(A), exactly, and a probe
//                             of the complement for the rest                        [Meyer, Musco, Musco, Woodruff 2021]
//
// Which when: entries of f(A) fall with the distance in the graph of a sparse A (Laplacians, lattices): Coloured. A few
// eigenvalues stick out (kernels): HutchPlusPlus. Neither: RandomSigns. The off-diagonal entries are large and the
// diagonal is even: UnitVectors.
// Costs: Coloured takes as many products a term as there are colours (about d^2 / 2 + 2 on a grid), and two vectors for
// each; HutchPlusPlus m (K + K / 2) products once, K the degree of f to rounding, and 4 m n operations a probe. Its Q comes from a
// stream of its own, the same in every sample, and is independent of the probes: no bias. The complement is probed by
// normal numbers scaled to their mean length (Epperly, Tropp & Webber 2024), so that a multiple of the identity in f(A) has
// no variance there either, and one probe of the setup is taken from each term, so that little is left for the roulette;
// the share of Q ends where the coefficients are 1e-17 of the largest one.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/stream.hpp>
#include <debias/operators/bounds.hpp>
#include <debias/operators/chebyshev.hpp>
#include <debias/operators/graph.hpp>
#include <debias/operators/symmetric.hpp>

namespace debias {

struct RandomSigns {};
struct UnitVectors {};
struct Coloured {
  int distance = 2;  ///< larger: less noise of a probe, which costs more products
};
struct Colours {
  std::vector<int> of;  ///< the colour of each row, from 0 on
};
struct HutchPlusPlus {
  int vectors = 20;  ///< the dimension of Q: how many eigenvalues may stick out
};

namespace detail {

inline void fill_signs(std::span<double> z, Stream& rng) {
  for (std::size_t first = 0; first < z.size(); first += 64) {
    std::uint64_t bits = rng.bits();
    const std::size_t last = std::min(z.size(), first + 64);
    for (std::size_t i = first; i < last; ++i, bits >>= 1) z[i] = static_cast<double>(bits & 1) * 2 - 1;
  }
}

/// The operator, mapped so that its interval becomes [-1, 1]: steps of T_k(t(A)) z.
template <SymmetricOperator A>
class Recurrence {
 public:
  Recurrence(HeldOperator<A> a, double lower, double upper)
      : a_(std::move(a)), scale_(2 / (upper - lower)), shift_(-(lower + upper) / (upper - lower)) {}

  [[nodiscard]] const HeldOperator<A>& held() const { return a_; }
  [[nodiscard]] std::size_t rows() const { return a_.rows(); }
  [[nodiscard]] std::size_t scratch_size() const { return HeldOperator<A>::fused ? 0 : a_.rows(); }

  /// y = T_1 x, y finite before.
  StepProducts first(std::span<const double> x, std::span<double> y, std::span<double> scratch) const {
    return a_.step(x, y, scale_, shift_, 0, scratch);
  }
  /// x = T_k z, y = T_(k-1) z, which becomes T_(k+1) z.
  StepProducts next(std::span<const double> x, std::span<double> y, std::span<double> scratch) const {
    return a_.step(x, y, 2 * scale_, 2 * shift_, -1, scratch);
  }

 private:
  HeldOperator<A> a_;
  double scale_;
  double shift_;
};

/// Probes that are ready to draw. `columns()` vectors a probe, whose outer products sum to the identity in the mean, but for
/// a part whose share of tr f(A) is known. `centre(k)`: a number to be taken from z^T T_k z before the roulette; `total()`:
/// what that share and all centres add up to. Any centres leave the mean as it is; good ones make terms small.
struct ReadySigns {
  [[nodiscard]] static std::size_t columns() { return 1; }
  static void draw(std::span<double> z, Stream& rng) { fill_signs(z, rng); }
  [[nodiscard]] static double centre(std::int64_t /*degree*/) { return 0; }
  [[nodiscard]] static double total() { return 0; }
};

struct ReadyUnits {
  [[nodiscard]] static std::size_t columns() { return 1; }
  static void draw(std::span<double> z, Stream& rng) {
    const auto n = static_cast<double>(z.size());
    std::fill(z.begin(), z.end(), 0.0);
    z[std::min(z.size() - 1, static_cast<std::size_t>(rng.uniform() * n))] = std::sqrt(n);
  }
  [[nodiscard]] static double centre(std::int64_t /*degree*/) { return 0; }
  [[nodiscard]] static double total() { return 0; }
};

struct ReadyColours {
  std::shared_ptr<const std::vector<int>> of;
  std::size_t count;

  [[nodiscard]] std::size_t columns() const { return count; }
  void draw(std::span<double> z, Stream& rng) const {
    std::fill(z.begin(), z.end(), 0.0);
    const std::size_t rows = of->size();
    for (std::size_t first = 0; first < rows; first += 64) {
      std::uint64_t bits = rng.bits();
      const std::size_t last = std::min(rows, first + 64);
      for (std::size_t i = first; i < last; ++i, bits >>= 1) {
        z[static_cast<std::size_t>((*of)[i]) * rows + i] = static_cast<double>(bits & 1) * 2 - 1;
      }
    }
  }
  [[nodiscard]] static double centre(std::int64_t /*degree*/) { return 0; }
  [[nodiscard]] static double total() { return 0; }
};

struct ReadyComplement {
  std::size_t rows;
  std::shared_ptr<const std::vector<double>> basis;    // of Q, vector by vector
  std::shared_ptr<const std::vector<double>> centres;  // of the complement, by a probe of the setup
  double sum = 0;

  [[nodiscard]] static std::size_t columns() { return 1; }
  void draw(std::span<double> z, Stream& rng) const {
    for (double& x : z) x = rng.normal();
    const std::size_t size = basis->size() / rows;
    for (std::size_t k = 0; k < size; ++k) {
      const std::span<const double> q = std::span(*basis).subspan(k * rows, rows);
      const double along = dot(q, z);
      for (std::size_t i = 0; i < rows; ++i) z[i] -= along * q[i];
    }
    const double factor = std::sqrt(static_cast<double>(rows - size) / dot(z, z));
    for (double& x : z) x *= factor;
  }
  [[nodiscard]] double centre(std::int64_t degree) const {
    return static_cast<std::size_t>(degree) < centres->size() ? (*centres)[static_cast<std::size_t>(degree)] : 0;
  }
  [[nodiscard]] double total() const { return sum; }
};

template <SymmetricOperator A>
ReadySigns ready(const char* /*name*/, const RandomSigns& /*probes*/, const Recurrence<A>& /*a*/,
                 const ChebyshevSeries& /*c*/) {
  return {};
}

template <SymmetricOperator A>
ReadyUnits ready(const char* /*name*/, const UnitVectors& /*probes*/, const Recurrence<A>& /*a*/,
                 const ChebyshevSeries& /*c*/) {
  return {};
}

template <SymmetricOperator A>
ReadyColours ready(const char* name, const Colours& probes, const Recurrence<A>& a, const ChebyshevSeries& /*c*/) {
  const int count = count_colours(name, probes.of, a.rows());
  return {std::make_shared<const std::vector<int>>(probes.of), static_cast<std::size_t>(count)};
}

template <SymmetricOperator A>
ReadyColours ready(const char* name, const Coloured& probes, const Recurrence<A>& a, const ChebyshevSeries& /*c*/) {
  static_assert(HeldOperator<A>::entries,
                "colouring reads the entries of a matrix: of an operator pass Colours{of} with colours of yours");
  if (probes.distance < 1) {
    refuse_operator(name, "distance of a colouring = " + std::to_string(probes.distance) +
                              " (must be 1 or more); did you mean RandomSigns{}?");
  }
  std::vector<std::int64_t> outer(a.rows() + 1);
  std::vector<std::int32_t> inner;
  std::size_t row = 0;
  a.held().for_each_entry([&](std::size_t i, std::size_t j, double x) {
    while (row < i) outer[++row] = static_cast<std::int64_t>(inner.size());
    if (i != j && x != 0) inner.push_back(static_cast<std::int32_t>(j));
  });
  while (row < a.rows()) outer[++row] = static_cast<std::int64_t>(inner.size());
  std::vector<int> of = colour_graph(outer, inner, probes.distance);
  const int count = count_colours(name, of, a.rows());
  if (2 * static_cast<std::size_t>(count) > a.rows() && a.rows() > 16) {
    refuse_operator(name,
                    "a colouring of distance " + std::to_string(probes.distance) + " takes " + std::to_string(count) +
                        " colours for " + std::to_string(a.rows()) +
                        " rows (each a product of every term); take RandomSigns{} or HutchPlusPlus{}, or a smaller "
                        "distance");
  }
  return {std::make_shared<const std::vector<int>>(std::move(of)), static_cast<std::size_t>(count)};
}

template <SymmetricOperator A>
ReadyComplement ready(const char* name, const HutchPlusPlus& probes, const Recurrence<A>& a, const ChebyshevSeries& c) {
  const std::size_t n = a.rows();
  if (probes.vectors < 1 || 2 * static_cast<std::size_t>(probes.vectors) > n) {
    refuse_operator(name, "HutchPlusPlus: vectors = " + std::to_string(probes.vectors) + " (must lie in [1, " +
                              std::to_string(n / 2) + "], half the rows)");
  }
  const auto vectors = static_cast<std::size_t>(probes.vectors);
  std::vector<double> scratch(a.scratch_size());
  std::vector<double> previous(n);
  std::vector<double> current(n);
  // sum_(k <= degree) c_k T_k x
  const auto apply = [&](std::span<const double> x, std::int64_t degree, std::span<double> out) {
    previous.assign(x.begin(), x.end());
    std::fill(current.begin(), current.end(), 0.0);
    a.first(previous, current, scratch);
    for (std::size_t i = 0; i < n; ++i) out[i] = c(0) * previous[i] + c(1) * current[i];
    for (std::int64_t k = 2; k <= degree; ++k) {
      a.next(current, previous, scratch);
      previous.swap(current);
      const double factor = c(k);
      for (std::size_t i = 0; i < n; ++i) out[i] += factor * current[i];
    }
  };
  // What sticks out of f(A) is seen beside its mean eigenvalue.
  const std::int64_t rough = c.degree_below(1e-3);
  std::vector<double> basis(vectors * n);
  std::vector<double> x(n);
  double mean = 0;
  for (std::size_t k = 0; k < vectors; ++k) {
    Stream rng = split(Stream(0, 8 + k), Branch::pilot);
    fill_signs(x, rng);
    const std::span<double> y = std::span(basis).subspan(k * n, n);
    apply(x, rough, y);
    if (k == 0) mean = dot(x, y) / static_cast<double>(n);
    for (std::size_t i = 0; i < n; ++i) y[i] -= mean * x[i];
  }
  orthonormalise(basis, n);

  // z^T T_k z of one vector, added to those there are.
  const auto add_moments = [&](std::span<const double> z, std::vector<double>& moments) {
    previous.assign(z.begin(), z.end());
    std::fill(current.begin(), current.end(), 0.0);
    const double zeroth = dot(previous, previous);
    StepProducts step = a.first(previous, current, scratch);
    const double first = step.cross;
    moments[0] += zeroth;
    for (std::size_t degree = 1;; degree += 2) {
      if (degree < moments.size()) moments[degree] += 2 * step.cross - first;
      if (degree + 1 >= moments.size()) break;
      moments[degree + 1] += 2 * step.square - zeroth;
      step = a.next(current, previous, scratch);
      previous.swap(current);
    }
  };
  std::vector<double> of_space(static_cast<std::size_t>(c.degree_below(1e-17)) + 1);
  for (std::size_t k = 0; k < basis.size() / n; ++k) add_moments(std::span(basis).subspan(k * n, n), of_space);
  ReadyComplement ready{n, std::make_shared<const std::vector<double>>(std::move(basis)), nullptr};
  Stream rng = split(Stream(0, 7), Branch::pilot);
  ready.draw(x, rng);
  std::vector<double> centres(static_cast<std::size_t>(c.degree_below(1e-4)) + 1);
  add_moments(x, centres);
  for (std::size_t k = of_space.size(); k-- > 0;) {
    ready.sum += c(static_cast<std::int64_t>(k)) * (of_space[k] + (k < centres.size() ? centres[k] : 0));
  }
  if (!std::isfinite(ready.sum)) refuse_operator(name, "HutchPlusPlus: A times a finite vector is not finite");
  ready.centres = std::make_shared<const std::vector<double>>(std::move(centres));
  return ready;
}

}  // namespace detail

}  // namespace debias

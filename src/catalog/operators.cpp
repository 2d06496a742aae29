// Log determinants of sparse symmetric matrices by probes and Chebyshev terms: the noise of probes and slow terms at once.

#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/SparseCore>

#include <debias/operators.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {

namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Entries = std::vector<Eigen::Triplet<double>>;

Sparse matrix(Eigen::Index n, const Entries& entries) {
  Sparse a(n, n);
  a.setFromTriplets(entries.begin(), entries.end());
  return a;
}

// The entry of the diagonal, and one for each distance beside it.
Sparse banded(Eigen::Index n, const std::vector<double>& by_distance) {
  const auto width = static_cast<Eigen::Index>(by_distance.size());
  Entries entries;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index d = 0; d < width; ++d) {
      const double x = by_distance[static_cast<std::size_t>(d)];
      if (i + d < n) entries.emplace_back(i, i + d, x);
      if (d > 0 && i >= d) entries.emplace_back(i, i - d, x);
    }
  }
  return matrix(n, entries);
}

}  // namespace

Problem log_determinant_of_chain() {
  const double shift = 4.0 / 999;
  Problem p =
      make({.id = "M08",
            .name = "chain-log-determinant",
            .module = "operators.hpp",
            .truth = 65.39649713833831107852,
            .formula = "log det of tridiagonal(-1, 2 + s, -1), n = 1000, s = 4/999 (condition 1000), random signs: "
                       "(n+1) t + log(1 - e^(-2 (n+1) t)) - log(2 sinh t), 2 cosh t = 2 + s"},
           log_determinant_spd(banded(1000, {2 + shift, -1}), {.lower = shift}));
  p.sample_cost = 32;
  return p;
}

Problem log_determinant_of_grid() {
  constexpr Eigen::Index side = 20;
  constexpr double shift = 0.1;
  Entries entries;
  for (Eigen::Index y = 0; y < side; ++y) {
    for (Eigen::Index x = 0; x < side; ++x) {
      const Eigen::Index here = y * side + x;
      entries.emplace_back(here, here, 4 + shift);
      if (x > 0) entries.emplace_back(here, here - 1, -1.0);
      if (x + 1 < side) entries.emplace_back(here, here + 1, -1.0);
      if (y > 0) entries.emplace_back(here, here - side, -1.0);
      if (y + 1 < side) entries.emplace_back(here, here + side, -1.0);
    }
  }
  Problem p = make({.id = "M09",
                    .name = "laplacian-log-determinant",
                    .module = "operators.hpp",
                    .truth = 494.6053676910407491022,
                    .formula = "log det of the Laplacian of a 20 x 20 grid + 0.1, random signs: sum of "
                               "log(4.1 - 2 cos(j pi / 21) - 2 cos(k pi / 21)), j, k = 1 ... 20"},
                   log_determinant_spd(matrix(side * side, entries), {.lower = shift}));
  p.sample_cost = 8;
  return p;
}

Problem log_determinant_of_kernel() {
  // All entries are dyadic; the spectrum lies above the least value of the symbol, 3/32, at pi.
  const std::vector<double> kernel{1.015625, 0.6328125, 0.1875, 0.015625};
  Problem p =
      make({.id = "M10",
            .name = "kernel-log-determinant",
            .module = "operators.hpp",
            .truth = -304.5252173040525481577,
            .formula = "log det of a Gaussian process, 500 points, kernel (1 - d/4)^4 (1 + d) and nugget 1/64, random "
                       "signs: by Cholesky"},
           log_determinant_spd(banded(500, kernel), {.lower = 0.09375}));
  p.sample_cost = 8;
  return p;
}

}  // namespace debias::catalog

// Linear algebra: the trace of exp(A) of a sparse matrix that one can only multiply with. On a graph it counts closed
// walks (the Estrada index); here of a ring of n nodes, whose eigenvalues are 2 cos(2 pi j / n).

#include <cmath>
#include <iostream>
#include <vector>

#include <Eigen/SparseCore>

#include <debias/debias.hpp>
#include <debias/linear_operators.hpp>

int main() {
  const int n = 500;
  std::vector<Eigen::Triplet<double>> edges;
  for (int i = 0; i < n; ++i) {
    edges.emplace_back(i, (i + 1) % n, 1);
    edges.emplace_back((i + 1) % n, i, 1);
  }
  Eigen::SparseMatrix<double> ring(n, n);
  ring.setFromTriplets(edges.begin(), edges.end());

  const auto coefficient = [](std::int64_t k) { return 1 / std::tgamma(static_cast<double>(k) + 1); };
  const auto terms = debias::trace_of_function(ring, coefficient, INFINITY);
  // Eight terms always, then as many as a coin with 1/2 gives: the terms of exp fall faster than any such tail.
  const auto estimator = debias::roulette(terms, debias::Geometric(0.5), {.base_level = 8});
  const auto result = debias::estimate(estimator, {.samples = 20'000, .seed = 1});
  double exact = 0;
  for (int j = 0; j < n; ++j) exact += std::exp(2 * std::cos(2 * std::acos(-1.0) * j / n));
  std::cout << "trace_of_exponential " << result.mean << " +- " << result.standard_error << ", exact " << exact << '\n';
}

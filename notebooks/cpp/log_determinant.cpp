// Linear algebra, statistics: log det of a sparse symmetric positive definite matrix, as a Gaussian Markov field has it; here of
// the Laplacian of a square grid plus a shift, whose eigenvalues are known.

#include <cmath>
#include <iostream>
#include <vector>

#include <Eigen/SparseCore>

#include <debias/debias.hpp>
#include <debias/operators.hpp>

int main() {
  const int side = 60;
  const double shift = 0.05;
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < side * side; ++i) {
    entries.emplace_back(i, i, 4 + shift);
    for (const int j : {i - side, i % side > 0 ? i - 1 : -1, (i + 1) % side > 0 ? i + 1 : -1, i + side}) {
      if (j >= 0 && j < side * side) entries.emplace_back(i, j, -1);
    }
  }
  Eigen::SparseMatrix<double> a(side * side, side * side);
  a.setFromTriplets(entries.begin(), entries.end());

  // No eigenvalue lies below the shift. Entries of log A fall with the distance on the grid: probes by colours.
  const auto terms = debias::log_determinant_spd(a, {.lower = shift}, debias::Coloured{.distance = 3});
  const auto result = debias::estimate(debias::recipe(terms), {.samples = 2000, .seed = 1});
  double exact = 0;
  for (int j = 1; j <= side; ++j) {
    for (int k = 1; k <= side; ++k) {
      const double angle = std::acos(-1.0) / (side + 1);
      exact += std::log(4 + shift - 2 * std::cos(j * angle) - 2 * std::cos(k * angle));
    }
  }
  std::cout.precision(10);
  std::cout << "log_determinant " << result.mean << " +- " << result.standard_error << ", exact " << exact << '\n';
}

#include <debias/linear_operators.hpp>

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include <Eigen/LU>
#include <Eigen/Sparse>

#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"
#include "laws/sequence_laws.hpp"
#include "operators/matrices.hpp"

using namespace debias;
using debias::laws::estimator_laws;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::VectorXd;
using ::laws::Failures;
using ::laws::sequence_laws;
using Sparse = Eigen::SparseMatrix<double>;

namespace {

const Matrix2d coupled_pair{{0.5, 0.4}, {0.2, 0.3}};  // D11: spectral radius 0.7
const Vector2d source(1, 2);
const Vector2d first(1, 0);
const Vector2d second(0, 1);
const Matrix3d chain{{0.3, 0.2, 0}, {0.2, 0.4, 0.1}, {0, 0.1, 0.2}};  // D17: spectral radius 0.573205

struct Functional {  // an operator that is no matrix
  Matrix2d a;
  [[nodiscard]] Eigen::Index rows() const { return 2; }
  [[nodiscard]] VectorXd apply(const VectorXd& x) const { return Vector2d(a * x); }
};

// 0.9 times the mean of the four neighbours on a grid with zero boundary.
Sparse grid(Eigen::Index width, Eigen::Index height) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(4 * width * height));
  for (Eigen::Index y = 0; y < height; ++y) {
    for (Eigen::Index x = 0; x < width; ++x) {
      const Eigen::Index here = y * width + x;
      if (x > 0) entries.emplace_back(here, here - 1, 0.225);
      if (x + 1 < width) entries.emplace_back(here, here + 1, 0.225);
      if (y > 0) entries.emplace_back(here, here - width, 0.225);
      if (y + 1 < height) entries.emplace_back(here, here + width, 0.225);
    }
  }
  Sparse a(width * height, width * height);
  a.setFromTriplets(entries.begin(), entries.end());
  return a;
}

template <class E>
bool agrees(const E& estimator, double truth, std::int64_t samples = 1 << 14) {
  const auto r = estimate(estimator, {.samples = samples, .seed = 17});
  INFO(r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  return std::abs(r.mean - truth) < 4.5 * r.standard_error;
}

}  // namespace

TEST_CASE("D11: the terms of a Neumann series are A^k b, for dense, sparse and matrix-free operators",
          "[linear_operators][exact]") {
  const Sparse sparse = coupled_pair.sparseView();
  Stream rng(1, 1);
  const auto dense_series = neumann(coupled_pair, source);
  const auto functional_series = neumann(coupled_pair, source, first);
  const auto sparse_series = neumann(sparse, source);
  const auto free_series = neumann(Functional{coupled_pair}, source);
  auto dense_terms = dense_series(rng);
  auto functional_terms = functional_series(rng);
  auto sparse_terms = sparse_series(rng);
  auto free_terms = free_series(rng);
  Vector2d power = source;
  for (int k = 0; k < 40; ++k, power = coupled_pair * power) {
    const VectorXd term = dense_terms().value;
    CHECK((term - power).norm() <= 1e-15 * power.norm());
    CHECK((sparse_terms().value - power).norm() <= 1e-15 * power.norm());
    CHECK((free_terms().value - power).norm() <= 1e-15 * power.norm());
    CHECK(functional_terms().value == term[0]);
  }
}

TEST_CASE("D11: Neumann series are unbiased for the whole vector and for a functional",
          "[linear_operators][statistical]") {
  CHECK(sequence_laws(levels_of(neumann(coupled_pair, source, first)), {.last = 12, .work_tolerance = 1.5}) ==
        Failures{});
  CHECK(estimator_laws(roulette(neumann(coupled_pair, source, first)), 50.0 / 9) == Failures{});
  const VectorXd solution = Vector2d(50.0 / 9, 40.0 / 9);
  CHECK(estimator_laws(roulette(neumann(coupled_pair, source)), solution) == Failures{});
  CHECK(agrees(single_term(levels_of(neumann(coupled_pair, source, second))), 40.0 / 9));
  // power check: the series of another matrix
  const Matrix2d slower = 0.99 * coupled_pair;
  CHECK(estimator_laws(roulette(neumann(slower, source, first)), 50.0 / 9) != Failures{});
}

TEST_CASE("D11: the walk of Ulam and von Neumann has the mean of the series, and the rates of its weights",
          "[linear_operators][statistical]") {
  // M = |a_ij| r_i = [[.45, .36], [.1, .15]]
  const double radius = 0.3 + std::sqrt(0.09 - 0.0315);
  const auto walk = neumann_walk(coupled_pair, source, first);
  CHECK(walk.rates.variance_decay == Approx(-std::log2(radius)).epsilon(1e-6));
  CHECK(sequence_laws(levels_of(walk), {.last = 10, .work_tolerance = 1.5}) == Failures{});
  CHECK(estimator_laws(roulette(walk), 50.0 / 9) == Failures{});
  CHECK(agrees(roulette(neumann_walk(coupled_pair, source, Vector2d(2, -3))), -20.0 / 9));
  const Sparse sparse = coupled_pair.sparseView();
  CHECK(agrees(roulette(neumann_walk(sparse, source, second)), 40.0 / 9));
  // negative entries, and a row without any: x_0 = 1 - x_1 / 2, x_1 = 2
  const Matrix2d ends{{0, -0.5}, {0, 0}};
  CHECK(agrees(roulette(neumann_walk(ends, source, first), Geometric(0.5)), 0));
  CHECK(estimator_laws(roulette(walk), 50.0 / 9 * 1.01) != Failures{});
}

TEST_CASE("the walk is refused where its weights have infinite variance although the series converges",
          "[linear_operators][exact]") {
  const Matrix2d spiral{{0.6, -0.6}, {0.6, 0.6}};  // radius 0.6 sqrt 2; a_ij^2 / p_ij = 0.72 has radius 1.44
  CHECK(spectral_radius(spiral) == Approx(0.6 * std::sqrt(2.0)).epsilon(1e-2));
  CHECK_THROWS_WITH(neumann_walk(spiral, source, first), Catch::Contains("1.44") && Catch::Contains("neumann"));
  const Vector2d exact = (Matrix2d::Identity() - spiral).inverse() * source;
  CHECK(agrees(roulette(neumann(spiral, source, first)), exact[0]));
  // the second moments of the weights do what M says: E W_k^2 = sum_j (M^k)_0j = 1.44^k, for any number of
  // walks
  const Matrix2d mild = 0.8 * spiral;  // 0.64 * 1.44 < 1
  const auto walk = neumann_walk(mild, Vector2d(1, 1), first);
  for (std::uint64_t i = 0; i < 100; ++i) {
    Stream rng(3, i);
    auto terms = walk(rng);
    for (int k = 0; k < 10; ++k) {
      const double term = terms().value;
      CHECK(term * term == Approx(std::pow(0.64 * 1.44, k)).epsilon(1e-12));
    }
  }
}

TEST_CASE("D17: log det(I - A) and traces of functions by random signs", "[linear_operators][statistical]") {
  const double truth = std::log(0.297);
  const auto log_det = log_determinant(chain);
  CHECK(log_det.rates.variance_decay == Approx(-2 * std::log2(0.573205)).epsilon(1e-3));
  CHECK(estimator_laws(roulette(log_det), truth) == Failures{});
  CHECK(estimator_laws(roulette(log_det), truth * 1.03) != Failures{});
  const Sparse sparse = chain.sparseView();
  CHECK(agrees(roulette(log_determinant(sparse)), truth));

  // term 1 is -z^T A z: mean -tr A, variance 2 sum_(i != j) a_ij^2 = 0.2 [Hutchinson 1990]
  std::vector<double> ones;
  for (std::uint64_t i = 0; i < 1 << 14; ++i) {
    Stream rng(2, i);
    auto terms = log_det(rng);
    CHECK(terms().value == 0);
    ones.push_back(terms().value);
  }
  const Moments m = Moments::of(ones);
  CHECK(std::abs(m.mean + 0.9) < 4.5 * m.standard_error());
  CHECK(m.variance() == Approx(0.2).epsilon(0.05));

  const double trace_of_exp = testing::trace_by_eigenvalues(chain, [](double x) { return std::exp(x); });
  const auto inverse_factorial = [](std::int64_t k) { return 1 / std::tgamma(static_cast<double>(k) + 1); };
  const auto exponential = trace_of_function(chain, inverse_factorial, std::numeric_limits<double>::infinity());
  CHECK(agrees(roulette(exponential, Geometric(0.5)), trace_of_exp));
}

TEST_CASE("the spectral radius of a matrix is found to a percent, of a nilpotent one it is 0",
          "[linear_operators][exact]") {
  CHECK(spectral_radius(coupled_pair) == Approx(0.7).epsilon(1e-9));
  CHECK(spectral_radius(chain) == Approx(0.573205).epsilon(1e-5));
  CHECK(spectral_radius(Functional{coupled_pair}) == spectral_radius(coupled_pair));
  CHECK(spectral_radius(Matrix2d{{0, 1}, {0, 0}}) == 0);
  CHECK(spectral_radius(Matrix2d{{0.9, 100}, {0, 0.9}}) == Approx(0.9).epsilon(1e-2));  // a Jordan block
  CHECK(std::isinf(spectral_radius(Matrix2d{{1e308, 1e308}, {1e308, 1e308}})));
}

TEST_CASE("an operator that does not converge is refused with its estimated spectral radius",
          "[linear_operators][exact]") {
  const Matrix2d growing = 2 * coupled_pair;
  CHECK_THROWS_WITH(neumann(growing, source), Catch::Contains("spectral radius = 1.4"));
  CHECK_THROWS_WITH(neumann(growing, source, first), Catch::Contains("spectral radius = 1.4"));
  CHECK_THROWS_WITH(neumann_walk(growing, source, first), Catch::Contains("(must be below 1)"));
  CHECK_THROWS_WITH(log_determinant(growing), Catch::Contains("spectral radius = 1.4"));
  CHECK_THROWS_AS(neumann(Matrix2d(Matrix2d::Identity()), source), std::invalid_argument);
  CHECK_THROWS_WITH(trace_of_function(
                        growing, [](std::int64_t) { return 1.0; }, 0.5),
                    Catch::Contains("(must be below 0.5)"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(neumann(Matrix2d{{nan, 0}, {0, 0}}, source), std::invalid_argument);
}

TEST_CASE("sizes that do not fit are refused", "[linear_operators][exact]") {
  const VectorXd three = VectorXd::Ones(3);
  CHECK_THROWS_WITH(neumann(coupled_pair, three), Catch::Contains("2 rows") && Catch::Contains("3"));
  CHECK_THROWS_AS(neumann(coupled_pair, source, three), std::invalid_argument);
  CHECK_THROWS_AS(neumann_walk(coupled_pair, source, three), std::invalid_argument);
  CHECK_THROWS_WITH(neumann_walk(coupled_pair, source, Vector2d(0, 0)), Catch::Contains("c = 0"));
  const Eigen::MatrixXd oblong = Eigen::MatrixXd::Zero(2, 3);
  CHECK_THROWS_WITH(neumann(oblong, source), Catch::Contains("not square"));
  CHECK_THROWS_AS(log_determinant(oblong), std::invalid_argument);
}

TEST_CASE("a sparse system of 100000 unknowns agrees with Eigen's solver in memory proportional to the entries",
          "[linear_operators][stat]") {
  const Sparse a = grid(400, 250);
  const Eigen::Index n = a.rows();
  REQUIRE(n == 100000);
  const VectorXd b = VectorXd::LinSpaced(n, 0, 1);
  VectorXd c = VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < 10; ++i) c[i * 9973 + 123] = i % 3 == 0 ? -1 : 1;
  Sparse identity(n, n);
  identity.setIdentity();
  Eigen::ConjugateGradient<Sparse, Eigen::Lower | Eigen::Upper> solver(identity - a);
  solver.setTolerance(1e-13);
  const double truth = c.dot(solver.solve(b));
  REQUIRE(solver.error() < 1e-12);

  // What is alive while the operator is applied, above what was alive before.
  struct Watched {
    const Sparse* a;
    std::size_t* peak;
    std::size_t before;
    static std::size_t alive() {
      const auto m = mallinfo2();
      return m.uordblks + m.hblkhd;
    }
    [[nodiscard]] Eigen::Index rows() const { return a->rows(); }
    [[nodiscard]] VectorXd apply(const VectorXd& x) const {
      VectorXd y = *a * x;
      *peak = std::max(*peak, alive() - before);
      return y;
    }
  };
  std::size_t peak = 0;
  const auto watched = roulette(neumann(Watched{&a, &peak, Watched::alive()}, b, c), {.base_level = 60});
  const auto r = estimate(watched, {.samples = 64, .seed = 5, .threads = 1});
  INFO("series: " << r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(r.standard_error < 0.002 * std::abs(truth));
  CHECK(peak < 10 * 8 * static_cast<std::size_t>(n));  // a few vectors; the matrix itself is not copied

  const std::size_t before = Watched::alive();
  const auto walk = roulette(neumann_walk(a, b, c));
  CHECK(Watched::alive() - before < 4 * 12 * static_cast<std::size_t>(a.nonZeros()));
  const auto w = estimate(walk, {.samples = 1 << 19, .seed = 5});
  INFO("walk: " << w);
  CHECK(std::abs(w.mean - truth) < 4.5 * w.standard_error);
  CHECK(w.standard_error < 0.02 * std::abs(truth));
}

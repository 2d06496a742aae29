// Bounds of spectra: what is refused, with which words, and what is found.

#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>

#include <Eigen/Core>
#include <Eigen/Sparse>

#include <debias/operators.hpp>

#include "catch_shim.hpp"
#include "operators/matrices.hpp"

using namespace debias;
using namespace debias::testing;
using Catch::Contains;
using Eigen::MatrixXd;

namespace {

// A as an operator whose entries nobody can read.
template <class Matrix>
auto hidden(const Matrix& a) {
  return symmetric_operator(a.rows(), [a](std::span<const double> x, std::span<double> y) {
    Eigen::Map<Eigen::VectorXd>(y.data(), a.rows()) = a * Eigen::Map<const Eigen::VectorXd>(x.data(), a.cols());
  });
}

const double not_a_number = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TEST_CASE("the interval holds the spectrum, by Gershgorin and by Lanczos", "[operators][exact]") {
  for (const double shift : {1e-3, 0.1, 3.0}) {
    const Sparse a = chain(400, shift);
    const Spectrum by_entries = spectrum_of_spd(a);
    CHECK(by_entries.lower == Approx(shift).epsilon(1e-9));
    CHECK(by_entries.lower_by == "Gershgorin");
    CHECK(by_entries.upper >= 4 + shift - 1e-4);
    const Spectrum by_products = spectrum_of_spd(hidden(a), {.lower = shift});
    CHECK(by_products.upper >= 4 + shift - 1e-4);
    CHECK(by_products.upper < 1.25 * (4 + shift));
    CHECK(by_products.upper_by == "Lanczos");
    CHECK(by_products.lowest_ritz > shift);
  }
  // isolated eigenvalues: the residual is small, and the bound close to them
  const Spectrum isolated = spectrum_of_spd(hidden(kernel(60, 20, 0.5)), {.lower = 0.5, .steps = 30});
  const double largest = largest_eigenvalue(kernel(60, 20, 0.5));
  CHECK(isolated.highest_ritz == Approx(largest).epsilon(1e-9));
  CHECK(isolated.residual < 1e-6);
  CHECK(isolated.upper >= largest);
  CHECK(isolated.condition() == Approx(isolated.upper / 0.5));
  // a multiple of the identity has an interval, too
  const MatrixXd identity = 3 * MatrixXd::Identity(5, 5);
  const Spectrum one = spectrum_of_spd(identity);
  CHECK(one.lower <= 3);
  CHECK(one.upper > 3);
}

TEST_CASE("the upper bound by Lanczos holds for 200 matrices with one eigenvalue just outside the others",
          "[operators][statistical]") {
  int above = 0;
  for (int i = 0; i < 200; ++i) {
    Eigen::VectorXd values = Eigen::VectorXd::LinSpaced(300, 1, 2);
    values[i % 300] = 2.05;  // of weight 1/300 in the start: 12 steps do not see it clearly
    const auto diagonal = symmetric_operator(300, [values](std::span<const double> x, std::span<double> y) {
      for (std::size_t k = 0; k < x.size(); ++k) y[k] = values[static_cast<Eigen::Index>(k)] * x[k];
    });
    const Spectrum s = spectrum_of_spd(diagonal, {.lower = 0.9, .steps = 16});
    CHECK(s.upper >= 2.05);
    above += s.highest_ritz + s.residual >= 2.05 ? 1 : 0;
  }
  CHECK(above < 200);  // the residual alone does not prove a bound
}

TEST_CASE("bounds that the steps refute are refused with what refutes them", "[operators][exact]") {
  const Sparse a = chain(300, 0.5);  // spectrum in [.5, 4.5]
  CHECK_THROWS_WITH(log_determinant_spd(a, {.lower = 0.7}), Contains("refuted") && Contains("condition is at least"));
  CHECK_THROWS_WITH(log_determinant_spd(a, {.lower = 0.5, .upper = 4}),
                    Contains("refuted") && Contains("at least 4.4"));
  CHECK_THROWS_WITH(log_determinant_spd(hidden(a), {.lower = 0.7}), Contains("refuted"));
  CHECK_THROWS_WITH(log_determinant_spd(hidden(a), {}), Contains("no lower bound") && Contains("nugget"));
  CHECK_THROWS_WITH(solve(a, Eigen::VectorXd::Ones(300), Eigen::VectorXd::Ones(300), {.lower = 2}),
                    Contains("refuted"));
  CHECK_THROWS_WITH(quadratic_form(a, functions::Sqrt{}, Eigen::VectorXd::Ones(300), {.lower = 2}),
                    Contains("refuted"));
  CHECK_THROWS_WITH(log_determinant_gradient(a, {.lower = 2}, RandomSigns{}, a), Contains("refuted"));
  CHECK_NOTHROW(log_determinant_spd(a, {.lower = 0.5, .upper = 4.5}));
  CHECK_NOTHROW(log_determinant_spd(a, {.lower = 0.3, .upper = 5}));  // true, and wider than need be
  for (const double wrong : {not_a_number, 0.0, -1.0, std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(log_determinant_spd(a, {.lower = wrong}), std::invalid_argument);
  }
  for (const double wrong : {not_a_number, 0.0, -1.0, 0.4, std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(log_determinant_spd(a, {.lower = 0.5, .upper = wrong}), std::invalid_argument);
  }
  CHECK_THROWS_WITH(log_determinant_spd(a, {.lower = 0.5, .steps = 1}), Contains("steps = 1"));
}

TEST_CASE("matrices that are not symmetric, not definite, not finite or not square are refused", "[operators][exact]") {
  Sparse a = chain(50, 1);
  a.coeffRef(10, 11) = -1.0001;
  CHECK_THROWS_WITH(log_determinant_spd(a), Contains("not symmetric") && Contains("-1.0001"));
  const Sparse triangle = chain(50, 1).triangularView<Eigen::Lower>();
  CHECK_THROWS_WITH(log_determinant_spd(triangle), Contains("fill both"));
  MatrixXd dense = kernel(30, 3, 1);
  dense(3, 7) += 1e-6;
  CHECK_THROWS_WITH(log_determinant_spd(dense), Contains("not symmetric"));
  MatrixXd skew = kernel(30, 3, 1);
  skew.triangularView<Eigen::StrictlyUpper>() *= 1.01;
  CHECK_THROWS_WITH(log_determinant_spd(hidden(skew), {.lower = 0.1}), Contains("not symmetric"));
  // one entry off among thousands is below what two products show, and the entries show it (above)
  CHECK_THROWS_WITH(log_determinant_spd(chain(50, -0.5)), Contains("not positive definite"));
  CHECK_THROWS_WITH(log_determinant_spd(hidden(chain(50, -0.5)), {.lower = 0.1}), Contains("not positive definite"));
  const MatrixXd negative = -kernel(30, 3, 1);
  CHECK_THROWS_WITH(solve(negative, Eigen::VectorXd::Ones(30), Eigen::VectorXd::Ones(30)),
                    Contains("not positive definite") && Contains("spectral radius"));
  CHECK_NOTHROW(trace_of_function(negative, functions::Exp{}, {}));  // e^A asks for no sign
  for (const double wrong : {not_a_number, std::numeric_limits<double>::infinity()}) {
    MatrixXd broken = kernel(30, 3, 1);
    broken(29, 28) = broken(28, 29) = wrong;
    CHECK_THROWS_WITH(log_determinant_spd(broken), Contains("must be finite"));
    const Sparse sparse = broken.sparseView();
    CHECK_THROWS_WITH(log_determinant_spd(sparse), Contains("must be finite"));
    CHECK_THROWS_WITH(log_determinant_spd(hidden(broken), {.lower = 0.5}), Contains("not finite"));
    CHECK_THROWS_WITH(log_determinant_gradient(kernel(30, 3, 1), {.lower = 1}, RandomSigns{}, broken),
                      Contains("must be finite"));
    Eigen::VectorXd b = Eigen::VectorXd::Ones(30);
    b[7] = wrong;
    CHECK_THROWS_AS(solve(kernel(30, 3, 1), b, Eigen::VectorXd::Ones(30), {.lower = 1}), std::invalid_argument);
    CHECK_THROWS_AS(solve(kernel(30, 3, 1), Eigen::VectorXd::Ones(30), b, {.lower = 1}), std::invalid_argument);
    CHECK_THROWS_AS(quadratic_form(kernel(30, 3, 1), functions::Log{}, b, {.lower = 1}), std::invalid_argument);
  }
  CHECK_THROWS_WITH(log_determinant_spd(MatrixXd(3, 4)), Contains("square"));
  CHECK_THROWS_WITH(log_determinant_spd(MatrixXd(0, 0)), Contains("no rows"));
  CHECK_THROWS_WITH(solve(kernel(30, 3, 1), Eigen::VectorXd::Ones(29), Eigen::VectorXd::Ones(30)), Contains("29"));
  CHECK_THROWS_AS(symmetric_operator(0, [](std::span<const double>, std::span<double>) {}), std::invalid_argument);
}

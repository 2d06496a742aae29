// Traces, log determinants, solves and gradients by Chebyshev terms.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Sparse>

#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/linear_operators.hpp>
#include <debias/operators.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"
#include "laws/sequence_laws.hpp"
#include "operators/matrices.hpp"

using namespace debias;
using namespace debias::testing;
using debias::laws::estimator_laws;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using ::laws::Failures;
using ::laws::sequence_laws;

namespace {

const Sparse small = chain(24, 0.5);  // condition 9
const double small_log_det = log_det_of_chain(24, 0.5);
const laws::EstimatorLawOptions few{.samples = 1 << 13, .repeats = 200, .samples_per_repeat = 256};

template <class Matrix>
auto by_spans(const Matrix& a) {
  return symmetric_operator(a.rows(), [a](std::span<const double> x, std::span<double> y) {
    Eigen::Map<VectorXd>(y.data(), a.rows()) = a * Eigen::Map<const VectorXd>(x.data(), a.cols());
  });
}

struct ByVectors {
  Sparse a;
  [[nodiscard]] Eigen::Index rows() const { return a.rows(); }
  [[nodiscard]] VectorXd apply(const VectorXd& x) const { return a * x; }
};

template <class Terms>
double first_terms(const Terms& terms, std::uint64_t index, int count) {
  Stream rng(5, index);
  auto cursor = terms(rng);
  double sum = 0;
  for (int k = 0; k < count; ++k) sum += cursor().value;
  return sum;
}

template <class E>
double z_of(const E& estimator, double truth, std::int64_t samples = 1 << 13) {
  const auto r = estimate(estimator, {.samples = samples, .seed = 17});
  INFO(r);
  CHECK(r.standard_error > 0);
  return std::abs(r.mean - truth) / r.standard_error;
}

}  // namespace

TEST_CASE("the terms of one probe sum to z^T f(A) z, whatever holds the operator", "[operators][exact]") {
  const MatrixXd dense = small;
  const Eigen::SparseMatrix<double, Eigen::RowMajor> rows = small;
  const SpectrumBounds bounds{.lower = 0.5, .upper = 4.5};
  VectorXd z(24);
  Stream rng(5, 3);
  std::vector<double> signs(24);
  debias::detail::fill_signs(signs, rng);
  for (Eigen::Index i = 0; i < 24; ++i) z[i] = signs[static_cast<std::size_t>(i)];
  const double log_form = z.dot(function_by_eigenvalues(dense, [](double x) { return std::log(x); }) * z);
  CHECK(first_terms(log_determinant_spd(small, bounds), 3, 40) == Approx(log_form).epsilon(1e-11));
  CHECK(first_terms(log_determinant_spd(dense, bounds), 3, 40) == Approx(log_form).epsilon(1e-11));
  CHECK(first_terms(log_determinant_spd(rows, bounds), 3, 40) == Approx(log_form).epsilon(1e-11));
  CHECK(first_terms(log_determinant_spd(by_spans(small), bounds), 3, 40) == Approx(log_form).epsilon(1e-11));
  CHECK(first_terms(log_determinant_spd(ByVectors{small}, bounds), 3, 40) == Approx(log_form).epsilon(1e-11));
  CHECK(first_terms(log_determinant_spd(small, bounds), 3, 3) != Approx(log_form).epsilon(1e-6));

  const auto form = [&](const auto& f) { return z.dot(function_by_eigenvalues(dense, f) * z); };
  CHECK(first_terms(quadratic_form(small, functions::Sqrt{}, z, bounds), 0, 40) ==
        Approx(form([](double x) { return std::sqrt(x); })).epsilon(1e-11));
  CHECK(first_terms(quadratic_form(small, functions::Exp{}, z, bounds), 0, 40) ==
        Approx(form([](double x) { return std::exp(x); })).epsilon(1e-11));
  CHECK(first_terms(quadratic_form(small, functions::Reciprocal{}, z, bounds), 0, 40) ==
        Approx(form([](double x) { return 1 / x; })).epsilon(1e-11));
  const auto mine = [](double x) { return std::cos(x) / (1 + x); };
  CHECK(first_terms(quadratic_form(small, mine, z, bounds), 0, 40) == Approx(form(mine)).epsilon(1e-11));
  const VectorXd b = VectorXd::LinSpaced(24, -1, 2);
  const VectorXd x = solved(dense, b);
  for (const Eigen::Index i : {0, 7, 23}) {
    CHECK(first_terms(solve(small, b, VectorXd::Unit(24, i), bounds), 0, 60) == Approx(x[i]).epsilon(1e-9));
  }
  CHECK(quadratic_form(small, mine, z, bounds).exact_from < 60);
}

TEST_CASE("log det, traces and solves are unbiased with an honest standard error", "[operators][statistical]") {
  const MatrixXd dense = small;
  CHECK(estimator_laws(roulette(log_determinant_spd(small, {.lower = 0.5})), small_log_det, few) == Failures{});
  // power checks: another shift, and a matrix whose last row is weighted otherwise
  CHECK(estimator_laws(roulette(log_determinant_spd(chain(24, 0.51), {.lower = 0.5})), small_log_det, few) !=
        Failures{});
  CHECK(estimator_laws(roulette(log_determinant_spd(small, {.lower = 0.5})), 1.02 * small_log_det, few) != Failures{});
  CHECK(z_of(roulette(trace_of_function(small, functions::Sqrt{}, {.lower = 0.5})),
             trace_by_eigenvalues(dense, [](double x) { return std::sqrt(x); })) < 4.5);
  CHECK(z_of(roulette(trace_of_function(small, functions::Reciprocal{}, {.lower = 0.5})),
             trace_by_eigenvalues(dense, [](double x) { return 1 / x; })) < 4.5);
  CHECK(z_of(roulette(trace_of_function(small, functions::Exp{}, {}), Geometric(0.3), {.base_level = 2}),
             trace_by_eigenvalues(dense, [](double x) { return std::exp(x); })) < 4.5);
  const auto mine = [](double x) { return std::sin(x) / x; };
  CHECK(z_of(roulette(trace_of_function(small, mine, {.lower = 0.5}), Geometric(0.3), {.base_level = 2}),
             trace_by_eigenvalues(dense, mine)) < 4.5);
  const VectorXd b = VectorXd::LinSpaced(24, -1, 2);
  const VectorXd x = solved(dense, b);
  const auto component = solve(small, b, VectorXd::Unit(24, 5), {.lower = 0.5});
  CHECK(estimator_laws(roulette(component), x[5], few) == Failures{});
  CHECK(estimator_laws(roulette(component), 1.01 * x[5], few) != Failures{});
  CHECK(z_of(single_term(levels_of(component)), x[5]) < 4.5);
  CHECK(z_of(roulette(quadratic_form(small, functions::Reciprocal{}, b, {.lower = 0.5})), b.dot(x)) < 4.5);
}

TEST_CASE("declared rates are those of solves and quadratic forms, per level", "[operators][statistical]") {
  const VectorXd b = VectorXd::Unit(24, 3);
  // condition 9: q = 2, one degree a level: E D_k^2 ~ 4^-k; two degrees: 16^-k
  const Sparse a = chain(24, 0.5);
  const auto x = solve(a, b, b, {.lower = 0.5, .upper = 4.5});
  CHECK(x.rates.variance_decay == Approx(2).epsilon(1e-12));
  CHECK(quadratic_form(a, functions::Reciprocal{}, b, {.lower = 0.5, .upper = 4.5}).rates.variance_decay ==
        Approx(4).epsilon(1e-12));
  const auto log_det = log_determinant_spd(a, {.lower = 0.5, .upper = 4.5});
  CHECK(log_det.rates.variance_decay == Approx(4).epsilon(1e-12));
  CHECK(sequence_laws(levels_of(log_det), {.last = 8, .samples = 1024, .variance_tolerance = 1, .work_tolerance = 1}) ==
        Failures{});
}

TEST_CASE("every kind of probe has the mean of the trace", "[operators][statistical]") {
  const auto log = [](double x) { return std::log(x); };
  CHECK(estimator_laws(roulette(log_determinant_spd(small, {.lower = 0.5}, Coloured{.distance = 2})), small_log_det,
                       few) == Failures{});
  CHECK(estimator_laws(roulette(log_determinant_spd(small, {.lower = 0.5}, HutchPlusPlus{.vectors = 4})), small_log_det,
                       few) == Failures{});
  // a diagonal that is not even, so that unit vectors have a variance
  Sparse uneven = chain(24, 0.5);
  for (Eigen::Index i = 0; i < 24; ++i) uneven.coeffRef(i, i) += 0.1 * static_cast<double>(i);
  const double truth = trace_by_eigenvalues(MatrixXd(uneven), log);
  CHECK(estimator_laws(roulette(log_determinant_spd(uneven, {.lower = 0.5}, UnitVectors{})), truth, few) == Failures{});
  CHECK(estimator_laws(roulette(log_determinant_spd(uneven, {.lower = 0.5}, UnitVectors{})), truth * 1.02, few) !=
        Failures{});
  std::vector<int> thirds(24);
  for (std::size_t i = 0; i < 24; ++i) thirds[i] = static_cast<int>(i % 3);
  CHECK(z_of(roulette(log_determinant_spd(by_spans(uneven), {.lower = 0.5}, Colours{thirds})), truth) < 4.5);
  const MatrixXd k = kernel(40, 6, 0.1);
  const double of_kernel = trace_by_eigenvalues(k, log);
  CHECK(z_of(roulette(log_determinant_spd(k, {.lower = 0.1}, HutchPlusPlus{.vectors = 12})), of_kernel, 1 << 12) < 4.5);
  CHECK(z_of(roulette(log_determinant_spd(by_spans(k), {.lower = 0.1}, HutchPlusPlus{.vectors = 12})), of_kernel,
             1 << 12) < 4.5);
  // power check: the space of Q without what the complement leaves out
  CHECK(z_of(roulette(log_determinant_spd(k, {.lower = 0.1}, HutchPlusPlus{.vectors = 12})), of_kernel * 0.95,
             1 << 12) > 4.5);
}

TEST_CASE("probes that do not fit are refused", "[operators][exact]") {
  using Catch::Contains;
  CHECK_THROWS_WITH(log_determinant_spd(small, {.lower = 0.5}, Coloured{.distance = 0}), Contains("distance"));
  CHECK_THROWS_WITH(log_determinant_spd(kernel(40, 6, 0.1), {.lower = 0.1}, Coloured{}), Contains("40 colours"));
  for (const int wrong : {0, -1, 13}) {
    CHECK_THROWS_WITH(log_determinant_spd(small, {.lower = 0.5}, HutchPlusPlus{.vectors = wrong}), Contains("[1, 12]"));
  }
  CHECK_THROWS_WITH(log_determinant_spd(small, {.lower = 0.5}, Colours{{0, 1}}), Contains("2 colours for 24 rows"));
  CHECK_THROWS_WITH(log_determinant_spd(small, {.lower = 0.5}, Colours{std::vector<int>(24, -1)}), Contains("-1"));
  CHECK_THROWS_WITH(log_determinant_spd(small, {.lower = 0.5}, Colours{std::vector<int>(24, 24)}), Contains("24"));
}

TEST_CASE("colours keep rows of one colour apart", "[operators][exact]") {
  const Sparse a = grid(13, 0.1);
  for (const int distance : {1, 2, 3, 5}) {
    std::vector<std::int64_t> outer(a.outerIndexPtr(), a.outerIndexPtr() + a.rows() + 1);
    std::vector<std::int32_t> inner(a.innerIndexPtr(), a.innerIndexPtr() + a.nonZeros());
    const std::vector<int> colours = debias::detail::colour_graph(outer, inner, distance);
    int clashes = 0;
    int beyond = 0;
    for (int i = 0; i < 169; ++i) {
      for (int j = 0; j < i; ++j) {
        const int apart = std::abs(i / 13 - j / 13) + std::abs(i % 13 - j % 13);
        const bool same = colours[static_cast<std::size_t>(i)] == colours[static_cast<std::size_t>(j)];
        clashes += same && apart <= distance ? 1 : 0;
        beyond += same && apart == distance + 1 ? 1 : 0;
      }
    }
    CHECK(clashes == 0);
    CHECK(beyond > 0);
    CHECK(debias::detail::count_colours("test", colours, 169) <= distance * distance + 4);
  }
}

TEST_CASE("a gradient of log det comes from the same probes, with covariances", "[operators][statistical]") {
  // A = K + theta I with K a kernel, and A scaled: d/dtheta = tr A^-1, d/dscale = tr(A^-1 A) = n
  const MatrixXd a = kernel(30, 3, 0.5);
  const MatrixXd identity = MatrixXd::Identity(30, 30);
  MatrixXd other(30, 30);
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 30; ++j) other(i, j) = std::cos(0.3 * (i - j));
  }
  const auto terms = log_determinant_gradient(a, {.lower = 0.5}, RandomSigns{}, identity, other);
  const auto e = roulette(terms);
  const auto r = estimate(e, {.samples = 1 << 13, .seed = 9});
  REQUIRE(r.components.size() == 6);
  const MatrixXd inverse = inverse_of(a);
  const double truths[] = {trace_by_eigenvalues(a, [](double x) { return std::log(x); }), inverse.trace(),
                           (inverse * other).trace()};
  for (std::size_t i = 0; i < 3; ++i) {
    CAPTURE(i, r.components[i].mean, truths[i]);
    CHECK(std::abs(r.components[i].mean - truths[i]) < 4.5 * r.components[i].standard_error);
    CHECK(std::abs(r.components[i].mean - 1.3 * truths[i]) > 4.5 * r.components[i].standard_error);
  }
  // the covariances are those of the samples
  const int n = 4096;
  double mean[3] = {};
  double product[3][3] = {};
  for (int k = 0; k < n; ++k) {
    const auto sample = trace(e, 9, k).sample.value;
    for (int i = 0; i < 3; ++i) {
      mean[i] += sample[i] / n;
      for (int j = 0; j < 3; ++j) product[i][j] += (sample[i] - truths[i]) * (sample[j] - truths[j]) / n;
    }
  }
  const auto run = estimate(e, {.samples = n, .seed = 9});
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double direct = (product[i][j] - (mean[i] - truths[i]) * (mean[j] - truths[j])) / (n - 1);
      CHECK(gradient_covariance(run, i, j) == Approx(direct).epsilon(1e-6).margin(1e-9));
    }
  }
  CHECK(gradient_covariance(run, 0, 1) != 0);
  CHECK_THROWS_AS(gradient_covariance(run, 0, 3), std::out_of_range);
  // sparse, coloured, and a derivative that is an operator
  const auto coloured = log_determinant_gradient(small, {.lower = 0.5}, Coloured{.distance = 3},
                                                 by_spans(Sparse(MatrixXd::Identity(24, 24).sparseView())));
  const auto s = estimate(roulette(coloured), {.samples = 4096, .seed = 9});
  CHECK(std::abs(s.components[0].mean - small_log_det) < 4.5 * s.components[0].standard_error);
  CHECK(std::abs(s.components[1].mean - inverse_of(small).trace()) < 4.5 * s.components[1].standard_error);
}

TEST_CASE("M08: variance x products is a twentieth of the power series, and right where that is wrong",
          "[operators][statistical]") {
  const double shift = 4.0 / 999;
  const double truth = log_det_of_chain(1000, shift);
  CHECK(truth == Approx(65.39649713833841).epsilon(1e-14));
  const Sparse a = chain(1000, shift);
  const auto r = estimate(recipe(log_determinant_spd(a, {.lower = shift})), {.samples = 8192, .seed = 3});
  INFO(r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 0.9 * truth) > 4.5 * r.standard_error);
  CHECK(r.split.probe_share() > 0.5);
  CHECK(r.split.sentence().find("probes are the noise") != std::string::npos);
  // today's: log det A = n log s + log det(I - (I - A / s)) by powers, s at the middle of the spectrum
  const double middle = 2 + shift / 2;
  Sparse identity(1000, 1000);
  identity.setIdentity();
  const Sparse rest = identity - a / middle;
  const auto powers = roulette(log_determinant(rest), Geometric(1.0 / 484));
  const auto p = estimate(powers, {.samples = 512, .seed = 3});
  const double ours = r.components[0].variance * (r.work / static_cast<double>(r.samples));
  const double theirs = p.components[0].variance * (p.work / static_cast<double>(p.samples));
  CAPTURE(ours, theirs, p.mean + 1000 * std::log(middle));
  CHECK(20 * ours < theirs);
}

TEST_CASE("a false lower bound that Lanczos cannot refute is seen in the run", "[operators][statistical]") {
  const double shift = 4.0 / 999;
  const Sparse a = chain(1000, shift);
  // three times too high: 16 steps of Lanczos see no eigenvalue below it
  const SpectrumBounds wrong{.lower = 3 * shift, .upper = 4 + shift, .steps = 16};
  const auto hidden = by_spans(a);
  const double truth = log_det_of_chain(1000, shift);
  const auto r = estimate(roulette(log_determinant_spd(hidden, wrong), Geometric(0.05)), {.samples = 4096, .seed = 3});
  CAPTURE(slow_terms(r));
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(slow_terms(r).find("more slowly than declared") != std::string::npos);
  const auto by_recipe = estimate(recipe(log_determinant_spd(hidden, wrong)), {.samples = 1 << 14, .seed = 3});
  std::ostringstream text;
  text << by_recipe;
  INFO(text.str());
  CHECK(std::abs(by_recipe.mean - truth) < 4.5 * by_recipe.standard_error);
  CHECK(text.str().find("more slowly than declared") != std::string::npos);
  // more steps refute it
  CHECK_THROWS(log_determinant_spd(hidden, {.lower = 3 * shift, .upper = 4 + shift, .steps = 120}));
  // power check: a true one is not spoken of, nor one that is wider than need be by little
  for (const double lower : {shift, 0.99 * shift}) {
    const auto right =
        estimate(roulette(log_determinant_spd(hidden, {.lower = lower, .upper = 4 + shift}), Geometric(0.05)),
                 {.samples = 4096, .seed = 3});
    CHECK(slow_terms(right).empty());
  }
  CHECK(slow_terms(estimate(roulette(log_determinant_spd(grid(20, 0.1), {.lower = 0.1}), Geometric(0.2)),
                            {.samples = 4096, .seed = 3}))
            .empty());
}

TEST_CASE("probing and Hutch++ take at most a fifth of the variance x products of plain probes",
          "[operators][statistical]") {
  const auto cost = [](const auto& terms, std::int64_t samples) {
    const auto r = estimate(roulette(terms, Geometric(0.35), {.base_level = 4}), {.samples = samples, .seed = 4});
    INFO(r);
    CHECK(r.standard_error > 0);
    return r.components[0].variance * r.work / static_cast<double>(r.samples);
  };
  const Sparse a = grid(30, 0.08);  // condition 100
  const SpectrumBounds bounds{.lower = 0.08};
  const double plain = cost(log_determinant_spd(a, bounds), 2048);
  CHECK(5 * cost(log_determinant_spd(a, bounds, Coloured{.distance = 3}), 512) < plain);
  const MatrixXd k = kernel(120, 8, 0.1);
  const double plain_kernel = cost(log_determinant_spd(k, {.lower = 0.1}), 1024);
  CHECK(5 * cost(log_determinant_spd(k, {.lower = 0.1}, HutchPlusPlus{.vectors = 25}), 512) < plain_kernel);
}

TEST_CASE("log det of the Laplacian with 10^6 unknowns has a relative error of 1e-4 in memory of a few vectors",
          "[operators][statistical][.long]") {
  const Sparse a = grid(1000, 0.004);  // condition 2000
  const double truth = log_det_of_grid(1000, 0.004);
  const auto r = estimate(
      roulette(log_determinant_spd(a, {.lower = 0.004}, Coloured{.distance = 3}), Geometric(0.08), {.base_level = 8}),
      {.samples = 32, .seed = 2});
  INFO(r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(r.standard_error < 1e-4 * truth);
  // power check: half a per mille off
  CHECK(std::abs(r.mean - 1.0005 * truth) > 4.5 * r.standard_error);
}

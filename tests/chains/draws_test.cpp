#include <debias/chains/draws.hpp>

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

#include "catch_shim.hpp"

#include <debias/chains.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/taylor.hpp>

using namespace debias;

namespace {

double square(double x) { return x * x; }
double density(double x) { return -0.5 * x * x; }
double wide(Stream& rng) { return 3 * rng.normal(); }

auto chain(const ChainOptions& o = {.burn_in = 5, .length = 40}) {
  return coupled_chain(random_walk(density, 2.4), wide, square, o);
}

}  // namespace

TEST_CASE("a function of an expectation by chains is unbiased, and one of plain averages is not",
          "[chains][statistical]") {
  const auto g = [](double m) { return m * m; };
  const auto r = estimate(single_term(function_of_mean(draws_of(chain()), g)), {.samples = 40000, .seed = 3});
  CHECK(std::abs(r.mean - 1) < 4.5 * r.standard_error);
  const auto s =
      estimate(single_term(function_of_mean(draws_of(chain()), functions::Square{})), {.samples = 40000, .seed = 3});
  CHECK(s.mean == Approx(r.mean).epsilon(1e-9));
  const auto plain = estimate(truncated(function_of_mean(draws_of(chain()), g), 0), {.samples = 40000, .seed = 3});
  CHECK(std::abs(plain.mean - 1) > 4.5 * plain.standard_error);
  // bounded functions
  const auto logistic =
      estimate(single_term(function_of_mean(draws_of(chain()), functions::Logistic{})), {.samples = 20000, .seed = 3});
  CHECK(std::abs(logistic.mean - 1 / (1 + std::exp(-1.0))) < 4.5 * logistic.standard_error);
}

TEST_CASE("K05: exp(-E X^2) by the power series of signed draws is 1/e", "[chains][statistical]") {
  const auto terms = taylor(draws_of(chain({.burn_in = 20, .length = 80, .lag = 20})), functions::ExpMinus{}, 1.0);
  const auto r = estimate(roulette(terms, Poisson(1)), {.samples = 20000, .seed = 3});
  CHECK(std::abs(r.mean - std::exp(-1.0)) < 4.5 * r.standard_error);
  CHECK(r.standard_error < 0.01);
  CHECK(std::abs(r.mean - std::exp(-1.1)) > 4.5 * r.standard_error);
}

TEST_CASE("functions that signed draws have no mean under are refused, with the reason", "[chains][exact]") {
  const auto of = [](const auto& g) { return function_of_mean(draws_of(chain()), g); };
  CHECK_THROWS_WITH(of(functions::Log{}), Catch::Contains("g has no finite value at 0"));
  CHECK_THROWS_WITH(of(functions::Reciprocal{}), Catch::Contains("g has no finite value at 0"));
  CHECK_THROWS_WITH(of(functions::Sqrt{}), Catch::Contains("g has no value at -0.25") && Catch::Contains("signed"));
  CHECK_THROWS_WITH(of(functions::ExpMinus{}),
                    Catch::Contains("faster than any power towards -") && Catch::Contains("taylor_sum"));
  CHECK_THROWS_WITH(of(functions::Exp{}), Catch::Contains("faster than any power towards 64"));
  // lambdas that nobody has named
  CHECK_THROWS_WITH(of([](double m) { return std::pow(m, 1.5); }), Catch::Contains("no value"));
  CHECK_THROWS_WITH(of([](double m) { return std::cosh(m / 50); }), Catch::Contains("faster than any power"));
  CHECK_THROWS_WITH(of([](double m) { return std::log(std::abs(m)); }), Catch::Contains("no finite value at 0"));
  CHECK_THROWS_WITH(of([](double m) { return std::exp(-1e-6 * m); }),
                    Catch::Contains("faster than any power towards -"));
  CHECK_NOTHROW(of([](double m) { return m * m * m - 2 * m; }));
  CHECK_NOTHROW(of([](double m) { return m + 1e-30 * std::pow(m, 12); }));
  CHECK_NOTHROW(of([](double m) { return 1 / (1 + std::exp(-m)); }));
  CHECK_NOTHROW(of([](double m) { return std::exp(-m * m); }));
  CHECK_NOTHROW(of([](double m) { return std::sqrt(1 + m * m); }));
  CHECK_NOTHROW(of([](double m) { return std::atan(m); }));
  // each component of a mean
  const auto two = [](double x) { return Eigen::Array2d(x, x * x); };
  const auto pair = draws_of(coupled_chain(random_walk(density, 2.4), wide, two, {.burn_in = 5, .length = 40}));
  CHECK_NOTHROW(function_of_mean(pair, [](const Eigen::Array2d& m) { return m[1] - m[0] * m[0]; }));
  CHECK_THROWS_WITH(function_of_mean(pair, [](const Eigen::Array2d& m) { return std::log(1 + m[1]); }),
                    Catch::Contains("no finite value at -1"));
  const auto variance =
      estimate(single_term(function_of_mean(pair, [](const Eigen::Array2d& m) { return m[1] - m[0] * m[0]; })),
               {.samples = 20000, .seed = 3});
  CHECK(std::abs(variance.mean - 1) < 4.5 * variance.standard_error);
}

// Chebyshev series: their sums are their functions.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <debias/operators/chebyshev.hpp>

#include "catch_shim.hpp"

using debias::ChebyshevSeries;
using debias::Rates;

namespace {

// The largest error of the sum of `terms` coefficients over the interval, relative to the largest value.
template <class F>
double error_of(const ChebyshevSeries& c, const F& f, std::int64_t terms) {
  double worst = 0;
  double size = 0;
  for (int i = 0; i <= 40; ++i) {
    const double t = -1 + i / 20.0;
    const double x = (c.lower() + c.upper()) / 2 + (c.upper() - c.lower()) / 2 * t;
    const double angle = std::acos(t);
    double sum = 0;
    for (std::int64_t k = terms - 1; k >= 0; --k) sum += c(k) * std::cos(static_cast<double>(k) * angle);
    worst = std::max(worst, std::abs(sum - f(x)));
    size = std::max(size, std::abs(f(x)));
  }
  return worst / size;
}

double log_of(double x) { return std::log(x); }
double inverse_of(double x) { return 1 / x; }
double sqrt_of(double x) { return std::sqrt(x); }
double exp_of(double x) { return std::exp(x); }

}  // namespace

TEST_CASE("series of log, inverse, square root, exponential and any analytic f sum to the function",
          "[operators][exact]") {
  for (const double condition : {1.5, 10.0, 1000.0, 1e5}) {
    const double b = 0.3 * condition;
    const auto terms = static_cast<std::int64_t>(20 * std::sqrt(condition)) + 60;
    CHECK(error_of(ChebyshevSeries::log(0.3, b), log_of, terms) < 1e-12);
    CHECK(error_of(ChebyshevSeries::inverse(0.3, b), inverse_of, terms) < 1e-10);
    CHECK(error_of(ChebyshevSeries::sqrt(0.3, b), sqrt_of, terms) < 1e-12);
  }
  for (const double b : {1.0, 30.0, 700.0}) {
    CHECK(error_of(ChebyshevSeries::exp(-b, b), exp_of, 4000) < 1e-12);
    CHECK(error_of(ChebyshevSeries::exp(-2000, b / 100), exp_of, 8000) < 1e-12);
  }
  const auto bump = [](double x) { return 1 / (1 + 25 * x * x); };
  const ChebyshevSeries runge = ChebyshevSeries::of(bump, -1, 1);
  CHECK(error_of(runge, bump, 400) < 1e-13);
  CHECK(runge.last().value() > 100);
  CHECK(runge(runge.last().value() + 1) == 0);
  // by cosine transform as by the closed form
  const ChebyshevSeries by_points = ChebyshevSeries::of(log_of, 0.1, 10);
  for (std::int64_t k = 0; k < 60; ++k) CHECK(std::abs(by_points(k) - ChebyshevSeries::log(0.1, 10)(k)) < 1e-14);
  const ChebyshevSeries square = ChebyshevSeries::of([](double x) { return x * x; }, -3, 5);
  CHECK(square.last() == 2);
  // power check: the series of a neighbouring interval
  CHECK(error_of(
            ChebyshevSeries::log(0.3, 30), [](double x) { return std::log(1.0001 * x); }, 400) > 1e-6);
}

TEST_CASE("rates are those of the coefficients", "[operators][exact]") {
  const ChebyshevSeries log = ChebyshevSeries::log(1, 100);  // q = 11 / 9
  CHECK(log.rates(1).variance_decay == Approx(2 * std::log2(11.0 / 9)));
  CHECK(log.rates(2).variance_decay == Approx(4 * std::log2(11.0 / 9)));
  CHECK(ChebyshevSeries::inverse(1, 100)(51) / ChebyshevSeries::inverse(1, 100)(50) == Approx(-9.0 / 11));
  CHECK(ChebyshevSeries::sqrt(1, 100)(2001) / ChebyshevSeries::sqrt(1, 100)(2000) == Approx(-9.0 / 11).epsilon(1e-2));
  CHECK(ChebyshevSeries::exp(-1, 1).rates(1).variance_decay == Rates::faster_than_any);
  const ChebyshevSeries mine = ChebyshevSeries::of(log_of, 1, 100);
  CHECK(mine.rates(1).variance_decay == Approx(2 * std::log2(11.0 / 9)).epsilon(0.15));
  CHECK(std::abs(log(log.degree_below(1e-6))) <= 1e-6 * std::abs(log(1)));
  CHECK(std::abs(log(log.degree_below(1e-6) - 1)) > 1e-6 * std::abs(log(1)));
}

TEST_CASE("functions that are not analytic on the interval, and intervals that are none, are refused",
          "[operators][exact]") {
  using Catch::Contains;
  CHECK_THROWS_WITH(ChebyshevSeries::of([](double x) { return std::abs(x); }, -1, 1), Contains("not analytic"));
  CHECK_THROWS_WITH(ChebyshevSeries::of([](double x) { return x > 0.3 ? 1.0 : 0.0; }, -1, 1), Contains("not analytic"));
  CHECK_THROWS_WITH(ChebyshevSeries::of(log_of, -1, 1), Contains("must be finite"));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double wrong : {nan, 0.0, -1.0, 2.0}) {
    CHECK_THROWS_AS(ChebyshevSeries::log(wrong, 2), std::invalid_argument);
    CHECK_THROWS_AS(ChebyshevSeries::inverse(wrong, 2), std::invalid_argument);
    CHECK_THROWS_AS(ChebyshevSeries::sqrt(wrong, 2), std::invalid_argument);
  }
  CHECK_THROWS_AS(ChebyshevSeries::exp(2, 1), std::invalid_argument);
  CHECK_THROWS_AS(ChebyshevSeries::exp(0, 800), std::invalid_argument);
  CHECK_THROWS_AS(ChebyshevSeries::exp(nan, 1), std::invalid_argument);
  CHECK_THROWS_AS(ChebyshevSeries::of(exp_of, 1, nan), std::invalid_argument);
}

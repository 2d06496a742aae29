#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/core/vector_math.hpp>

using namespace debias;

namespace {

/// The largest difference to the function of one number, in ulp of the result.
double largest_error(void (*many)(std::span<double>), double (*one)(double), double low, double high) {
  std::vector<double> x(1003);
  Stream(9, 0).fill(x);
  for (double& v : x) v = low + (high - low) * v;
  std::vector<double> y = x;
  many(y);
  double worst = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double exact = one(x[i]);
    const double ulp = std::nextafter(std::abs(exact), std::numeric_limits<double>::infinity()) - std::abs(exact);
    worst = std::max(worst, std::abs(y[i] - exact) / ulp);
  }
  return worst;
}

}  // namespace

TEST_CASE("functions of many numbers are within 4 ulp of those of one", "[core][exact]") {
  CHECK(largest_error(vector_math::exp, std::exp, -700, 700) <= 4);
  CHECK(largest_error(vector_math::exp, std::exp, -1e-3, 1e-3) <= 4);
  CHECK(largest_error(vector_math::expm1, std::expm1, -30, 30) <= 4);
  CHECK(largest_error(vector_math::expm1, std::expm1, -1e-9, 1e-9) <= 4);
  CHECK(largest_error(vector_math::log, std::log, 1e-300, 1e300) <= 4);
  CHECK(largest_error(vector_math::log, std::log, 0.5, 2) <= 4);
  CHECK(largest_error(vector_math::log1p, std::log1p, -0.999, 1) <= 4);
  CHECK(largest_error(vector_math::log1p, std::log1p, -1e-12, 1e-12) <= 4);
  CHECK(largest_error(vector_math::sin, std::sin, -100, 100) <= 4);
}

TEST_CASE("a function of many numbers does not depend on their place", "[core][exact]") {
  std::vector<double> x(40);
  Stream(9, 1).fill(x);
  std::vector<double> all = x;
  vector_math::exp(all);
  for (std::size_t first = 0; first < x.size(); ++first) {
    std::vector<double> some(x.begin() + static_cast<std::ptrdiff_t>(first), x.end());
    vector_math::exp(some);
    CHECK(std::vector<double>(all.begin() + static_cast<std::ptrdiff_t>(first), all.end()) == some);
  }
}

TEST_CASE("exact values and the ends of the domain", "[core][exact]") {
  std::vector<double> x{0, -0.0};
  vector_math::expm1(x);
  CHECK(x == std::vector<double>{0, 0});
  x = {0, -std::numeric_limits<double>::infinity(), 1000};
  vector_math::exp(x);
  CHECK(x == std::vector<double>{1, 0, std::numeric_limits<double>::infinity()});
  x = {0, -1, std::numeric_limits<double>::quiet_NaN()};
  vector_math::log(x);
  CHECK(x[0] == -std::numeric_limits<double>::infinity());
  CHECK(std::isnan(x[1]));
  CHECK(std::isnan(x[2]));
}

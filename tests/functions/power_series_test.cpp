#include <debias/functions/power_series.hpp>

#include <cmath>
#include <cstdint>

#include <boost/multiprecision/cpp_dec_float.hpp>

#include <debias/functions.hpp>
#include <debias/pmf/poisson.hpp>

#include "catch_shim.hpp"

using namespace debias;

namespace {

using Exact = boost::multiprecision::cpp_dec_float_50;

/// The error of the first `terms` terms of the series of g about a at a + h, relative to g.
template <class G, class F>
double series_error(const G& g, const F& exact, double a, double h, int terms) {
  auto series = g.expand(a);
  Exact sum = 0;
  Exact power = 1;
  for (int k = 0; k < terms; ++k) {
    sum += Exact(series()) * power;
    power *= Exact(h) / Exact(series.scale);
  }
  const Exact truth = exact(Exact(Exact(a) + Exact(h)));
  return static_cast<double>(abs((sum - truth) / truth));
}

}  // namespace

TEST_CASE("the power series of each function sum up to the function, to 1e-14, from either side of the centre",
          "[functions][exact]") {
  using boost::multiprecision::exp;
  using boost::multiprecision::log;
  using boost::multiprecision::pow;
  using boost::multiprecision::sqrt;
  const auto check = [](const auto& g, const auto& exact, std::initializer_list<double> centres) {
    for (const double a : centres) {
      const double reach = std::min(1.5, 0.7 * g.expand(a).radius);
      for (const double h : {-reach, -0.1 * reach, 0.3 * reach, reach}) {
        CAPTURE(a, h);
        CHECK(series_error(g, exact, a, h, 120) < 1e-14);
      }
    }
  };
  check(functions::Exp{}, [](const Exact& x) { return Exact(exp(x)); }, {-3.0, 0.0, 2.0, 40.0});
  check(functions::ExpMinus{}, [](const Exact& x) { return Exact(exp(-x)); }, {-3.0, 0.0, 2.0, 100.0});
  check(functions::Reciprocal{}, [](const Exact& x) { return Exact(1 / x); }, {-2.0, 0.01, 3.0});
  check(functions::Square{}, [](const Exact& x) { return Exact(x * x); }, {-2.0, 0.5, 3.0});
  check(functions::Log{}, [](const Exact& x) { return Exact(log(x)); }, {0.01, 0.5, 30.0});
  check(functions::Sqrt{}, [](const Exact& x) { return Exact(sqrt(x)); }, {0.01, 1.0, 30.0});
  check(functions::Power{-1.5}, [](const Exact& x) { return Exact(pow(x, Exact(-1.5))); }, {0.5, 3.0});
  check(functions::Power{3}, [](const Exact& x) { return Exact(x * x * x); }, {-0.5, 3.0});
  check(functions::Davis{0.5}, [](const Exact& x) { return Exact(pow(1 + x / 4, -4)); }, {0.0, 2.0, 16.0});
  check(functions::Logistic{}, [](const Exact& x) { return Exact(1 / (1 + exp(-x))); }, {-2.0, 0.0, 0.5, 5.0});
}

TEST_CASE("coefficients neither overflow nor underflow at order 500 of a thick medium", "[functions][exact]") {
  auto series = functions::ExpMinus{}.expand(300);  // Poisson masses with alternating signs
  const Poisson pmf(300);
  for (std::int64_t k = 0; k <= 500; ++k) {
    const double c = series();
    CHECK(c * (k % 2 == 0 ? 1 : -1) == Approx(pmf.mass(k)).epsilon(1e-12));
  }
  auto log = functions::Log{}.expand(1e-200);
  log();
  for (std::int64_t k = 1; k <= 500; ++k) CHECK(std::abs(log()) == Approx(1 / static_cast<double>(k)));
}

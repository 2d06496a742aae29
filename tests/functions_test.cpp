#include <debias/functions.hpp>

#include <cmath>
#include <functional>
#include <limits>

#include <boost/multiprecision/cpp_dec_float.hpp>
#include <Eigen/Core>

#include "catch_shim.hpp"

using namespace debias;

namespace {

using Exact = boost::multiprecision::cpp_dec_float_50;

/// g(m) - (g(m + d) + g(m - d)) / 2 with 50 digits, from the doubles m and d.
template <class G>
Exact exact_gap(const G& g, double m, double d) {
  const Exact mean = m;
  const Exact half = d;
  return g(mean) - (g(Exact(mean + half)) + g(Exact(mean - half))) / 2;
}

/// The largest relative error of `gap(m, d)` over means and ratios d / m from 1e-9 to 0.99, both signs of d.
template <class Gap, class G>
double worst_error(const Gap& gap, const G& g, std::initializer_list<double> means) {
  double worst = 0;
  for (const double m : means) {
    for (const double ratio : {1e-9, 1e-6, 1e-3, 0.03, 0.2, 0.49, 0.5, 0.51, 0.7, 0.99}) {
      for (const double d : {m * ratio, -m * ratio}) {
        const Exact exact = exact_gap(g, m, d);
        const double error = static_cast<double>(abs((Exact(gap(m, d)) - exact) / exact));
        if (!(error <= worst)) worst = error;
      }
    }
  }
  return worst;
}

/// The largest relative error of the function itself.
template <class F, class G>
double worst_value_error(const F& f, const G& g, std::initializer_list<double> means) {
  double worst = 0;
  for (const double m : means) {
    const Exact exact = g(Exact(m));
    const double error = static_cast<double>(abs((Exact(f(m)) - exact) / exact));
    if (!(error <= worst)) worst = error;
  }
  return worst;
}

template <class F>
auto gap_of(const F& f) {
  return [f](double m, double d) { return f.gap(m, d); };
}

template <class F, class G>
void check_function(const F& f, const G& g, std::initializer_list<double> means, double tolerance = 2e-15) {
  CHECK(worst_value_error(f, g, means) < tolerance);
  CHECK(worst_error(gap_of(f), g, means) < tolerance);
  for (const double m : means) CHECK(f.gap(m, 0.0) == 0.0);
}

}  // namespace

TEST_CASE("gaps have 14 digits where the subtraction has none", "[functions][exact]") {
  const auto exact_exp = [](const Exact& x) { return Exact(exp(x)); };
  const auto exact_exp_minus = [](const Exact& x) { return Exact(exp(-x)); };
  check_function(functions::Exp{}, exact_exp, {-20.0, -1.0, 0.3, 1.0, 7.0}, 1e-14);
  check_function(functions::ExpMinus{}, exact_exp_minus, {-1.0, 0.01, 0.3, 1.0, 7.0, 40.0}, 1e-14);
  check_function(functions::Reciprocal{}, [](const Exact& x) { return Exact(1 / x); }, {-2.0, 1e-9, 5.0});
  check_function(functions::Square{}, [](const Exact& x) { return Exact(x * x); }, {-2.0, 0.3, 1e9});
  check_function(
      functions::Log{}, [](const Exact& x) { return Exact(log(x)); }, {1e-9, 0.3, 1e9}, 1e-14);
  check_function(functions::Sqrt{}, [](const Exact& x) { return Exact(sqrt(x)); }, {1e-9, 0.3, 1.0, 1e9});
  check_function(functions::Logistic{}, [](const Exact& x) { return Exact(1 / (1 + exp(-x))); },
                 {-30.0, -1.0, 0.01, 0.5, 3.0, 30.0});
  for (const double a : {-1.5, -0.25, 0.5, 1.5, 2.0, 3.7}) {
    check_function(
        functions::Power{a}, [a](const Exact& x) { return Exact(pow(x, Exact(a))); }, {1e-3, 0.3, 1.0, 50.0}, 1e-14);
  }
  for (const double c : {0.05, 0.5, 0.8, 2.0}) {
    const Exact c2 = Exact(c) * c;
    check_function(
        functions::Davis{c}, [c2](const Exact& x) { return Exact(pow(1 + c2 * x, -1 / c2)); }, {0.01, 0.3, 2.0, 10.0},
        1e-14);
  }

  // Power check: the plain subtraction, and a gap that is off by a small term.
  const auto subtracted = [](double m, double d) {
    return std::exp(-m) - (std::exp(-(m + d)) + std::exp(-(m - d))) / 2;
  };
  CHECK(worst_error(subtracted, exact_exp_minus, {1.0}) > 0.1);
  const auto quadratic = [](double m, double d) { return -0.5 * std::exp(-m) * d * d; };
  CHECK(worst_error(quadratic, exact_exp_minus, {1.0}) > 1e-3);
}

TEST_CASE("gaps of thick media and of halves far apart neither overflow nor vanish", "[functions][exact]") {
  CHECK(functions::ExpMinus{}.gap(1000, 1000) == -0.5);
  CHECK(functions::ExpMinus{}.gap(1000, 990) == Approx(-0.5 * std::exp(-10)).epsilon(1e-14));
  CHECK(functions::Exp{}.gap(-800, 800) == -0.5);
  CHECK(functions::Logistic{}.gap(800, 900) == Approx(0.5));
  CHECK(functions::Logistic{}.gap(-800, 900) == Approx(-0.5));
  CHECK(functions::Logistic{}.gap(900, 800) == Approx(0.0).margin(1e-40));
  CHECK(functions::Reciprocal{}.gap(3e-200, 1e-200) == Approx(-1 / 24e-200).epsilon(1e-14));
  CHECK(functions::Sqrt{}.gap(5e200, 4e200) == Approx((std::sqrt(5.0) - 2) * 1e100).epsilon(1e-14));
}

TEST_CASE("a half that is zero has the gap of its definition", "[functions][exact]") {
  CHECK(functions::Sqrt{}.gap(2, 2) == Approx(std::sqrt(2.0) - 1));
  CHECK(functions::Sqrt{}.gap(0, 0) == 0);
  CHECK(functions::Power{1.5}.gap(2, 2) == Approx(std::pow(2, 1.5) - 4));
  CHECK(functions::Power{0.5}.gap(0, 0) == 0);
  CHECK(functions::Power{2}.gap(-3, 1) == Approx(-1));
  CHECK_FALSE(std::isfinite(functions::Reciprocal{}.gap(2, 2)));
  CHECK_FALSE(std::isfinite(functions::Log{}.gap(2, 2)));
}

TEST_CASE("outside its domain a function and its gap are NaN, never a finite number", "[functions][exact]") {
  const auto nan = [](double x) { return std::isnan(x); };
  for (const double d : {0.0, 0.1, 3.0}) {
    CHECK(nan(functions::Log{}.gap(-2, d)));
    CHECK(nan(functions::Sqrt{}.gap(-2, d)));
    CHECK(nan(functions::Power{0.5}.gap(-2, d)));
    CHECK(nan(functions::Davis{2}.gap(-2, d)));
  }
  CHECK(nan(functions::Log{}(-2)));
  CHECK(nan(functions::Sqrt{}(-2)));
  CHECK(nan(functions::Power{-1.5}(-2)));
  CHECK(nan(functions::Davis{2}(-2)));
  CHECK(nan(functions::Log{}.gap(1, 2)));  // one half is negative
  CHECK(nan(functions::Sqrt{}.gap(1, 2)));
  CHECK(nan(functions::Power{0.5}.gap(1, 2)));
  const double undefined = std::numeric_limits<double>::quiet_NaN();
  CHECK(nan(functions::Exp{}.gap(undefined, 0)));
  CHECK(nan(functions::Square{}.gap(1, undefined)));
  CHECK(nan(functions::Absolute{}(undefined)));
  CHECK(nan(functions::Absolute{}.gap(undefined, 1)));
  CHECK(nan(functions::PositivePart{}(undefined)));
  CHECK(nan(functions::PositivePart{}.gap(1, undefined)));
  CHECK(nan(functions::Logistic{}.gap(undefined, 1)));
}

TEST_CASE("a kink has a gap only between the halves", "[functions][exact]") {
  for (const double m : {-2.0, -0.5, 0.0, 0.25, 3.0}) {
    for (const double d : {-4.0, -0.5, 0.0, 0.25, 2.0, 8.0}) {
      const auto plain = [m, d](const std::function<double(double)>& g) {
        return g(m) - (g(m + d) + g(m - d)) / 2;  // exact: all numbers are short
      };
      CHECK(functions::Absolute{}.gap(m, d) == plain([](double x) { return std::abs(x); }));
      CHECK(functions::PositivePart{}.gap(m, d) == plain([](double x) { return x > 0 ? x : 0; }));
    }
  }
}

TEST_CASE("componentwise applies a function and its gap to each component", "[functions][exact]") {
  const auto g = functions::componentwise(functions::ExpMinus{});
  const Eigen::Array3d m(0.5, 1.0, 2.0);
  const Eigen::Array3d d(0.1, 0.0, -0.3);
  const Eigen::Array3d values = g(m);
  const Eigen::Array3d gaps = g.gap(m, d);
  for (Eigen::Index i = 0; i < 3; ++i) {
    CHECK(values[i] == functions::ExpMinus{}(m[i]));
    CHECK(gaps[i] == functions::ExpMinus{}.gap(m[i], d[i]));
  }
  const auto without_gap = functions::componentwise([](double x) { return x * x; });
  CHECK(without_gap(m)[2] == 4.0);
}

#include <debias/functions.hpp>

#include <cmath>
#include <functional>
#include <initializer_list>
#include <limits>
#include <utility>

#include <boost/multiprecision/cpp_dec_float.hpp>
#include <Eigen/Core>

#include "catch_shim.hpp"

#include <debias/function_of_mean.hpp>
#include <debias/reciprocal.hpp>

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

// ---- halves at the ends of the range

namespace {

/// The relative error of a gap against 50 digits; absolute where the gap is zero.
double gap_error(double gap, const Exact& exact) {
  if (exact == 0) return std::abs(gap);
  return static_cast<double>(abs((Exact(gap) - exact) / exact));
}

/// The gap of two halves as the sequence takes it, level 1 of draws a, b.
template <class G>
double gap_in_a_sequence(const G& g, double a, double b) {
  const auto x = [a, b](Stream& rng) {
    const bool second = rng.uniform() != Stream(1, 0).uniform();  // the first number of this very stream
    return second ? b : a;
  };
  Stream rng(1, 0);
  return function_of_mean(x, g)(1, rng).difference;
}

template <class G, class E>
double worst_gap_in_a_sequence(const G& g, const E& exact, std::initializer_list<std::pair<double, double>> halves) {
  double worst = 0;
  for (const auto& [first, second] : halves) {
    for (const bool swapped : {false, true}) {
      const double a = swapped ? second : first;
      const double b = swapped ? first : second;
      const Exact expected = exact((Exact(a) + b) / 2) - (exact(Exact(a)) + exact(Exact(b))) / 2;
      if (a == b) {
        CHECK(gap_in_a_sequence(g, a, b) == 0);
        continue;
      }
      // Down to 2^-26 of the other a half is known from mean and half difference, to the rounding of the other.
      const double ratio = std::max(std::abs(a), std::abs(b)) / std::min(std::abs(a), std::abs(b));
      const double doubt = std::isfinite(ratio) && ratio < 0x1p26 ? ratio : 1;
      const double error = gap_error(gap_in_a_sequence(g, a, b), expected) / doubt;
      INFO("halves " << a << ", " << b);
      if (!(error <= worst)) worst = error;
    }
  }
  return worst;
}

const std::initializer_list<std::pair<double, double>> positive_halves = {
    {1, 1e-17}, {3, 1e-9}, {1e300, 1e-300}, {1e-300, 3e-300}, {1e-310, 4e-318}, {2e200, 1e180}, {0.7, 0.7}, {5, 4}};

}  // namespace

TEST_CASE("the gap of a ratio is right where one half weighs next to nothing", "[functions][exact]") {
  const auto difference = [](const Eigen::Array2d& a, const Eigen::Array2d& b) {
    const auto x = [a, b](Stream& rng) { return Eigen::Array2d(rng.uniform() != Stream(1, 0).uniform() ? b : a); };
    Stream rng(1, 0);
    return function_of_mean(x, functions::Ratio{})(1, rng).difference;
  };
  CHECK(difference({-1, 1}, {-4.6e-17, 1e-17}) == Approx(1.8).epsilon(1e-15));
  CHECK(difference({-4.6e-17, 1e-17}, {-1, 1}) == Approx(1.8).epsilon(1e-15));
  const double values[] = {-3.0, -1e-5, 1e-200, 0.25, 1e12};
  const double weights[] = {1e-300, 1e-20, 0.5, 1.0, 3e7, 1e250};
  const auto exact = [](const Eigen::Array2d& a, const Eigen::Array2d& b) {
    const Exact x = a[0];
    const Exact y = b[0];
    const Exact v = a[1];
    const Exact w = b[1];
    return Exact((x + y) / (v + w) - (x / v + y / w) / 2);
  };
  double worst = 0;
  for (const double v : weights) {
    for (const double w : weights) {
      for (const double first : values) {
        for (const double second : values) {
          const Eigen::Array2d a(first * v, v);
          const Eigen::Array2d b(second * w, w);
          if (!a.isFinite().all() || !b.isFinite().all() || v == w) continue;
          if (std::abs(a[0]) < 1e-290 || std::abs(b[0]) < 1e-290) continue;
          const double lopsided = std::max(v, w) / std::min(v, w);
          // Where the halves are told from mean and half difference, these are rounded: 2^-52 of the larger half.
          const double doubt = lopsided < 0x1p26 ? lopsided : 1.0;
          const double error = gap_error(difference(a, b), exact(a, b));
          // Ratios that nearly agree differ by less than the rounding of first v and second w.
          if (first != second) worst = std::max(worst, error / doubt);
        }
      }
    }
  }
  CHECK(worst < 1e-14);
  // from means and half differences whose ratios nearly agree: the determinant has all its digits
  for (const double tiny : {1e-3, 1e-9, 1e-14}) {
    const Eigen::Array2d m(1, 3);
    const Eigen::Array2d d(0.1 * (1 + tiny), 0.3);
    const Exact a = (Exact(m[0]) + d[0]) / (Exact(m[1]) + d[1]);
    const Exact b = (Exact(m[0]) - d[0]) / (Exact(m[1]) - d[1]);
    CHECK(gap_error(functions::Ratio{}.gap(m, d), Exact(Exact(m[0]) / m[1] - (a + b) / 2)) < 2e-15);
  }
  CHECK(functions::Ratio{}.gap(Eigen::Array2d(1, 4), Eigen::Array2d(0.25, 1)) == 0);
  CHECK(
      std::isnan(functions::Ratio{}.gap(Eigen::Array2d(0.5, 0.5), Eigen::Array2d(0.5, 0.5))));  // a half without weight
}

TEST_CASE("gaps in a sequence have their digits at halves that are tiny, huge, equal, or far apart",
          "[functions][exact]") {
  const auto check = [](const auto& g, const auto& exact, double tolerance,
                        std::initializer_list<std::pair<double, double>> halves) {
    CHECK(worst_gap_in_a_sequence(g, exact, halves) < tolerance);
  };
  const auto log_of = [](const Exact& x) { return Exact(log(x)); };
  const auto root = [](const Exact& x) { return Exact(sqrt(x)); };
  const auto inverse = [](const Exact& x) { return Exact(1 / x); };
  check(functions::Log{}, log_of, 1e-14, positive_halves);
  check(functions::Sqrt{}, root, 2e-15, positive_halves);
  check(
      functions::Reciprocal{}, inverse, 2e-15,
      {{1, 1e-17}, {-1, -1e-17}, {1, -1e-17}, {1e300, 1e-300}, {1e-300, 3e-300}, {2, -1}, {0.7, 0.7}, {1e200, 1e190}});
  check(ClampedReciprocal(1e-30), inverse, 2e-15, {{1, 1e-17}, {1e20, 3}, {4, 5}});
  for (const double p : {-2.0, -0.5, 1e-3, 0.5, 0.999, 1.0, 1.001, 1.5, 2.0, 3.0}) {
    INFO("power " << p);
    check(functions::Power{p}, [p](const Exact& x) { return Exact(pow(x, Exact(p))); }, 1e-13,
          {{1, 1e-17}, {3, 1e-9}, {1e100, 1e-60}, {1e-90, 3e-90}, {0.7, 0.7}, {5, 4}, {5, 1e-3}});
  }
  for (const double c : {1e-3, 0.5, 4.0}) {
    INFO("Davis " << c);
    const Exact c2 = Exact(c) * c;
    check(functions::Davis{c}, [c2](const Exact& x) { return Exact(exp(-log(1 + c2 * x) / c2)); }, 1e-11,
          {{1, 1e-17}, {1e20, 1}, {1e5, 1e-9}, {0.7, 0.7}, {5, 4}, {500, 3}, {1e-12, 1e-30}});
  }
  check(functions::ExpMinus{}, [](const Exact& x) { return Exact(exp(-x)); }, 1e-14,
        {{1e20, 1}, {1e10, 2}, {1, 1e-17}, {1e-9, 1e-20}, {0, 1e-3}, {-1e-30, 3}, {-2, 1}, {0.7, 0.7}});
  check(functions::Exp{}, [](const Exact& x) { return Exact(exp(x)); }, 1e-14,
        {{-1e20, 1}, {1, 1e-17}, {0, 2}, {3, 3}});
  check(functions::Logistic{}, [](const Exact& x) { return Exact(1 / (1 + exp(-x))); }, 1e-14,
        {{1e20, 1}, {1e20, 50}, {-1e20, -3}, {1e20, -1e-3}, {1, 1e-17}, {1e-9, 1e-20}, {0.7, 0.7}});
  check(functions::Absolute{}, [](const Exact& x) { return Exact(abs(x)); }, 2e-15,
        {{1, -1e-20}, {-1, 1e-300}, {3, -2}, {1, 1e-20}, {1, -1}, {0, -2}});
  check(functions::PositivePart{}, [](const Exact& x) { return x > 0 ? x : Exact(0); }, 2e-15,
        {{1, -1e-20}, {-1, 1e-300}, {3, -2}, {1, 1e-20}, {1, -1}, {0, -2}});
  check(functions::Square{}, [](const Exact& x) { return Exact(x * x); }, 2e-15, {{1, -1e-20}, {1e150, 2}, {4, 5}});

  // Power check: mean and half difference alone have lost the small half.
  CHECK_FALSE(std::isfinite(functions::Reciprocal{}.gap(0.5, 0.5)));
  CHECK(gap_error(functions::ExpMinus{}.gap(5e19, 5e19), Exact(-exp(Exact(-1)) / 2)) > 0.1);
}

TEST_CASE("gaps from mean and half difference have their digits up to a half that is nearly zero",
          "[functions][exact]") {
  const auto worst = [](const auto& g, const auto& exact, double smallest = 1e-310) {
    double largest = 0;
    for (const double m : {smallest, 1e-200, 0.5, 3.0, 1e200}) {
      for (const double nearly : {0.9, 0.999, 1 - 1e-7, 1 - 1e-14}) {
        for (const double d : {m * nearly, -m * nearly}) {
          const double error = gap_error(g.gap(m, d), exact_gap(exact, m, d));
          if (!(error <= largest)) largest = error;
        }
      }
    }
    return largest;
  };
  CHECK(worst(functions::Log{}, [](const Exact& x) { return Exact(log(x)); }) < 1e-14);
  CHECK(worst(functions::Sqrt{}, [](const Exact& x) { return Exact(sqrt(x)); }) < 2e-15);
  for (const double p : {1e-9, 0.1, 0.5, 0.9, 1 - 1e-9, 1 + 1e-9, 1.1}) {
    INFO("power " << p);
    CHECK(worst(
              functions::Power{p}, [p](const Exact& x) { return Exact(pow(x, Exact(p))); }, 1e-250) < 1e-13);
  }
  for (const double d : {0.3, 1.7, 2.0, 1e9}) CHECK(functions::Power{1}.gap(2, d) == 0);  // a straight line
  const functions::Power cube{3};
  for (const double m : {1.0, -1e-3, 1e-12}) {
    CHECK(gap_error(cube.gap(m, 1e4), exact_gap([](const Exact& x) { return Exact(x * x * x); }, m, 1e4)) < 1e-14);
  }
  // The batch form takes the same branch.
  double m[70];
  double d[70];
  for (std::size_t i = 0; i < 70; ++i) {
    m[i] = 2;
    d[i] = i % 3 == 0 ? 2 * (1 - 1e-9) : 0.5;
  }
  functions::Log::gaps(m, d);
  for (std::size_t i = 0; i < 70; ++i) {
    CHECK(d[i] == Approx(functions::Log{}.gap(2, i % 3 == 0 ? 2 * (1 - 1e-9) : 0.5)).epsilon(1e-14));
  }
}

TEST_CASE("thick correlated media and logarithmic weights far apart have finite gaps", "[functions][exact]") {
  const Exact c2 = Exact(1e-4) * 1e-4;
  const auto davis = [c2](const Exact& x) { return Exact(exp(-log(1 + c2 * x) / c2)); };
  CHECK(gap_error(functions::Davis{1e-4}.gap(1000, 900), exact_gap(davis, 1000, 900)) < 1e-6);  // c^2 = 1e-8: 8 digits
  const auto sum_of_two = [](double m0, double d0, double m1, double d1) {
    const auto g = [](const Exact& x, const Exact& y) { return Exact(log(exp(x) + exp(y))); };
    return Exact(g(m0, m1) - (g(Exact(m0) + d0, Exact(m1) + d1) + g(Exact(m0) - d0, Exact(m1) - d1)) / 2);
  };
  for (const double d : {1e-9, 1.0, 100.0, 160.0, 700.0, 2000.0}) {
    for (const double m : {0.0, -1.0, -500.0, -2000.0, 30.0}) {
      INFO("m " << m << ", d " << d);
      const double gap = functions::LogSumExp{}.gap(Eigen::Array2d(0, m), Eigen::Array2d(0.25, d));
      const Exact exact = sum_of_two(0, 0.25, m, d);
      CHECK(static_cast<double>(abs(Exact(gap) - exact)) <= 1e-13 * (static_cast<double>(abs(exact)) + 1e-30));
    }
  }
}

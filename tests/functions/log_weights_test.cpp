#include <debias/functions/log_weights.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>

#include "../catch_shim.hpp"
#include "../laws/value_laws.hpp"

using namespace debias;
using functions::LogMeanExp;

namespace {

bool close(double x, double y) { return std::abs(x - y) <= 1e-13 * std::abs(y); }

// The same as of plain numbers, where these can be written.
double log_gap(double a, double b) { return std::log((a + b) / 2) - (std::log(a) + std::log(b)) / 2; }
Weighted<double> mean(const Weighted<double>& a, const Weighted<double>& b) { return debias::scaled(a + b, 0.5); }
Weighted<double> half_difference(const Weighted<double>& a, const Weighted<double>& b) {
  return debias::scaled(a - b, 0.5);
}

}  // namespace

TEST_CASE("the log of a weight is its exponent, however far from 0", "[functions][log_weights][exact]") {
  for (const double l : {0.0, 1.0, -1.0, 700.0, -2000.0, 1e6, -1e6, -3e15}) {
    CAPTURE(l);
    CHECK(std::abs(LogMeanExp{}(exp_of(l)) - l) <= 4e-16 * std::abs(l));
  }
  CHECK(close(exp_of(-3.25).at(0), std::exp(-3.25)));
  CHECK(close(exp_of(40.5).at(0), std::exp(40.5)));
  constexpr double infinite = std::numeric_limits<double>::infinity();
  CHECK(LogMeanExp{}(exp_of(-infinite)) == -infinite);
  CHECK(LogMeanExp{}(exp_of(infinite)) == infinite);
  CHECK(std::isnan(LogMeanExp{}(exp_of(std::numeric_limits<double>::quiet_NaN()))));
  CHECK(LogMeanExp{}(exp_of(-infinite) + exp_of(-5000)) == LogMeanExp{}(exp_of(-5000)));
}

TEST_CASE("sums, differences and gaps of weights are those of their values, at any height",
          "[functions][log_weights][exact]") {
  for (const double height : {0.0, -5000.0, 1e5}) {
    for (const double apart : {0.0, 1e-3, 0.5, 3.0, 17.0, 19.0, 60.0}) {
      const Weighted<double> a = exp_of(height);
      const Weighted<double> b = exp_of(height - apart);
      const double r = std::exp(-apart);
      CAPTURE(height, apart);
      const double rounding = 1e-15 * std::abs(height);
      CHECK(std::abs(LogMeanExp{}(mean(a, b)) - (height + std::log((1 + r) / 2))) <= 1e-15 + rounding);
      const double gap = LogMeanExp{}.gap(mean(a, b), half_difference(a, b));
      const double of_halves = LogMeanExp{}.gap_of_halves(a, b);
      CHECK(std::abs(of_halves - log_gap(1, r)) <= 1e-14 + rounding);
      CHECK(std::abs(of_halves - LogMeanExp{}.gap_of_halves(b, a)) <= 1e-15);
      if (apart < 17) CHECK(std::abs(gap - log_gap(1, r)) <= 1e-12 + rounding);
      CHECK(lopsided(a, b) == (apart > 18.5));
      CHECK(lopsided(b, a) == lopsided(a, b));
    }
    CHECK(LogMeanExp{}.gap(exp_of(height), half_difference(exp_of(height), exp_of(height))) == 0);
  }
}

TEST_CASE("of a lopsided pair the small half keeps its say", "[functions][log_weights][exact]") {
  // -log 2 + 1e4 / 2: a gap of plain numbers would be infinite.
  CHECK(close(LogMeanExp{}.gap_of_halves(exp_of(0), exp_of(-1e4)), -std::numbers::ln2 + 5e3));
  CHECK(std::isinf(functions::Log{}.gap_of_halves(1, std::exp(-1e4))) ==
        std::isinf(functions::Log{}.gap_of_halves(1, 0.0)));
}

TEST_CASE("arrays of weights give the log and the weighted means beside it", "[functions][log_weights][exact]") {
  using Two = Eigen::Array2d;
  const auto at = [](double l, double x) { return exp_of(l, Two(1, x)); };
  for (const double height : {0.0, -4000.0}) {
    const auto a = at(height + 0.3, 2);
    const auto b = at(height - 0.4, -1);
    const double w_a = std::exp(0.3);
    const double w_b = std::exp(-0.4);
    const double ratio = (2 * w_a - w_b) / (w_a + w_b);
    const Weighted<Two> m = debias::scaled(a + b, 0.5);
    const Two value = LogMeanExp{}(m);
    CHECK(std::abs(value[0] - height - std::log((w_a + w_b) / 2)) < 1e-11);
    CHECK(std::abs(value[1] - ratio) < 1e-11);
    const Two by_mean = LogMeanExp{}.gap(m, debias::scaled(a - b, 0.5));
    const Two by_halves = LogMeanExp{}.gap_of_halves(a, b);
    CHECK(std::abs(by_mean[0] - log_gap(w_a, w_b)) < 1e-11);
    CHECK(std::abs(by_mean[1] - (ratio - 0.5)) < 1e-11);
    CHECK(std::abs(by_halves[0] - by_mean[0]) < 1e-11);
    CHECK(std::abs(by_halves[1] - by_mean[1]) < 1e-11);
  }
}

TEST_CASE("a mean of weights that all underflow has a finite log, unbiased, where the plain log has none",
          "[functions][log_weights][statistical]") {
  // log E e^l, l = -2000 - 300 u: -2000 + log((1 - e^-300) / 300). No shift serves all l: the weights span 130 decades.
  const auto log_weight = [](std::span<const double> x) { return -2000 - 300 * x[0]; };
  const double truth = -2000 - std::log(300.0);
  const Plan plan{.samples = 1 << 12, .seed = 3};
  const auto weight = [=](std::span<const double> x) { return exp_of(log_weight(x)); };
  const auto r = estimate(
      single_term(function_of_integral(weight, Cube(1), LogMeanExp{}, {.rates = Rates{3, 1}}), {.base_level = 6}),
      plan);
  CAPTURE(r.mean, r.standard_error);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - (truth + 1)) > 4.5 * r.standard_error);
  CHECK(std::isfinite(r.mean));
  const auto plain = [=](std::span<const double> x) { return std::exp(log_weight(x)); };
  const auto lost = estimate(single_term(function_of_integral(plain, Cube(1), functions::Log{})), plan);
  CHECK_FALSE(std::isfinite(lost.mean));
}

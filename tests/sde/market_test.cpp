#include <debias/sde/market.hpp>

#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <debias/core/estimate.hpp>
#include <debias/core/no_pmf.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/sde/heston.hpp>
#include <debias/sde/sensitivities.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;

namespace {

const CoxIngersollRoss<> rate{.start = 0.04, .reversion = 2, .mean = 0.04, .volatility = 0.2, .horizon = 1};

// E exp(-u X_T) [Cox, Ingersoll & Ross 1985].
double laplace(const CoxIngersollRoss<>& m, double u) {
  const double fall = std::exp(-m.reversion * m.horizon);
  const double square = m.volatility * m.volatility;
  const double c = 1 + u * square * (1 - fall) / (2 * m.reversion);
  return std::pow(c, -2 * m.reversion * m.mean / square) * std::exp(-u * m.start * fall / c);
}

// A call under Heston's model by its characteristic function [Albrecher et al. 2007], strike K.
double heston_call(const Heston<>& m, double strike) {
  using C = std::complex<double>;
  const auto& v = m.variance;
  const double t = v.horizon;
  const auto characteristic = [&](const C& u) {
    const C i(0, 1);
    const C b = v.reversion - m.correlation * v.volatility * i * u;
    const C d = std::sqrt(b * b + v.volatility * v.volatility * (i * u + u * u));
    const C g = (b - d) / (b + d);
    const C e = std::exp(-d * t);
    const double s2 = v.volatility * v.volatility;
    return std::exp(i * u * (std::log(m.start) + m.rate * t) +
                    v.reversion * v.mean / s2 * ((b - d) * t - 2.0 * std::log((1.0 - g * e) / (1.0 - g))) +
                    v.start / s2 * (b - d) * (1.0 - e) / (1.0 - g * e));
  };
  // Lewis 2001: C = S - sqrt(S K) e^(-r t / 2) / pi times the integral of Re(...) / (w^2 + 1/4)
  double integral = 0;
  const double step = 0.01;
  const double k = std::log(strike);
  for (double w = step / 2; w < 200; w += step) {
    const C u(w, -0.5);
    const C x = std::exp(C(0, -w) * k) * characteristic(u);
    integral += x.real() / (w * w + 0.25) * step;
  }
  return m.start - std::exp(-m.rate * t) * std::sqrt(strike) * integral / std::numbers::pi;
}

struct Smooth {
  static constexpr int smoothness = 2;
  template <class X>
  X operator()(const X& x) const {
    return exp(X(-10 * x));
  }
};

}  // namespace

TEST_CASE("Cox, Ingersoll and Ross: Laplace transform, laws and derivative", "[sde][law]") {
  const auto payoff = [](double x) { return std::exp(-10 * x); };
  const auto levels = own_steps(rate, payoff);
  CHECK(laws::sequence_laws(levels, {.last = 9, .samples = 2048, .rates_from = 5}) == laws::Failures{});
  const double truth = laplace(rate, 10);
  const auto r = estimate(single_term(levels), {.samples = 1 << 15, .seed = 41});
  INFO(r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.01 * truth) > 4.5 * r.standard_error);

  const auto model = []<class X>(const X& start, const X& volatility) {
    return CoxIngersollRoss<X>{
        .start = start, .reversion = X(2), .mean = X(0.04), .volatility = volatility, .horizon = 1};
  };
  const auto g =
      estimate(single_term(sensitivities(OwnStep{}, model, Smooth{}, 0.04, 0.2)), {.samples = 1 << 14, .seed = 43});
  const auto slope = [](const auto& at, double h) { return (laplace(at(h), 10) - laplace(at(-h), 10)) / (2 * h); };
  const double in_start = slope([](double h) { return CoxIngersollRoss<>{0.04 + h, 2, 0.04, 0.2, 1}; }, 1e-5);
  const double in_volatility = slope([](double h) { return CoxIngersollRoss<>{0.04, 2, 0.04, 0.2 + h, 1}; }, 1e-5);
  CHECK(std::abs(g.mean.slopes[0] - in_start) < 4.5 * g.standard_error.slopes[0]);
  CHECK(std::abs(g.mean.slopes[1] - in_volatility) < 4.5 * g.standard_error.slopes[1]);
  CHECK(std::abs(g.mean.slopes[0] - 1.1 * in_start) > 4.5 * g.standard_error.slopes[0]);
  CHECK(std::abs(g.mean.slopes[1] - 1.5 * in_volatility) > 4.5 * g.standard_error.slopes[1]);
}

TEST_CASE("Heston: price and delta of a call beside the characteristic function", "[sde][statistical]") {
  const Heston<> m{.start = 100, .rate = 0.03, .variance = rate, .correlation = -0.7};
  const double truth = heston_call(m, 105);
  const auto levels = heston(m, CallPayoff{105});
  const auto r = estimate(single_term(levels), {.samples = 1 << 15, .seed = 47});
  INFO(r << truth);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.05 * truth) > 4.5 * r.standard_error);
  CHECK(laws::sequence_laws(levels, {.last = 9, .samples = 2048, .rates_from = 5}) == laws::Failures{});

  using D = Dual<1>;
  const Heston<D> dual{.start = D::parameter(0, 100),
                       .rate = 0.03,
                       .variance = {.start = 0.04, .reversion = 2, .mean = 0.04, .volatility = 0.2, .horizon = 1},
                       .correlation = -0.7};
  const auto moved = [&m](double by) {
    Heston<> other = m;
    other.start += by;
    return heston_call(other, 105);
  };
  const double delta = (moved(0.01) - moved(-0.01)) / 0.02;
  const auto g = estimate(single_term(heston(dual, CallPayoff{105})), {.samples = 1 << 14, .seed = 53});
  CHECK(std::abs(g.mean.slopes[0] - delta) < 4.5 * g.standard_error.slopes[0]);
  CHECK(std::abs(g.mean.slopes[0] - 1.05 * delta) > 4.5 * g.standard_error.slopes[0]);
}

TEST_CASE("Heston's paths: the price by antithetic twins, whose rates let a PMF exist, and plain Milstein's do not",
          "[sde][statistical]") {
  const Heston<> m{.start = 100, .rate = 0.03, .variance = rate, .correlation = -0.7};
  const auto call = [](const HestonPaths::State& x) { return std::exp(-0.03) * positive_part(x[0] - 105); };
  const auto twins = heston_paths(m, call);
  const double truth = heston_call(m, 105);
  const auto r = estimate(single_term(twins, {.base_level = 2}), {.samples = 1 << 14, .seed = 59});
  INFO(r << truth);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.1 * truth) > 4.5 * r.standard_error);
  const auto fall = [](const auto& levels) {
    const auto square = [&levels](std::int64_t k) {
      double sum = 0;
      for (std::uint64_t i = 0; i < 2000; ++i) {
        Stream rng(61, i);
        const double d = levels(k, rng).difference;
        sum += d * d;
      }
      return sum;
    };
    return std::log2(square(4) / square(6)) / 2;
  };
  CHECK(fall(twins) > 1.7);
  CHECK(fall(milstein(HestonPaths(m), call, {1, 1})) < 1.5);
  // a variance that touches 0
  Heston<> rough = m;
  rough.variance.volatility = 0.6;
  CHECK(fall(heston_paths(rough, call)) < 1.5);
  CHECK_THROWS_AS(single_term(heston_paths(rough, call)), NoPmfError);

  // where the variance is 0 or below it has no noise, and no slope of it
  const HestonPaths paths(m);
  for (const double v : {0.0, -0.01}) {
    const HestonPaths::State low(100, v);
    CHECK(paths.diffusion(low, 0).isZero());
    CHECK(paths.diffusion_along(low, 0, {1, 0}).isZero());
    CHECK(paths.drift(low, 0)[1] == 2 * 0.04);
  }
  CHECK_THROWS_AS(HestonPaths(Heston<>{.variance = rate, .correlation = 1}), std::invalid_argument);
  CHECK_THROWS_AS(HestonPaths(Heston<>{.start = -1, .variance = rate}), std::invalid_argument);
  CHECK_THROWS_AS(HestonPaths(Heston<>{.variance = {.volatility = -1}}), std::invalid_argument);
}

TEST_CASE("a local volatility has the derivative of its function", "[sde][exact]") {
  const LocalVolatility m([](const auto& x, double t) { return (0.5 + t) * pow(x, -0.2); }, 100.0, 0.05);
  CHECK(m.diffusion(90, 0.5) == Approx(std::pow(90, 0.8)));
  CHECK(m.diffusion_derivative(90, 0.5) == Approx(0.8 * std::pow(90, -0.2)).epsilon(1e-12));
  CHECK(laws::sequence_laws(milstein(m, [](double x) { return x; }), {.last = 6, .samples = 2048}) == laws::Failures{});
}

TEST_CASE("what a model is not defined for is refused before a draw, or shows in the sample", "[sde][nan]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto end = [](double x) { return x; };
  for (const double bad : {nan, 0.0, -1.0, std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(milstein(BlackScholes<>{.start = bad}, end), std::invalid_argument);
    CHECK_THROWS_AS(milstein(BlackScholes<>{.volatility = bad}, end), std::invalid_argument);
    CHECK_THROWS_AS(own_steps(CoxIngersollRoss<>{.start = bad}, end), std::invalid_argument);
    CHECK_THROWS_AS(own_steps(CoxIngersollRoss<>{.mean = bad}, end), std::invalid_argument);
    CHECK_THROWS_AS(milstein(LocalVolatility([bad](const auto& x, double) { return bad + 0 * x; }, 100.0, 0.05), end),
                    std::invalid_argument);
  }
  CHECK_THROWS_AS(own_steps(CoxIngersollRoss<>{.volatility = 2.1}, end), std::invalid_argument);
  CHECK_THROWS_AS(heston(Heston<>{.variance = rate, .correlation = 1}, CallPayoff{1}), std::invalid_argument);
  // between both bounds the steps are defined, and nothing says that they converge fast enough
  CHECK_THROWS_AS(single_term(own_steps(CoxIngersollRoss<>{.volatility = 1}, end)), NoPmfError);
  // Euler's path of the same law falls below zero, where its root is no number: the sample is not finite
  const auto euler_paths =
      euler(CoxIngersollRoss<>{.start = 0.04, .reversion = 0.5, .mean = 0.04, .volatility = 0.25}, end);
  const auto r = estimate([&euler_paths](Stream& rng) { return euler_paths.value_at(4, rng).value; },
                          {.samples = 1000, .seed = 1});
  CHECK(r.nonfinite > 0);
  CHECK(std::isnan(r.mean));
}

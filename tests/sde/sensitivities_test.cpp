#include <debias/sde/sensitivities.hpp>

#include <cmath>
#include <cstdint>

#include <debias/core/estimate.hpp>
#include <debias/core/no_pmf.hpp>
#include <debias/covariance.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/sde/greeks.hpp>
#include <debias/sde/likelihood_ratio.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"
#include "laws/value_laws.hpp"
#include "sde/difference_quotients.hpp"

using namespace debias;

namespace {

using Tree = Branched<Smoothed<MilsteinStep>>;

// S = K = 100, r = 0.05, sigma = 0.2, T = 1.
const auto market = []<class X>(const X& spot, const X& volatility, const X& rate, const X& horizon) {
  return BlackScholes<X, X>{.start = spot, .rate = rate, .volatility = volatility, .horizon = horizon};
};
const auto of_spot = []<class X>(const X& spot) {
  return BlackScholes<X>{.start = spot, .rate = X(0.05), .volatility = X(0.2)};
};
const auto call = discounted(CallPayoff{100});
const auto digital = discounted(DigitalPayoff{100, 100});

constexpr double call_greeks[] = {10.45058357218556678, 0.6368306511756191, 37.52403469169379, 53.23248154537634,
                                  6.414027546438196};  // the last: d/dT = -theta
constexpr double call_gamma = 0.01876201734584690;
constexpr double digital_value = 53.23248154537634;
constexpr double digital_delta = 1.876201734584689;

template <class T>
concept Ordered = requires(const T& x) {
  x > 100;
};

// f, f' and f'' of a function of one number by nested duals.
template <class F>
Dual<1, Dual<1>> twice(const F& f, double x) {
  return f(Dual<1, Dual<1>>::parameter(0, Dual<1>::parameter(0, x)));
}

// A model of a user: constant elasticity of variance, all coefficients by hand.
template <class X>
struct Elastic {
  X start;
  X scale;
  double horizon = 1;
  X drift(const X& x, double /*t*/) const { return 0.05 * x; }
  X diffusion(const X& x, double /*t*/) const { return scale * pow(x, 0.8); }
  X diffusion_derivative(const X& x, double /*t*/) const { return 0.8 * scale * pow(x, -0.2); }
};

}  // namespace

TEST_CASE("a dual number has the derivatives of the formula, the second too, and is a Value", "[sde][exact]") {
  const auto f = [](const auto& x) {
    return exp(sin(x)) / (1 + x * x) - 2 * log(x) * sqrt(x) + pow(x, 1.5) * tanh(x) -
           (3 - cos(x)) * normal_distribution(x);
  };
  const double x = 1.3;
  const double h = 1e-4;
  const auto plain = [](double y) {
    return std::exp(std::sin(y)) / (1 + y * y) - 2 * std::log(y) * std::sqrt(y) + std::pow(y, 1.5) * std::tanh(y) -
           (3 - std::cos(y)) * normal_distribution(y);
  };
  const auto d = twice(f, x);
  CHECK(d.value.value == Approx(plain(x)).epsilon(1e-14));
  CHECK(d.slopes[0].value == d.value.slopes[0]);
  CHECK(d.slopes[0].value == Approx((plain(x + h) - plain(x - h)) / (2 * h)).epsilon(1e-7));
  CHECK(d.slopes[0].slopes[0] == Approx((plain(x + h) - 2 * plain(x) + plain(x - h)) / (h * h)).epsilon(1e-5));
  CHECK(component_count(d) == 4);
  CHECK(component(d, 3) == d.slopes[0].slopes[0]);
  CHECK(component(d, 1) == d.value.slopes[0]);
  const auto kink = [](const auto& y) { return max(y, 1.0) + min(y, 2 * y) + abs(-y); };
  CHECK(twice(kink, 1.3).slopes[0].value == 3);
  CHECK(twice(kink, 0.7).slopes[0].value == 2);
  CHECK(std::isnan(positive_part(Dual<1>(std::nan(""))).value));
}

TEST_CASE("payoffs have their expectation over a normal law, with its slopes", "[sde][exact]") {
  // by the midpoint rule over 8 deviations
  const auto mean_of = [](const auto& payoff, double m, double s) {
    double sum = 0;
    const int n = 200000;
    for (int i = 0; i < n; ++i) {
      const double z = -8 + 16 * (i + 0.5) / n;
      sum += payoff(m + s * z) * normal_density(z) * 16 / n;
    }
    return sum;
  };
  CHECK(CallPayoff{100}.expected(103.0, 7.0) == Approx(mean_of(CallPayoff{100}, 103, 7)).epsilon(1e-8));
  CHECK(PutPayoff{100}.expected(103.0, 7.0) == Approx(mean_of(PutPayoff{100}, 103, 7)).epsilon(1e-8));
  CHECK(DigitalPayoff{100, 3}.expected(103.0, 7.0) == Approx(mean_of(DigitalPayoff{100, 3}, 103, 7)).epsilon(1e-4));
  const auto m = Dual<2>::parameter(0, 103);
  const auto s = Dual<2>::parameter(1, 7);
  const auto slopes = [&](const auto& p) {
    const double h = 1e-5;
    const auto d = p.expected(m, s);
    CHECK(d.value == Approx(p.expected(103.0, 7.0)).epsilon(1e-14));
    CHECK(d.slopes[0] == Approx((p.expected(103 + h, 7.0) - p.expected(103 - h, 7.0)) / (2 * h)).epsilon(1e-7));
    CHECK(d.slopes[1] == Approx((p.expected(103.0, 7 + h) - p.expected(103.0, 7 - h)) / (2 * h)).epsilon(1e-6));
  };
  slopes(CallPayoff{100});
  slopes(PutPayoff{100});
  slopes(DigitalPayoff{100, 3});
}

TEST_CASE("the slopes of a path are its difference quotients, in every parameter", "[sde][exact]") {
  const auto check = [](auto scheme, const auto& payoff) {
    const auto levels_at = [&](const testing::Parameters& p) {
      return sensitivities(scheme, market, payoff, p[0], p[1], p[2], p[3]);
    };
    testing::check_difference_quotients(levels_at, {100, 0.2, 0.05, 1}, 1e-6);
  };
  check(Tree{}, call);
  check(Tree{}, digital);
  check(MilsteinStep{}, discounted(PutPayoff{90}));
}

TEST_CASE("what no mean of slopes knows does not compile, and what has no PMF is refused with its rates",
          "[sde][compile]") {
  STATIC_REQUIRE_FALSE(Ordered<Dual<1>>);
  STATIC_REQUIRE(Ordered<double>);
  STATIC_REQUIRE_FALSE(detail::sees_every_derivative<Branched<MilsteinStep>, DigitalPayoff, 1>);
  STATIC_REQUIRE_FALSE(detail::sees_every_derivative<Branched<MilsteinStep>, CallPayoff, 2>);
  STATIC_REQUIRE(detail::sees_every_derivative<MilsteinStep, CallPayoff, 1>);
  STATIC_REQUIRE(detail::sees_every_derivative<Tree, DigitalPayoff, 2>);
  const auto refused = [](const auto& levels, double beta) {
    try {
      single_term(levels);
      FAIL("not refused");
    } catch (const NoPmfError& e) {
      CHECK(e.variance_decay().value == beta);
    }
  };
  refused(sensitivities(MilsteinStep{}, of_spot, call, 100.0), 1);
  refused(sensitivities(Smoothed<MilsteinStep>{}, of_spot, digital, 100.0), 0.5);
  refused(second_sensitivities(Smoothed<MilsteinStep>{}, of_spot, call, 100.0), 0.5);
  refused(second_sensitivities(Tree{}, of_spot, digital, 100.0), 0.5);
}

TEST_CASE("E14, E15, E17, E18: value, delta, vega, rho and theta of a call from one run, with their covariance",
          "[sde][statistical]") {
  const auto levels = sensitivities(Tree{}, market, call, 100.0, 0.2, 0.05, 1.0);
  const auto r = estimate(single_term(with_covariance(levels), {.base_level = 2}), {.samples = 1 << 14, .seed = 23});
  INFO(r);
  for (std::size_t i = 0; i < 5; ++i) {
    const auto& c = r.components[i];
    CHECK(std::abs(c.mean - call_greeks[i]) < 4.5 * c.standard_error);
    CHECK(std::abs(c.mean - 1.1 * call_greeks[i]) > 4.5 * c.standard_error);
  }
  const auto c = covariance(r);
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < 5; ++j) {
      CHECK(c[i][j] == c[j][i]);
      CHECK(std::abs(c[i][j]) <= std::sqrt(c[i][i] * c[j][j]) * (1 + 1e-6));
    }
  }
  CHECK(c[0][1] > 0.5 * std::sqrt(c[0][0] * c[1][1]));  // a path that pays more has more delta
}

TEST_CASE("the covariance of a run is that of its samples", "[sde][exact]") {
  const auto levels = sensitivities(Smoothed<MilsteinStep>{}, of_spot, call, 100.0);
  const auto estimator = single_term(with_covariance(levels));
  const auto r = estimate(estimator, {.samples = 1000, .seed = 3});
  double sum[2] = {0, 0};
  double cross = 0;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const auto z = trace(estimator, 3, static_cast<std::int64_t>(i)).sample.value.value;
    sum[0] += z.value;
    sum[1] += z.slopes[0];
    cross += z.value * z.slopes[0];
  }
  const double expected = (cross / 1000 - sum[0] * sum[1] / 1e6) / 999;
  CHECK(covariance(r)[0][1] == Approx(expected).epsilon(1e-6));
}

TEST_CASE("the Greeks are the sensitivities by their names", "[sde][exact]") {
  const auto named = greeks(Tree{}, BlackScholes<>{.start = 100, .rate = 0.05, .volatility = 0.2}, call);
  const auto slopes = sensitivities(Tree{}, market, call, 100.0, 0.2, 0.05, 1.0);
  for (const std::int64_t k : {0, 3}) {
    Stream one(1, 2);
    Stream two(one);
    Stream three(one);
    const Draw<Greeks> a = named(k, one);
    const auto b = slopes(k, two);
    CHECK(a.value.value == b.value.value);
    CHECK(a.difference.delta == b.difference.slopes[0]);
    CHECK(a.difference.vega == b.difference.slopes[1]);
    CHECK(a.difference.rho == b.difference.slopes[2]);
    CHECK(a.difference.theta == -b.difference.slopes[3]);
    CHECK(named.value_at(k, three).value.theta == a.value.theta);
    CHECK(debias::sum(a.value, a.difference).rho == a.value.rho + a.difference.rho);
    CHECK(scaled(a.value, 2).vega == 2 * a.value.vega);
  }
}

TEST_CASE("E16: the delta of a digital and the gamma of a call, by branching and the conditional last step",
          "[sde][statistical]") {
  const auto agrees = [](double mean, double error, double truth) {
    CHECK(std::abs(mean - truth) < 4.5 * error);
    CHECK(std::abs(mean - 1.2 * truth) > 4.5 * error);
  };
  const Plan plan{.samples = 1 << 14, .seed = 29};
  const auto d = estimate(single_term(sensitivities(Tree{}, of_spot, digital, 100.0), {.base_level = 3}), plan);
  agrees(d.mean.value, d.standard_error.value, digital_value);
  agrees(d.mean.slopes[0], d.standard_error.slopes[0], digital_delta);
  const auto g = estimate(single_term(second_sensitivities(Tree{}, of_spot, call, 100.0), {.base_level = 3}), plan);
  agrees(g.mean.slopes[0].slopes[0], g.standard_error.slopes[0].slopes[0], call_gamma);
}

TEST_CASE("the likelihood ratio has the delta of a payoff that only jumps", "[sde][statistical]") {
  const auto payoff = [](double x) { return x > 100 ? 100 * std::exp(-0.05) : 0; };
  const auto levels = likelihood_ratio(Branched<MilsteinStep>{}, of_spot, payoff, 100.0);
  const auto r = estimate(single_term(levels, {.base_level = 3}), {.samples = 1 << 14, .seed = 31});
  INFO(r);
  CHECK(std::abs(r.mean.slopes[0] - digital_delta) < 4.5 * r.standard_error.slopes[0]);
  CHECK(std::abs(r.mean.slopes[0] - 1.2 * digital_delta) > 4.5 * r.standard_error.slopes[0]);
  CHECK(std::abs(r.mean.value - digital_value) < 4.5 * r.standard_error.value);
}

TEST_CASE("a model and a payoff of a user have all of it", "[sde][statistical]") {
  const auto model = []<class X>(const X& spot, const X& scale) { return Elastic<X>{spot, scale}; };
  const auto spread = [](const auto& x, const auto& /*model*/) {
    return std::exp(-0.05) * (positive_part(x - 95) - positive_part(x - 105));
  };
  const auto levels = sensitivities(Branched<MilsteinStep>{}, model, spread, 100.0, 0.5);
  CHECK(laws::sequence_laws(levels, {.last = 5, .samples = 2048, .rates = false}) == laws::Failures{});
  // beside bumped paths at one level, with the same numbers
  const double h = 1e-3;
  double slope = 0;
  double bumped = 0;
  double square = 0;
  const int n = 4096;
  for (std::uint64_t i = 0; i < n; ++i) {
    Stream rng(37, i);
    const double x = levels.value_at(4, rng).value.slopes[0];
    const auto at = [&](double s) {
      Stream again(37, i);
      return sensitivities(Branched<MilsteinStep>{}, model, spread, s, 0.5).value_at(4, again).value.value;
    };
    const double y = (at(100 + h) - at(100 - h)) / (2 * h);
    slope += x / n;
    bumped += y / n;
    square += (x - y) * (x - y) / n;
  }
  CHECK(std::abs(slope - bumped) < 4.5 * std::sqrt(square / n) + 1e-6);
  CHECK(slope > 0.1);
}

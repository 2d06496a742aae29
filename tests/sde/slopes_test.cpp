// The last step that knows Milstein's skew, and slopes of what a path leaves behind.

#include <debias/sde/sensitivities.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/sde/likelihood_ratio.hpp>

#include "catch_shim.hpp"
#include "sde/difference_quotients.hpp"

using namespace debias;

namespace {

const auto market = []<class X>(const X& spot, const X& volatility, const X& rate, const X& horizon) {
  return BlackScholes<X, X>{.start = spot, .rate = rate, .volatility = volatility, .horizon = horizon};
};

// E f(m + s (exp(q Z - q^2 / 2) - 1) / q) by the midpoint rule.
template <class F>
double mean_of(const F& f, double m, double s, double q) {
  double sum = 0;
  const int n = 40000;
  for (int i = 0; i < n; ++i) {
    const double z = -9 + 18 * (i + 0.5) / n;
    const double x = q == 0 ? z : std::expm1(q * z - q * q / 2) / q;
    sum += f(m + s * x) * normal_density(z) * 18 / n;
  }
  return sum;
}

// E D_k^2 of a component.
template <class S>
double second_moment(const S& levels, std::int64_t k, std::size_t component) {
  double sum = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    Stream rng(5, i);
    const double d = debias::component(levels(k, rng).difference, component);
    sum += d * d / 2000;
  }
  return sum;
}

// A digital that knows the normal law only.
struct NormalDigital {
  static constexpr int smoothness = 0;
  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return DigitalPayoff{100, 100}.expected(mean, deviation);
  }
};

}  // namespace

TEST_CASE("payoffs have their expectation over a law with a skew, either sign, small and large", "[sde][exact]") {
  for (const double q : {-0.7, -0.06, -0.01, 0.0, 1e-9, 0.003, 0.049, 0.051, 0.4, 1.5}) {
    for (const double m : {70.0, 99.0, 103.0, 140.0}) {
      CAPTURE(q, m);
      const auto check = [&](const auto& payoff, double close) {
        CHECK(payoff.expected(m, 11.0, q) == Approx(mean_of(payoff, m, 11, q)).epsilon(1e-6).margin(close));
      };
      check(CallPayoff{100}, 1e-6);
      check(PutPayoff{100}, 1e-6);
      check(DigitalPayoff{100, 3}, 1e-3);
      // a call less a put is the mean less the strike
      CHECK(CallPayoff{100}.expected(m, 11.0, q) - PutPayoff{100}.expected(m, 11.0, q) ==
            Approx(m - 100).epsilon(1e-11));
    }
  }
  // a law that ends before the strike
  CHECK(DigitalPayoff{100, 3}.expected(90.0, 1.0, -0.2) == 0);
  CHECK(CallPayoff{100}.expected(90.0, 1.0, -0.2) == 0);
  CHECK(DigitalPayoff{100, 3}.expected(110.0, 1.0, 0.2) == 3);
  CHECK(PutPayoff{100}.expected(110.0, 1.0, 0.2) == 0);
  CHECK(std::isnan(CallPayoff{100}.expected(std::nan(""), 1.0, 0.1)));
  CHECK(std::isnan(DigitalPayoff{100}.expected(100.0, std::nan(""), 0.1)));
  CHECK(std::isnan(DigitalPayoff{100}.expected(100.0, 1.0, std::nan(""))));
}

TEST_CASE("the expectation over a law with a skew has its slopes, at a skew of 0, too", "[sde][exact]") {
  using D = Dual<3>;
  for (const double q : {-0.3, 0.0, 0.02, 0.2}) {
    const auto check = [&](const auto& p) {
      const double h = 1e-5;
      const auto d = p.expected(D::parameter(0, 103), D::parameter(1, 7), D::parameter(2, q));
      const auto at = [&](double dm, double ds, double dq) { return p.expected(103 + dm, 7 + ds, q + dq); };
      CHECK(d.value == Approx(at(0, 0, 0)).epsilon(1e-13));
      CHECK(d.slopes[0] == Approx((at(h, 0, 0) - at(-h, 0, 0)) / (2 * h)).epsilon(1e-6));
      CHECK(d.slopes[1] == Approx((at(0, h, 0) - at(0, -h, 0)) / (2 * h)).epsilon(1e-6));
      CHECK(d.slopes[2] == Approx((at(0, 0, h) - at(0, 0, -h)) / (2 * h)).epsilon(1e-6));
    };
    check(CallPayoff{100});
    check(PutPayoff{110});
    check(DigitalPayoff{100, 3});
  }
}

TEST_CASE(
    "a digital is a tenth as loud with the skew of the last step, and its coarse path has the mean of the level below",
    "[sde][law]") {
  using Tree = Branched<Smoothed<MilsteinStep>>;
  const auto skewed = sensitivities(Tree{}, market, discounted(DigitalPayoff{100, 100}), 100.0, 0.2, 0.05, 1.0);
  const auto normal = sensitivities(Tree{}, market, discounted(NormalDigital{}), 100.0, 0.2, 0.05, 1.0);
  for (const std::int64_t k : {2, 3, 4}) {
    for (const std::size_t component : {0, 1}) {
      CHECK(10 * second_moment(skewed, k, component) < second_moment(normal, k, component));
    }
  }
  // the payoff's own expectation is what Branching asks for
  const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2};
  const DigitalPayoff paid{100, 100 * std::exp(-0.05)};
  const auto price = milstein(stock, paid, Branching{});
  Stream one(1, 2);
  Stream two(one);
  CHECK(price(4, one).difference == Approx(skewed(4, two).difference.value).epsilon(1e-9));
  for (const std::int64_t k : {1, 2, 4}) {
    double sum = 0;
    double square = 0;
    const int n = 16000;
    for (std::uint64_t i = 0; i < n; ++i) {
      Stream rng(7, i);
      Stream other(9, i);
      const auto draw = price(k, rng);
      const double x = draw.value - draw.difference - price.value_at(k - 1, other).value;
      sum += x / n;
      square += x * x / n;
    }
    CHECK(std::abs(sum) < 4.5 * std::sqrt(square / n));
    CHECK(std::abs(sum + 3) > 4.5 * std::sqrt(square / n));
  }
}

TEST_CASE("the slopes of an average, an extreme and a barrier are their difference quotients, in every parameter",
          "[sde][exact]") {
  const auto check = [](auto scheme, const auto& summary, const auto& payoff) {
    const auto levels_at = [&](const testing::Parameters& p) {
      return sensitivities(scheme, market, summary, discounted(payoff), Rates{2, 1}, p[0], p[1], p[2], p[3]);
    };
    testing::check_difference_quotients(levels_at, {100, 0.2, 0.05, 1}, 1e-5);
  };
  check(MilsteinStep{}, Minimum{}, [](const auto& p) { return p.terminal - p.minimum; });
  check(MilsteinStep{}, Maximum{}, [](const auto& p) { return positive_part(p.maximum - 105); });
  check(Branched<MilsteinStep>{}, Average{}, [](const auto& p) { return positive_part(p.average() - 100); });
  check(MilsteinStep{}, StaysAbove{85}, [](const auto& p) { return positive_part(p.terminal - 100) * p.probability; });
  check(MilsteinStep{}, StaysBelow{125}, [](const auto& p) { return p.terminal * p.probability; });
  check(Branched<MilsteinStep>{}, AverageOf{[](const auto& x) {
          using std::log;
          return log(x);
        }},
        [](const auto& p) { return positive_part(exp(p.average()) - 100); });
}

TEST_CASE("a summary of slopes draws what that of numbers draws, and a NaN stays in it", "[sde][exact]") {
  const BlackScholes<> stock{.start = 100, .rate = 0.05, .volatility = 0.2};
  const auto lookback = [](const auto& p) { return p.terminal - p.minimum; };
  const auto dual = sensitivities(MilsteinStep{}, market, Minimum{}, lookback, Rates{2, 1}, 100.0, 0.2, 0.05, 1.0);
  const auto plain = milstein(stock, Minimum{}, lookback);
  for (const std::int64_t k : {0, 2, 5}) {
    Stream one(3, 4);
    Stream two(one);
    CHECK(dual(k, one).value.value == Approx(plain(k, two).value).epsilon(1e-13));
    CHECK(one.bits() == two.bits());
  }
  Minimum least;
  least.add(Bridge{1, 2, std::nan(""), 1}, 0.5);
  least.add(Bridge{1, 2, 1, 1}, 0.5);
  CHECK(std::isnan(least.minimum));
  Maximum greatest;
  greatest.add(Bridge{1, std::nan(""), 1, 1}, 0.5);
  greatest.add(Bridge{1, 2, 1, 1}, 0.5);
  CHECK(std::isnan(greatest.maximum));
}

TEST_CASE("scores of the lognormal law have the gamma of a digital, which no tree has", "[sde][statistical]") {
  const BlackScholes<> stock{.start = 100, .rate = 0.05, .volatility = 0.2};
  const double paid = 100 * std::exp(-0.05);
  const auto levels =
      likelihood_ratio(Branched<MilsteinStep>{}, stock, [paid](double x) { return x > 100 ? paid : 0; });
  const auto r = estimate(single_term(levels, {.base_level = 3}), {.samples = 1 << 14, .seed = 67});
  const double density = paid * normal_density(0.15);
  const double truth[] = {53.23248154537634, 1.876201734584689, -density * 0.35 / 0.2, -density * 0.35 / 400};
  INFO(r);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& c = r.components[i];
    CHECK(std::abs(c.mean - truth[i]) < 4.5 * c.standard_error);
    CHECK(std::abs(c.mean - 1.5 * truth[i]) > 4.5 * c.standard_error);
  }
  CHECK_THROWS_AS(likelihood_ratio(MilsteinStep{}, BlackScholes<>{.start = -1}, [](double x) { return x; }),
                  std::invalid_argument);
}

#include <debias/sde.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

// The market of the standard tests: S_0 = K = 100, r = 0.05, sigma = 0.2, T = 1.
const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2, .horizon = 1};
const OrnsteinUhlenbeck spring{.start = 1, .reversion = 2, .mean = 0, .volatility = 1, .horizon = 1};

double terminal(double x) { return x; }
double discounted(double x) { return std::exp(-0.05) * x; }
double square(double x) { return x * x; }
double call(double x) { return std::exp(-0.05) * std::max(x - 100, 0.0); }

// Mean of the first and of the second moment of what `draw(rng)` returns.
template <class Draws>
std::pair<Moments, Moments> two_moments(std::size_t n, const Draws& draw) {
  std::vector<double> first;
  std::vector<double> second;
  for (std::uint64_t i = 0; i < n; ++i) {
    Stream rng(2015, i);
    first.push_back(draw(rng));
    second.push_back(first.back() * first.back());
  }
  return {Moments::of(first), Moments::of(second)};
}

double z_score(const Moments& m, double truth) { return std::abs(m.mean - truth) / m.standard_error(); }

// E f^2, E c^2 and E f f c of the factors by which one coarse step multiplies S, and E f: all that the exact
// moments of I_k and D_k need. Fine steps have the length h, coarse ones 2 h.
struct Factors {
  double fine_mean, coarse_mean, fine_square, coarse_square, cross;
};

Factors euler_factors(double h, double r, double sigma) {
  const double f = 1 + r * h;
  const double c = 1 + 2 * r * h;
  const double v = sigma * sigma * h;
  return {f, c, f * f + v, c * c + 2 * v, f * f * c + 2 * v * f};
}

// f = A + sigma w + s w^2, s = sigma^2 / 2, w normal of variance h; c = B + sigma (w + w') + s (w + w')^2.
Factors milstein_factors(double h, double r, double sigma) {
  const double s = sigma * sigma / 2;
  const double a = 1 + r * h - s * h;
  const double b = 1 + 2 * r * h - 2 * s * h;
  const double f0 = a + s * h;              // E f
  const double f1 = sigma * h;              // E f w
  const double f2 = a * h + 3 * s * h * h;  // E f w^2
  const auto mean_square = [sigma, s](double constant, double variance) {
    return constant * constant + sigma * sigma * variance + 3 * s * s * variance * variance +
           2 * constant * s * variance;
  };
  return {f0, b + 2 * s * h, mean_square(a, h), mean_square(b, 2 * h),
          b * f0 * f0 + 2 * sigma * f1 * f0 + s * (2 * f2 * f0 + 2 * f1 * f1)};
}

// E D_k and E D_k^2 for the payoff scale * S_T, k >= 1.
std::pair<double, double> exact_moments(const Factors& q, std::int64_t k, double scale) {
  const double n = std::ldexp(1.0, static_cast<int>(k - 1));  // coarse steps
  const double mean = std::pow(q.fine_mean, 2 * n) - std::pow(q.coarse_mean, n);
  const double mean_square =
      std::pow(q.fine_square, 2 * n) - 2 * std::pow(q.cross, n) + std::pow(q.coarse_square, n);
  return {scale * mean, scale * scale * mean_square};
}

struct Clock {  // dX = t dt: a path that knows the time and nothing else
  double start = 0;
  double horizon = 3;
  double drift(double /*x*/, double t) const { return t; }
  double diffusion(double /*x*/, double /*t*/) const { return 0; }
};

// The coarse path with increments of its own.
struct IndependentIncrements {
  Rates rates{2, 1};
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const auto s = milstein(stock, terminal);
    const auto fine = s.value_at(level, rng);
    if (level == 0) return base(fine.value, fine.work);
    const auto coarse = s.value_at(level - 1, rng);
    return coupled(fine.value, coarse.value, fine.work + coarse.work);
  }
};

}  // namespace

TEST_CASE("E06: a path is the product of its Euler factors, both on the same increments", "[sde][exact]") {
  const auto s = euler(stock, terminal);
  for (std::int64_t k = 0; k <= 6; ++k) {
    Stream rng(1, 2);
    Stream same = rng;
    const Draw<double> draw = s(k, rng);
    const std::int64_t steps = std::int64_t{1} << k;
    const double h = 1 / static_cast<double>(steps);
    double fine = 100;
    double coarse = 100;
    double before = 0;
    for (std::int64_t i = 0; i < steps; ++i) {
      const double dw = std::sqrt(h) * same.normal();
      fine *= 1 + 0.05 * h + 0.2 * dw;
      if (i % 2 == 1) coarse *= 1 + 0.05 * 2 * h + 0.2 * (before + dw);
      before = dw;
    }
    CHECK(draw.value == Approx(fine).epsilon(1e-13));
    CHECK(std::abs(draw.difference - (k == 0 ? fine : fine - coarse)) < 1e-11);
    CHECK(rng.bits() == same.bits());  // one normal a fine step
  }
}

TEST_CASE("E06: the formula of the exact level moments gives the table", "[sde][exact]") {
  constexpr std::array mean{0.059451839031294626,  0.030471389841000656, 0.015428209597846065,
                            0.0077630308453104284, 0.003893848491852981, 0.0019500203281652285};
  constexpr std::array mean_square{3.8490935478170312,  2.0031743945516167,  1.0212599206336595,
                                   0.51552896282767892, 0.25898524851171741, 0.12979720944473614};
  for (std::size_t j = 0; j < mean.size(); ++j) {  // the table has Delta_j = D_(j+1)
    const auto k = static_cast<std::int64_t>(j + 1);
    const auto exact = exact_moments(euler_factors(std::ldexp(1.0, -static_cast<int>(k)), 0.05, 0.2), k,
                                     100 * std::exp(-0.05));
    // three powers near 1.1 cancel, times the scale 95^2
    CHECK(std::abs(exact.first - mean[j]) < 1e-11);
    CHECK(std::abs(exact.second - mean_square[j]) < 1e-9);
  }
}

TEST_CASE("E06, E07: E D_k and E D_k^2 are the exact ones", "[sde][statistical]") {
  const auto by_euler = euler(stock, discounted);
  const auto by_milstein = milstein(stock, discounted);
  const double scale = 100 * std::exp(-0.05);
  for (std::int64_t k = 1; k <= 5; ++k) {
    const double h = std::ldexp(1.0, -static_cast<int>(k));
    INFO("level " << k);
    const auto e = two_moments(1 << 15, [&](Stream& rng) { return by_euler(k, rng).difference; });
    const auto e_exact = exact_moments(euler_factors(h, 0.05, 0.2), k, scale);
    CHECK(z_score(e.first, e_exact.first) < 5.5);
    CHECK(z_score(e.second, e_exact.second) < 5.5);
    const auto m = two_moments(1 << 15, [&](Stream& rng) { return by_milstein(k, rng).difference; });
    const auto m_exact = exact_moments(milstein_factors(h, 0.05, 0.2), k, scale);
    CHECK(z_score(m.first, m_exact.first) < 5.5);
    CHECK(z_score(m.second, m_exact.second) < 5.5);
    // one scheme has not the second moment of the other, one level not that of the next
    CHECK(z_score(e.second, m_exact.second) > 5.5);
    CHECK(z_score(m.second, e_exact.second) > 5.5);
    CHECK(z_score(m.second, exact_moments(milstein_factors(h / 2, 0.05, 0.2), k + 1, scale).second) > 5.5);
  }
}

TEST_CASE("E07: both schemes have the mean 100 (1 + r h)^n at every level", "[sde][statistical]") {
  const auto by_euler = euler(stock, terminal);
  const auto by_milstein = milstein(stock, terminal);
  for (std::int64_t k = 0; k <= 5; ++k) {
    const double n = std::ldexp(1.0, static_cast<int>(k));
    const double exact = 100 * std::pow(1 + 0.05 / n, n);
    const auto e = two_moments(1 << 15, [&](Stream& rng) { return by_euler(k, rng).value; });
    const auto m = two_moments(1 << 15, [&](Stream& rng) { return by_milstein(k, rng).value; });
    CHECK(z_score(e.first, exact) < 5.5);
    CHECK(z_score(m.first, exact) < 5.5);
    CHECK(z_score(e.first, exact + 1) > 5.5);  // 1 % of the truth
  }
}

TEST_CASE("E08: with additive noise Euler and Milstein are one scheme, of the known second moment",
          "[sde][statistical]") {
  const auto by_euler = euler(spring, square, {2, 1});
  const auto by_milstein = milstein(spring, square);
  for (std::int64_t k = 0; k <= 6; ++k) {
    for (std::uint64_t i = 0; i < 20; ++i) {
      Stream one(9, i);
      Stream two(9, i);
      const Draw<double> a = by_euler(k, one);
      const Draw<double> b = by_milstein(k, two);
      CHECK(a.value == b.value);
      CHECK(a.difference == b.difference);
    }
    const double h = std::ldexp(1.0, -static_cast<int>(k));
    double exact = 1;
    for (double t = 0; t < 1; t += h) exact = (1 - 2 * h) * (1 - 2 * h) * exact + h;
    const auto m = two_moments(1 << 14, [&](Stream& rng) { return by_euler(k, rng).value; });
    CHECK(z_score(m.first, exact) < 5.5);
  }
}

TEST_CASE("the declared rates of the schemes hold", "[sde][law]") {
  CHECK(sequence_laws(euler(stock, discounted), {.last = 7}) == Failures{});                        // E06
  CHECK(sequence_laws(milstein(stock, terminal), {.last = 7}) == Failures{});                       // E07
  CHECK(sequence_laws(milstein(stock, call), {.last = 7}) == Failures{});                           // E02
  CHECK(sequence_laws(euler(spring, square, {2, 1}), {.last = 8, .rates_from = 4}) == Failures{});  // E08
  CHECK(law_exists(milstein(stock, call).rates));
  CHECK_FALSE(law_exists(euler(stock, call).rates));

  CHECK(sequence_laws(euler(stock, discounted, {2, 1}), {.last = 7}) != Failures{});
  CHECK(sequence_laws(euler(spring, square), {.last = 8, .rates_from = 4}) != Failures{});
}

TEST_CASE("a coarse path with increments of its own has not the declared rate", "[sde][law]") {
  CHECK(sequence_laws(IndependentIncrements{}, {.last = 7}) != Failures{});
  // nothing else is wrong with it: the means still telescope
  CHECK(sequence_laws(IndependentIncrements{}, {.last = 7, .rates = false}) == Failures{});
}

TEST_CASE("a swapped sign and a coarse path that drops an increment do not telescope", "[sde][law]") {
  const auto s = milstein(spring, square);
  const auto swapped = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference = -d.difference;
    return d;
  };
  const auto dropped = [&s](std::int64_t k, Stream& rng) {
    if (k == 0) return s(0, rng);
    const double h = std::ldexp(1.0, -static_cast<int>(k));
    double fine = 1;
    double coarse = 1;
    for (std::int64_t i = 0; i < (std::int64_t{1} << k); i += 2) {
      const double dw1 = std::sqrt(h) * rng.normal();
      const double dw2 = std::sqrt(h) * rng.normal();
      fine += -2 * fine * h + dw1;
      fine += -2 * fine * h + dw2;
      coarse += -2 * coarse * 2 * h + dw1;
    }
    return coupled(fine * fine, coarse * coarse);
  };
  CHECK(sequence_laws(swapped) != Failures{});
  CHECK(sequence_laws(dropped) != Failures{});
}

TEST_CASE("value_at is the fine path of a draw, bit for bit, without the work of the coarse one",
          "[sde][exact]") {
  const GeometricBrownianMotion odd{.start = 1.1, .growth = 0.3, .volatility = 0.7, .horizon = 0.9};
  const auto s = milstein(odd, call);
  const auto path = euler(odd, terminal);
  for (std::int64_t k = 0; k <= 8; ++k) {
    Stream one(4, 4);
    Stream two = one;
    CHECK(path(k, one).value == path.value_at(k, two).value);
    CHECK(one.bits() == two.bits());
    const double steps = std::ldexp(1.0, static_cast<int>(k));
    CHECK(s(k, one).work == (k == 0 ? 1 : 1.5 * steps));
    CHECK(s.value_at(k, two).work == steps);
  }
}

TEST_CASE("both paths see the right time: dX = t dt", "[sde][exact]") {
  const auto s = euler(Clock{}, terminal, {2, 1});
  for (std::int64_t k = 0; k <= 10; ++k) {
    Stream rng(1, 1);
    const Draw<double> draw = s(k, rng);
    const double h = std::ldexp(1.0, -static_cast<int>(k));
    CHECK(draw.value == Approx(4.5 * (1 - h)).epsilon(1e-13));
    if (k > 0) CHECK(draw.difference == Approx(4.5 * h).epsilon(1e-11));
  }
}

TEST_CASE("a level beyond 62 throws, and so does an impossible horizon", "[sde][exact]") {
  const auto s = euler(stock, terminal);
  Stream rng(1, 1);
  CHECK_THROWS_AS(s(63, rng), std::length_error);
  CHECK_THROWS_AS(s.value_at(63, rng), std::length_error);
  CHECK_THROWS_AS(s(std::numeric_limits<std::int64_t>::max(), rng), std::length_error);
  for (const double horizon : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    CHECK_THROWS_AS(euler(GeometricBrownianMotion{.horizon = horizon}, terminal), std::invalid_argument);
    CHECK_THROWS_AS(milstein(GeometricBrownianMotion{.horizon = horizon}, terminal), std::invalid_argument);
  }
}

TEST_CASE("a payoff may be a vector", "[sde][exact]") {
  const auto s = milstein(stock, [](double x) { return Eigen::Vector2d(terminal(x), call(x)); });
  const auto prices = milstein(stock, terminal);
  const auto calls = milstein(stock, call);
  for (std::int64_t k = 0; k <= 4; ++k) {
    Stream one(3, 1);
    Stream two = one;
    Stream three = one;
    const auto draw = s(k, one);
    CHECK(draw.difference.x() == prices(k, two).difference);
    CHECK(draw.difference.y() == calls(k, three).difference);
  }
}

TEST_CASE("a model without a diffusion derivative is for Euler only", "[sde][compile]") {
  using S = decltype(milstein(stock, terminal));
  STATIC_REQUIRE(BiasedSequence<S>);
  STATIC_REQUIRE(DeclaresRates<S>);
  STATIC_REQUIRE(OffersValueAt<S>);
  STATIC_REQUIRE(ScalarSde<Clock>);
  STATIC_REQUIRE_FALSE(DifferentiableSde<Clock>);
  STATIC_REQUIRE_FALSE(ScalarSde<double>);
  STATIC_REQUIRE(DifferentiableSde<OrnsteinUhlenbeck>);
}

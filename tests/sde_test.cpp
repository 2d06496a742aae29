#include <debias/sde.hpp>
#include <debias/sde/vector.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/survey.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;
using laws::SequenceLawOptions;

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
  const double mean_square = std::pow(q.fine_square, 2 * n) - 2 * std::pow(q.cross, n) + std::pow(q.coarse_square, n);
  return {scale * mean, scale * scale * mean_square};
}

struct Clock {  // dX = t dt: a path that knows the time and nothing else
  double start = 0;
  double horizon = 3;
  double drift(double /*x*/, double t) const { return t; }
  double diffusion(double /*x*/, double /*t*/) const { return 0; }
};

double asian(const Average& path) { return std::exp(-0.05) * std::max(path.average() - 100, 0.0); }
double lookback(const Minimum& path) { return std::exp(-0.05) * (path.terminal - path.minimum); }
double highest(const Maximum& path) { return std::exp(-0.05) * (path.maximum - path.terminal); }
double barrier_call(const StaysAbove& path) { return call(path.terminal) * path.probability; }
const auto log_average = AverageOf{[](double x) { return std::log(x); }};
const auto geometric_asian = [](const auto& path) {
  return std::exp(-0.05) * std::max(std::exp(path.average()) - 100, 0.0);
};

// dX = dW_1, dY = X dW_2: the simplest noise that does not commute [Clark & Cameron 1980].
struct ClarkCameron {
  Eigen::Vector2d start{0, 0};
  double horizon = 1;
  Eigen::Vector2d drift(const Eigen::Vector2d& /*x*/, double /*t*/) const { return {0, 0}; }
  Eigen::Matrix2d diffusion(const Eigen::Vector2d& x, double /*t*/) const { return Eigen::Matrix2d{{1, 0}, {0, x[0]}}; }
  Eigen::Matrix2d diffusion_along(const Eigen::Vector2d& /*x*/, double /*t*/, const Eigen::Vector2d& v) const {
    return Eigen::Matrix2d{{0, 0}, {0, v[0]}};
  }
};
const auto cosine_of_y = [](const Eigen::Vector2d& x) { return std::cos(x[1]); };

// A scalar model as a vector of one component, of dynamic size.
template <class M>
struct AsVector {
  M model;
  Eigen::VectorXd start = Eigen::VectorXd::Constant(1, model.start);
  double horizon = model.horizon;
  static Eigen::MatrixXd one(double x) { return Eigen::MatrixXd::Constant(1, 1, x); }
  Eigen::VectorXd drift(const Eigen::VectorXd& x, double t) const { return one(model.drift(x[0], t)); }
  Eigen::MatrixXd diffusion(const Eigen::VectorXd& x, double t) const { return one(model.diffusion(x[0], t)); }
  Eigen::MatrixXd diffusion_along(const Eigen::VectorXd& x, double t, const Eigen::VectorXd& v) const {
    return one(v[0] * model.diffusion_derivative(x[0], t));
  }
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
    Stream same(rng);
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
    const auto exact =
        exact_moments(euler_factors(std::ldexp(1.0, -static_cast<int>(k)), 0.05, 0.2), k, 100 * std::exp(-0.05));
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
  CHECK(pmf_exists(milstein(stock, call).rates));
  CHECK_FALSE(pmf_exists(euler(stock, call).rates));

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

TEST_CASE("value_at is the fine path of a draw, bit for bit, without the work of the coarse one", "[sde][exact]") {
  const GeometricBrownianMotion odd{.start = 1.1, .growth = 0.3, .volatility = 0.7, .horizon = 0.9};
  const auto s = milstein(odd, call);
  const auto path = euler(odd, terminal);
  for (std::int64_t k = 0; k <= 8; ++k) {
    Stream one(4, 4);
    Stream two(one);
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
    Stream two(one);
    Stream three(one);
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

TEST_CASE("the quantiles of a bridge invert its crossing probability, and its integral has the moments of a bridge",
          "[sde][exact]") {
  const Bridge bridge{1.2, 0.9, 0.4, 0.3};
  double mean = 0;
  double square = 0;
  const int n = 4096;
  for (int i = 0; i < n; ++i) {
    const double u = (i + 0.5) / n;
    const double low = bridge.minimum(u);
    const double high = bridge.maximum(u);
    CHECK(low <= 0.9);
    CHECK(high >= 1.2);
    CHECK(bridge.crossing(1.2 - low, 0.9 - low) == Approx(u).epsilon(1e-12));
    CHECK(bridge.crossing(high - 1.2, high - 0.9) == Approx(u).epsilon(1e-12));
    mean += bridge.integral(u) / n;
    square += bridge.integral(u) * bridge.integral(u) / n;
  }
  CHECK(mean == Approx(0.3 * 1.05).epsilon(1e-12));
  CHECK(square - mean * mean == Approx(0.16 * 0.027 / 12).epsilon(2e-3));
  CHECK(bridge.crossing(-0.1, 0.2) == 1);
  CHECK(bridge.crossing(0.1, 0) == 1);
  CHECK(Bridge{1, 1, 0, 0.3}.crossing(0.1, 0.1) == 0);  // a line does not cross
}

TEST_CASE("averages, extremes and barriers keep the laws of a sequence, with the declared rates", "[sde][law]") {
  CHECK(sequence_laws(milstein(stock, Average{}, asian), {.last = 7}) == Failures{});
  CHECK(sequence_laws(milstein(stock, Minimum{}, lookback), {.last = 7}) == Failures{});
  CHECK(sequence_laws(milstein(stock, Maximum{}, highest), {.last = 7}) == Failures{});
  CHECK(sequence_laws(milstein(stock, log_average, geometric_asian), {.last = 7}) == Failures{});
  // behind a barrier the rate 1.5 shows below level 8 only: see the table of second moments
  CHECK(sequence_laws(milstein(stock, StaysAbove{85}, barrier_call, {1.5, 1}), {.last = 7, .rates = false}) ==
        Failures{});
  CHECK(sequence_laws(euler(stock, Average{}, asian, {1, 1}), {.last = 7}) == Failures{});
  // power checks: bridges that a summary ignores
  struct Trapezoid : Average {
    void add(const Bridge& b, double /*u*/) { Average::add(Bridge{b.from, b.to, 0, b.length}, 0.5); }
  };
  struct EndsAbove : StaysAbove {
    void add(const Bridge& b, double /*u*/) { StaysAbove::add(Bridge{b.from, b.to, 0, b.length}, 0.5); }
  };
  const SequenceLawOptions means{.last = 3, .samples = 1 << 15, .rates = false};
  CHECK(sequence_laws(milstein(stock, Trapezoid{}, asian), means) != Failures{});
  const auto survival = [](const StaysAbove& path) { return path.probability; };
  CHECK(sequence_laws(milstein(stock, StaysAbove{95}, survival), means) == Failures{});
  CHECK(sequence_laws(milstein(stock, EndsAbove{{95}}, survival), means) != Failures{});
}

TEST_CASE("a summary without bridges sees the steps of each path", "[sde][exact]") {
  struct Steps {
    std::vector<double> seen{};
    void add(double from, double to, double length) { seen.insert(seen.end(), {from, to, length}); }
  };
  const auto clock = euler(Clock{}, Steps{}, [](const Steps& s) { return static_cast<double>(s.seen.size()); });
  Stream rng(1, 1);
  CHECK(clock(3, rng).value == 24);
  CHECK(clock(3, rng).difference == 12);
  const auto last = euler(Clock{}, Steps{}, [](const Steps& s) { return s.seen[s.seen.size() - 2]; });
  CHECK(last(3, rng).value == euler(Clock{}, terminal)(3, rng).value);
}

TEST_CASE("options on geometric Brownian motion: European, Asian, lookback, barrier", "[sde][statistical]") {
  const auto agrees = [](const auto& levels, double truth, std::int64_t base_level = 0) {
    const auto r = estimate(single_term(levels, {.base_level = base_level}), {.samples = 1 << 16, .seed = 3});
    INFO(r);
    CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
    CHECK(std::abs(r.mean - 1.1 * truth) > 4.5 * r.standard_error);
  };
  agrees(milstein(stock, call), 10.45058357218556678165);
  agrees(milstein(stock, Average{}, asian), 5.7630879029);
  agrees(milstein(stock, Minimum{}, lookback), 17.21680223736086576685);
  agrees(milstein(stock, StaysAbove{85}, barrier_call, {1.5, 1}), 9.949270308634219269);
  agrees(milstein(stock, log_average, geometric_asian), 5.546818633789207247287);
}

TEST_CASE("E10: the antithetic twin restores the rate 2 where noise does not commute", "[sde][vector][law]") {
  const ClarkCameron model;
  CHECK(sequence_laws(antithetic_milstein(model, cosine_of_y), {.last = 7}) == Failures{});
  CHECK(sequence_laws(milstein(model, cosine_of_y, {1, 1}), {.last = 7}) == Failures{});
  CHECK(sequence_laws(euler(model, cosine_of_y), {.last = 7}) == Failures{});
  CHECK(sequence_laws(milstein(model, cosine_of_y), {.last = 7}) != Failures{});
  const auto r = estimate(single_term(antithetic_milstein(model, cosine_of_y)), {.samples = 1 << 16});
  INFO(r);
  CHECK(std::abs(r.mean - 1 / std::sqrt(std::cosh(1.0))) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1 / std::cosh(1.0)) > 4.5 * r.standard_error);
}

TEST_CASE("a vector of one component is the scalar scheme, and antithetic noise that commutes changes nothing",
          "[sde][vector][exact]") {
  const AsVector<GeometricBrownianMotion> wrapped{stock};
  const auto first_of = [](const Eigen::VectorXd& x) { return x[0]; };
  const auto scalar = milstein(stock, terminal);
  const auto vector = milstein(wrapped, first_of);
  const auto scalar_euler = euler(stock, terminal);
  const auto vector_euler = euler(wrapped, first_of);
  const auto averages = milstein(wrapped, AverageOf{first_of}, [](const auto& path) { return path.average(); });
  for (std::int64_t k = 0; k <= 6; ++k) {
    for (std::uint64_t i = 0; i < 10; ++i) {
      Stream one(7, i);
      Stream two(7, i);
      CHECK(vector(k, one).value == Approx(scalar(k, two).value).epsilon(1e-13));
      CHECK(one.bits() == two.bits());
      CHECK(vector(k, one).difference == Approx(scalar(k, two).difference).margin(1e-11));
      CHECK(vector_euler(k, one).value == Approx(scalar_euler(k, two).value).epsilon(1e-13));
      CHECK(averages(k, one).value > 0);
    }
  }
  CHECK(vector(3, *std::make_unique<Stream>(1, 1)).work == 12);
  CHECK(antithetic_milstein(wrapped, first_of)(3, *std::make_unique<Stream>(1, 1)).work == 20);
  STATIC_REQUIRE(DifferentiableVectorSde<ClarkCameron>);
  STATIC_REQUIRE_FALSE(VectorSde<GeometricBrownianMotion>);
  STATIC_REQUIRE_FALSE(ScalarSde<ClarkCameron>);
}

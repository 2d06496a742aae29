#include <debias/nested.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

const auto normal = [](Stream& rng) { return rng.normal(); };
const auto around = [](double y, Stream& rng) { return y + rng.normal(); };

/// The largest |z| of the means of I_k, D_k and D_k^2.
template <class S>
double worst_z(const S& s, std::int64_t level, int n, double value, double difference, double square) {
  std::vector<double> values;
  std::vector<double> differences;
  std::vector<double> squares;
  for (int i = 0; i < n; ++i) {
    Stream rng = split_level(Stream(61, static_cast<std::uint64_t>(i)), level);
    const auto draw = s(level, rng);
    values.push_back(draw.value);
    differences.push_back(draw.difference);
    squares.push_back(draw.difference * draw.difference);
  }
  const auto z = [](const std::vector<double>& xs, double truth) {
    const Moments m = Moments::of(xs);
    return std::abs(m.mean - truth) / m.standard_error();
  };
  return std::max({z(values, value), z(differences, difference), z(squares, square)});
}

}  // namespace

TEST_CASE("the squared inner mean of the normal model has the closed-form moments of each level",
          "[nested][statistical]") {
  const auto f02 = nested(normal, around, functions::Square{});
  for (std::int64_t k = 1; k <= 6; ++k) {
    CAPTURE(k);
    const double n = std::ldexp(1.0, static_cast<int>(k) - 1);  // draws in each half
    CHECK(worst_z(f02, k, 40000, 1 + 0.5 / n, -0.5 / n, 0.75 / (n * n)) < 4.5);
  }
  // Power check: the moments of the level below, and an outer draw for each inner one (E I_k = 1 / n).
  CHECK(worst_z(f02, 3, 40000, 1 + 0.5 / 4, -0.5 / 2, 0.75 / 4) > 4.5);
  const auto not_nested = function_of_mean([](Stream& rng) { return around(normal(rng), rng); }, functions::Square{});
  CHECK(worst_z(not_nested, 3, 40000, 1 + 0.5 / 4, -0.5 / 4, 0.75 / 16) > 4.5);
}

TEST_CASE("nested expectations of smooth functions keep the laws of a sequence", "[nested][law]") {
  const auto uniform = [](Stream& rng) { return rng.uniform(); };
  CHECK(sequence_laws(nested(normal, around, functions::Square{})) == Failures{});            // F02
  CHECK(sequence_laws(nested(uniform, around, functions::ExpMinus{})) == Failures{});         // F06
  CHECK(sequence_laws(nested(normal, around, functions::Square{}, {1.5, 1})) != Failures{});  // power check
}

TEST_CASE("a kink inside the range of the inner mean has the rates {1.5, 1}", "[nested][law]") {
  const auto f01 = nested(normal, around, functions::PositivePart{}, {1.5, 1});
  CHECK(sequence_laws(f01, {.last = 8, .samples = 8192, .rates_from = 3}) == Failures{});

  // Power check: a kink declared smooth.
  const auto declared_smooth = nested(normal, around, functions::PositivePart{});
  CHECK(sequence_laws(declared_smooth, {.last = 8, .samples = 8192, .rates_from = 3}) != Failures{});
}

TEST_CASE("level means approach the nested expectation", "[nested][statistical]") {
  const auto mean_at = [](const auto& s, std::int64_t level) {
    std::vector<double> values;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Stream rng(62, i);
      values.push_back(s.value_at(level, rng).value);
    }
    return Moments::of(values);
  };
  // F01: the mean of n draws given Y is N(0, 1 + 1/n), so that E I_k = sqrt((1 + 1/n) / (2 pi)) exactly.
  const auto f01 = nested(normal, around, functions::PositivePart{}, {1.5, 1});
  const Moments at_five = mean_at(f01, 5);
  const double exact = std::sqrt((1 + 1 / 32.0) / (2 * std::numbers::pi));
  CHECK(std::abs(at_five.mean - exact) < 4.5 * at_five.standard_error());
  // Power check: the level with one draw.
  CHECK(std::abs(mean_at(f01, 0).mean - exact) > 4.5 * at_five.standard_error());
}

TEST_CASE("one outer draw serves all inner draws of a level, and the work counts it", "[nested][exact]") {
  struct Patient {
    std::string name;
    double dose;
  };
  const auto outer = [](Stream& rng) { return Patient{"a name that does not fit a small string", rng.uniform()}; };
  const auto inner = [](const Patient& p, Stream&) { return p.dose; };
  const auto s = nested(outer, inner, functions::Log{});
  for (std::int64_t k = 0; k <= 4; ++k) {
    Stream rng(63, 0);
    Stream replay(rng);
    const auto draw = s(k, rng);
    CHECK(draw.value == Approx(std::log(replay.uniform())).epsilon(1e-15));
    CHECK(draw.work == std::ldexp(1.0, static_cast<int>(k)) + 1);
    if (k > 0) CHECK(draw.difference == 0);
  }
}

TEST_CASE("inner draws may be vectors: a maximum over decisions", "[nested][law]") {
  // The second term of F05: X is known before choosing between the payoffs 0 and X + Y.
  const auto payoffs = [](double x, Stream& rng) { return Eigen::Array2d(0, x + rng.normal()); };
  const auto best = [](const Eigen::Array2d& mean) { return mean.maxCoeff(); };
  const auto s = nested(normal, payoffs, best, {1.5, 1});
  CHECK(sequence_laws(s, {.last = 8, .samples = 8192, .rates_from = 3}) == Failures{});
}

TEST_CASE("a level beyond int64 throws before the outer draw", "[nested][exact]") {
  const auto outer = [](Stream&) -> double { throw std::logic_error("drawn"); };
  const auto s = nested(outer, around, functions::Square{});
  Stream rng(64, 0);
  CHECK_THROWS_AS(s(63, rng), std::length_error);
  CHECK_THROWS_AS(s.shared(63, 0, rng), std::length_error);
  CHECK_THROWS_AS(s(3, rng), std::logic_error);
}

TEST_CASE("F09: two nestings, the inner draw an unbiased estimate of a nested expectation", "[nested][law]") {
  const auto given_x = [](double x) {
    const auto y = [x](Stream& rng) { return x + rng.normal(); };
    return single_term(nested(y, around, functions::Square{}), Geometric::with_exponent(1.2));
  };
  const auto inner = estimated(given_x);
  // draws of one stream are independent, and have the mean x^2 + 1
  std::vector<double> draws;
  std::vector<double> products;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    Stream rng(8, i);
    const double one = inner(0.5, rng);
    const double two = inner(0.5, rng);
    draws.push_back(one);
    products.push_back((one - 1.25) * (two - 1.25));
  }
  const Moments mean = Moments::of(draws);
  const Moments covariance = Moments::of(products);
  CHECK(std::abs(mean.mean - 1.25) < 4.5 * mean.standard_error());
  CHECK(std::abs(covariance.mean) < 4.5 * covariance.standard_error());
  CHECK(mean.variance() > 4.5 * covariance.standard_error());  // what equal draws would have had

  const auto f = [](double m) { return std::exp(-std::max(m, 0.0)); };
  const auto s = nested(normal, inner, f);
  CHECK(sequence_laws(s, {.last = 5, .rates = false}) == Failures{});
  const auto r = estimate(single_term(s, {.base_level = 2}), {.samples = 1 << 14});
  INFO(r);
  CHECK(std::abs(r.mean - std::exp(-1) / std::sqrt(3.0)) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - std::exp(-1.25)) > 4.5 * r.standard_error);  // E[Z^2|X] = X^2 + 2 taken for its square
}

TEST_CASE("an inner expectation on nets is unbiased, and its differences fall twice as fast", "[nested][statistical]") {
  // exp(-E[X | Y]), X = (Y + x_1) (1 + x_2) / 2 over the square: exp(-3/4 (Y + 1/2)), Y uniform.
  const auto outer = [](Stream& rng) { return rng.uniform(); };
  const auto at = [](double y, std::span<const double> x) { return 0.5 * (y + x[0]) * (1 + x[1]); };
  const auto drawn = [at](double y, Stream& rng) {
    const double x[2] = {rng.uniform(), rng.uniform()};
    return at(y, x);
  };
  const double truth = std::exp(-0.375) * (1 - std::exp(-0.75)) / 0.75;
  const auto nets = nested(outer, at, Cube(2), functions::ExpMinus{});
  const auto r = estimate(single_term(nets), {.samples = 1 << 14, .seed = 3});
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.02 * truth) > 4.5 * r.standard_error);
  const auto square = [](const auto& s) {
    double total = 0;
    for (std::uint64_t i = 0; i < 512; ++i) {
      Stream rng(7, i);
      const double d = s(8, rng).difference;
      total += d * d;
    }
    return total;
  };
  CHECK(square(nets) < 1e-3 * square(nested(outer, drawn, functions::ExpMinus{})));
}

TEST_CASE("a log of a mean of weights that would all underflow is that of the weights beside their largest",
          "[nested][statistical]") {
  // log E e^l, l = -2000 - 3 x over [0, 1]: -2000 + log((1 - e^-3) / 3).
  const auto outer = [](Stream&) { return 0.0; };
  const auto at = [](double, std::span<const double> x) -> Eigen::Array2d { return {std::exp(-3 * x[0]), -2000}; };
  const auto r = estimate(single_term(nested(outer, at, Cube(1), functions::ShiftedLog{})), {.samples = 1 << 12});
  CHECK(std::abs(r.mean - (-2000 + std::log((1 - std::exp(-3)) / 3))) < 4.5 * r.standard_error + 1e-9);
}

namespace {

// E log(p(y | theta) / E p(y | theta')), y = xi theta + noise / 2, theta ~ N(0, 1): log(1 + 4 xi^2) / 2; with its slope in xi.
constexpr double design = 0.8;
struct Experiment {
  double theta;
  double noise;
};
Experiment experiment(Stream& rng) {
  const double theta = rng.normal();
  return {theta, rng.normal() / 2};
}
Weighted<Eigen::Array2d> likelihood(const Experiment& e, double other) {
  const double off = design * (e.theta - other) + e.noise;
  return exp_of(-2 * off * off, Eigen::Array2d(1, -4 * off * (e.theta - other)));
}
struct InformationAndSlope {
  Eigen::Array2d operator()(const Weighted<Eigen::Array2d>& mean, const Experiment& e) const {
    return Eigen::Array2d(-2 * e.noise * e.noise, 0) - functions::LogMeanExp{}(mean);
  }
  Eigen::Array2d gap(const Weighted<Eigen::Array2d>& m, const Weighted<Eigen::Array2d>& d, const Experiment&) const {
    return -functions::LogMeanExp{}.gap(m, d);
  }
  Eigen::Array2d gap_of_halves(const Weighted<Eigen::Array2d>& a, const Weighted<Eigen::Array2d>& b,
                               const Experiment&) const {
    return -functions::LogMeanExp{}.gap_of_halves(a, b);
  }
};

}  // namespace

TEST_CASE("f sees the outer draw, over nets and over draws: information gain and its gradient",
          "[nested][statistical]") {
  const auto on_net = [](const Experiment& e, std::span<const double> u) {
    return likelihood(e, normal_quantile(u[0]));
  };
  const auto drawn = [](const Experiment& e, Stream& rng) { return likelihood(e, rng.normal()); };
  const Eigen::Array2d truth(0.5 * std::log1p(4 * design * design), 4 * design / (1 + 4 * design * design));
  const auto check = [&](const auto& sequence, std::int64_t samples) {
    const auto r = estimate(single_term(sequence, {.base_level = 3}), {.samples = samples, .seed = 5});
    for (int i = 0; i < 2; ++i) {
      CAPTURE(i, r.mean[i], truth[i], r.standard_error[i]);
      CHECK(std::abs(r.mean[i] - truth[i]) < 4.5 * r.standard_error[i]);
      CHECK(std::abs(r.mean[i] - 1.1 * truth[i]) > 4.5 * r.standard_error[i]);
    }
    return r.standard_error[0] * r.standard_error[0] * r.work;
  };
  const auto nets = nested(experiment, on_net, Cube(1), InformationAndSlope{}, {.rates = Rates{3, 1}});
  const auto draws = nested(experiment, drawn, InformationAndSlope{}, {1.5, 1});
  static_assert(decltype(nets)::has_gap && decltype(draws)::has_gap);
  CHECK(nets.deepest_level() == 27);
  check(nets, 1 << 15);
  check(draws, 1 << 15);
  CHECK(sequence_laws(nets, {.last = 6, .samples = 4096, .rates = false}) == Failures{});
}

TEST_CASE("f of the mean alone and f that ignores the outer draw are the same, bit for bit", "[nested][exact]") {
  struct Ignores {
    double operator()(double m, double /*y*/) const { return functions::Exp{}(m); }
    double gap(double m, double d, double /*y*/) const { return functions::Exp{}.gap(m, d); }
  };
  const auto at = [](double y, std::span<const double> x) { return y * x[0] + x[1]; };
  const auto compare = [](const auto& alone, const auto& ignores) {
    for (const std::int64_t level : {0, 1, 4}) {
      Stream s(7, 1);
      Stream t(7, 1);
      const auto a = alone(level, s);
      const auto b = ignores(level, t);
      CHECK(a.value == b.value);
      CHECK(a.difference == b.difference);
      CHECK(a.work == b.work);
      CHECK(s.bits() == t.bits());
    }
    Stream s(7, 2);
    Stream t(7, 2);
    CHECK(alone.shared(4, 2, s).base == ignores.shared(4, 2, t).base);
  };
  compare(nested(normal, around, functions::Exp{}), nested(normal, around, Ignores{}));
  compare(nested(normal, at, Cube(2), functions::Exp{}), nested(normal, at, Cube(2), Ignores{}));
  // Without a gap the rounding is stated.
  const auto rounded = nested(normal, around, [](double m, double y) { return std::exp(m - y); });
  static_assert(!decltype(rounded)::has_gap);
  CHECK(estimate(single_term(rounded), {.samples = 64}).bias_bound.size >= 0);
}

TEST_CASE("nets of members outside nets inside: both expectations grow quiet", "[nested][statistical]") {
  // E log E[e^(y x - 900) | y]. From 16 inner points on what is left is the outer noise, and nets of members quiet that.
  const auto outer = [](Stream& rng) { return rng.uniform(); };
  const auto at = [](double y, std::span<const double> x) { return exp_of(y * x[0] - 900); };
  const auto s = nested(outer, at, Cube(1), functions::LogMeanExp{});
  static_assert(decltype(s)::plain_inside);
  static_assert(!decltype(nested(normal, around, functions::Exp{}))::plain_inside);  // its draws are those of the point
  const auto run = [&](Points points) {
    return estimate(recipe(s, {.base_level = 4, .points = points}), {.samples = 1 << 13, .seed = 4});
  };
  const auto nets = run(Points::nets);
  const auto plain = run(Points::plain);
  // The integral of log((e^y - 1) / y) over [0, 1], less 900.
  const double truth = -900 + 0.26382;
  CAPTURE(nets.mean, plain.mean, nets.standard_error, plain.standard_error);
  CHECK(std::abs(nets.mean - truth) < 1e-3);
  CHECK(nets.standard_error < 0.2 * plain.standard_error);
}

#include <debias/function_of_mean/cubes.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/survey.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::sequence_laws;

namespace {

using Point = std::span<const double>;

// exp(-|1 - t|^2 / 2): its mean under N(0, I_d) is exp(-d (ln 2 / 2 + 1/4)).
double likelihood(Point t) {
  double squares = 0;
  for (const double x : t) squares += (1 - x) * (1 - x);
  return std::exp(-0.5 * squares);
}
const double log_evidence = -(std::numbers::ln2 / 2 + 0.25);

auto evidence(std::int64_t d) {
  return function_of_integral(expectation_under(densities::Normal{}, likelihood), Cube(d), functions::Log{});
}
// The same from independent draws.
auto independent_evidence(int d) {
  const auto x = [d](Stream& rng) {
    double squares = 0;
    for (int t = 0; t < d; ++t) {
      const double z = 1 - rng.normal();
      squares += z * z;
    }
    return std::exp(-0.5 * squares);
  };
  return function_of_mean(x, functions::Log{});
}

// Sobol's g, whose integral over [0, 1]^5 is 1.
double sobol_g(Point x) {
  double f = 1;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto a = static_cast<double>(i + 1);
    f *= (std::abs(4 * x[i] - 2) + a) / (1 + a);
  }
  return f;
}

// Its kinks lie where nets are cut anyway.
auto kinks() { return function_of_integral(sobol_g, Cube(5), functions::ExpMinus{}, {.rates = Rates{4.4, 1}}); }

template <class S>
double beta_of(const S& sequence, std::int64_t levels, std::int64_t samples) {
  return survey(sequence, levels, {.samples = samples, .seed = 5}).evidence.decay.value;
}

// Variance of I_level.
template <class S>
double variance_of_value(const S& sequence, std::int64_t level, std::int64_t samples) {
  const auto value = [&](Stream& rng) { return sequence.value_at(level, rng).value; };
  const auto r = estimate(value, {.samples = samples, .seed = 3});
  return r.components.front().variance;
}

}  // namespace

TEST_CASE("nets in a cube satisfy the laws of a sequence", "[cubes][law]") {
  CHECK(sequence_laws(evidence(3)) == laws::Failures{});
  CHECK(sequence_laws(kinks()) == laws::Failures{});
}

TEST_CASE("g of an integral over a cube is unbiased, and loses its base to be found out", "[cubes][statistical]") {
  const auto z_of = [](const auto& r, double truth) { return (r.mean - truth) / r.standard_error; };
  for (const std::int64_t d : {1, 2, 4, 8}) {
    const auto r = estimate(single_term(evidence(d), {.base_level = 2}), {.samples = 1 << 14, .seed = 1});
    CAPTURE(d, r.mean, r.standard_error);
    CHECK(std::abs(z_of(r, static_cast<double>(d) * log_evidence)) < 4.5);
    // Without the correction, only the base: what is wrong with it is seen.
    const auto base = estimate([&](Stream& rng) { return evidence(d).value_at(2, rng).value; }, {.samples = 1 << 14});
    CHECK(std::abs(z_of(base, static_cast<double>(d) * log_evidence)) > 4.5);
  }
  const auto g = estimate(single_term(function_of_integral(sobol_g, Cube(5), functions::ExpMinus{})),
                          {.samples = 1 << 14, .seed = 1});
  CHECK(std::abs(z_of(g, std::exp(-1))) < 4.5);
}

TEST_CASE("both halves of a net, and each group of a shared base, have the mean of their own level",
          "[cubes][statistical]") {
  const auto s = evidence(2);
  // E shared(5, 2).base = E I_2, in which the groups of one half alone have part too.
  const auto mean = [](const auto& f) { return estimate(f, {.samples = 1 << 14, .seed = 9}); };
  const auto base = mean([&](Stream& rng) { return s.shared(5, 2, rng).base; });
  const auto alone = mean([&](Stream& rng) { return s.value_at(2, rng).value; });
  CHECK(std::abs(base.mean - alone.mean) < 4.5 * std::hypot(base.standard_error, alone.standard_error));
  CHECK(base.standard_error < 0.5 * alone.standard_error);
  const auto other = mean([&](Stream& rng) { return s.value_at(1, rng).value; });
  CHECK(std::abs(base.mean - other.mean) > 4.5 * std::hypot(base.standard_error, other.standard_error));
}

TEST_CASE("differences fall as declared: evidence in 1 to 8 dimensions, and kinks in 5", "[cubes][statistical][stat]") {
  const double asked[] = {0, 0, 4.2, 0, 3.3, 0, 0, 0, 2.4};
  for (const std::int64_t d : {1, 2, 3, 4, 5, 6, 7, 8}) {
    const double beta = beta_of(evidence(d), 12, 1024);
    CAPTURE(d, beta);
    CHECK(beta >= asked[d]);
    CHECK(beta >= evidence(d).rates.variance_decay);
  }
  CHECK_FALSE(beta_of(independent_evidence(2), 12, 1024) >= asked[8]);
  const double beta = beta_of(kinks(), 12, 1024);
  CAPTURE(beta);
  CHECK(beta >= kinks().rates.variance_decay);
}

TEST_CASE("at 4096 look-ups the variance is 5000, 300 and 8 times below that of independent draws", "[cubes][stat]") {
  const double asked[] = {5e3, 300, 8};
  std::size_t i = 0;
  for (const std::int64_t d : {2, 4, 8}) {
    const double nets = variance_of_value(evidence(d), 12, 256);
    const double independent = variance_of_value(independent_evidence(static_cast<int>(d)), 12, 256);
    CAPTURE(d, independent / nets);
    CHECK(independent > asked[i++] * nets);
  }
}

TEST_CASE("errors fall with the points of a growing base like work^-1.1, -0.9 and -0.6", "[cubes][stat]") {
  const double asked[] = {-1.1, -0.9, -0.6};
  std::size_t i = 0;
  for (const std::int64_t d : {2, 4, 8}) {
    const double few = variance_of_value(evidence(d), 6, 1024);
    const double many = variance_of_value(evidence(d), 12, 256);
    const double slope = std::log2(many / few) / 2 / 6;
    CAPTURE(d, slope);
    CHECK(slope <= asked[i]);
    const double plain = std::log2(variance_of_value(independent_evidence(static_cast<int>(d)), 12, 256) /
                                   variance_of_value(independent_evidence(static_cast<int>(d)), 6, 1024)) /
                         2 / 6;
    CHECK_FALSE(plain <= asked[2]);
    ++i;
  }
}

TEST_CASE("arrays of means go into functions of several: a self-normalised mean over a cube", "[cubes]") {
  // E x_1 under the density e^(x_1 + x_2) / Z on the square: 1 / (e - 1).
  const auto f = [](Point x) -> Eigen::Array2d {
    const double w = std::exp(x[0] + x[1]);
    return {w * x[0], w};
  };
  const auto r = estimate(single_term(function_of_integral(f, Cube(2), functions::Ratio{})), {.samples = 1 << 13});
  const double truth = 1 / (std::numbers::e - 1);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.01 * truth) > 4.5 * r.standard_error);
}

TEST_CASE("an integrand of many points at once gives the same bits as one of a point", "[cubes][exact]") {
  const auto one = [](Point x) { return x[0] * x[1] + x[2]; };
  struct Many {
    double operator()(Point x) const { return x[0] * x[1] + x[2]; }
    void operator()(Point x, std::span<double> out) const {
      const std::size_t n = out.size();
      for (std::size_t i = 0; i < n; ++i) out[i] = x[i] * x[n + i] + x[2 * n + i];
    }
  };
  static_assert(BatchedCubeIntegrand<Many>);
  const auto a = function_of_integral(one, Cube(3), functions::Exp{});
  const auto b = function_of_integral(Many{}, Cube(3), functions::Exp{});
  for (const std::int64_t level : {0, 1, 3, 7, 9}) {
    Stream s(4, 2);
    Stream t(4, 2);
    const auto x = a(level, s);
    const auto y = b(level, t);
    CHECK(x.value == y.value);
    CHECK(x.difference == y.difference);
    CHECK(x.work == y.work);
  }
}

TEST_CASE("256 coordinates are integrated, and none or more are refused", "[cubes][exact]") {
  const auto f = [](Point x) {
    double total = 0;
    for (const double t : x) total += t;
    return total / static_cast<double>(x.size());
  };
  const auto square = function_of_integral(f, Cube(256), functions::Square{});
  Stream rng(1, 2);
  const auto draw = square(9, rng);
  CHECK(std::abs(draw.value - 0.25) < 1e-3);
  CHECK_THROWS_AS(Cube(0), std::invalid_argument);
  CHECK_THROWS_AS(Cube(-3), std::invalid_argument);
  CHECK_THROWS_AS(Cube(257), std::invalid_argument);
}

TEST_CASE("a net ends at level 27, which a run knows beforehand", "[cubes][exact]") {
  const auto s = evidence(2);
  CHECK(s.deepest_level() == 27);
  Stream rng(1, 2);
  CHECK_THROWS_AS(s(28, rng), std::length_error);
}

TEST_CASE("integrals over the line and over R^d come to the cube by a density", "[cubes][densities]") {
  const auto near = [](const auto& r, double truth) { return std::abs(r.mean - truth) < 4.5 * r.standard_error; };
  const Plan plan{.samples = 1 << 13, .seed = 2};
  // The integral of e^(-|x|^2) over the plane is pi, by a law of heavier tails.
  const auto bell = [](Point x) { return std::exp(-x[0] * x[0] - x[1] * x[1]); };
  CHECK(near(
      estimate(single_term(function_of_integral(integral_over(densities::StudentT{4}, bell), Cube(2), functions::Log{}),
                           {.base_level = 4}),
               plan),
      std::log(std::numbers::pi)));
  // Of x^2 e^-x over x > 0: 2, by combs and an Exponential.
  const auto gamma = [](double x) { return x * x * std::exp(-x); };
  CHECK(near(estimate(single_term(function_of_integral(integral_over(densities::Exponential{0.5}, gamma),
                                                       functions::Reciprocal{}, {.rates = {3, 1}}),
                                  {.base_level = 5}),
                      plan),
             0.5));
  // E e^(X / 2) under N(1, 2^2): e^(1/2 + 1/2).
  const auto e = [](double x) { return std::exp(x / 2); };
  CHECK(near(estimate(single_term(function_of_integral(expectation_under(densities::Normal{1, 2}, e), functions::Log{},
                                                       {.rates = {2, 1}}),
                                  {.base_level = 5}),
                      plan),
             1.0));
}

TEST_CASE("quantiles of Student's t are those of its tables, and its densities too", "[densities][exact]") {
  const auto close = [](double x, double y) { return std::abs(x - y) <= 1e-9 * std::abs(y); };
  CHECK(close(densities::StudentT{1}.quantile(0.975), 12.706204736174698));
  CHECK(close(densities::StudentT{2}.quantile(0.975), 4.302652729911275));
  CHECK(close(densities::StudentT{4}.quantile(0.975), 2.7764451051977987));
  CHECK(close(densities::StudentT{4, 1, 2}.quantile(0.025), 1 - 2 * 2.7764451051977987));
  CHECK(close(densities::StudentT{1}.density(1), 1 / (2 * std::numbers::pi)));
  for (const double degrees : {1.0, 2.0, 3.5}) {
    CHECK(densities::StudentT{degrees}.quantile(0x1p-53) < -1e4);
    CHECK(std::abs(densities::StudentT{degrees}.quantile(0.5)) < 1e-12);
  }
  CHECK_THROWS_AS(densities::StudentT{0}.quantile(0.5), std::invalid_argument);
  CHECK_THROWS_AS((densities::StudentT{2, 0, -1}.density(0.5)), std::invalid_argument);
}

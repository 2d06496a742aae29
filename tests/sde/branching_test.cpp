#include <debias/sde.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/core/no_pmf.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/sde/vector.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2, .horizon = 1};
const double discount = std::exp(-0.05);

double call(double x) { return discount * std::max(x - 100, 0.0); }
double digital(double x) { return x > 100 ? 100 * discount : 0; }

double step(double x, double h, double dw) { return x * (1 + 0.05 * h + 0.2 * dw + 0.02 * (dw * dw - h)); }

// The same as a vector of one component.
struct AsVector {
  using State = Eigen::Matrix<double, 1, 1>;
  State start{100.0};
  double horizon = 1;
  [[nodiscard]] State drift(const State& x, double /*t*/) const { return 0.05 * x; }
  [[nodiscard]] State diffusion(const State& x, double /*t*/) const { return 0.2 * x; }
  [[nodiscard]] State diffusion_along(const State& /*x*/, double /*t*/, const State& v) const { return 0.2 * v; }
};

}  // namespace

TEST_CASE("a tree of level 2 has a stem of two steps and two leaves, one of level 1 is a path", "[sde][exact]") {
  const auto tree = milstein(stock, call, Branching{});
  Stream rng(1, 2);
  Stream same(rng);
  const Draw<double> draw = tree(2, rng);
  const auto increment = [&same] { return 0.5 * same.normal(); };
  const double dw1 = increment();
  const double dw2 = increment();
  const double fine_stem = step(step(100, 0.25, dw1), 0.25, dw2);
  const double coarse_stem = step(100, 0.5, dw1 + dw2);
  double fine = 0;
  double difference = 0;
  for (int leaf = 0; leaf < 2; ++leaf) {
    const double dw3 = increment();
    const double dw4 = increment();
    const double end = call(step(step(fine_stem, 0.25, dw3), 0.25, dw4));
    fine += end / 2;
    difference += (end - call(step(coarse_stem, 0.5, dw3 + dw4))) / 2;
  }
  CHECK(draw.value == Approx(fine).epsilon(1e-13));
  CHECK(std::abs(draw.difference - difference) < 1e-12);
  CHECK(rng.bits() == same.bits());

  const auto path = milstein(stock, call);
  for (std::int64_t k = 0; k <= 1; ++k) {
    Stream one(3, 4);
    Stream two(one);
    const Draw<double> a = tree(k, one);
    const Draw<double> b = path(k, two);
    CHECK(a.value == b.value);
    CHECK(a.difference == b.difference);
    CHECK(a.work == b.work);
  }
}

TEST_CASE("the work of a tree is (k + 1) 2^(k - 1) steps, and value_at has the fine half of a draw", "[sde][exact]") {
  const auto tree = milstein(
      stock, StaysAbove{85}, [](const StaysAbove& p) { return digital(p.terminal) * p.probability; }, Branching{});
  for (std::int64_t k = 1; k <= 8; ++k) {
    Stream one(5, 6);
    Stream two(one);
    const Draw<double> draw = tree(k, one);
    const Term<double> value = tree.value_at(k, two);
    CHECK(draw.value == value.value);
    CHECK(one.bits() == two.bits());
    const double steps = static_cast<double>(k + 1) * std::ldexp(1.0, static_cast<int>(k) - 1);
    CHECK(value.work == steps);
    CHECK(draw.work == 1.5 * steps);
  }
}

TEST_CASE("a tree of vectors is that of numbers", "[sde][exact]") {
  const auto numbers = milstein(stock, digital, Branching{});
  const auto first = [](const AsVector::State& x) { return digital(x[0]); };
  const auto vectors = milstein(AsVector{}, first, Branching{});
  const auto twins = antithetic_milstein(AsVector{}, first, Branching{}, {1, 1.2});
  for (std::int64_t k = 0; k <= 5; ++k) {
    Stream one(7, 8);
    Stream two(one);
    Stream three(one);
    const Draw<double> draw = numbers(k, one);
    CHECK(vectors(k, two).value == Approx(draw.value).epsilon(1e-12));
    CHECK(std::abs(vectors.rates.variance_decay - 2) < 1e-12);
    CHECK(twins(k, three).work == (k == 0 ? 1 : 2.5 / 1.5 * draw.work));
  }
}

TEST_CASE("E13: a digital call on trees keeps the laws with its declared rates, a path alone does not", "[sde][law]") {
  CHECK(sequence_laws(milstein(stock, digital, Branching{}), {.last = 8, .rates_from = 4}) == Failures{});
  // few levels and many draws: a jump between both paths is rare
  CHECK(sequence_laws(milstein(stock, digital, {2, 1}), {.last = 5, .samples = 1 << 15}) != Failures{});
  // Euler's trees have not the rates of Milstein's
  CHECK(sequence_laws(euler(stock, digital, Branching{}, {2, 1.2}), {.last = 6, .rates_from = 3}) != Failures{});
}

TEST_CASE("E13: a digital call on trees is right, and Euler's tree has no PMF", "[sde][statistical]") {
  constexpr double truth = 53.23248154537634;
  const auto r =
      estimate(single_term(milstein(stock, digital, Branching{}), {.base_level = 3}), {.samples = 1 << 14, .seed = 13});
  INFO(r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.1 * truth) > 4.5 * r.standard_error);
  CHECK_THROWS_AS(single_term(euler(stock, digital, Branching{})), NoPmfError);
  CHECK_THROWS_AS(single_term(milstein(stock, digital, {1, 1})), NoPmfError);
}

TEST_CASE("a knock-out that pays by whether its minimum stays above a barrier is right on trees",
          "[sde][statistical]") {
  const auto knock_out = [](const Minimum& path) { return path.minimum > 85 ? discount : 0; };
  // exp(-r T) P(min S > B) = exp(-r T) (Phi(d) - (B / S)^(2 r / sigma^2 - 1) Phi(d')), [Reiner & Rubinstein 1991]
  const auto phi = [](double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; };
  const double log_barrier = std::log(0.85);
  const double drift = 0.05 - 0.02;
  const double truth = discount * (phi((drift - log_barrier) / 0.2) -
                                   std::exp(2 * drift * log_barrier / 0.04) * phi((drift + log_barrier) / 0.2));
  const auto r =
      estimate(single_term(milstein(stock, Minimum{}, knock_out, Branching{}, {1.5, 1.2}), {.base_level = 2}),
               {.samples = 1 << 13, .seed = 17});
  INFO(r);
  CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.1 * truth) > 4.5 * r.standard_error);
}

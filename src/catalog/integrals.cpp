// Functions of an integral over [0, 1], by equidistant combs with one random offset.

#include <cmath>
#include <numbers>

#include <boost/math/special_functions/gamma.hpp>

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/reciprocal.hpp>

#include "exponential.hpp"
#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

constexpr double pi = std::numbers::pi;

// exp(-integral of extinction), with the rates of its comb and of jittered points; 0 <= extinction <=
// majorant.
template <class F>
Problem transmittance(Facts facts, const F& extinction, const Rates& rates, double majorant,
                      const Rates& jittered = {6, 1}) {
  facts.module = "function_of_mean.hpp";
  Problem p = make(std::move(facts), function_of_integral(extinction, functions::ExpMinus{}), rates);
  add_exponential_methods(p, extinction, majorant, jittered, majorant < 10 ? 1 : 3);
  return p;
}

constexpr Rates smooth{4, 1};
constexpr Rates exact{Rates::faster_than_any, 1};  // the comb integrates exactly from some level on

}  // namespace

Problem transmittance_constant() {
  return transmittance(
      {.id = "B01",
       .name = "transmittance-constant",
       .truth = 0.1353352832366126918940,
       .formula = "exp(-tau), extinction 2: e^-2"},
      [](double) { return 2.0; }, exact, 2);
}

Problem transmittance_linear() {
  return transmittance(
      {.id = "B02",
       .name = "transmittance-linear",
       .truth = 0.3678794411714423215955,
       .formula = "exp(-tau), extinction 2x: 1/e"},
      [](double x) { return 2 * x; }, smooth, 2);
}

Problem transmittance_exponential() {
  return transmittance(
      {.id = "B03",
       .name = "transmittance-exponential",
       .truth = 0.2733514155455598650183,
       .formula = "exp(-tau), extinction 3 exp(-2x): exp(-(3/2)(1 - e^-2))"},
      [](double x) { return 3 * std::exp(-2 * x); }, smooth, 3);
}

Problem transmittance_sinusoid() {
  return transmittance(
      {.id = "B04",
       .name = "transmittance-sinusoid",
       .truth = 0.3678794411714423215955,
       .formula = "exp(-tau), extinction 1 + sin(2 pi x): 1/e"},
      [](double x) { return 1 + std::sin(2 * pi * x); }, exact, 2);
}

Problem transmittance_step() {
  return transmittance({.id = "B06",
                        .name = "transmittance-step",
                        .truth = 0.1888756028375618384606,
                        .formula = "exp(-tau), extinction 4 on [0, 1/3), 1/2 beyond: exp(-5/3)"},
                       [](double x) { return x < 1.0 / 3 ? 4.0 : 0.5; }, smooth, 4, {4, 1});
}

Problem transmittance_bump() {
  return transmittance(
      {.id = "B08",
       .name = "transmittance-bump",
       .truth = 0.1346281012846045847888,
       .formula = "exp(-tau), extinction 8 exp(-(x - 0.4)^2 / 0.02): tau = 2.005239..."},
      [](double x) {
        const double d = x - 0.4;
        return 8 * std::exp(-d * d / 0.02);
      },
      smooth, 8);
}

Problem transmittance_thick() {
  return transmittance(
      {.id = "B09",
       .name = "transmittance-thick",
       .truth = 4.539992976248485153559e-5,
       .formula = "exp(-tau), extinction 20x: e^-10"},
      [](double x) { return 20 * x; }, smooth, 20);
}

namespace {

// (1 + c^2 tau)^(-1/c^2) for extinction slope x.
Problem davis(Facts facts, double c, double slope) {
  facts.module = "function_of_mean.hpp";
  const functions::Davis g{c};
  const auto extinction = [slope](double x) { return slope * x; };
  Problem p = make(std::move(facts), function_of_integral(extinction, g), smooth);
  const auto x = [extinction](Stream& rng) { return extinction(rng.uniform()); };
  const Centre middle = centre_between(0, slope);
  add(p, {.name = "taylor", .description = "the power series about a centre, with roulette"},
      roulette(taylor(x, g, middle)));
  add(p, {.name = "taylor_symmetric", .description = "the power series about a centre, with symmetric products"},
      taylor_sum(x, g, middle, Geometric(0.6)));
  add_p_series_cumulative(p, taylor(x, g, slope), g(slope));
  // Not the PMF of Bhanot and Kennedy: the terms fall like 0.15^k only.
  add_u_statistics(p, extinction, g, 5, Geometric(0.9));
  add_jittered(p, extinction, g, 1);
  // T = E exp(-m tau), m ~ Gamma(1 / c^2, c^2).
  const auto mixture = [extinction, slope, c](Stream& rng) {
    const double m = c * c * boost::math::gamma_p_inv(1 / (c * c), rng.uniform());
    const auto at = [m, extinction](Stream& draws) { return m * extinction(draws.uniform()); };
    Stream path = rng.split(1);
    NullRecord none;
    return roulette(taylor(at, functions::ExpMinus{}, slope * m), RunningWeight(std::exp(-slope * m)))(path, none);
  };
  add(p, {.name = "gamma_mixture", .description = "p_series_cumulative of exp(-m tau) for a random m of the Gamma law"},
      mixture);
  return p;
}

}  // namespace

Problem transmittance_davis() {
  return davis({.id = "B12",
                .name = "transmittance-davis",
                .truth = 0.1975308641975308641975,
                .formula = "(1 + c^2 tau)^(-1/c^2), c = 1/2, extinction 4x: 16/81"},
               0.5, 4);
}

Problem transmittance_pink() {
  return davis({.id = "B13",
                .name = "transmittance-pink",
                .truth = 0.2758841825888301593187,
                .formula = "(1 + c^2 tau)^(-1/c^2), c = 0.8, extinction 4x: 2.28^(-1.5625)"},
               0.8, 4);
}

Problem transmittance_straight() {
  // max(0, 1 - tau / 3), with its gap.
  struct Straight {
    double operator()(double m) const { return functions::PositivePart{}(1 - m / 3); }
    double gap(double m, double d) const { return functions::PositivePart{}.gap(1 - m / 3, d / 3); }
  };
  const auto extinction = [](double x) { return 2 * x; };
  Problem p = make({.id = "B17",
                    .name = "transmittance-straight",
                    .module = "function_of_mean.hpp",
                    .truth = 0.6666666666666666666667,
                    .formula = "max(0, 1 - tau / 3), extinction 2x: 2/3"},
                   function_of_integral(extinction, Straight{}), exact);
  add_jittered(p, extinction, Straight{}, 1);
  return p;
}

Problem reciprocal_of_integral() {
  // One point may fall on the zero of f; two points half a period apart average to 4 exactly.
  const auto f = [](double x) { return 4 * (1 + std::sin(2 * pi * x)); };
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  Problem p = make({.id = "B14",
                    .name = "reciprocal-of-integral",
                    .module = "reciprocal.hpp",
                    .truth = 0.25,
                    .formula = "1 / integral of 4 (1 + sin 2 pi x): 1/4",
                    .lowest_base = 1},
                   debias::reciprocal_of_integral(f), exact);
  // b = E (1 - X/8)^2 = 3/8
  add(p, {.name = "reciprocal_series", .description = "the geometric series about a centre, with roulette"},
      roulette(reciprocal_series(x, 8.0), Geometric(0.35)));
  // b = 1/3 about E X^2 / E X = 6, where E (1 - X/6)^4 = 0.23
  add(p, {.name = "taylor_symmetric", .description = "the power series about a centre, with symmetric products"},
      taylor_sum(x, functions::Reciprocal{}, 6.0, Geometric(0.3)));
  add(p, {.name = "reciprocal_trials", .description = "the number of trials until one succeeds"},
      reciprocal_trials(x, 8));
  add(p, {.name = "reciprocal_product", .description = "one term of the geometric series, drawn geometrically"},
      ReciprocalProduct(x, 1.0 / 8, 0.7));
  add(p, {.name = "clamped", .description = "single_term with a clamp that vanishes with the level"},
      single_term(clamped_reciprocal_of_integral(f), Geometric(0.6), {.base_level = 1}));
  add_jittered(p, f, functions::Reciprocal{}, 3);
  return p;
}

Problem transmittance_singular() {
  // Not bounded: of the series only those without a majorant apply.
  const auto extinction = [](double x) { return std::pow(std::abs(x - 1.0 / 3), -0.25); };
  const functions::ExpMinus g;
  Problem p = make({.id = "B15",
                    .name = "transmittance-singular",
                    .module = "function_of_mean.hpp",
                    .truth = 0.2083285151439589729275,
                    .formula = "exp(-tau), extinction |x - 1/3|^(-1/4): tau = (4/3)((1/3)^(3/4) + (2/3)^(3/4))"},
                   function_of_integral(extinction, g), Rates{3, 1});
  add_u_statistics(p, extinction, g, 5, BhanotKennedy(0.9, 2, 2));
  add_jittered(p, extinction, g, 1, {3, 1});
  return p;
}

Problem kink_of_integral() {
  // |tau - 1| as |integral of 2x - 1|, whose gap is exact.
  const auto f = [](double x) { return 2 * x - 1; };
  const functions::Absolute g;
  Problem p = make({.id = "B18",
                    .name = "kink-of-integral",
                    .module = "function_of_mean.hpp",
                    .truth = 0,
                    .formula = "|tau - 1|, extinction 2x: 0"},
                   function_of_integral(f, g), Rates{2, 1});
  add_jittered(p, f, g, 1, {3, 1});
  return p;
}

}  // namespace debias::catalog

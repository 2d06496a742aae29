// Derivatives by finite differences; expectations with common random numbers.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <debias/derivative.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

// Discounted payoff of a call on geometric Brownian motion, S = K = 100, r = 0.05, sigma = 0.2, T = 1.
double call_payoff(double spot, Stream& rng) {
  const double terminal = spot * std::exp(0.05 - 0.2 * 0.2 / 2 + 0.2 * rng.normal());
  return std::exp(-0.05) * std::max(terminal - 100, 0.0);
}

}  // namespace

Problem derivative_of_sine() {
  return make({.id = "C01",
               .name = "derivative-of-sine",
               .module = "derivative.hpp",
               .truth = 0.5403023058681397174009,
               .formula = "d/dx sin x at 1, forward, first step 1.5: cos 1"},
              finite_difference([](double x) { return std::sin(x); }, 1.0));
}

Problem derivative_of_exp() {
  return make({.id = "C02",
               .name = "derivative-of-exp",
               .module = "derivative.hpp",
               .truth = 1,
               .formula = "d/dx e^x at 0, central: 1"},
              finite_difference([](double x) { return std::exp(x); }, 0.0, {.kind = Difference::central}));
}

Problem derivative_of_fast_sine() {
  const auto f = [](double x) { return 2.5 * (1 + std::sin(2 * std::numbers::pi * x)); };
  return make({.id = "C03",
               .name = "derivative-of-fast-sine",
               .module = "derivative.hpp",
               .truth = 4.854027596813666443367,
               .formula = "d/dx (5/2)(1 + sin 2 pi x) at 0.2, the first step longer than a period: 5 pi cos(0.4 pi)"},
              finite_difference(f, 0.2));
}

Problem derivative_of_kink() {
  const auto f = [](double x) { return std::abs(x) * std::sqrt(std::abs(x)); };
  return make({.id = "C04",
               .name = "derivative-of-kink",
               .module = "derivative.hpp",
               .truth = 0,
               .formula = "d/dx |x|^(3/2) at 0, forward: 0"},
              finite_difference(f, 0.0, {}, Rates{1, 0}));
}

Problem second_derivative_of_log() {
  return make({.id = "C05",
               .name = "second-derivative-of-log",
               .module = "derivative.hpp",
               .truth = -0.25,
               .formula = "d2/dx2 log x at 2, second difference: -1/4"},
              finite_difference([](double x) { return std::log(x); }, 2.0, {.kind = Difference::second}));
}

Problem black_scholes_delta() {
  Problem p = make({.id = "C06",
                    .name = "black-scholes-delta",
                    .module = "derivative.hpp",
                    .truth = 0.6368306511756190712233,
                    .formula = "d/dS of a call, S = K = 100, r = 0.05, sigma = 0.2, T = 1, common random numbers: "
                               "Phi(d1)"},
                   finite_difference(call_payoff, 100.0, {.first_step = 10}, Rates{1, 0}));
  // The best exponent, 1/2, would reach the rounding horizon (level 47) once in ten million samples.
  p.pmf = AnyPmf(Geometric::with_exponent(0.8));
  return p;
}

Problem derivative_of_expectation() {
  const auto f = [](double theta, Stream& rng) { return std::sin(theta * rng.uniform()); };
  return make({.id = "C09",
               .name = "derivative-of-expectation",
               .module = "derivative.hpp",
               .truth = 0.3817732906760362240534,
               .formula = "d/dt E sin(t U) at 1, central, common random numbers: sin 1 + cos 1 - 1"},
              finite_difference(f, 1.0, {.kind = Difference::central}));
}

Problem black_scholes_gamma() {
  return make({.id = "C12",
               .name = "black-scholes-gamma",
               .module = "derivative.hpp",
               .truth = 0.01876201734584689391871,
               .formula = "d2/dS2 of the same call: phi(d1) / (S sigma sqrt T); differences grow, no PMF exists"},
              finite_difference(call_payoff, 100.0, {.kind = Difference::second, .first_step = 10}, Rates{-1, 0}));
}

}  // namespace debias::catalog

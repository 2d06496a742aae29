// Functionals of stochastic differential equations in 2^k steps.

#include <algorithm>
#include <cmath>

#include <debias/sde.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

constexpr GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2, .horizon = 1};

}  // namespace

Problem european_call() {
  const auto payoff = [](double s) { return std::exp(-0.05) * std::max(s - 100, 0.0); };
  return make({.id = "E02",
               .name = "european-call",
               .module = "sde.hpp",
               .truth = 10.45058357218556678165,
               .formula = "call on geometric Brownian motion, S = K = 100, r = 0.05, sigma = 0.2, T = 1, Milstein: "
                          "Black-Scholes"},
              milstein(stock, payoff));
}

Problem gbm_by_euler() {
  return make({.id = "E06",
               .name = "gbm-by-euler",
               .module = "sde.hpp",
               .truth = 100,
               .formula = "discounted E S_T by Euler's scheme: 100; variance and work at the border, no law exists"},
              euler(stock, [](double s) { return std::exp(-0.05) * s; }));
}

Problem mean_of_gbm() {
  return make({.id = "E07",
               .name = "mean-of-gbm",
               .module = "sde.hpp",
               .truth = 105.1271096376024039698,
               .formula = "E S_T, Milstein: 100 e^0.05"},
              milstein(stock, [](double s) { return s; }));
}

Problem second_moment_of_ou() {
  const OrnsteinUhlenbeck model{.start = 1, .reversion = 2, .mean = 0, .volatility = 1, .horizon = 1};
  return make({.id = "E08",
               .name = "second-moment-of-ou",
               .module = "sde.hpp",
               .truth = 0.2637367291665506352203,
               .formula = "E X_1^2, dX = -2 X dt + dW, X_0 = 1, Euler: (1 + 3 e^-4) / 4"},
              euler(model, [](double x) { return x * x; }, Rates{2, 1}));
}

}  // namespace debias::catalog

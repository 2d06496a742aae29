// Functionals of stochastic differential equations in 2^k steps.

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include <debias/sde.hpp>
#include <debias/sde/vector.hpp>

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

Problem asian_call() {
  const auto payoff = [](const Average& path) { return std::exp(-0.05) * std::max(path.average() - 100, 0.0); };
  return make(
      {.id = "E03",
       .name = "asian-call",
       .module = "sde.hpp",
       .truth = 5.763087902964673878253,
       .formula = "call on the continuous arithmetic average of the same, Milstein with bridges: Geman and Yor"},
      milstein(stock, Average{}, payoff));
}

Problem lookback_call() {
  const auto payoff = [](const Minimum& path) { return std::exp(-0.05) * (path.terminal - path.minimum); };
  return make({.id = "E04",
               .name = "lookback-call",
               .module = "sde.hpp",
               .truth = 17.21680223736086576685,
               .formula = "call with floating strike, S_T - min S, Milstein with bridges: Goldman, Sosin and Gatto"},
              milstein(stock, Minimum{}, payoff));
}

Problem barrier_call() {
  const auto payoff = [](const StaysAbove& path) {
    return std::exp(-0.05) * std::max(path.terminal - 100, 0.0) * path.probability;
  };
  return make({.id = "E05",
               .name = "barrier-call",
               .module = "sde.hpp",
               .truth = 9.949270308634219269057,
               .formula = "call that ends when S falls to 85, Milstein with bridges: Merton"},
              milstein(stock, StaysAbove{85}, payoff, Rates{1.5, 1}));
}

Problem gbm_by_euler() {
  return make({.id = "E06",
               .name = "gbm-by-euler",
               .module = "sde.hpp",
               .truth = 100,
               .formula = "discounted E S_T by Euler's scheme: 100; variance and work at the border, no PMF exists"},
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

Problem geometric_asian_call() {
  const AverageOf log_average{[](double s) { return std::log(s); }};
  const auto payoff = [](const auto& path) { return std::exp(-0.05) * std::max(std::exp(path.average()) - 100, 0.0); };
  return make({.id = "E09",
               .name = "geometric-asian-call",
               .module = "sde.hpp",
               .truth = 5.546818633789207247287,
               .formula = "call on the continuous geometric average, Milstein and trapezoids: a lognormal formula"},
              milstein(stock, log_average, payoff));
}

Problem clark_cameron() {
  struct Model {
    Eigen::Vector2d start{0, 0};
    double horizon = 1;
    [[nodiscard]] Eigen::Vector2d drift(const Eigen::Vector2d& /*x*/, double /*t*/) const { return {0, 0}; }
    [[nodiscard]] Eigen::Matrix2d diffusion(const Eigen::Vector2d& x, double /*t*/) const {
      return Eigen::Matrix2d{{1, 0}, {0, x[0]}};
    }
    [[nodiscard]] Eigen::Matrix2d diffusion_along(const Eigen::Vector2d& /*x*/, double /*t*/,
                                                  const Eigen::Vector2d& v) const {
      return Eigen::Matrix2d{{0, 0}, {0, v[0]}};
    }
  };
  return make({.id = "E10",
               .name = "clark-cameron",
               .module = "sde/vector.hpp",
               .truth = 0.8050181821945920493117,
               .formula = "E cos Y_1, dX = dW_1, dY = X dW_2, antithetic Milstein: (cosh 1)^(-1/2)"},
              antithetic_milstein(Model{}, [](const Eigen::Vector2d& x) { return std::cos(x[1]); }));
}

Problem second_moment_of_ou() {
  const OrnsteinUhlenbeck model{.start = 1, .reversion = 2, .mean = 0, .volatility = 1, .horizon = 1};
  return make({.id = "E08",
               .name = "second-moment-of-ou",
               .module = "sde.hpp",
               .truth = 0.2637367291665506352203,
               .formula = "E X_1^2, dX = -2 X dt + dW, X_0 = 1, Euler: (1 + 3 e^-4) / 4"},
              euler(
                  model, [](double x) { return x * x; }, Rates{2, 1}));
}

}  // namespace debias::catalog

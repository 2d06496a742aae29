// Steady states of contractive Markov chains, started k steps in the past.

#include <algorithm>
#include <cmath>

#include <debias/steady_state.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {

Problem autoregression() {
  const auto step = [](double x, Stream& rng) { return 0.5 * x + rng.normal(); };
  return make({.id = "H01",
               .name = "autoregression",
               .module = "steady_state.hpp",
               .truth = 1.333333333333333333333,
               .formula = "E X^2, X <- X/2 + N(0, 1): 4/3"},
              steady_state(step, 0.0, squared, contraction(0.5)));
}

Problem waiting_time() {
  const auto step = [](double wait, Stream& rng) {
    const double service = rng.exponential();
    const double gap = 2 * rng.exponential();
    return std::max(0.0, wait + service - gap);
  };
  return make({.id = "H02",
               .name = "waiting-time",
               .module = "steady_state.hpp",
               .truth = 1,
               .formula = "mean wait in the M/M/1 queue, arrivals 1/2, service 1: 1"},
              steady_state(
                  step, 0.0, [](double w) { return w; }, Rates{-std::log2(8.0 / 9), 0}));
}

Problem bernoulli_convolution() {
  const auto step = [](double x, Stream& rng) { return (x + (rng.uniform() < 0.5 ? 0 : 1)) / 2; };
  return make({.id = "H04",
               .name = "bernoulli-convolution",
               .module = "steady_state.hpp",
               .truth = 0.3333333333333333333333,
               .formula = "E X^2, X <- (X + B)/2, B = 0 or 1: 1/3 (the uniform law)"},
              steady_state(step, 0.0, squared, contraction(0.5)));
}

Problem cantor_law() {
  const auto step = [](double x, Stream& rng) { return (x + (rng.uniform() < 0.5 ? 0 : 2)) / 3; };
  return make({.id = "H05",
               .name = "cantor-law",
               .module = "steady_state.hpp",
               .truth = 0.375,
               .formula = "E X^2, X <- (X + 2B)/3, B = 0 or 1: 3/8 (the Cantor law)"},
              steady_state(step, 0.0, squared, contraction(1.0 / 3)));
}

Problem dickman_law() {
  const auto step = [](double x, Stream& rng) { return rng.uniform() * (1 + x); };
  return make({.id = "H07",
               .name = "dickman-law",
               .module = "steady_state.hpp",
               .truth = 1.5,
               .formula = "E X^2, X <- U (1 + X): 3/2 (the Dickman law)"},
              steady_state(step, 0.0, squared, contraction(1 / std::sqrt(3.0))));
}

}  // namespace debias::catalog

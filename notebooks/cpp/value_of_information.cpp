// Health economics: what it is worth to know some parameters of a decision before it is made (EVPPI), and all of them (EVPI).
//
//   payoff of treating b = m + 2 X_1 + X_2 + 3 Y_1 + 2 Y_2, all normal and independent; of doing nothing 0
//   knowing X: E max(E[b | X], 0) - max(E b, 0),  knowing everything: E max(b, 0) - max(E b, 0)
//
// With b | X of mean N(m, s^2), E max = m Phi(m / s) + s phi(m / s), the unit normal loss: s^2 = 5 for X, 18 for everything.
// The maximum is a kink: rates {1.5, 1} from independent inner draws, steeper from nets.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>
#include <span>

#include <Eigen/Core>

#include <debias/debias.hpp>

namespace {

constexpr double m = 1;

struct Known {
  double x[2];
};

// max(0, a number m of this deviation), in the mean.
double expected_max(double deviation) {
  const double z = m / deviation;
  const double density = std::exp(-z * z / 2) / std::sqrt(2 * std::numbers::pi);
  return m * std::erfc(-z / std::numbers::sqrt2) / 2 + deviation * density;
}

}  // namespace

int main() {
  const auto known = [](debias::Stream& rng) {
    Known k;
    for (double& x : k.x) x = rng.normal();
    return k;
  };
  // The payoff, and what the best decision for these very parameters would pay.
  const auto payoff = [](const Known& k, std::span<const double> u) {
    const double y[] = {debias::normal_quantile(u[0]), debias::normal_quantile(u[1])};
    const double b = m + 2 * k.x[0] + k.x[1] + 3 * y[0] + 2 * y[1];
    return Eigen::Array2d(b, std::max(b, 0.0));
  };
  const auto values = [](const Eigen::Array2d& mean) {
    const double now = std::max(m, 0.0);
    return Eigen::Array2d(std::max(mean[0], 0.0) - now, mean[1] - now);
  };
  const auto problem = debias::nested(known, payoff, debias::Cube(2), values, {.rates = debias::Rates{2, 1}});
  const auto result = debias::estimate(debias::recipe(problem), {.samples = 1 << 16, .seed = 1});
  const double exact[] = {expected_max(std::sqrt(5.0)) - m, expected_max(std::sqrt(18.0)) - m};
  const char* const names[] = {"knowing_x", "knowing_all"};
  for (int i = 0; i < 2; ++i) {
    std::cout << names[i] << ' ' << result.mean[i] << " +- " << result.standard_error[i] << ", exact " << exact[i]
              << '\n';
  }
}

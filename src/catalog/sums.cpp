// Series, cut off at a depth without debiasing.

#include <cmath>

#include <Eigen/Core>

#include <debias/linear_operators.hpp>
#include <debias/series.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

double power(double x, std::int64_t k) { return std::pow(x, static_cast<double>(k)); }

}  // namespace

Problem geometric_series() {
  return make({.id = "D01", .name = "geometric-series", .module = "series.hpp", .truth = 2, .formula = "sum 2^-k: 2"},
              series([](std::int64_t k) { return power(0.5, k); }, geometric_terms(0.5)));
}

Problem slow_geometric_series() {
  return make(
      {.id = "D02", .name = "slow-geometric-series", .module = "series.hpp", .truth = 20, .formula = "sum 0.95^k: 20"},
      series([](std::int64_t k) { return power(0.95, k); }, geometric_terms(0.95)));
}

Problem zeta_of_two() {
  const auto term = [](std::int64_t k) {
    const double n = static_cast<double>(k) + 1;
    return 1 / (n * n);
  };
  return make({.id = "D03",
               .name = "zeta-of-two",
               .module = "series.hpp",
               .truth = 1.644934066848226436472,
               .formula = "sum 1/k^2: pi^2/6"},
              series(term, polynomial_terms(2)));
}

Problem series_for_e() {
  return make({.id = "D07",
               .name = "series-for-e",
               .module = "series.hpp",
               .truth = 2.718281828459045235360,
               .formula = "sum 1/k!: e"},
              series([](std::int64_t k) { return 1 / std::tgamma(static_cast<double>(k) + 1); }, factorial_terms));
}

Problem machin_pi() {
  // atan(1/5) and atan(1/239) side by side, term by term.
  const auto term = [](std::int64_t k) {
    const double n = 2 * static_cast<double>(k) + 1;
    return (k % 2 == 0 ? 1 : -1) / n * (16 * std::pow(5, -n) - 4 * std::pow(239, -n));
  };
  return make({.id = "D08",
               .name = "machin-pi",
               .module = "series.hpp",
               .truth = 3.141592653589793238463,
               .formula = "16 atan(1/5) - 4 atan(1/239) by their series: pi"},
              series(term, geometric_terms(1.0 / 25)));
}

Problem bessel_j0() {
  const auto term = [](std::int64_t k) {
    const double factorial = std::tgamma(static_cast<double>(k) + 1);
    return (k % 2 == 0 ? 1 : -1) / factorial / factorial;
  };
  return make({.id = "D09",
               .name = "bessel-j0",
               .module = "series.hpp",
               .truth = 0.2238907791412356680518,
               .formula = "sum (-1)^k / (k!)^2: J0(2)"},
              series(term, factorial_terms));
}

Problem neumann_matrix() {
  const Eigen::Matrix2d a{{0.5, 0.4}, {0.2, 0.3}};
  const Eigen::Vector2d b(1, 2);
  const Eigen::Vector2d c(1, 0);
  Problem p = make({.id = "D11",
                    .name = "neumann-matrix",
                    .module = "linear_operators.hpp",
                    .truth = 5.555555555555555555556,
                    .formula = "x = A x + b, A = [[.5, .4], [.2, .3]], b = (1, 2), first component: 50/9"},
                   neumann(a, b, c));
  add(p, {"neumann_walk", "random walk over the entries of the matrix, roulette"}, roulette(neumann_walk(a, b, c)));
  return p;
}

Problem furnace() {
  return make({.id = "D14",
               .name = "furnace",
               .module = "series.hpp",
               .truth = 5,
               .formula = "radiance in a furnace of albedo 0.8, cut at a path depth: sum 0.8^k = 5"},
              series([](std::int64_t k) { return power(0.8, k); }, geometric_terms(0.8)));
}

Problem facing_walls() {
  // A light path between the walls: state i holds the wall, the weight the albedos so far; E_i = 1 is what it
  // emits.
  struct Path {
    int wall;
    double weight;
  };
  const auto start = [](Stream&) { return Path{0, 1}; };
  const auto bounce = [](const Path& p, Stream&) { return Path{1 - p.wall, p.weight * (p.wall == 0 ? 0.5 : 0.7)}; };
  const auto emitted = [](const Path& p) { return p.weight; };
  return make({.id = "D16",
               .name = "facing-walls",
               .module = "series.hpp",
               .truth = 2.307692307692307692308,
               .formula = "radiosity of the first of two facing walls, albedos .5 and .7, E = (1, 1): 30/13"},
              path_series(start, bounce, emitted, geometric_terms(std::sqrt(0.35))));
}

Problem log_determinant_by_probes() {
  const Eigen::Matrix3d a{{0.3, 0.2, 0}, {0.2, 0.4, 0.1}, {0, 0.1, 0.2}};
  return make({.id = "D17",
               .name = "log-determinant",
               .module = "linear_operators.hpp",
               .truth = -1.214023140179437433806,
               .formula = "log det(I - A), A = [[.3, .2, 0], [.2, .4, .1], [0, .1, .2]], random signs: ln 0.297"},
              log_determinant(a));
}

Problem log_series() {
  // Random terms: each is the deterministic one times 2 U, as if every order were itself a simulation.
  const auto term = [](std::int64_t k, Stream& rng) {
    return 2 * rng.uniform() * power(0.9, k + 1) / (static_cast<double>(k) + 1);
  };
  return make({.id = "D18",
               .name = "log-series",
               .module = "series.hpp",
               .truth = 2.302585092994045684018,
               .formula = "sum E[2 U] 0.9^k / k, each term drawn: ln 10"},
              series(term, geometric_terms(0.9)));
}

Problem wallis_product() {
  // W_n = prod_(i <= n) 4 i^2 / (4 i^2 - 1) with n = 2^k factors; D_k from the logarithm of the new factors.
  const auto sequence = [](std::int64_t level, Stream&) -> Draw<double> {
    double product = 4.0 / 3;
    double step = product;
    std::int64_t n = 1;
    for (std::int64_t k = 0; k < level; ++k, n *= 2) {
      double log_ratio = 0;
      for (std::int64_t i = n + 1; i <= 2 * n; ++i) {
        const double x = 2 * static_cast<double>(i);
        log_ratio += std::log1p(1 / (x * x - 1));
      }
      step = product * std::expm1(log_ratio);
      product += step;
    }
    return {product, step, static_cast<double>(n)};
  };
  return make({.id = "D19",
               .name = "wallis-product",
               .module = "core/sequence.hpp",
               .truth = 1.570796326794896619231,
               .formula = "Wallis product of 2^k factors: pi/2"},
              sequence, Rates{2, 1});
}

}  // namespace debias::catalog

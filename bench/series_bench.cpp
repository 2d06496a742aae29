// Series and walks against plain loops: plain/..., ratio of times, alternating in one run.

#include <cmath>
#include <cstdint>

#include <benchmark/benchmark.h>

#include <Eigen/Core>

#include <debias/estimators/roulette.hpp>
#include <debias/linear_operators.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/series.hpp>

#include "against_loops.hpp"

namespace debias::bench {
namespace {

// A light path in a furnace: one random number a vertex, emission 2 u.
void plain_light_path() {
  struct Vertex {
    double emission;
    double throughput;
  };
  const auto path = path_series(
      [](Stream& rng) {
        return Vertex{2 * rng.uniform(), 1};
      },
      [](const Vertex& v, Stream& rng) {
        return Vertex{2 * rng.uniform(), 0.8 * v.throughput};
      },
      [](const Vertex& v) { return v.throughput * v.emission; }, geometric_terms(0.8));
  const auto plain = [](Stream& order, Stream& rng) {
    double radiance = 2 * rng.uniform();
    double throughput = 1;
    while (order.uniform() < 0.8) {
      throughput *= 0.8 / 0.8;
      radiance += throughput * 2 * rng.uniform();
    }
    return radiance;
  };
  register_comparison("light_path", roulette(path, Geometric(0.2)), plain);
}
// The walk of Ulam and von Neumann on a 2 x 2 matrix.
void plain_walk() {
  const Eigen::Matrix2d a{{0.5, 0.4}, {0.2, 0.3}};
  const auto walk = neumann_walk(a, Eigen::Vector2d(1, 2), Eigen::Vector2d(1, 0));
  const double survival = 0.7;
  const auto plain = [survival](Stream& order, Stream& rng) { return plain::walk(survival, order, rng); };
  register_comparison("neumann_walk", roulette(walk, Geometric(1 - survival)), plain);
}

const bool registered = [] {
  plain_light_path();
  plain_walk();
  return true;
}();

}  // namespace
}  // namespace debias::bench

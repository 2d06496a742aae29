// Functions of an integral over [0, 1]^d: variance x look-ups of one sample, g of a mean of so many points, which are independent,
// jittered, a comb (both in one dimension only) or a scrambled net (debias_bench --benchmark_filter=table/cubes).

#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/core/estimate.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>

#include "against_loops.hpp"

namespace debias::bench {
namespace {

// exp(-|1 - t|^2 / 2) under N(0, I_d).
struct Likelihood {
  double operator()(double t) const { return std::exp(-0.5 * (1 - t) * (1 - t)); }
  double operator()(std::span<const double> t) const {
    double squares = 0;
    for (const double x : t) squares += (1 - x) * (1 - x);
    return std::exp(-0.5 * squares);
  }
};

// I_level alone.
template <class S>
Cell base_of(const std::string& method, const S& sequence, std::int64_t level, double truth) {
  const auto value = [&](Stream& rng) { return sequence.value_at(level, rng).value; };
  const auto samples = (std::int64_t{1} << 22) >> level;
  const auto r = estimate(value, {.samples = samples, .threads = 1});
  return {method, r.moments.variance() / (truth * truth),
          std::sqrt((r.moments.kurtosis() - 1) / static_cast<double>(r.samples)),
          std::exp2(static_cast<double>(level))};
}

void add_cubes(Table& table) {
  const functions::Log g;
  for (const int d : {1, 2, 4, 8}) {
    const double truth = -d * (std::numbers::ln2 / 2 + 0.25);
    const auto f = expectation_under(densities::Normal{}, Likelihood{});
    const auto draws = [d](Stream& rng) {
      double squares = 0;
      for (int t = 0; t < d; ++t) {
        const double z = 1 - rng.normal();
        squares += z * z;
      }
      return std::exp(-0.5 * squares);
    };
    for (const int level : {4, 6, 8, 10, 12}) {
      std::vector<Cell> cells = {base_of("independent", function_of_mean(draws, g), level, truth)};
      if (d == 1) {
        cells.push_back(base_of("jittered", function_of_jittered_integral(f, g), level, truth));
        cells.push_back(base_of("comb", function_of_integral(f, g), level, truth));
      } else {
        cells.push_back({.method = "jittered"});
        cells.push_back({.method = "comb"});
      }
      cells.push_back(base_of("net", function_of_integral(f, Cube(d), g), level, truth));
      table.add("log evidence, d = " + std::to_string(d) + ", " + std::to_string(1 << level) + " look-ups", cells);
    }
  }
}

const bool registered = [] {
  register_table("cubes", add_cubes);
  return true;
}();

}  // namespace
}  // namespace debias::bench

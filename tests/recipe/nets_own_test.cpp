// The European call as a user writes it, by the bridge helper and in the order of time, beside the catalogue's sequence.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/recipe.hpp>
#include <debias/sde.hpp>

using namespace debias;

namespace {

constexpr double call_price = 10.450583572185565;
constexpr std::size_t seeds = 16;

double pay(double s) { return std::max(s - 100, 0.0) * std::exp(-0.05); }
double step(double x, double dw, double h) { return x + 0.05 * x * h + 0.2 * x * dw + 0.02 * x * (dw * dw - h); }

/// Along the path that `path_of(rng, steps)` makes.
template <class PathOf>
auto call_along(const PathOf& path_of) {
  return [path_of](std::int64_t level, Stream& rng) {
    const std::int64_t n = std::int64_t{1} << level;
    const double h = 1 / static_cast<double>(n);
    auto w = path_of(rng, n);
    if (level == 0) return base(pay(step(100, w.next(), h)));
    double fine = 100;
    double coarse = 100;
    for (std::int64_t i = 0; i < n; i += 2) {
      const double a = w.next();
      const double b = w.next();
      fine = step(step(fine, a, h), b, h);
      coarse = step(coarse, a + b, 2 * h);
    }
    return coupled(pay(fine), pay(coarse), 1.5 * static_cast<double>(n));
  };
}

/// The increments as anyone draws them.
struct InTime {
  Stream* rng;
  double sqrt_h;
  double next() const { return sqrt_h * rng->normal(); }
};

struct Medians {
  double work = 0;
  double rms = 0;  // of the true error, in goals
};

constexpr double error = 0.001;

Medians medians(const auto& sequence, const RecipeOptions& options = {}) {
  std::array<double, seeds> work{};
  double squares = 0;
  for (std::size_t i = 0; i < seeds; ++i) {
    const auto r = estimate(recipe(sequence, options), {.seed = i + 1, .goal = {.error = error}});
    work[i] = r.work;
    squares += std::pow((r.mean - call_price) / error, 2) / seeds;
  }
  std::sort(work.begin(), work.end());
  return {work[seeds / 2], std::sqrt(squares)};
}

const auto catalogue = milstein(GeometricBrownianMotion{.start = 100, .growth = 0.05, .volatility = 0.2}, pay);
const auto by_bridges = call_along([](Stream& rng, std::int64_t n) { return BrownianPath(rng, n); });
const auto in_time = call_along([](Stream& rng, std::int64_t n) {
  return InTime{&rng, std::sqrt(1 / static_cast<double>(n))};
});

void compare(const RecipeOptions& options) {
  const Medians theirs = medians(catalogue);
  const Medians bridges = medians(by_bridges, options);
  const Medians time = medians(in_time, options);
  CAPTURE(theirs.work, theirs.rms, bridges.work, bridges.rms, time.work, time.rms);
  CHECK(bridges.work <= 1.1 * theirs.work);
  CHECK(time.work <= 1.8 * theirs.work);
  CHECK(bridges.rms < 1.5);  // known to 18 %
  CHECK(time.rms < 1.5);
}

}  // namespace

TEST_CASE("a call by hand with the catalogue's rates takes 1.1 of its work by bridges, and 1.8 in the order of time",
          "[nets][recipe][goal][statistical][.long]") {
  compare({.rates = Rates{2, 1}});
}

TEST_CASE("a call by hand without rates takes 1.1 of the catalogue's work by bridges, and 1.8 in the order of time",
          "[nets][recipe][goal][statistical][.long][!mayfail]") {
  // Not met: 1.8 and 2.0. Rates that only the pilot's levels show come with their doubt, and the tail then falls with an exponent of
  // 1.06 to 1.11 where 1.25 is best.
  compare({});
}

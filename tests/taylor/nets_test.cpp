// Taylor sums and reciprocals whose factors are means over scrambled nets.

#include <cmath>
#include <cstdint>
#include <span>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/reciprocal.hpp>
#include <debias/taylor.hpp>

#include "../catch_shim.hpp"

using namespace debias;

namespace {

constexpr int dimension = 4;

// Its integral over the cube is ((e^a - 1) / a)^4, a = 1/2.
double integrand(std::span<const double> x) {
  double total = 0;
  for (const double t : x) total += t;
  return std::exp(0.5 * total);
}
const double integral = std::pow(std::expm1(0.5) / 0.5, dimension);

// A mean of so many independent draws.
struct MeanOfDraws {
  std::int64_t points;
  double work;
  explicit MeanOfDraws(std::int64_t n) : points(n), work(static_cast<double>(n)) {}
  double operator()(Stream& rng) const {
    double total = 0;
    for (std::int64_t i = 0; i < points; ++i) {
      double sum = 0;
      for (int t = 0; t < dimension; ++t) sum += rng.uniform();
      total += std::exp(0.5 * sum);
    }
    return total / work;
  }
};

template <class X>
auto series(const X& x, const TaylorSumOptions& options) {
  return taylor_sum(x, functions::Reciprocal{}, integral * 1.001, Geometric(0.95), options);
}

template <class E>
double variance_times_lookups(const E& e, std::int64_t samples) {
  const auto r = estimate(e, {.samples = samples, .seed = 8, .threads = 1});
  CAPTURE(r.mean, 1 / integral, r.standard_error);
  CHECK(std::abs(r.mean - 1 / integral) < 4.5 * r.standard_error);
  CHECK(std::abs(r.mean - 1.01 / integral) > 4.5 * r.standard_error);
  return r.components.front().variance * r.work / static_cast<double>(r.samples);
}

}  // namespace

TEST_CASE("a series whose factors are nets takes 1000 times less than one of independent draws, and less than doubling",
          "[taylor][cubes][statistical]") {
  constexpr std::int64_t points = 256;
  const Cube cube(dimension);
  const double net = variance_times_lookups(series(net_mean(integrand, cube, points), {.base_level = 1}), 512);
  const double drawn = variance_times_lookups(series(MeanOfDraws(points), {.base_level = 1}), 512);
  CHECK(1000 * net < drawn);
  const auto doubling = reciprocal_of_integral(integrand, cube);
  const double by_doubling = variance_times_lookups(single_term(doubling, {.base_level = 7}), 512);
  CHECK(1000 * by_doubling < drawn);
  CHECK(net < 1.5 * by_doubling);
  // An average over pairs and triples of small nets loses to one large net.
  const double of_four =
      variance_times_lookups(series(net_mean(integrand, cube, points / 4), {.base_level = 1, .draws = 4}), 512);
  CHECK(net < 0.5 * of_four);
}

TEST_CASE("reciprocals over a cube are those of its function_of_integral, clamped where f may vanish",
          "[reciprocal][cubes][exact]") {
  const Cube cube(dimension);
  const auto one = reciprocal_of_integral(integrand, cube);
  const auto other = function_of_integral(integrand, cube, functions::Reciprocal{});
  const auto clamped = clamped_reciprocal_of_integral(integrand, cube, 0.5);
  for (const std::int64_t level : {0, 3, 6}) {
    Stream r(1, 1);
    Stream s(1, 1);
    Stream t(1, 1);
    const auto draw = one(level, r);
    CHECK(draw.value == other(level, s).value);
    CHECK(draw.value == clamped(level, t).value);  // the integrand is nowhere below the clamp
  }
  // f = 0 on half of the square: the plain one is infinite for few points, the clamped one is not.
  const auto half = [](std::span<const double> x) { return x[0] < 0.5 ? 0.0 : x[0] + x[1]; };
  const auto r = estimate(single_term(clamped_reciprocal_of_integral(half, Cube(2)), {.base_level = 3}),
                          {.samples = 1 << 12, .seed = 2});
  CAPTURE(r.mean, r.standard_error);
  CHECK(std::abs(r.mean - 1.6) < 4.5 * r.standard_error);  // 1 / (3/8 + 1/4)
  CHECK(std::abs(r.mean - 1.7) > 4.5 * r.standard_error);
}

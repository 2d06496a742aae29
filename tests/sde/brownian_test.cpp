#include <debias/sde/brownian.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <span>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/sde.hpp>

using namespace debias;

namespace {

const GeometricBrownianMotion stock{.start = 100, .growth = 0.05, .volatility = 0.2};
double call(double s) { return std::max(s - 100, 0.0); }

/// The same option by hand.
Draw<double> own(std::int64_t level, Stream& rng) {
  const std::int64_t n = std::int64_t{1} << level;
  const double h = 1 / static_cast<double>(n);
  const auto step = [](double x, double dw, double dt) {
    return x + 0.05 * x * dt + 0.2 * x * dw + 0.2 * x * 0.2 * (dw * dw - dt) / 2;
  };
  BrownianPath w(rng, n);
  double fine = 100;
  double coarse = 100;
  if (n == 1) return base(call(step(fine, w.next(), h)));
  for (std::int64_t i = 0; i < n; i += 2) {
    const double a = w.next();
    const double b = w.next();
    fine = step(step(fine, a, h), b, h);
    coarse = step(coarse, a + b, 2 * h);
  }
  return coupled(call(fine), call(coarse));
}

/// The largest deviation, in standard errors, of the variances h and covariances 0 of increments, from `paths` of them.
template <class Next>
double worst_moment(std::int64_t steps, std::size_t paths, double h, const Next& path) {
  const auto n = static_cast<std::size_t>(steps);
  std::vector<double> square(n);
  std::vector<double> product(n);  // with the next one
  double end = 0;
  for (std::size_t i = 0; i < paths; ++i) {
    const std::vector<double> dw = path(i);
    double sum = 0;
    for (std::size_t k = 0; k < n; ++k) {
      square[k] += dw[k] * dw[k];
      product[k] += dw[k] * dw[(k + 1) % n];
      sum += dw[k];
    }
    end += sum * sum;
  }
  const auto size = static_cast<double>(paths);
  double worst = std::abs(end / size / (h * static_cast<double>(steps)) - 1) / std::sqrt(2 / size);
  for (std::size_t k = 0; k < n; ++k) {
    worst = std::max(worst, std::abs(square[k] / size / h - 1) / std::sqrt(2 / size));
    if (n > 1) worst = std::max(worst, std::abs(product[k] / size / h) * std::sqrt(size));
  }
  return worst;
}

}  // namespace

TEST_CASE("a path of a plain stream has its increments in time, bit for bit", "[sde][exact]") {
  Stream one(3, 4);
  Stream two(one);
  BrownianPath w(one, 12, 3);
  for (int i = 0; i < 12; ++i) CHECK(w.next() == std::sqrt(3.0 / 12) * two.normal());
  CHECK(one.bits() == two.bits());
}

TEST_CASE("the path of a point has its end in number 0, then midpoints, and takes as many numbers", "[sde][exact]") {
  Stream point = Stream(3, 4).point(5);
  Stream numbers = Stream(3, 4).point(5);
  std::array<double, 8> z;
  for (double& x : z) x = numbers.normal();
  BrownianPath w(point, 8, 2);
  std::array<double, 9> path{};
  for (std::size_t i = 0; i < 8; ++i) path[i + 1] = path[i] + w.next();
  CHECK(path[8] == Approx(std::sqrt(2.0) * z[0]));
  CHECK(path[4] == Approx(path[8] / 2 + std::sqrt(2.0) / 2 * z[1]));
  CHECK(path[2] == Approx(path[4] / 2 + 0.5 * z[2]));
  CHECK(path[6] == Approx((path[4] + path[8]) / 2 + 0.5 * z[3]));
  CHECK(path[3] == Approx((path[2] + path[4]) / 2 + std::sqrt(0.5) / 2 * z[5]));
  CHECK(point.bits() == numbers.bits());
}

TEST_CASE("increments by bridges are independent normals, whatever the number of steps", "[sde][statistical]") {
  constexpr std::size_t paths = 4000;
  for (const std::int64_t steps : std::initializer_list<std::int64_t>{1, 3, 8, 24, 512, 1536}) {
    const double h = 2.0 / static_cast<double>(steps);
    CAPTURE(steps);
    const auto path = [&](std::size_t i, double slip) {
      Stream point = Stream(7, i).point(0);  // each alone is as good as any stream
      BrownianPath w(point, steps, 2);
      std::vector<double> dw;
      for (std::int64_t k = 0; k < steps; ++k) dw.push_back(w.next());
      if (slip > 0) dw[0] *= 1 + slip;
      return dw;
    };
    CHECK(worst_moment(steps, paths, h, [&](std::size_t i) { return path(i, 0); }) < 6.5);
    CHECK_FALSE(worst_moment(steps, paths, h, [&](std::size_t i) { return path(i, 0.1); }) < 6.5);
  }
}

TEST_CASE("an option by hand along a BrownianPath has the numbers of milstein, plain or netted", "[sde][exact]") {
  const auto sequence = milstein(stock, call);
  for (std::int64_t level = 0; level <= 10; ++level) {
    for (std::uint64_t r = 0; r < 4; ++r) {
      for (const bool netted : {false, true}) {
        Stream one = netted ? Stream(1, 2).point(r) : Stream(1, 2).split(r);
        Stream two(one);
        Stream three(one);
        const Draw<double> draw = sequence(level, one);
        const Draw<double> by_hand = own(level, two);
        CAPTURE(level, r, netted);
        CHECK(by_hand.value == Approx(draw.value).epsilon(1e-12));
        CHECK(std::abs(by_hand.difference - draw.difference) <= 1e-11);
        CHECK(sequence.value_at(level, three).value == draw.value);
      }
    }
  }
}

TEST_CASE("a batch of points draws the paths of each point alone", "[sde][exact]") {
  const auto check = [](const auto& sequence, const std::vector<std::int64_t>& levels) {
    std::size_t wrong = 0;
    for (const std::int64_t level : levels) {
      for (const std::size_t size : std::initializer_list<std::size_t>{1, 7, 64}) {
        const Stream net = Stream(4, 8).split(static_cast<std::uint64_t>(level));
        std::vector<Term<double>> values(size);
        std::vector<Term<double>> differences(size);
        StreamBatch one = StreamBatch::points(net, 64, size);
        StreamBatch two = StreamBatch::points(net, 64, size);
        sequence.values(level, one, values);
        sequence.differences(level, two, differences);
        for (std::size_t b = 0; b < size; ++b) {
          Stream point = net.point(64 + b);
          const Draw<double> draw = sequence(level, point);
          wrong += !(std::abs(values[b].value - draw.value) <= 1e-12 * std::abs(draw.value));
          wrong += !(std::abs(differences[b].value - draw.difference) <= 1e-10);
          wrong += differences[b].work != draw.work;
        }
      }
    }
    CHECK(wrong == 0);
  };
  check(milstein(stock, call), {0, 1, 2, 5, 8, 9});
  check(milstein(stock, Average{}, [](const Average& p) { return call(p.average()); }), {0, 1, 3, 7, 9});
  check(milstein(stock, Minimum{}, [](const Minimum& p) { return p.terminal - p.minimum; }), {0, 1, 4, 9});
  check(euler(OrnsteinUhlenbeck{.start = 1}, [](double x) { return x * x; }, {2, 1}), {0, 3, 8});
}

TEST_CASE("a BrownianPath without a step or a horizon is refused", "[sde][exact]") {
  Stream rng(1, 1);
  CHECK_THROWS_WITH(BrownianPath(rng, 0), Catch::Contains("0 steps"));
  for (const double horizon :
       {0.0, -1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    CHECK_THROWS_AS(BrownianPath(rng, 4, horizon), std::invalid_argument);
  }
}

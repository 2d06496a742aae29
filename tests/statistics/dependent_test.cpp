#include <cmath>
#include <cstdint>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/diagnostics.hpp>
#include <debias/statistics/dependent.hpp>

using namespace debias;

namespace {

struct Chain {
  Moments moments;
  BlockMeans blocks;
};

/// x' = rho x + noise, of variance 1.
Chain chain(double rho, std::int64_t n, std::uint64_t seed) {
  Chain c;
  Stream rng(seed, 0);
  std::vector<double> x;
  double last = rng.normal();
  for (std::int64_t i = 0; i < n; ++i) {
    last = rho * last + std::sqrt(1 - rho * rho) * rng.normal();
    x.push_back(last);
    c.blocks.add(last);
  }
  for (std::size_t i = 0; i < x.size(); i += 256) {
    c.moments.merge(Moments::of(std::span(x).subspan(i, std::min<std::size_t>(256, x.size() - i))));
  }
  return c;
}

Dependence of(const Chain& c) { return dependence_of(c.blocks.means(), c.blocks.length(), c.moments); }

}  // namespace

TEST_CASE("the time of a chain is that of its correlation, whatever the blocks", "[dependent][statistical]") {
  for (const double rho : {0.0, 0.5, 0.9, 0.99, -0.9}) {
    for (const std::int64_t n : {20'000, 200'000}) {
      const double time = (1 + rho) / (1 - rho);
      const Dependence d = of(chain(rho, n, 3));
      CAPTURE(rho, n, d.time, time);
      CHECK(d.time > 0.5 * time - 0.05);
      CHECK(d.time < 2 * time + 0.05);
      CHECK(d.matters() == (rho != 0));
    }
  }
}

TEST_CASE("the interval of a chain covers, and one of too few values is not called known", "[dependent][statistical]") {
  // 2,000 values of a chain that forgets in 200: the plain interval covers one in ten.
  int covered = 0;
  int plain = 0;
  int known = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Chain c = chain(0.99, 2000, seed);
    const Dependence d = of(c);
    const Interval i = interval_with(c.moments.mean, d.standard_error, d.degrees);
    covered += i.low <= 0 && 0 <= i.high;
    const Interval p = interval_of(c.moments);
    plain += p.low <= 0 && 0 <= p.high;
    known += d.known();
  }
  CHECK(covered >= 30);
  CHECK(plain <= 15);  // the power check
  CHECK(known <= 10);
}

TEST_CASE("independent values keep their error", "[dependent][exact]") {
  const Chain c = chain(0, 5000, 9);
  CHECK_FALSE(of(c).matters());
  CHECK(of(c).standard_error == Approx(c.moments.standard_error()).epsilon(0.25));
  const Chain few = chain(0.5, 20, 9);
  CHECK(of(few).standard_error == few.moments.standard_error());
}

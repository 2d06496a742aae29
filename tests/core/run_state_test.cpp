// What a run keeps of its chunks, and what a result makes of it. Faults that no other test saw (tests/mutants.txt).

#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>

#include "core/run_state_bytes.hpp"

using namespace debias;

TEST_CASE("2^k chunks are kept as one node, so a state does not grow with its samples", "[core][estimate][exact]") {
  // All tails are full at 8192 samples: from there on a state has the same bytes.
  const auto draw = [](Stream& rng) { return rng.normal(); };
  const auto bytes = [&](std::int64_t chunks, std::int64_t first) {
    return encode(estimate(draw, {.samples = 512 * chunks, .seed = 3, .first = 512 * first}).state).size();
  };
  CHECK(bytes(16, 0) == bytes(128, 0));
  CHECK(bytes(16, 16) == bytes(16, 0));
  // 15 = 1 + 2 + 4 + 8 and 31 chunks: one node more.
  const std::size_t node = bytes(17, 0) - bytes(16, 0);
  CHECK(bytes(31, 0) == bytes(16, 0) + 4 * node);
}

TEST_CASE("the variance of a result is over n - 1, of numbers and of components", "[core][estimate][exact]") {
  // 0, 1, 2, 3: squares about the mean sum to 5.
  const auto numbers = estimate([](Stream& rng) { return static_cast<double>(rng.index()); }, {.samples = 4});
  CHECK(numbers.components[0].variance == Approx(5.0 / 3));
  CHECK(numbers.standard_error == Approx(std::sqrt(5.0 / 12)));
  const auto pairs = estimate(
      [](Stream& rng) {
        const auto i = static_cast<double>(rng.index());
        return std::complex<double>(i, -2 * i);
      },
      {.samples = 4});
  CHECK(pairs.components[0].variance == Approx(5.0 / 3));
  CHECK(pairs.components[1].variance == Approx(20.0 / 3));
  CHECK(pairs.components[1].standard_error == Approx(std::sqrt(20.0 / 12)));
}

TEST_CASE("two results that share one sample refuse to merge, and name it", "[core][estimate][exact]") {
  const auto draw = [](Stream& rng) { return rng.normal(); };
  const auto part = [&](std::int64_t first, std::int64_t samples) {
    return estimate(draw, {.samples = samples, .seed = 3, .first = first});
  };
  const auto a = part(512, 512);
  CHECK_THROWS_WITH(merge(a, part(1023, 100)), Catch::Contains("both results hold sample 1023"));
  CHECK_THROWS_WITH(merge(part(1023, 100), a), Catch::Contains("both results hold sample 1023"));
  CHECK_THROWS_WITH(merge(part(413, 100), a), Catch::Contains("both results hold sample 512"));
  CHECK(merge(part(1024, 100), a).samples == 612);
}

// What a run keeps of its chunks, and what a result makes of it. Faults that no other test saw (tests/mutants.txt).

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>

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

TEST_CASE("bytes whose sums or extremes are of fewer samples than their range are refused",
          "[core][checkpoint][exact]") {
  // One part of a chunk, so that every one of its samples is among both tails.
  constexpr std::size_t n = 300;
  const Bytes whole = encode(estimate([](Stream& rng) { return rng.normal(); }, {.samples = n, .seed = 3}).state);
  const auto set = [](Bytes& bytes, std::size_t at, std::uint64_t x) {
    ByteWriter w;
    w.number(x);
    std::copy(w.bytes.begin(), w.bytes.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
  };
  const auto number = [&whole](std::size_t at) {
    std::uint64_t x = 0;
    ByteReader(std::span(whole).subspan(at)).number(x);
    return x;
  };
  const std::size_t list = 8 + 8 * n;  // its size, and the values
  const std::size_t upper = whole.size() - 16 - (8 + 24 * Extremes::largest_capacity) - 2 * list;
  REQUIRE(number(upper) == n);
  REQUIRE(number(upper + list) == n);
  std::size_t node = 0;  // its first and last sample, whether it is whole, and how many values are in its sums
  while (!(number(node) == 0 && number(node + 8) == n && number(node + 16) == 0 && number(node + 24) == n)) ++node;
  CHECK(decode(whole).last() == static_cast<std::int64_t>(n));

  for (const std::uint64_t other : {std::uint64_t{0}, std::uint64_t{n - 1}, std::uint64_t{n + 1}}) {
    Bytes counted = whole;
    set(counted, node + 24, other);
    CHECK_THROWS_WITH(decode(counted), Catch::Contains("contradict each other"));
  }
  for (const std::size_t at : {upper, upper + list}) {
    Bytes without = whole;
    set(without, at, 0);
    const auto values = without.begin() + static_cast<std::ptrdiff_t>(at + 8);
    without.erase(values, values + static_cast<std::ptrdiff_t>(8 * n));
    CHECK_THROWS_WITH(decode(without), Catch::Contains("contradict each other"));
  }
}

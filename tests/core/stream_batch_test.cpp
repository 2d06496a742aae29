#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/accumulator.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>

using namespace debias;

TEST_CASE("a batch draws the numbers of its members alone, whatever its size and position", "[core][stream][exact]") {
  const Stream sample(5, 77);
  for (const std::size_t size : std::initializer_list<std::size_t>{1, 2, 3, 4, 5, 7, 8, 9, 31, 32, 33, 63, 64}) {
    for (const std::size_t first : std::initializer_list<std::size_t>{1, 2, 3, 8}) {
      for (const std::size_t then : std::initializer_list<std::size_t>{1, 2, 5}) {
        StreamBatch batch(sample, 3, size, 12);
        std::vector<double> u(first * size);
        std::vector<double> z(then * size);
        batch.uniforms(u);
        batch.normals(z);
        std::size_t wrong = 0;
        for (std::size_t b = 0; b < size; ++b) {
          Stream alone = sample.split(3 + b).split(12);
          for (std::size_t t = 0; t < first; ++t) wrong += u[t * size + b] != alone.uniform();
          for (std::size_t t = 0; t < then; ++t) wrong += z[t * size + b] != alone.normal();
          wrong += batch.stream(b).uniform() != alone.uniform();
        }
        CAPTURE(size, first, then);
        CHECK(wrong == 0);
      }
    }
  }
}

TEST_CASE("a stratified batch has one first uniform in each stratum, and its other uniforms as they were",
          "[core][stream][exact]") {
  constexpr std::size_t size = 20;
  constexpr std::int64_t strata = 50;
  StreamBatch plain(Stream(1, 2), 30, size, 4);
  StreamBatch batch(Stream(1, 2), 30, size, 4, 30, strata);
  std::vector<double> before(2 * size);
  std::vector<double> after(2 * size);
  plain.uniforms(before);
  batch.uniforms(after);
  for (std::size_t b = 0; b < size; ++b) {
    CHECK(after[b] == Approx((30.0 + static_cast<double>(b) + before[b]) / strata).epsilon(1e-15));
    CHECK(after[b] < 1);
    CHECK(after[size + b] == before[size + b]);
  }
  plain.uniforms(before);
  batch.uniforms(after);
  CHECK(before == after);
}

TEST_CASE("many normal quantiles are those of one number at a time", "[core][stream][exact]") {
  std::vector<double> u(1001);
  Stream(3, 0).fill(u);
  u[0] = 0x1p-53;
  u[1] = 1 - 0x1p-53;
  u[2] = 0.075;
  u[3] = 0.925;
  u[4] = 0.5;
  std::vector<double> z = u;
  normal_quantiles(z);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < u.size(); ++i) wrong += z[i] != normal_quantile(u[i]);
  CHECK(wrong == 0);
}

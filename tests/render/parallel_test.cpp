#include <atomic>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"
#include "render/parallel.hpp"

using debias::render::in_parallel;

TEST_CASE(
    "pieces run once each, an exception ends the others and comes back, and an interrupt leaves out what has not begun",
    "[render][exact]") {
  for (const int threads : {1, 2, 7}) {
    CAPTURE(threads);
    std::atomic<int> sum = 0;
    in_parallel(
        100, threads, [&](int i) { sum += i; }, [](int) { return true; });
    CHECK(sum == 4950);
    const auto piece = [&](int i) {
      if (i == 3) throw std::invalid_argument("piece " + std::to_string(i));
      ++sum;
    };
    sum = 0;
    CHECK_THROWS_WITH(in_parallel(100, threads, piece, [](int) { return true; }), "piece 3");
    if (threads == 1) CHECK(sum == 3);
    sum = 0;
    in_parallel(
        100, 1, [&](int) { ++sum; }, [](int finished) { return finished < 10; });
    CHECK(sum == 10);
  }
}

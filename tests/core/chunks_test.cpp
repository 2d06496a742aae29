// The one queue of a run: every chunk once, in order, to threads by ones and to ranks by aligned groups.

#include <cstdint>
#include <vector>

#include "catch_shim.hpp"

#include "core/chunks.hpp"

using namespace debias;
using debias::detail::Chunks;

namespace {

constexpr std::int64_t chunk = 768;  // of blocks of 3: no power of two

bool is_power_of_two(std::int64_t n) { return n > 0 && (n & (n - 1)) == 0; }

}  // namespace

TEST_CASE("threads get each chunk once and in order, whatever was cut", "[core][exact]") {
  for (const auto& [first, last] :
       {RunState::Range{0, 10 * chunk}, {300, 301}, {300, 5 * chunk}, {chunk, 3 * chunk + 3}, {0, 1}}) {
    Chunks chunks(chunk);
    chunks.give({first, last});
    chunks.give({7, 7});  // nothing
    std::int64_t position = first;
    std::int64_t left = (last - 1) / chunk - first / chunk + 1;
    while (!chunks.empty()) {
      CHECK(chunks.left() == left--);
      CHECK(chunks.next() == position);
      const auto [begin, end] = chunks.take();
      REQUIRE(begin == position);
      REQUIRE(end > begin);
      CHECK((end - 1) / chunk == begin / chunk);
      position = end;
    }
    CHECK(position == last);
    CHECK(left == 0);
    CHECK(chunks.take() == RunState::Range{0, 0});
  }
}

TEST_CASE("a rank gets whole aligned groups, large ones first, and single chunks at the end", "[core][exact]") {
  for (const std::int64_t ranks : {1, 2, 3, 100}) {
    for (const std::int64_t threads : {1, 3}) {
      Chunks chunks(chunk);
      const std::vector<RunState::Range> given = {{300, 1000 * chunk + 3}, {1500 * chunk, 2000 * chunk}};
      for (const RunState::Range& some : given) chunks.give(some);
      std::size_t range = 0;
      std::int64_t position = given[0].first;
      std::int64_t largest = 0;
      std::int64_t last_size = 0;
      while (!chunks.empty()) {
        const std::int64_t share = chunks.left() / (2 * ranks);
        const auto [begin, end] = chunks.take_share(ranks, threads);
        if (position == given[range].second) position = given[++range].first;
        REQUIRE(begin == position);
        position = end;
        const std::int64_t size = (end - 1) / chunk - begin / chunk + 1;
        CHECK(is_power_of_two(size));
        CHECK(begin / chunk % size == 0);
        CHECK(size <= std::max<std::int64_t>(share, threads));
        largest = std::max(largest, size);
        last_size = size;
      }
      CHECK(position == given[1].second);
      CHECK(largest >= 1500 / (8 * ranks));
      CHECK(last_size <= threads);
    }
  }
}

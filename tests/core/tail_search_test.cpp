#include <debias/core/tail_search.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "catch_shim.hpp"

TEST_CASE("A table of any length is searched for the largest j with u <= tails[j]", "[core][exact]") {
  for (std::size_t size = 2; size < 40; ++size) {
    std::vector<double> tails(size);
    for (std::size_t j = 0; j < size; ++j) tails[j] = std::ldexp(1.0, -static_cast<int>(j));
    for (std::size_t j = 0; j + 1 < size; ++j) {
      CAPTURE(size, j);
      CHECK(debias::search_tails(tails, tails[j]) == static_cast<std::int64_t>(j));
      CHECK(debias::search_tails(tails, std::nextafter(tails[j + 1], 1.0)) == static_cast<std::int64_t>(j));
    }
  }
}

TEST_CASE("Among equal tails the deepest level is sampled", "[core][exact]") {
  CHECK(debias::search_tails(std::vector<double>{1, 1, 1, 0.5, 0.5, 0.1}, 1.0) == 2);
  CHECK(debias::search_tails(std::vector<double>{1, 1, 1, 0.5, 0.5, 0.1}, 0.5) == 4);
}

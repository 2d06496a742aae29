#include <debias/statistics/meeting.hpp>

#include <cmath>
#include <cstdint>
#include <map>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>

using namespace debias;

namespace {

// Times of `n` chains as the level table keeps them: one by one below 64, then octaves.
template <class Draw>
std::vector<MeetingInterval> times_of(int n, std::uint64_t seed, const Draw& draw) {
  std::map<std::int64_t, MeetingInterval> rows;
  for (int i = 0; i < n; ++i) {
    Stream rng(seed, static_cast<std::uint64_t>(i));
    const auto t = static_cast<std::int64_t>(std::min(draw(rng), 1e15));
    std::int64_t first = t;
    std::int64_t last = t;
    if (t >= 64) {
      first = 64;
      while (t >= 2 * first) first *= 2;
      last = 2 * first - 1;
    }
    MeetingInterval& row = rows[first];
    row = {first, last, row.chains + 1};
  }
  std::vector<MeetingInterval> all;
  for (const auto& [first, row] : rows) all.push_back(row);
  return all;
}

double geometric(Stream& rng, double mean) { return 1 + std::floor(mean * rng.exponential()); }
double power(Stream& rng, double alpha) { return std::floor(5 * std::pow(rng.uniform(), -1 / alpha)); }

}  // namespace

TEST_CASE("meeting times with a geometric tail are light, whatever their mean and lag", "[chains][meeting][law]") {
  for (const double mean : {0.1, 1.0, 3.0, 17.0, 60.0, 1000.0, 1e6}) {
    for (const double lag : {0.0, 10.0, 500.0}) {
      for (const int n : {1000, 20000}) {
        int light = 0;
        for (std::uint64_t seed = 1; seed <= 20; ++seed) {
          light += meeting_tail(times_of(n, seed, [&](Stream& rng) { return lag + geometric(rng, mean); })).kind ==
                   MeetingKind::light;
        }
        INFO("mean " << mean << ", lag " << lag << ", " << n << " chains");
        CHECK(light >= 18);
      }
    }
  }
}

TEST_CASE("meeting times with a power below two are never light, and heavy where chains are many",
          "[chains][meeting][law]") {
  for (const double alpha : {0.5, 1.0, 1.5, 1.8}) {
    for (const int n : {1000, 20000}) {
      int light = 0;
      int heavy = 0;
      for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        const MeetingTail tail = meeting_tail(times_of(n, seed, [&](Stream& rng) { return power(rng, alpha); }));
        light += tail.kind == MeetingKind::light;
        heavy += tail.kind == MeetingKind::heavy;
      }
      INFO("alpha " << alpha << ", " << n << " chains");
      CHECK(light <= 2);
      if (alpha <= 1.5 && n == 20000) CHECK(heavy >= 15);
    }
  }
  int heavy = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    heavy += meeting_tail(times_of(20000, seed, [](Stream& rng) { return power(rng, 3); })).kind == MeetingKind::heavy;
  }
  CHECK(heavy == 0);
}

TEST_CASE("a second scale of time that few chains show is not light", "[chains][meeting][law]") {
  for (const double share : {0.005, 0.01, 0.02}) {
    int light = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      light += meeting_tail(times_of(1000, seed, [&](Stream& rng) {
                 const double scale = rng.uniform() < share ? 1e5 : 20;
                 return geometric(rng, scale);
               })).kind == MeetingKind::light;
    }
    INFO("share " << share);
    CHECK(light <= 1);
  }
}

TEST_CASE("chains that were cut are no chains that met", "[chains][meeting][exact]") {
  const std::vector<MeetingInterval> times{{1, 1, 500}, {2, 2, 250}, {3, 3, 150}, {128, 255, 100}};
  const MeetingTail met = meeting_tail(times);
  CHECK(met.cut == 0);
  CHECK(met.last == 255);
  const MeetingTail cut = meeting_tail(times, 100);
  CHECK(cut.cut == 100);
  CHECK(std::isinf(cut.late));
  CHECK(cut.kind != MeetingKind::light);
  CHECK_THAT(cut.sentence(), Catch::Contains("100 had not met when they were cut"));
  CHECK(meeting_tail({}).chains == 0);
}

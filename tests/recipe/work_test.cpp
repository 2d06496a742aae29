// Work whose growth falls from level to level: how a pilot goes on beyond the levels that it draws.

#include <cmath>
#include <cstdint>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/recipe.hpp>

#include "catalog/run_by.hpp"

using namespace debias;

namespace {

// D_k of sd 2^(-decay k / 2), and a work.
template <class Work>
auto levels_of(double decay, const Work& work) {
  return [decay, work](std::int64_t level, Stream& rng) {
    const double z = rng.normal();
    if (level == 0) return base(1 + z);
    return Draw<double>{1 + z, std::exp2(-decay * static_cast<double>(level) / 2) * z,
                        work(static_cast<double>(level))};
  };
}

// The growth of work in octaves a level, by a short pilot.
template <class S>
double growth_of(const S& levels) {
  const Advice a = advise(level_runs(levels), {.samples = 1 << 15, .seed = 3, .threads = 1}, RecipeOptions{});
  CHECK(a.survey.rows.back().level < 6);  // few levels were drawn
  return a.survey.evidence.work.value;
}

}  // namespace

TEST_CASE("work of trees is followed beyond the levels that a short pilot draws", "[recipe][exact]") {
  // Where they lead to: 1. The lines through what was drawn: 1.44, 1.67, 1.53.
  CHECK(growth_of(levels_of(2, [](double k) { return (k + 1) * std::exp2(k - 1); })) < 1.26);
  CHECK(growth_of(levels_of(2.5, [](double k) { return std::pow(k + 1, 1.5) * std::exp2(k - 1); })) < 1.4);
  CHECK(growth_of(levels_of(2.5, [](double k) { return std::pow(k + 1, 0.7) * std::exp2(1.2 * k); })) < 1.4);
}

TEST_CASE("work that grows like a power of 2, or ever faster, is taken from the levels that were drawn",
          "[recipe][exact]") {
  CHECK(std::abs(growth_of(levels_of(2.5, [](double k) { return std::exp2(1.4 * k); })) - 1.4) < 1e-9);
  CHECK(growth_of(levels_of(4, [](double k) { return std::exp2(1.5 * k + 0.1 * k * k); })) > 1.7);
}

TEST_CASE("the digital's delta to 0.02 takes a twentieth of the steps of bumping, pilots included",
          "[recipe][greeks][statistical]") {
  const catalog::Problem& p = catalog::find("E16");
  constexpr double bumping = 2.75e6;  // steps, at its best: bench/sensitivities_bench.cpp
  constexpr int seeds = 5;
  double work = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Plan plan{.seed = seed, .threads = 1, .goal = {.error = 0.02}};
    const Advice advice = advise(p.levels, plan, RecipeOptions{});
    const Statistics s = testing::run_by(advice, p, plan);
    CAPTURE(seed, s.work, s.pilot_work);
    CHECK(std::abs(s.components.front().mean - p.truth) < 4.5 * s.components.front().standard_error);
    work += s.work / seeds;
  }
  CHECK(work < bumping / 20);
}

TEST_CASE("levels that nobody has seen are drawn no more often than the last that was", "[recipe][exact]") {
  // Slopes at a barrier (E D_k^2 ~ 2^(-k / 2), rare): a run of 1e5 had 1e5 steps a member, most of them at such levels.
  const auto never_more = [](const LevelRuns& levels) {
    for (const std::int64_t samples : {30'000, 100'000}) {
      const Advice a = advise(levels, {.samples = samples, .seed = 1, .threads = 1}, RecipeOptions{});
      const std::int64_t first = a.base_level + (a.base == Base::every_sample ? 1 : 0);
      for (std::int64_t k = a.survey.rows.back().level + 1; k < a.survey.rows.back().level + 8; ++k) {
        CAPTURE(samples, k, a.pmf.spec());
        CHECK(a.pmf.mass(k - first) <= 1.001 * a.pmf.mass(k - 1 - first));
      }
      CHECK(a.predicted.work < 3000);
    }
  };
  never_more(catalog::find("E20").levels);
  const auto rare = [](double chance, double size) {
    return level_runs([=](std::int64_t level, Stream& rng) {
      const auto k = static_cast<double>(level);
      const double u = rng.uniform();
      if (level == 0) return base(u);
      return Draw<double>{u, u < std::exp2(-chance * k) ? std::exp2(size * k) : 0, std::exp2(k)};
    });
  };
  never_more(rare(1.5, 0.5));
  never_more(rare(1.2, 0.3));
}

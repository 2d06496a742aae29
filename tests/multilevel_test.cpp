#include <cmath>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"

#include <debias/multilevel.hpp>

using namespace debias;
using namespace debias::trial;

namespace {

/// Geometric Brownian motion would do; this one is exact: E I_k = 1 - 2^-k, Var D_k = 2^(-beta k), work 2^k.
struct Levels {
  double beta = 2;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double k = static_cast<double>(level);
    const double d = (level == 0 ? 0.0 : std::exp2(-k)) + std::exp2(-beta * k / 2) * rng.normal();
    return {level == 0 ? d : 1 - std::exp2(-k), d, std::exp2(k)};
  }
};

}  // namespace

TEST_CASE("multilevel keeps its root mean square error, variance and bias together", "[multilevel][statistical]") {
  for (const double beta : {1.0, 1.5, 2.0}) {
    const double error = 0.02;
    double square = 0;
    double bias = 0;
    const int seeds = 50;
    for (int seed = 1; seed <= seeds; ++seed) {
      const auto r = multilevel(Levels{beta}, error, {.seed = static_cast<std::uint64_t>(seed)});
      CHECK(r.converged);
      const double e = r.components[0].mean - 1;
      square += e * e / seeds;
      bias += e / seeds;
    }
    CAPTURE(beta, std::sqrt(square), bias);
    CHECK(std::sqrt(square) < 1.2 * error);
    CHECK(bias < 0);  // it is biased, and by no more than the share that it allows itself
    CHECK(bias > -std::sqrt(0.25) * error - 4.5 * error / std::sqrt(seeds));
  }
}

TEST_CASE("multilevel puts its draws where sqrt of variance over work asks for them", "[multilevel][statistical]") {
  const auto r = multilevel(Levels{2}, 0.01, {.seed = 3});
  double roots = 0;
  for (const MultilevelRow& row : r.rows) roots += std::sqrt(row.variance * row.work);
  double total = 0;
  for (const MultilevelRow& row : r.rows) {
    const double wanted = std::sqrt(row.variance / row.work) * roots / (0.75 * 1e-4);
    if (row.level < 4) CHECK(static_cast<double>(row.draws) == Approx(wanted).epsilon(0.1));
    total += static_cast<double>(row.draws) * row.work;
  }
  CHECK(r.work - r.pilot_work == Approx(total));  // the pilots have draws of their own
  CHECK(r.pilot_work < 2 * total);
  CHECK(r.alpha == Approx(1).margin(0.3));
  CHECK(r.bias > 0);
  CHECK(r.error() < 0.0105);
}

TEST_CASE("multilevel is the same for any threads and says when its levels are not enough", "[multilevel][exact]") {
  const auto one = multilevel(SquaredMean{}, 0.05, {.seed = 2, .threads = 1});
  const auto two = multilevel(SquaredMean{}, 0.05, {.seed = 2, .threads = 2});
  CHECK(one.components[0].mean == two.components[0].mean);
  CHECK(one.work == two.work);
  const auto cut = multilevel(Levels{2}, 0.01, {.seed = 2}, {.most_levels = 4});
  CHECK_FALSE(cut.converged);
  std::ostringstream text;
  text << cut;
  CHECK(text.str().find("NOT met") != text.str().npos);
  CHECK(text.str().find("Var D") == text.str().npos);
  text.str("");
  text << full(cut);
  CHECK(text.str().find("Var D") != text.str().npos);
}

namespace {

/// U (1 + sum of 2^(first - j) over first <= j <= k): no difference before level `first`.
struct Pause {
  std::int64_t first;
  Draw<double> at(std::int64_t level, double u) const {
    const auto of = [&](std::int64_t k) {
      double sum = 1;
      for (std::int64_t j = first; j <= k; ++j) sum += std::exp2(static_cast<double>(first - j));
      return u * sum;
    };
    return level == 0 ? base(of(0)) : coupled(of(level), of(level - 1), std::exp2(static_cast<double>(level)));
  }
  Draw<double> operator()(std::int64_t level, Stream& rng) const { return at(level, rng.uniform()); }
};

/// No differences at all, and says so.
struct Ends {
  std::int64_t exact_from = 0;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double u = rng.uniform();
    return level == 0 ? base(u) : coupled(u, u);
  }
};

/// A mean of 2^k draws, which needs no levels.
struct MeanOfDraws {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const std::int64_t n = std::int64_t{1} << level;
    double sum = 0;
    for (std::int64_t i = 0; i < n; ++i) sum += std::floor(1024 * rng.uniform());
    const double mean = sum / static_cast<double>(n);
    return level == 0 ? base(mean) : coupled(mean, mean, static_cast<double>(n));
  }
};

bool says_zeros(const MultilevelStatistics& m) {
  return !m.warnings.empty() && m.warnings.back().code == WarningCode::zero_differences;
}

}  // namespace

TEST_CASE("levels that have shown no difference meet no goal, unless they are the end", "[multilevel][exact]") {
  for (const std::int64_t first : {4, 6, 9}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const auto pause = multilevel(Pause{first}, 0.01, {.seed = seed});
      CHECK_FALSE(pause.goal_met());
      CHECK(says_zeros(pause));
    }
  }
  const auto seen = multilevel(Pause{2}, 0.01);
  CHECK(seen.goal_met());
  CHECK_FALSE(says_zeros(seen));
  const auto ends = multilevel(Ends{}, 0.01);
  CHECK(ends.goal_met());
  CHECK_FALSE(says_zeros(ends));
  const auto average = multilevel(MeanOfDraws{}, 10);
  CHECK(average.goal_met());
  CHECK_FALSE(says_zeros(average));
  const auto constant =
      multilevel([](std::int64_t level, Stream&) { return level == 0 ? base(7.0) : coupled(7.0, 7.0); }, 0.01);
  CHECK(constant.goal_met());
  CHECK_FALSE(says_zeros(constant));
}

TEST_CASE("multilevel refuses impossible errors and options", "[multilevel][exact]") {
  CHECK_THROWS_WITH(multilevel(Levels{}, 0), Catch::Contains("error = 0"));
  CHECK_THROWS_AS(multilevel(Levels{}, 1, {}, {.bias_share = 1}), std::invalid_argument);
  CHECK_THROWS_AS(multilevel(Levels{}, 1, {}, {.first_draws = 1}), std::invalid_argument);
  CHECK_THROWS_AS(multilevel(Levels{}, 1, {}, {.most_levels = 2}), std::invalid_argument);
}

// Levels whose draws have no moments: what a recipe and a survey say of them.

#include <cmath>
#include <string>

#include "catch_shim.hpp"

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/recipe.hpp>
#include <debias/reciprocal.hpp>
#include <debias/survey.hpp>

#include "statistics/tally.hpp"

using namespace debias;

namespace {

/// Weights of exp(-x^4/2 + x^2) under N(0, s^2).
struct Weights {
  double s;
  double operator()(Stream& rng) const {
    const double z = rng.normal();
    const double x = s * z;
    return std::exp(-x * x * x * x / 2 + x * x + z * z / 2);
  }
  [[nodiscard]] double truth() const {
    double integral = 0;
    for (int i = -6000; i <= 6000; ++i) {
      const double x = 1e-3 * i;
      integral += 1e-3 * std::exp(-x * x * x * x / 2 + x * x);
    }
    return s * std::sqrt(2 * 3.141592653589793) / integral;
  }
};

// Words of the inside, and numbers that are none.
bool is_internal(const std::string& text) {
  for (const char* word : {"best_masses", "nan", "was not drawn", "inf "}) {
    if (text.find(word) != text.npos) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("reciprocals of means of wild weights are right, open, or refused in words",
          "[evidence][inputs][statistical]") {
  struct Case {
    double s;
    std::int64_t lowest_base;
    int seeds;
  };
  for (const Case c : {Case{1, 0, 10}, Case{1, 3, 10}, Case{2, 0, 6}, Case{3, 0, 3}, Case{3, 5, 3}, Case{5, 0, 3}}) {
    CAPTURE(c.s, c.lowest_base);
    const Weights weights{c.s};
    int covered = 0;
    int ran = 0;
    for (int seed = 1; seed <= c.seeds; ++seed) {
      const Plan plan{.samples = 1 << 12, .seed = static_cast<std::uint64_t>(seed)};
      std::string said;
      try {
        const auto r = estimate(recipe(reciprocal(weights), {.lowest_base = c.lowest_base}), plan);
        ++ran;
        const Interval i = r.interval();
        covered += i.low <= weights.truth() && weights.truth() <= i.high;
        for (const Warning& remark : r.advice.survey.remarks) said += remark.text;
        for (const Warning& warning : r.warnings) said += warning.text;
      } catch (const std::invalid_argument& e) {
        said = e.what();
      }
      CAPTURE(said);
      CHECK_FALSE(is_internal(said));
      CHECK(said.find("every estimate") == said.npos);
    }
    CHECK(ran >= c.seeds - 1);
    CHECK(covered >= ran - (c.seeds >= 10 ? 2 : 1));
  }
}

TEST_CASE("a survey of levels without moments says so, and accuses no coupling", "[evidence][inputs][exact]") {
  const auto remarks = [](const Survey& s) {
    std::string all;
    for (const Warning& remark : s.remarks) all += remark.text + ". ";
    return all;
  };
  const std::string wild = remarks(survey(reciprocal(Weights{3}), 6, {.samples = 4096}));
  CAPTURE(wild);
  CHECK(wild.find("biased") == wild.npos);
  CHECK_FALSE(is_internal(wild));
  // From a level on that has moments.
  const Survey above = survey(reciprocal(Weights{3}), 6, {.samples = 4096}, 6);
  CHECK(above.rows.front().level == 6);
  CHECK(above.pmf_exists != Answer::no);
  // Power: a coupling that is wrong is still accused where the moments are finite.
  const auto wrong = [](std::int64_t level, Stream& rng) {
    const double x = rng.normal();
    const double h = std::exp2(-static_cast<double>(level));
    return level == 0 ? base(x + h) : coupled(x + h, x + h, 1.0);
  };
  CHECK(remarks(survey(wrong, 5, {.samples = 1 << 16})).find("biased") != std::string::npos);
}

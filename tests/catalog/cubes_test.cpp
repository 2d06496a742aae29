// Catalogue I01 to I06 as the program and Python run them.

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include "catalog/run_by.hpp"
#include "catch_shim.hpp"

#include <debias/functions.hpp>
#include <debias/nested.hpp>
#include <debias/recipe.hpp>
#include <debias/survey.hpp>

#include "catalog/make.hpp"

using namespace debias;

namespace {

// By a recipe: the path of `debias run ID --estimator recipe --points auto`.
Statistics by_recipe(const catalog::Problem& p, const Plan& plan, std::optional<Points> points) {
  RecipeOptions options;
  options.points = points;
  const Advice advice = advise(p.levels, plan, options);
  REQUIRE(advice.usable());
  Statistics s = testing::run_by(advice, p, plan);
  detail::follow(s, advice, plan.goal);
  return s;
}

}  // namespace

TEST_CASE("I01 to I06 are unbiased by PMF, and not off by a hundredth", "[cubes][catalog][statistical]") {
  for (const std::string id : {"I01", "I02", "I03", "I04", "I05", "I06"}) {
    const catalog::Problem& p = catalog::find(id);
    catalog::Choice choice;
    choice.pmf = catalog::default_pmf(p);
    choice.base_level = 4;
    const Statistics s = p.run(choice, {.samples = 1 << 13, .seed = 22});
    const ComponentEstimate& e = s.components.front();
    CAPTURE(id, e.mean, p.truth, e.standard_error);
    CHECK(std::abs(e.mean - p.truth) < 5.2 * e.standard_error);
    CHECK(std::abs(e.mean - 1.1 * p.truth) > 5.2 * e.standard_error);
  }
}

TEST_CASE("the differences of I01 to I06 fall as declared", "[cubes][catalog][stat]") {
  for (const std::string id : {"I01", "I02", "I03", "I04", "I05", "I06"}) {
    const catalog::Problem& p = catalog::find(id);
    const Survey s = survey(p.levels, 12, {.samples = 1024, .seed = 5});
    CAPTURE(id, s.evidence.decay.value);
    CHECK(s.evidence.decay.value >= p.rates.variance_decay);
  }
}

TEST_CASE("information gain takes less than a tenth of the work of independent draws from the prior",
          "[cubes][catalog][stat]") {
  struct Observed {
    std::array<double, 2> y;
    double residual;
  };
  const auto observe = [](Stream& rng) {
    Observed o{};
    for (double& y : o.y) y = rng.normal();
    for (double& y : o.y) {
      const double noise = rng.normal() / 2;
      y += noise;
      o.residual += noise * noise;
    }
    return o;
  };
  const auto ratio = [](const Observed& o, Stream& rng) {
    double squares = 0;
    for (const double y : o.y) {
      const double off = y - rng.normal();
      squares += off * off;
    }
    return std::exp(-2 * (squares - o.residual));
  };
  struct MinusLog {
    double operator()(double m) const { return -functions::Log{}(m); }
    double gap(double m, double d) const { return -functions::Log{}.gap(m, d); }
    double gap_of_halves(double a, double b) const { return -functions::Log{}.gap_of_halves(a, b); }
  };
  const catalog::Problem& gain = catalog::find("I06");
  const catalog::Problem prior =
      catalog::make({.name = "prior", .truth = gain.truth}, nested(observe, ratio, MinusLog{}), Rates{1.5, 1});
  const Statistics nets = by_recipe(gain, {.seed = 1, .goal = {.error = 1e-3}}, std::nullopt);
  const Statistics plain = by_recipe(prior, {.seed = 1, .goal = {.error = 1e-2}}, Points::plain);
  const ComponentEstimate& e = nets.components.front();
  const double scale = std::pow(plain.components.front().standard_error / e.standard_error, 2);
  UNSCOPED_INFO("nets: error " << e.standard_error << ", work " << nets.work << "; independent: error "
                               << plain.components.front().standard_error << ", work " << plain.work);
  CHECK(std::abs(e.mean - gain.truth) < 4.5 * e.standard_error);
  CHECK(10 * nets.work < scale * plain.work);
}

TEST_CASE("information gain meets a goal of .001 over 16 seeds, in a hundredth of the work of independent draws",
          "[cubes][catalog][stat]") {
  const catalog::Problem& gain = catalog::find("I06");
  constexpr double goal = 1e-3;
  double squares = 0;
  double work = 0;
  int missed = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    const Statistics s = by_recipe(gain, {.seed = seed, .threads = 1, .goal = {.error = goal}}, std::nullopt);
    const ComponentEstimate& e = s.components.front();
    missed += e.standard_error > goal;
    squares += std::pow((e.mean - gain.truth) / goal, 2) / 16;
    work += s.work / 16;
  }
  CAPTURE(squares, work, missed);
  CHECK(std::sqrt(squares) <= 1.1);
  CHECK(missed <= 1);  // sized by a pilot, one in twenty may
  CHECK(work < 6e6);   // of independent draws from the prior: 6e6 at a goal of .01, 100 times that here
}

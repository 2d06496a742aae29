#include <debias/derivative/bias.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <string>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/core/report.hpp>
#include <debias/derivative.hpp>
#include <debias/derivative/partial.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>

#include "catch_shim.hpp"

using namespace debias;

TEST_CASE("the bound of a run is in its result, printed, and kept by a merge", "[derivative][exact]") {
  const auto s = single_term(finite_difference([](double x) { return std::sin(x); }, 1.0));
  const auto a = estimate(s, {.samples = 4096});
  const auto b = estimate(s, {.samples = 4096, .first = 4096});
  CHECK(a.bias_bound.size > 0);
  CHECK(a.bias_bound.size < 1e-6);
  CHECK(merge(a, b).bias_bound.size == std::max(a.bias_bound.size, b.bias_bound.size));
  std::ostringstream text;
  text << a;
  CHECK_THAT(text.str(), Catch::Contains("at most") && Catch::Contains("end at level"));
  // strata keep it, and so does a recipe
  const auto in_blocks = estimate(stratified(s, 64), {.samples = 64 * 4096});
  CHECK(in_blocks.bias_bound.size > 0);
  CHECK(in_blocks.bias_bound.size < 1e-6);
  const auto by_recipe =
      estimate(recipe(finite_difference([](double x) { return std::sin(x); }, 1.0)), {.samples = 4096});
  CHECK(by_recipe.bias_bound.size > 0);
  // an unbiased estimator states none, and a rate that does not fall bounds nothing
  CHECK(estimate(single_term(finite_difference([](double x) { return x; }, 1.0, {}, {2, 0}), Geometric(0.5)),
                 {.samples = 64})
            .bias_bound.size < 1e-6);
  CHECK(estimate([](Stream& rng) { return rng.uniform(); }, {.samples = 64}).bias_bound.size == 0);
  const auto growing = finite_difference([](double x) { return std::sin(x); }, 1.0, {}, {-1, 0});
  CHECK(std::isinf(growing.bias_bound(LevelTable{}).size));
}

// ---- functions without noise: where the bound on the bias is a promise, and where it is none

namespace {

using Function = double (*)(double);  // one type: an estimator for each takes half a second to compile

template <class F>
BiasBound bound_of(F f, double at, const DifferenceOptions& options) {
  return estimate(single_term(finite_difference(f, at, options)), {.samples = 1 << 14}).bias_bound;
}

}  // namespace

TEST_CASE("jumps, cusps, poles and kinks have an infinite bound on the bias, which says why", "[derivative][exact]") {
  const auto refused = [](Function f, double at, Difference kind) {
    const BiasBound bound = bound_of(f, at, {.kind = kind, .first_step = 1.5});
    INFO("kind " << static_cast<int>(kind) << ": " << bound.sentence);
    CHECK(std::isinf(bound.size));
    CHECK_THAT(bound.sentence, Catch::Contains("the differences") || Catch::Contains("not finite"));
    CHECK_THAT(bound.sentence, !Catch::Contains("nan"));
  };
  const auto jump = [](double x) { return x >= 1 ? 1.0 : 0.0; };
  refused(jump, 1, Difference::central);  // mean 121 beside "at most 1.1e-4"
  refused(jump, 1, Difference::second);
  refused([](double x) { return x > 1 ? 1.0 : 0.0; }, 1, Difference::forward);
  refused([](double x) { return x > 0 ? 1e-3 : 0.0; }, 0, Difference::forward);
  refused([](double x) { return std::floor(x) + std::sin(x); }, 3, Difference::central);
  refused([](double x) { return std::sqrt(std::abs(x - 1)); }, 1, Difference::forward);
  refused([](double x) { return std::cbrt(x - 1); }, 1, Difference::central);
  refused([](double x) { return std::abs(x - 1); }, 1, Difference::second);                  // a kink
  refused([](double x) { return std::pow(std::abs(x - 1), 1.5); }, 1, Difference::forward);  // falls at half the rate
  refused([](double x) { return std::pow(std::abs(x), 2.5); }, 0, Difference::second);
  refused([](double x) { return 1 / (x - 1); }, 1, Difference::central);  // a pole
  refused([](double x) { return 1 / ((x - 1) * (x - 1)); }, 1, Difference::second);
  refused([](double x) { return std::log(std::abs(x - 1)); }, 1, Difference::second);
  refused([](double x) { return x == 1 ? 0 : (x - 1) * std::sin(std::log(std::abs(x - 1))); }, 1, Difference::forward);

  const Eigen::Vector2d at(1, 1);
  const auto mixed = [&](const Eigen::Vector2d& x) { return jump(x[0]) + std::sin(x[1]); };
  const auto of_gradient =
      estimate(single_term(gradient(mixed, at, {.kind = Difference::central})), {.samples = 1 << 12}).bias_bound;
  CHECK(std::isinf(of_gradient.size));
  CHECK_THAT(of_gradient.sentence, Catch::Contains("axis 0") && Catch::Contains("the differences"));
}

TEST_CASE("functions that fall as declared keep their bound, and it holds", "[derivative][exact]") {
  const auto keeps = [](Function f, double at, const DifferenceOptions& options, double truth) {
    const auto d = finite_difference(f, at, options);
    const auto r = estimate(single_term(d), {.samples = 1 << 12});
    INFO("kind " << static_cast<int>(options.kind) << " at " << at << ": " << r.bias_bound.sentence);
    CHECK(std::isfinite(r.bias_bound.size));
    Stream rng(1, 0);
    const double rounding_of_truth = 1e-15 * std::abs(truth);
    CHECK(std::abs(d.value_at(d.last_level(), rng).value - truth) <= r.bias_bound.size + rounding_of_truth);
  };
  for (const int extrapolations : {0, 2}) {
    for (const double at : {0.0, 1.0, 10.0}) {
      const DifferenceOptions forward{.extrapolations = extrapolations};
      const DifferenceOptions central{.kind = Difference::central, .extrapolations = extrapolations};
      const DifferenceOptions second{.kind = Difference::second, .extrapolations = extrapolations};
      keeps([](double x) { return std::exp(x); }, at, forward, std::exp(at));
      keeps([](double x) { return std::exp(x); }, at, second, std::exp(at));
      keeps([](double x) { return std::sin(x); }, at, central, std::cos(at));
      keeps([](double x) { return std::sin(x); }, at, forward, std::cos(at));
      const DifferenceOptions fine{.kind = Difference::central, .first_step = 0.05, .extrapolations = extrapolations};
      keeps([](double x) { return std::sin(20 * x); }, at, fine, 20 * std::cos(20 * at));
      keeps([](double x) { return 1 / (1 + x * x); }, at, central, -2 * at / ((1 + at * at) * (1 + at * at)));
      keeps([](double x) { return x * x - 3 * x; }, at, forward, 2 * at - 3);
      keeps([](double x) { return x * x * x; }, at, second, 6 * at);
      keeps([](double x) { return 5 - 2 * x; }, at, central, -2);
    }
  }
  keeps([](double x) { return std::abs(x - 1); }, 1, {}, 1);      // a derivative from the right
  keeps([](double x) { return std::abs(x - 1); }, 1.001, {}, 1);  // a kink that the steps leave behind
  keeps([](double x) { return x == 0 ? std::nan("") : std::sin(x) / x; }, 0, {.kind = Difference::central}, 0);
  // with the rate that a cusp has: x^1.5 falls like 2^(-k/2)
  const auto cusp = finite_difference([](double x) { return std::pow(x, 1.5); }, 0, {.last_level = 20}, Rates{1, 0});
  const auto r = estimate(single_term(cusp, Geometric(0.4)), {.samples = 1 << 12});
  CHECK(std::isfinite(r.bias_bound.size));
  CHECK(std::sqrt(1.5 * std::exp2(-20)) <= r.bias_bound.size);
}

TEST_CASE("equal differences of a random function are growth, not doubt", "[derivative][exact]") {
  // The kurtosis of equal numbers is a rounding below 1, and its root was no number.
  const auto jump = [](double x, Stream&) { return x >= 1 ? 1.0 : 0.0; };
  const auto flat = [](double x, Stream&) {
    return x == 1 ? 0 : (x - 1) * std::sin(std::numbers::pi * std::log2(x - 1));
  };
  const auto smooth = [](double x, Stream&) { return std::sin(x); };
  CHECK(std::isinf(bound_of(jump, 1, {.kind = Difference::central}).size));
  CHECK(std::isinf(bound_of(flat, 1, {}).size));
  CHECK(bound_of(smooth, 1, {}).size < 1e-3);
}

// The interval of a mean whose stated bias was 23 times its half width was called reliable.
TEST_CASE("an interval that leaves out the stated bias is not reliable, and says so", "[derivative][exact]") {
  const auto judged = [](const auto& result) {
    const RunVerdict verdict = result.verdict();
    std::ostringstream brief;
    std::ostringstream whole;
    brief << result;
    whole << full(result);
    const bool marked = brief.str().find(" (without the bias)\n") != std::string::npos;
    CHECK(marked == (brief.str().find("The interval leaves out the stated bias, ") != std::string::npos));
    CHECK(marked == (whole.str().find("The interval leaves out the stated bias, ") != std::string::npos));
    CHECK(verdict.interval_reliable() == !marked);
    return verdict.interval_reliable();
  };
  const auto sine = [](double x) { return std::sin(x); };
  const auto noisy = [](double x, Stream& rng) { return std::cos(x * rng.normal()); };
  const Plan plan{.samples = 1 << 14, .threads = 1};
  CHECK(judged(estimate(single_term(finite_difference(sine, 1.0)), plan)));
  CHECK(judged(estimate(single_term(finite_difference(noisy, 1.0)), plan)));
  CHECK(judged(estimate(single_term(finite_difference(noisy, 1.0, {.last_level = 12})), plan)));
  // bias of the last level, rounding of a large value, and no difference at all to tell how they fall
  CHECK_FALSE(judged(estimate(single_term(finite_difference(sine, 1.0, {.last_level = 4})), plan)));
  CHECK_FALSE(judged(estimate(recipe(finite_difference([](double x) { return 1e6 + std::sin(x); }, 1.0)), plan)));
  CHECK_FALSE(judged(estimate(recipe(finite_difference(noisy, 1.0, {.last_level = 2})), plan)));
}

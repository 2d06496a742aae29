// NaN and infinity from stochastic differential equations, Markov chains and derivatives.

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include <Eigen/Core>

#include "faults.hpp"

#include <debias/derivative.hpp>
#include <debias/derivative/partial.hpp>
#include <debias/sde.hpp>
#include <debias/sde/summaries.hpp>
#include <debias/sde/vector.hpp>
#include <debias/steady_state.hpp>

using namespace debias;
using namespace debias::faults;

namespace {

enum class Where { drift, diffusion, derivative, payoff };

// A geometric Brownian motion, one coefficient of which may be none.
struct BadSde {
  Where where;
  double start = 1;
  double horizon = 1;
  [[nodiscard]] double drift(double x, double /*t*/) const { return at(Where::drift, 0.05 * x); }
  [[nodiscard]] double diffusion(double x, double /*t*/) const { return at(Where::diffusion, 0.2 * x); }
  [[nodiscard]] double diffusion_derivative(double /*x*/, double /*t*/) const { return at(Where::derivative, 0.2); }
  [[nodiscard]] double at(Where coefficient, double right) const { return where == coefficient ? bad(right) : right; }
};

struct BadVectorSde {
  Where where;
  Eigen::Vector2d start = {1, 1};
  double horizon = 1;
  [[nodiscard]] Eigen::Vector2d drift(const Eigen::Vector2d& x, double /*t*/) const {
    return Eigen::Vector2d(where == Where::drift ? bad(0.1) : 0.1, -0.1 * x[1]);
  }
  [[nodiscard]] Eigen::Matrix2d diffusion(const Eigen::Vector2d& x, double /*t*/) const {
    Eigen::Matrix2d b = Eigen::Matrix2d::Zero();
    b(0, 0) = where == Where::diffusion ? bad(0.2 * x[0]) : 0.2 * x[0];
    b(1, 1) = 0.1;
    return b;
  }
  [[nodiscard]] Eigen::Matrix2d diffusion_along(const Eigen::Vector2d& /*x*/, double /*t*/,
                                                const Eigen::Vector2d& v) const {
    Eigen::Matrix2d b = Eigen::Matrix2d::Zero();
    b(0, 0) = where == Where::derivative ? bad(0.2 * v[0]) : 0.2 * v[0];
    return b;
  }
};

const char* name_of(Where where) {
  constexpr const char* names[] = {"drift", "diffusion", "diffusion_derivative", "payoff"};
  return names[static_cast<int>(where)];
}

}  // namespace

TEST_CASE("no path hides a NaN or an infinite coefficient behind its summary or payoff", "[nan][exact]") {
  // Payoffs whose comparisons would make a number of a NaN.
  const auto of_end = [](double x) { return std::max(0.0, std::min(2.0, x - 1)); };
  const auto of_minimum = [](const Minimum& path) { return std::max(0.0, 1 - path.minimum); };
  const auto of_maximum = [](const Maximum& path) { return std::max(0.0, path.maximum - 1); };
  const auto of_average = [](const Average& path) { return std::max(0.0, path.average() - 1); };
  const auto of_above = [](const StaysAbove& path) { return std::min(1.0, path.probability); };
  const auto of_below = [](const StaysBelow& path) { return std::min(1.0, path.probability); };
  for (const Where where : {Where::drift, Where::diffusion}) {
    const BadSde model{where};
    check_sequence("euler", name_of(where), euler(model, of_end));
    check_sequence("euler", name_of(where), euler(model, Minimum{}, of_minimum));
  }
  for (const Where where : {Where::drift, Where::diffusion, Where::derivative}) {
    const BadSde model{where};
    check_sequence("milstein", name_of(where), milstein(model, of_end));
    check_sequence("milstein", name_of(where), milstein(model, Minimum{}, of_minimum));
    check_sequence("milstein", name_of(where), milstein(model, Maximum{}, of_maximum));
    check_sequence("milstein", name_of(where), milstein(model, Average{}, of_average));
    check_sequence("milstein", name_of(where), milstein(model, StaysAbove{0.8}, of_above));
    check_sequence("milstein", name_of(where), milstein(model, StaysBelow{1.2}, of_below));
  }
  const GeometricBrownianMotion stock{.volatility = 0.2};
  check_sequence("milstein", "payoff", milstein(stock, [](double x) { return bad(x); }));
  check_sequence("euler", "payoff", euler(stock, Minimum{}, [](const Minimum& path) { return bad(path.minimum); }));
  const AverageOf of{[](double x) { return bad(x); }};
  const auto capped = [](const auto& path) { return std::min(2.0, path.average()); };
  check_sequence("euler", "function of AverageOf", euler(stock, of, capped));

  const auto first = [](const Eigen::Vector2d& x) { return std::max(0.0, x[0] - 1); };
  const auto second = [](const Eigen::Vector2d& x) { return std::max(0.0, x[1]); };  // that the fault does not reach
  for (const Where where : {Where::drift, Where::diffusion}) {
    check_sequence("euler", std::string("vector ") + name_of(where), euler(BadVectorSde{where}, first));
  }
  for (const Where where : {Where::drift, Where::diffusion, Where::derivative}) {
    const BadVectorSde model{where};
    check_sequence("milstein", std::string("vector ") + name_of(where), milstein(model, second));
    check_sequence("antithetic_milstein", name_of(where), antithetic_milstein(model, first));
  }
  check_sequence("antithetic_milstein", "payoff",
                 antithetic_milstein(BadVectorSde{Where::payoff}, [](const auto& x) { return bad(x[0]); }));
}

TEST_CASE("summaries keep a NaN whatever comes before and after it", "[nan][exact]") {
  const double nan = poisons[0];
  const Bridge good{1, 1.1, 0.2, 0.1};
  for (const Bridge& wrong : {Bridge{1, nan, 0.2, 0.1}, Bridge{nan, 1, 0.2, 0.1}, Bridge{1, 1.1, nan, 0.1}}) {
    Minimum least;
    Maximum greatest;
    Average mean;
    StaysAbove above{1.05};  // between the ends: the path may have crossed
    StaysBelow below{1.05};
    for (const Bridge& bridge : {good, wrong, good}) {
      least.add(bridge, 0.3);
      greatest.add(bridge, 0.3);
      mean.add(bridge, 0.3);
      above.add(bridge, 0.3);
      below.add(bridge, 0.3);
    }
    CHECK(std::isnan(least.minimum));
    CHECK(std::isnan(greatest.maximum));
    CHECK(std::isnan(mean.average()));
    CHECK(std::isnan(above.probability));
    CHECK(std::isnan(below.probability));
    CHECK(std::isnan(wrong.crossing(wrong.from - 1.05, wrong.to - 1.05)));
  }
}

TEST_CASE("the minimum of a path whose coefficients end is no number", "[nan][exact]") {
  struct Ends : GeometricBrownianMotion {
    [[nodiscard]] double drift(double x, double t) const { return t < 0.5 ? 0.05 * x : poisons[0]; }
    [[nodiscard]] double diffusion(double x, double t) const { return t < 0.5 ? 0.2 * x : poisons[0]; }
  };
  const auto levels = milstein(Ends{}, Minimum{}, [](const Minimum& path) { return path.minimum; });
  for (int i = 0; i < 64; ++i) {
    Stream rng(1, static_cast<std::uint64_t>(i));
    CHECK(std::isnan(levels(3, rng).difference));
  }
}

TEST_CASE("no chain hides a NaN or an infinity of its step", "[nan][exact]") {
  const auto wait = [](double x) { return std::min(5.0, x); };
  check_sequence(
      "steady_state", "step",
      steady_state([](double x, Stream& rng) { return bad(0.5 * x + rng.normal()); }, 0.0, wait, contraction(0.5)));
  check_sequence("steady_state", "f",
                 steady_state([](double x, Stream& rng) { return 0.5 * x + rng.normal(); }, 0.0,
                              [](double x) { return bad(x); }, contraction(0.5)));
  const auto hidden = [](double x, Stream& rng) {
    return std::isfinite(x) ? bad(0.5 * x + rng.normal()) : rng.normal();  // goes on from a NaN as if nothing were
  };
  check_sequence("steady_state", "step that hides it", steady_state(hidden, 0.0, wait, contraction(0.5)));
  for (const double start : poisons) {
    CHECK_THROWS_AS(steady_state([](double x, Stream&) { return x; }, start, wait, contraction(0.5)),
                    std::invalid_argument);
  }
}

TEST_CASE("no derivative hides a NaN or an infinity of its function", "[nan][exact]") {
  const auto plain = [](double x) { return bad(std::sin(x)); };
  const auto random = [](double x, Stream& rng) { return bad(std::sin(x + rng.normal())); };
  for (const Difference kind : {Difference::forward, Difference::central, Difference::second}) {
    check_sequence("finite_difference", "f(x)", finite_difference(plain, 1.0, {.kind = kind, .extrapolations = 1}));
    check_sequence("finite_difference", "f(x, rng)", finite_difference(random, 1.0, {.kind = kind}));
    check_sequence("finite_difference", "f beyond the last level",
                   finite_difference(random, 1.0, {.kind = kind, .last_level = 1}));
  }
  check("complex_step", "f", complex_step([](const std::complex<double>& z) { return bad(1) * std::exp(z); }, 1.0));
  const Eigen::Vector2d at(0.3, 0.2);
  check_sequence("gradient", "f", gradient([](const Eigen::Vector2d& x) { return bad(x[0] * std::exp(x[1])); }, at));
  check_sequence(
      "gradient", "f",
      gradient([](const Eigen::Vector2d& x, Stream& rng) { return bad(x[0] * rng.uniform()); }, at, {.last_level = 2}));
  check_sequence(
      "jacobian", "f",
      jacobian([](const Eigen::Vector2d& x) { return Eigen::Vector2d(x[0], bad(x[1])); }, at, Eigen::Matrix2d{}));
}

// Goals of recipes that may take nets, on problems that no rule of nets was tuned on.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/functions.hpp>
#include <debias/nested.hpp>
#include <debias/recipe.hpp>
#include <debias/sde.hpp>
#include <debias/steady_state.hpp>

using namespace debias;

namespace {

struct Score {
  double rms = 0;     // of the true error, in goals
  double stated = 0;  // of the standard error
  double covered = 0;
  int by_nets = 0;
};

template <BiasedSequence S>
Score score(const S& sequence, double truth, double error, int seeds = 64) {
  Score s;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto r =
        estimate(recipe(sequence), {.seed = 77'000 + static_cast<std::uint64_t>(seed), .goal = {.error = error}});
    s.rms += (r.mean - truth) * (r.mean - truth) / (error * error * seeds);
    s.stated += r.standard_error * r.standard_error / (error * error * seeds);
    const Interval i = r.interval();
    s.covered += i.low <= truth && truth <= i.high ? 1.0 / seeds : 0;
    s.by_nets += r.advice.points == Points::nets ? 1 : 0;
  }
  s.rms = std::sqrt(s.rms);
  s.stated = std::sqrt(s.stated);
  return s;
}

/// Wanted are 1.1 goals and 95 %; 64 seeds know an rms to 9 %, and a coverage of .95 to .027.
void check(const char* name, const auto& sequence, double truth, double error) {
  const Score s = score(sequence, truth, error);
  CAPTURE(name, error, s.rms, s.stated, s.covered, s.by_nets);
  CHECK(s.rms < 1.4);
  CHECK(s.covered > 0.85);
}

/// f of the integral of g(t, W_t), g(0, 0) = 0, over [0, 1], by trapezoids of `steps` 2^level steps.
template <class G, class F>
auto integral_along(std::int64_t steps, const G& g, const F& f) {
  return [=](std::int64_t level, Stream& rng) {
    const std::int64_t n = steps << level;
    const double h = 1.0 / static_cast<double>(n);
    BrownianPath path(rng, n);
    double w = 0;
    double fine = 0;
    double coarse = 0;
    for (std::int64_t i = 1; i <= n; ++i) {
      w += path.next();
      const double x = (i == n ? 0.5 : 1) * g(static_cast<double>(i) * h, w);
      fine += x * h;
      if (i % 2 == 0) coarse += x * 2 * h;
    }
    const double work = static_cast<double>(n);
    return level == 0 ? base(f(fine), work) : coupled(f(fine), f(coarse), work);
  };
}

double normal_probability(double x) { return std::erfc(-x / std::numbers::sqrt2) / 2; }

}  // namespace

TEST_CASE("goals are met on average where levels fall faster at first than in the end",
          "[nets][unseen][recipe][stat]") {
  // E X^3 of an Ornstein-Uhlenbeck process by Euler's steps; no rates are declared.
  const auto cube = [](std::int64_t level, Stream& rng) {
    const std::int64_t n = std::int64_t{1} << level;
    const double h = 1.0 / static_cast<double>(n);
    BrownianPath w(rng, n);
    double fine = 1;
    double coarse = 1;
    double both = 0;
    for (std::int64_t i = 0; i < n; ++i) {
      const double dw = w.next();
      fine += -1.5 * fine * h + 0.7 * dw;
      both += dw;
      if (i % 2 == 1) {
        coarse += -1.5 * coarse * 2 * h + 0.7 * both;
        both = 0;
      }
    }
    const double work = static_cast<double>(level == 0 ? n : n + n / 2);
    return level == 0 ? base(fine * fine * fine, work) : coupled(fine * fine * fine, coarse * coarse * coarse, work);
  };
  const double mean = std::exp(-1.5);
  const double variance = 0.49 / 3 * (1 - std::exp(-3.0));
  const double truth = mean * mean * mean + 3 * mean * variance;
  check("cube of a process that reverts", cube, truth, 0.004);
  check("cube of a process that reverts", cube, truth, 0.001);
}

TEST_CASE("goals are met on average by options that no rule was tuned on", "[nets][unseen][recipe][stat]") {
  const double strike = 110;
  const double sd = 0.35 * std::sqrt(0.5);
  const double d1 = (std::log(100 / strike) + 0.5 * (0.02 + 0.35 * 0.35 / 2)) / sd;
  const double put = strike * std::exp(-0.01) * normal_probability(sd - d1) - 100 * normal_probability(-d1);
  const auto by_steps =
      milstein(GeometricBrownianMotion{.start = 100, .growth = 0.02, .volatility = 0.35, .horizon = 0.5},
               [](double s) { return std::max(110 - s, 0.0) * std::exp(-0.01); });
  check("put", by_steps, put, 0.03);
  check("put", by_steps, put, 0.008);
}

TEST_CASE("goals are met on average by nested expectations that no rule was tuned on", "[nets][unseen][recipe][stat]") {
  const auto outer = [](Stream& rng) { return rng.normal(); };
  const auto inner = [](double y, Stream& rng) { return y + 1.5 * rng.normal() - 0.3; };
  const auto kink = nested(outer, inner, functions::PositivePart{}, Rates{1.5, 1});
  check("kink", kink, normal_density(0.3) - 0.3 * normal_probability(-0.3), 0.005);
}

namespace {

/// d/ds E max(u, s) at s = .37: .37. A difference is a rare event that grows rarer with the level.
struct SlopeAtKink {
  Rates rates{1, 0};
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double s = 0.37;
    const double u = rng.uniform();
    // (max(u, s + h) - max(u, s)) / h, without rounding: it has no horizon.
    const auto quotient = [&](double h) { return std::clamp((s - u) / h + 1, 0.0, 1.0); };
    const double h = std::exp2(-static_cast<double>(level + 1));
    return level == 0 ? base(quotient(h), 1.0) : coupled(quotient(h), quotient(2 * h), 1.0);
  }
};

}  // namespace

TEST_CASE("goals are met on average where differences are rare", "[nets][unseen][recipe][stat]") {
  check("slope at a kink", SlopeAtKink{}, 0.37, 0.01);
  check("slope at a kink", SlopeAtKink{}, 0.37, 0.002);
}

TEST_CASE("goals are met on average by a functional of a whole path", "[nets][unseen][recipe][stat]") {
  // E exp(-int_0^1 W^2 dt / 2) = 1 / sqrt(cosh 1) [Cameron & Martin 1945], by trapezoids.
  const auto by_trapezoids = integral_along(
      2, [](double, double w) { return w * w; }, [](double integral) { return std::exp(-integral / 2); });
  const double truth = 1 / std::sqrt(std::cosh(1.0));
  check("exponential functional", by_trapezoids, truth, 0.002);
  check("exponential functional", by_trapezoids, truth, 0.0005);
}

// Written when goals had learned to leave out levels that no run draws, tails to fit declared rates, and bases to stay below levels
// that look heavy above light ones: the problems above had taken part in that.

TEST_CASE("goals are met on average by a nested maximum that no later rule was tuned on",
          "[nets][unseen][recipe][stat]") {
  const auto outer = [](Stream& rng) { return rng.exponential(); };
  const auto inner = [](double y, Stream& rng) { return y - 1 + 3 * (rng.uniform() - 0.5); };
  check("maximum", nested(outer, inner, functions::PositivePart{}, Rates{1.5, 1}), std::exp(-1.0), 0.004);
}

namespace {

/// c_k (1 + Z), c_k = 2^(-5 k / 2) / 2 + 2^(-3 k / 4) / 50: as declared in the limit, and much steeper before.
struct SteepAtFirst {
  Rates rates{1.5, 1};
  static double sum(std::int64_t level) {
    double sum = 0;
    for (std::int64_t k = 0; k <= level; ++k) sum += size(k);
    return sum;
  }
  static double size(std::int64_t level) {
    const auto k = static_cast<double>(level);
    return 0.5 * std::exp2(-2.5 * k) + 0.02 * std::exp2(-0.75 * k);
  }
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double factor = 1 + rng.normal();
    return {sum(level) * factor, (level == 0 ? sum(0) : size(level)) * factor, std::exp2(static_cast<double>(level))};
  }
};

}  // namespace

TEST_CASE("goals are met on average where declared rates come late, which no rule was tuned on",
          "[nets][unseen][recipe][stat]") {
  const double truth = 0.5 / (1 - std::exp2(-2.5)) + 0.02 / (1 - std::exp2(-0.75));
  check("steep at first", SteepAtFirst{}, truth, 0.003);
}

TEST_CASE("goals are met on average by the survival of a path above a barrier that no rule was tuned on",
          "[nets][unseen][recipe][stat]") {
  // P(min S > B) = Phi((m - b) / s) - e^(2 m b / s^2) Phi((m + b) / s), m = r - s^2 / 2, b = log(B / S), T = 1.
  const double s = 0.25;
  const double m = 0.03 - s * s / 2;
  const double b = std::log(0.88);
  const double truth =
      normal_probability((m - b) / s) - std::exp(2 * m * b / (s * s)) * normal_probability((m + b) / s);
  const GeometricBrownianMotion stock{.start = 100, .growth = 0.03, .volatility = s};
  const auto survival = [](const StaysAbove& path) { return path.probability; };
  check("survival", milstein(stock, StaysAbove{88}, survival, {1.5, 1}), truth, 0.002);
}

// Written to judge a rule that was not taken: 64 points at least for levels beyond the third, which missed goals twice as often.

TEST_CASE("goals are met on average by a stationary chain that no rule was tuned on", "[nets][unseen][recipe][stat]") {
  // X = .7 X + U: E e^(X / 2) is the product of (e^a - 1) / a over a = .7^j / 2.
  double truth = 1;
  for (double a = 0.5; a > 1e-18; a *= 0.7) truth *= std::expm1(a) / a;
  const auto chain = steady_state([](double x, Stream& rng) { return 0.7 * x + rng.uniform(); }, 0.0,
                                  [](double x) { return std::exp(x / 2); }, contraction(0.7));
  check("chain", chain, truth, 0.01);
  check("chain", chain, truth, 0.002);
}

TEST_CASE("goals are met on average by a geometric average that no rule was tuned on", "[nets][unseen][recipe][stat]") {
  // The logarithm of the average of a stock: normal, of mean m / 2 and variance s^2 / 3, m = r - s^2 / 2 (Kemna & Vorst 1990).
  const double s = 0.3;
  const double m = 0.02 - s * s / 2;
  const double deviation = s / std::sqrt(3.0);
  const double d = (m / 2 - std::log(1.1)) / deviation + deviation;
  const double forward = std::exp(m / 2 + deviation * deviation / 2);
  const double truth = 100 * (forward * normal_probability(d) - 1.1 * normal_probability(d - deviation));
  const auto call = integral_along(
      1, [=](double t, double w) { return m * t + s * w; },
      [](double log_average) { return 100 * std::max(std::exp(log_average) - 1.1, 0.0); });
  check("geometric average", call, truth, 0.02);
  check("geometric average", call, truth, 0.004);
}

TEST_CASE("goals are met on average by a nested logarithm that no rule was tuned on", "[nets][unseen][recipe][stat]") {
  // E log E[e^(y + .8 Z) | y] = E y + .32, y uniform.
  const auto outer = [](Stream& rng) { return rng.uniform(); };
  const auto inner = [](double y, Stream& rng) { return std::exp(y + 0.8 * rng.normal()); };
  check("logarithm", nested(outer, inner, functions::Log{}, Rates{2, 1}), 0.82, 0.005);
  check("logarithm", nested(outer, inner, functions::Log{}, Rates{2, 1}), 0.82, 0.0015);
}

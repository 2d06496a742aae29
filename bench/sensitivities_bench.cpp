// Payoffs that jump and derivatives in parameters, to a standard error, pilot included, in steps of all paths: the recipe on trees
// and on conditional last steps beside plain multilevel levels and beside bumping with common random numbers
// (greeks/...: steps_ratio = ours / theirs, *_rms = true errors in units of the goal). And dual numbers: ours beside Boost.Math's
// (dual/...).

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include <benchmark/benchmark.h>
#include <boost/math/differentiation/autodiff.hpp>

#include <debias/recipe.hpp>
#include <debias/sde.hpp>
#include <debias/sde/sensitivities.hpp>

#include "baseline_multilevel.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

constexpr double r = 0.05;
constexpr double sigma = 0.2;
constexpr double spot = 100;
const double discount = std::exp(-r);
const GeometricBrownianMotion stock{.start = spot, .growth = r, .volatility = sigma, .horizon = 1};
const auto market = []<class X>(const X& s, const X& v) {
  return BlackScholes<X>{.start = s, .rate = X(r), .volatility = v};
};
const auto call = discounted(CallPayoff{100});
const auto digital_payoff = discounted(DigitalPayoff{100, 100});
double digital(double s) { return s > 100 ? 100 * discount : 0; }

// ---- to a standard error

struct Score {
  double steps = 0;
  double squares = 0;
  void add(double work, double error) {
    steps += work;
    squares += error * error;
  }
};

template <class Theirs>
void beside(benchmark::State& state, const auto& sequence, double truth, double goal, const Theirs& theirs) {
  constexpr int runs = 5;
  Score a;
  Score b;
  for (auto _ : state) {
    for (std::uint64_t seed = 1; seed <= runs; ++seed) {
      const auto result = estimate(recipe(sequence), {.seed = seed, .threads = 1, .goal = {.error = goal}});
      a.add(result.work, result.mean - truth);
      const auto answer = theirs(goal, Stream(seed, 0));
      b.add(answer.work, answer.value - truth);
    }
  }
  state.counters["steps_ratio"] = a.steps / b.steps;
  state.counters["our_steps"] = a.steps / runs;
  state.counters["their_steps"] = b.steps / runs;
  state.counters["our_rms"] = std::sqrt(a.squares / runs) / goal;
  state.counters["their_rms"] = std::sqrt(b.squares / runs) / goal;
}

// Multilevel Monte Carlo on plain levels of ours: bias 2^-k, differences 2^-k of both the digital and pathwise deltas.
auto multilevel_of(const auto& levels) {
  return [levels](double goal, Stream&& rng) {
    const auto difference = [&levels](int level, Stream& numbers) { return levels(level, numbers).difference; };
    const auto work = [](int level) { return level == 0 ? 1 : 1.5 * static_cast<double>(1 << level); };
    return plain::multilevel(difference, work, goal, 1, 1, std::move(rng));
  };
}

// Central differences over common random numbers with the steps n and the bump h that need the least work for the error:
// |bias| = that of the bump by the exact law + .0902 / n, Milstein's (by convolution of its steps, n = 64; .058 at n = 1), which
// may not cancel; variance = P(ends apart) (100 discount)^2 / (4 h^2). Nobody who does not know the answer has them.
plain::MultilevelAnswer bumped_digital(double goal, Stream&& rng) {
  const auto price = [](double s) {
    const double d = (std::log(s / 100) + r - sigma * sigma / 2) / sigma;
    return 100 * discount * std::erfc(-d / std::sqrt(2.0)) / 2;
  };
  const double truth = 1.876201734584689;
  double best = 1e300;
  int steps = 1;
  double bump = 1;
  for (int n = 1; n <= 256; ++n) {
    for (double h = 0.25; h < 30; h *= 1.05) {
      const double slope = (price(spot + h) - price(spot - h)) / (2 * h);
      const double bias = std::abs(slope - truth) + 0.0902 / n;
      const double apart = (price(spot + h) - price(spot - h)) * 100 * discount / (4 * h * h);
      const double left = goal * goal - bias * bias;
      if (!(left > 0)) continue;
      const double work = 2 * n * (apart - slope * slope) / left;
      if (work < best) {
        best = work;
        steps = n;
        bump = h;
      }
    }
  }
  const auto samples = static_cast<std::int64_t>(best / (2 * steps));
  const double h = 1.0 / steps;
  double sum = 0;
  for (std::int64_t i = 0; i < samples; ++i) {
    double factor = 1;  // both paths are multiples of one
    for (int j = 0; j < steps; ++j) {
      const double dw = std::sqrt(h) * rng.normal();
      factor *= 1 + r * h + sigma * dw + sigma * sigma / 2 * (dw * dw - h);
    }
    sum += (digital((spot + bump) * factor) - digital((spot - bump) * factor)) / (2 * bump);
  }
  return {sum / static_cast<double>(samples), 2.0 * steps * static_cast<double>(samples)};
}

using Tree = Branched<Smoothed<MilsteinStep>>;

void digital_price(benchmark::State& state) {
  beside(state, milstein(stock, digital, Branching{}), 53.23248154537634, 0.02,
         multilevel_of(milstein(stock, digital, Rates{1, 1})));
}
void smoothed_digital_price(benchmark::State& state) {
  beside(state, milstein(stock, DigitalPayoff{100, 100 * discount}, Branching{}), 53.23248154537634, 0.02,
         multilevel_of(milstein(stock, digital, Rates{1, 1})));
}
void digital_delta(benchmark::State& state) {
  beside(state, component_of(sensitivities(Tree{}, market, digital_payoff, spot, sigma), 1), 1.876201734584689,
         1.0 / static_cast<double>(state.range(0)), bumped_digital);
}
template <class Step>
void call_slope(benchmark::State& state) {
  const auto component = static_cast<std::size_t>(state.range(0));
  const double truth = component == 1 ? 0.6368306511756191 : 37.52403469169379;
  const double goal = component == 1 ? 0.001 : 0.1;
  beside(state, component_of(sensitivities(Step{}, market, call, spot, sigma), component), truth, goal,
         multilevel_of(component_of(sensitivities(MilsteinStep{}, market, call, spot, sigma), component)));
}
BENCHMARK(digital_price)
    ->Name("greeks/digital/recipe_against_multilevel")
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(smoothed_digital_price)
    ->Name("greeks/smoothed_digital/recipe_against_multilevel")
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(digital_delta)
    ->Name("greeks/digital_delta/recipe_against_bumping")
    ->Arg(50)
    ->Arg(200)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(call_slope<Smoothed<MilsteinStep>>)
    ->Name("greeks/call/smoothed_against_pathwise_multilevel")
    ->Arg(1)
    ->Arg(2)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(call_slope<Tree>)
    ->Name("greeks/call/tree_against_pathwise_multilevel")
    ->Arg(1)
    ->Arg(2)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

// ---- dual numbers: 64 steps of Milstein's scheme with the slopes in spot, volatility and rate

template <class X>
X path(X s, const X& v, const X& rate, const double* dw) {
  for (int i = 0; i < 64; ++i) {
    constexpr double h = 1.0 / 64;
    s = s + rate * s * h + v * s * dw[i] + v * s * v * ((dw[i] * dw[i] - h) / 2);
  }
  return s;
}
void duals(benchmark::State& state) {
  double dw[64];
  Stream rng(1, 1);
  for (double& x : dw) x = rng.normal() / 8;
  const auto ours = [&] {
    using D = Dual<3>;
    for (int i = 0; i < 1000; ++i) {
      dw[0] += 1e-9;
      benchmark::DoNotOptimize(path(D::parameter(0, spot), D::parameter(1, sigma), D::parameter(2, r), dw));
    }
  };
  const auto theirs = [&] {
    namespace ad = boost::math::differentiation;
    const auto p = ad::make_ftuple<double, 1, 1, 1>(spot, sigma, r);
    using X = std::remove_cvref_t<decltype(std::get<0>(p) * std::get<1>(p) * std::get<2>(p))>;
    const X s(std::get<0>(p));
    const X v(std::get<1>(p));
    const X rate(std::get<2>(p));
    for (int i = 0; i < 1000; ++i) {
      dw[0] += 1e-9;
      benchmark::DoNotOptimize(path(s, v, rate, dw));
    }
  };
  for (auto _ : state) report(state, paired_ratio(ours, theirs, 31), 1000);
}
BENCHMARK(duals)->Name("dual/path_of_64_steps")->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace debias::bench

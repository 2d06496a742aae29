#pragma once

// Options on geometric Brownian motion by Milstein's scheme in 2^k steps, with the Brownian bridge inside a step:
// the problems that every multilevel driver is shown on.
//   S0 = K = 100, r = 0.05, sigma = 0.2, T = 1; discounted. The coarse path takes two increments as one.
// Source of the bridge couplings: Giles, MCQMC 2006 (2008). Work counts the steps of both paths.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <debias/core/sequence.hpp>

namespace debias::trial {

enum class Payoff { european, asian, lookback, digital, smoothed_digital };

struct Option {
  Payoff payoff;

  [[nodiscard]] double truth() const {
    constexpr double values[] = {10.45058357218556678, 5.76309, 17.21680223736086577, 53.232481545376345,
                                 53.232481545376345};
    return values[static_cast<std::size_t>(payoff)];
  }

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const std::int64_t pairs = level == 0 ? 0 : std::int64_t{1} << (level - 1);
    const double h = std::exp2(-static_cast<double>(level));
    Path fine(h);
    Path coarse(2 * h);
    if (level == 0) {
      const Increment only = increment(h, rng);
      step(fine, only);
      return base(value(fine, only.w, false), 1.0);
    }
    Increment first;
    for (std::int64_t i = 0; i < pairs; ++i) {
      first = increment(h, rng);
      const Increment second = increment(h, rng);
      step(fine, first);
      step(fine, second);
      coarse_step(coarse, first, second);
    }
    return coupled(value(fine, 0, false), value(coarse, first.w, true), 3.0 * static_cast<double>(pairs));
  }

 private:
  static constexpr double start = 100;
  static constexpr double strike = 100;
  static constexpr double rate = 0.05;
  static constexpr double sigma = 0.2;

  struct Increment {
    double w = 0;     // of the Brownian motion
    double area = 0;  // of its bridge
    double log = 0;   // of a uniform, for the minimum of its bridge
  };
  struct Path {
    explicit Path(double step) : h(step) {}
    double h;
    double x = start;
    double before = start;  // the last step
    double sum = 0;
    double least = start;
  };

  [[nodiscard]] Increment increment(double h, Stream& rng) const {
    Increment i;
    i.w = std::sqrt(h) * rng.normal();
    if (payoff == Payoff::asian) i.area = h * std::sqrt(h / 12) * rng.normal();
    if (payoff == Payoff::lookback) i.log = std::log(rng.uniform());
    return i;
  }
  static void milstein(Path& p, double w) {
    p.before = p.x;
    p.x += rate * p.x * p.h + sigma * p.x * w + 0.5 * sigma * sigma * p.x * (w * w - p.h);
  }
  static double bridge_minimum(double a, double b, double h, double v, double log) {
    return 0.5 * (a + b - std::sqrt((b - a) * (b - a) - 2 * h * v * v * log));
  }
  void step(Path& p, const Increment& i) const {
    milstein(p, i.w);
    const double v = sigma * p.before;
    if (payoff == Payoff::asian) p.sum += 0.5 * p.h * (p.before + p.x) + v * i.area;
    if (payoff == Payoff::lookback) p.least = std::min(p.least, bridge_minimum(p.before, p.x, p.h, v, i.log));
  }
  void coarse_step(Path& p, const Increment& a, const Increment& b) const {
    milstein(p, a.w + b.w);
    const double v = sigma * p.before;
    const double twist = a.w - b.w;
    if (payoff == Payoff::asian)
      p.sum += 0.5 * p.h * (p.before + p.x) + v * (a.area + b.area + 0.25 * p.h * twist);
    if (payoff == Payoff::lookback) {
      const double middle = 0.5 * (p.before + p.x + v * twist);
      p.least = std::min({p.least, bridge_minimum(p.before, middle, p.h / 2, v, a.log),
                          bridge_minimum(middle, p.x, p.h / 2, v, b.log)});
    }
  }
  static double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

  // `w`: what the coarse path knows of its last step, the first half of its increment.
  [[nodiscard]] double value(const Path& p, double w, bool is_coarse) const {
    const double discount = std::exp(-rate);
    switch (payoff) {
      case Payoff::european:
        return discount * std::max(p.x - strike, 0.0);
      case Payoff::asian:
        return discount * std::max(p.sum - strike, 0.0);
      case Payoff::lookback:
        return discount * (p.x - p.least);
      case Payoff::digital:
        return discount * (p.x > strike ? strike : 0.0);
      case Payoff::smoothed_digital:
        break;
    }
    // The expectation over what is left of the last step, which Euler's scheme takes.
    const double known = is_coarse ? sigma * p.before * w : 0;
    const double left = is_coarse ? p.h / 2 : p.h;
    const double mean = p.before + rate * p.before * p.h + known;
    return discount * strike * normal_cdf((mean - strike) / (sigma * p.before * std::sqrt(left)));
  }
};

}  // namespace debias::trial

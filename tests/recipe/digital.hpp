#pragma once

// A digital option on geometric Brownian motion by Milstein's scheme in 2^k steps: 100 at T = 1 where S_T > 100.
//   S0 = 100, r = 0.05, sigma = 0.2; discounted. The coarse path takes two increments as one.
// As it is, beta = gamma = 1: no PMF. Smoothed by the conditional expectation over the last step, beta = 3/2, but most
// paths end far from the strike, where differences are next to nothing: a small pilot sees hardly anything else.
// Source: Giles, MCQMC 2006 (2008). Work counts the steps of both paths.

#include <cmath>
#include <cstdint>

#include <debias/core/sequence.hpp>

namespace debias::trial {

struct Digital {
  bool smoothed;

  static constexpr double truth() { return 53.232481545376345; }

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double h = std::exp2(-static_cast<double>(level));
    Path fine{h};
    if (level == 0) {
      fine.step(std::sqrt(h) * rng.normal());
      return base(payoff(fine, 0, h), 1.0);
    }
    Path coarse{2 * h};
    const std::int64_t pairs = std::int64_t{1} << (level - 1);
    double first = 0;
    for (std::int64_t i = 0; i < pairs; ++i) {
      first = std::sqrt(h) * rng.normal();
      const double second = std::sqrt(h) * rng.normal();
      fine.step(first);
      fine.step(second);
      coarse.step(first + second);
    }
    return coupled(payoff(fine, 0, h), payoff(coarse, first, h), 3.0 * static_cast<double>(pairs));
  }

 private:
  static constexpr double strike = 100;
  static constexpr double rate = 0.05;
  static constexpr double sigma = 0.2;

  struct Path {
    double h;
    double x = 100;
    double before = 100;  // the last step
    void step(double w) {
      before = x;
      x += rate * x * h + sigma * x * w + 0.5 * sigma * sigma * x * (w * w - h);
    }
  };

  // `w` is what is known of the last increment, `left` the time of what is not: the expectation over that, in one step
  // of Euler's scheme.
  [[nodiscard]] double payoff(const Path& p, double w, double left) const {
    const double discounted = std::exp(-rate) * strike;
    if (!smoothed) return p.x > strike ? discounted : 0;
    const double mean = p.before + rate * p.before * p.h + sigma * p.before * w;
    return discounted * 0.5 * std::erfc((strike - mean) / (sigma * p.before * std::sqrt(2 * left)));
  }
};

}  // namespace debias::trial

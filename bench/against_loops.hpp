#pragma once

// Our estimators beside plain loops of the same algorithm, alternating in one run, and tables of variance x
// look-ups.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/stream.hpp>

#include "baseline_exponential.hpp"
#include "paired.hpp"

namespace debias::bench {

inline constexpr std::int64_t round_samples = 1 << 12;

/// Each call takes the next samples: of the same ones a branch predictor would learn the levels by heart.
template <class Sample>
struct Loop {
  const Sample& sample;
  mutable std::int64_t first = 0;

  void operator()() const {
    double sum = 0;
    double squares = 0;
    for (std::int64_t i = first; i < first + round_samples; ++i) {
      Stream rng(1, static_cast<std::uint64_t>(i));
      const double z = sample(rng);
      sum += z;
      squares += z * z;
    }
    first += round_samples;
    benchmark::DoNotOptimize(sum);
    benchmark::DoNotOptimize(squares);
  }
};
template <class Sample>
Loop<Sample> loop(const Sample& sample) {
  return {sample};
}

namespace plain {

/// A function of E X by doubling independent draws: geometric PMF with parameter r, base(x) averaged over all draws,
/// and gap(n, mean, half the difference of the halves) of n draws weighted.
template <class X, class BaseOf, class GapOf>
double doubling(const X& x, const BaseOf& base, const GapOf& gap, double r, Stream& order, Stream& points) {
  const auto [level, mass] = geometric_level(1, r, order);
  const int n = 1 << level;
  Stream draws = points_of_level(order, points, level);
  double even = 0;
  double odd = 0;
  double bases = 0;
  for (int i = 0; i < n; i += 2) {
    const double a = x(draws);
    const double b = x(draws);
    even += a;
    odd += b;
    bases += base(a) + base(b);
  }
  return bases / n + gap(n, (even + odd) / n, (even - odd) / n) / mass;
}
template <class X, class G>
double doubling(const X& x, const G& g, double r, Stream& order, Stream& points) {
  return doubling(
      x, g, [&g](int, double mean, double half) { return g.gap(mean, half); }, r, order, points);
}

/// The walk of Ulam and von Neumann for <(1, 0), x>, x = A x + (1, 2), A = (0.5 0.4; 0.2 0.3), with roulette.
inline double walk(double survival, Stream& order, Stream& points) {
  constexpr double entries[2][2] = {{0.5, 0.4}, {0.2, 0.3}};
  constexpr double b[2] = {1, 2};
  int at = 0;
  double weight = 1;
  double sum = b[0];
  while (order.uniform() < survival) {
    const double row = entries[at][0] + entries[at][1];
    at = points.uniform() * row < entries[at][0] ? 0 : 1;
    weight *= row / survival;
    sum += weight * b[at];
  }
  return sum;
}

}  // namespace plain

/// One stream for the order and one for the points, as ours.
template <class Plain>
auto with_two_streams(const Plain& plain) {
  return [&plain](Stream& rng) {
    Stream order = split(rng, Branch::pmf);
    Stream points = split_level(rng, 0);
    return plain(order, points);
  };
}

template <Estimator E>
auto values_of(const E& e) {
  return [&e](Stream& rng) {
    NullRecord none;
    return draw_sample(e, rng, none).value;
  };
}

template <Estimator E, class Plain>
Ratio time_against(const E& e, const Plain& plain, int rounds) {
  const auto ours = values_of(e);
  const auto theirs = with_two_streams(plain);
  return paired_ratio(loop(ours), loop(theirs), rounds);
}

/// `ratio`: against a loop that draws from two streams; `one_stream`: from one, which saves a block of
/// Philox.
template <Estimator E, class Plain>
void compare(benchmark::State& state, const E& e, const Plain& plain) {
  const auto ours = values_of(e);
  const auto one = [&plain](Stream& rng) { return plain(rng, rng); };
  for (auto _ : state) {
    report(state, time_against(e, plain, 101), static_cast<double>(round_samples));
    state.counters["one_stream"] = paired_ratio(loop(ours), loop(one), 101).least;
  }
}

template <Estimator E, class Plain>
void register_comparison(const std::string& name, const E& e, const Plain& plain) {
  benchmark::RegisterBenchmark(("plain/" + name).c_str(),
                               [e, plain](benchmark::State& state) { compare(state, e, plain); })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

/// A method on a problem; no look-ups where it does not apply.
struct Cell {
  std::string method;
  double relative_variance = 0;  // of one sample
  double error = 0;              // its relative error
  double lookups = 0;            // a sample
  Ratio time = {};               // of a round; ratio 0 without a plain loop
};

/// `free_work` is work that looks nothing up, `scale` the look-ups in a unit of it.
template <Estimator E>
Cell measure(const std::string& method, const E& e, double truth, double free_work = 0, double scale = 1) {
  const auto r = estimate(e, {.samples = 1 << 19, .threads = 1});
  return {method, r.moments.variance() / (truth * truth),
          std::sqrt((r.moments.kurtosis() - 1) / static_cast<double>(r.samples)),
          scale * (r.work_per_sample() - free_work)};
}
template <Estimator E, class Plain>
Cell measure_against(const std::string& method, const E& e, const Plain& plain, double truth, double free_work = 0,
                     double scale = 1) {
  Cell cell = measure(method, e, truth, free_work, scale);
  cell.time = time_against(e, plain, 25);
  return cell;
}

/// Rows of cells with the same methods: relative variance x look-ups, then ns a sample and the ratio to a
/// plain loop.
class Table {
 public:
  void add(const std::string& where, const std::vector<Cell>& cells) {
    if (variances_.empty()) {
      variances_ = times_ = "| problem |";
      std::string rule = "\n|---|";
      for (const Cell& c : cells) {
        variances_ += " " + c.method + " |";
        times_ += " " + c.method + " |";
        rule += "---|";
      }
      variances_ += " least |" + rule + "---|\n";
      times_ += rule + "\n";
    }
    variances_ += "| " + where + " |";
    times_ += "| " + where + " |";
    std::string least;
    double least_variance = std::numeric_limits<double>::infinity();
    char text[64];
    for (const Cell& c : cells) {
      const double v = c.relative_variance * c.lookups;
      if (c.lookups == 0) {
        variances_ += " - |";
        times_ += " - |";
        continue;
      }
      if (v < least_variance) {
        least = c.method;
        least_variance = v;
      }
      std::snprintf(text, sizeof text, " %.2g%s |", v, std::isfinite(v) && !(c.error < 0.1) ? " ?" : "");
      variances_ += text;
      std::snprintf(text, sizeof text, " %.0f (%.2f) |", 1e9 * c.time.ours / static_cast<double>(round_samples),
                    c.time.ratio);
      times_ += c.time.ratio > 0 ? text : " - |";
    }
    variances_ += " " + least + " |\n";
    times_ += "\n";
  }
  void print() const { std::printf("%s\n%s\n", variances_.c_str(), times_.c_str()); }

 private:
  std::string variances_;
  std::string times_;
};

template <class Fill>
void register_table(const std::string& name, const Fill& fill) {
  benchmark::RegisterBenchmark(("table/" + name).c_str(),
                               [fill](benchmark::State& state) {
                                 for (auto _ : state) {
                                   Table table;
                                   fill(table);
                                   table.print();
                                 }
                               })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

}  // namespace debias::bench

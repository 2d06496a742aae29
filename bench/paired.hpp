#pragma once

// Two pieces of work timed in turn, A B A B ..., in one run: on a shared machine unpaired timings drift
// apart.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

namespace debias::bench {

template <class F>
double seconds_of(const F& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Of the line of least squares through (x, y).
inline double slope_of(const std::vector<double>& x, const std::vector<double>& y) {
  double mean_x = 0;
  double mean_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    mean_x += x[i] / static_cast<double>(x.size());
    mean_y += y[i] / static_cast<double>(x.size());
  }
  double xx = 0;
  double xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  return xy / xx;
}

/// Median over `rounds` of the paired ratios seconds(ours) / seconds(theirs), with the medians of both; and
/// the ratio of the least times, which is better where other processes take turns within a round.
struct Ratio {
  double ratio = 0;
  double least = 0;
  double ours = 0;
  double theirs = 0;
};

template <class Ours, class Theirs>
Ratio paired_ratio(const Ours& ours, const Theirs& theirs, int rounds = 15) {
  std::vector<double> ratios;
  std::vector<double> a;
  std::vector<double> b;
  ours();  // warm both up
  theirs();
  for (int i = 0; i < rounds; ++i) {
    a.push_back(seconds_of(ours));
    b.push_back(seconds_of(theirs));
    ratios.push_back(a.back() / b.back());
  }
  const double least = *std::min_element(a.begin(), a.end()) / *std::min_element(b.begin(), b.end());
  return {median(ratios), least, median(a), median(b)};
}

/// Reports a paired comparison of `samples` samples a round as counters of one benchmark.
inline void report(benchmark::State& state, const Ratio& r, double samples) {
  state.counters["ratio"] = r.ratio;
  state.counters["ratio_of_least"] = r.least;
  state.counters["ours_ns"] = 1e9 * r.ours / samples;
  state.counters["theirs_ns"] = 1e9 * r.theirs / samples;
}

}  // namespace debias::bench

// The runner against a hand-written loop with the same generator, PMF, draws and statistics.
// Counters: ratio (time of estimate / time of the loop, median of 15 alternating rounds, one thread), ns per
// sample of both, variance and efficiency of the estimate.

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <queue>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>

#include "paired.hpp"

namespace debias::bench {
namespace {

// What a careful user would write out: one pass over the samples, four moments, sums by level, both tails and
// the largest samples.
class HandStatistics {
 public:
  void level(std::int64_t k, double d, double work) {
    auto& row = levels_[static_cast<std::size_t>(std::min<std::int64_t>(k, 63))];
    row[0] += 1;
    row[1] += d;
    row[2] += d * d;
    row[3] += d * d * d * d;
    row[4] += work;
  }

  void add(std::int64_t index, double x, double work) {
    work_ += work;
    ++n_;
    const auto n = static_cast<double>(n_);
    const double delta = x - mean_;
    const double step = delta / n;
    const double step2 = step * step;
    const double term = delta * step * (n - 1);
    mean_ += step;
    m4_ += term * step2 * (n * n - 3 * n + 3) + 6 * step2 * m2_ - 4 * step * m3_;
    m3_ += term * step * (n - 2) - 3 * step * m2_;
    m2_ += term;
    keep(upper_, x, tail_size);
    keep(lower_, -x, tail_size);
    if (largest_.size() < 32 || std::abs(x) > largest_.top().first) {
      largest_.emplace(std::abs(x), index);
      if (largest_.size() > 32) largest_.pop();
    }
  }

  [[nodiscard]] double mean() const { return mean_; }

 private:
  static constexpr std::size_t tail_size = 4096;
  using Tail = std::priority_queue<double, std::vector<double>, std::greater<>>;
  static void keep(Tail& tail, double x, std::size_t size) {
    if (tail.size() < size) {
      tail.push(x);
    } else if (x > tail.top()) {
      tail.pop();
      tail.push(x);
    }
  }

  std::int64_t n_ = 0;
  double mean_ = 0, m2_ = 0, m3_ = 0, m4_ = 0, work_ = 0;
  std::array<std::array<double, 5>, 64> levels_{};
  Tail upper_, lower_;
  std::priority_queue<std::pair<double, std::int64_t>, std::vector<std::pair<double, std::int64_t>>, std::greater<>>
      largest_;
};

constexpr std::int64_t samples = 1 << 18;

// 1 / E X for X = 1 + U^2, doubling with the antithetic difference, base at level 0: the same arithmetic twice.
struct Doubling {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    if (level == 0) return base(1 / draw(rng));
    double a = 0;
    double b = 0;
    const std::int64_t half = std::int64_t{1} << (level - 1);
    for (std::int64_t i = 0; i < half; ++i) a += draw(rng);
    for (std::int64_t i = 0; i < half; ++i) b += draw(rng);
    const auto n = static_cast<double>(half);
    return coupled(2 * n / (a + b), (n / a + n / b) / 2, 2 * n);
  }
  static double draw(Stream& rng) {
    const double u = rng.uniform();
    return 1 + u * u;
  }
};

// Nothing but the skeleton: one uniform a level.
struct Skeleton {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double u = rng.uniform();
    return {u, std::ldexp(u, -static_cast<int>(level)), 1};
  }
};

template <class S>
void runner(benchmark::State& state, const S& sequence) {
  const Geometric pmf(0.6);
  const auto estimator = single_term(sequence, pmf);
  double ours = 0;
  double theirs = 0;
  Statistics statistics;
  const auto library = [&] {
    statistics = estimate(estimator, {.samples = samples, .seed = 7, .threads = 1});
    ours = statistics.components[0].mean;
  };
  const auto by_hand = [&] {
    HandStatistics kept;
    for (std::int64_t i = 0; i < samples; ++i) {
      const Stream rng(7, static_cast<std::uint64_t>(i));
      Stream pmf_stream = split(rng, Branch::pmf);
      const std::int64_t level = 1 + pmf.sample(pmf_stream.uniform());
      Stream base_stream = split_level(rng, 0);
      Stream level_stream = split_level(rng, level);
      const Draw<double> base = sequence(0, base_stream);
      const Draw<double> draw = sequence(level, level_stream);
      kept.level(0, base.value, base.work);
      kept.level(level, draw.difference, draw.work);
      kept.add(i, base.value + draw.difference / pmf.mass(level - 1), base.work + draw.work);
    }
    theirs = kept.mean();
  };
  for (auto _ : state) report(state, paired_ratio(library, by_hand), static_cast<double>(samples));
  if (!(std::abs(ours - theirs) <= 1e-12 * std::abs(ours))) state.SkipWithError("the two loops disagree");
  state.counters["variance"] = statistics.components[0].variance;
  state.counters["efficiency"] = statistics.efficiency();
}

// A finite difference of sin at 1 with steps 2^-k: one random number for the noise, no more.
struct FiniteDifference {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double noise = rng.uniform();
    const auto slope = [noise](double h) { return (std::sin(1 + h) - std::sin(1)) / h * (0.5 + noise); };
    const double h = std::ldexp(1.0, -static_cast<int>(level));
    return level == 0 ? base(slope(h)) : coupled(slope(h), slope(2 * h));
  }
};

// exp(-integral) of a linear function on combs.
struct Comb {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const std::int64_t n = std::int64_t{1} << level;
    const double u = rng.uniform();
    double even = 0;
    double odd = 0;
    for (std::int64_t i = 0; i < n; ++i) (i % 2 == 0 ? even : odd) += 2 * (static_cast<double>(i) + u) / n_of(n);
    const double fine = std::exp(-(even + odd) / n_of(n));
    if (level == 0) return base(fine);
    return coupled(fine, (std::exp(-2 * even / n_of(n)) + std::exp(-2 * odd / n_of(n))) / 2, n_of(n));
  }
  static double n_of(std::int64_t n) { return static_cast<double>(n); }
};

// One path of geometric Brownian motion by Milstein's scheme.
struct Path {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const std::int64_t n = std::int64_t{1} << level;
    const double h = 1 / static_cast<double>(n);
    if (level == 0) return base(step(1, h, rng.normal()));
    double fine = 1;
    double coarse = 1;
    for (std::int64_t i = 0; i < n; i += 2) {
      const double a = std::sqrt(h) * rng.normal();
      const double b = std::sqrt(h) * rng.normal();
      fine = step(step(fine, h, a), h, b);
      coarse = step(coarse, 2 * h, a + b);
    }
    return coupled(fine, coarse, 1.5 * static_cast<double>(n));
  }
  static double step(double x, double h, double dw) { return x * (1 + 0.05 * h + 0.2 * dw + 0.02 * (dw * dw - h)); }
};

// Terms U 2^-k of a series.
struct Series {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double term = std::ldexp(2 * rng.uniform(), -static_cast<int>(level));
    return level == 0 ? base(term) : Draw<double>{2 - term, term, 1};
  }
};

BENCHMARK_CAPTURE(runner, skeleton, Skeleton{})->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(runner, reciprocal, Doubling{})->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(runner, finite_difference, FiniteDifference{})->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(runner, comb, Comb{})->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(runner, path, Path{})->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(runner, series, Series{})->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace debias::bench

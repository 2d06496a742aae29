// Stratified blocks whose members run together against the best loop that anybody publishes or writes, by efficiency =
// 1 / (variance x seconds), at equal mean look-ups per estimate: efficiency/...
//
//   ratio        ours / best of the loops; a member counts as an estimate, a block as the mean of its members
//   levels_only  the same with strata over the level alone: the members' offsets independent
//   faster       seconds of the best loop / ours, for one estimate
//
// All sides alternate in each of 21 rounds, medians of the times. The loops are plain C++, one number after the other.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <Eigen/Core>

#include <debias/core/vector_math.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/linear_operators.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/reciprocal.hpp>
#include <debias/transmittance.hpp>

#include "against_loops.hpp"
#include "baseline_exponential.hpp"
#include "media.hpp"

namespace debias::bench {
namespace {

constexpr std::int64_t block = 64;

/// A plain loop: one estimate from a fresh stream.
struct Rival {
  std::string name;
  std::function<void()> round;  // the next round_samples samples
  double variance;              // of a sample
};

template <class Plain>
Rival rival(const std::string& name, const Plain& plain) {
  const auto sample = [plain](Stream& rng) { return plain(rng, rng); };  // one stream: what is fastest
  const double variance = estimate(sample, {.samples = 1 << 19}).moments.variance();
  const auto round = [sample, first = std::int64_t{0}]() mutable {
    const Loop<decltype(sample)> next{sample, first};
    next();
    first = next.first;
  };
  return {name, round, variance};
}

/// `together` is stratified, with members that run together; `apart` is the same one by one.
template <class Together, class Apart>
void contest(benchmark::State& state, const Together& together, const Apart& apart, const std::vector<Rival>& rivals) {
  static_assert(round_samples % block == 0);
  const Plan many{.samples = 1 << 19};
  const auto result = estimate(together, many);
  const double variance = result.moments.variance() * static_cast<double>(block);
  const double variance_apart = estimate(apart, many).moments.variance() * static_cast<double>(block);
  std::vector<double> ours;
  std::vector<std::vector<double>> theirs(rivals.size());
  for (auto _ : state) {
    for (std::int64_t round = 0; round < 21; ++round) {
      ours.push_back(seconds_of([&] {
        benchmark::DoNotOptimize(
            estimate(together, {.samples = round_samples, .first = round * round_samples, .threads = 1}).work);
      }));
      for (std::size_t i = 0; i < rivals.size(); ++i) {
        theirs[i].push_back(seconds_of(rivals[i].round));
      }
    }
  }
  const double seconds = median(ours);
  double best = 0;
  std::size_t winner = 0;
  for (std::size_t i = 0; i < rivals.size(); ++i) {
    const double efficiency = 1 / (rivals[i].variance * median(theirs[i]));
    if (efficiency > best) {
      best = efficiency;
      winner = i;
    }
  }
  state.SetLabel("best loop: " + rivals[winner].name);
  state.counters["ratio"] = 1 / (variance * seconds) / best;
  state.counters["levels_only"] = 1 / (variance_apart * seconds) / best;
  state.counters["faster"] = median(theirs[winner]) / seconds;
  state.counters["ours_ns"] = 1e9 * seconds / static_cast<double>(round_samples);
  state.counters["work"] = result.work_per_sample();
}

/// The same sequence without its batch hooks.
template <class S>
struct OneByOne {
  S sequence;
  auto operator()(std::int64_t level, Stream& rng) const { return sequence(level, rng); }
  auto shared(std::int64_t level, std::int64_t base, Stream& rng) const { return sequence.shared(level, base, rng); }
};

template <class S>
auto strata(const S& sequence, double r, std::int64_t base) {
  return stratified(single_term(sequence, Geometric(r), {.base_level = base}), block);
}

// ---- transmittance

/// An integrand for one number, and for many by its vector form `many`.
template <class F>
struct Batched : F {
  using F::F;
  using F::operator();
  void operator()(std::span<const double> at, std::span<double> out) const {
    std::copy(at.begin(), at.end(), out.begin());
    F::many(*this, out);
  }
};
struct SinusoidMedium : Sinusoid {
  using Sinusoid::Sinusoid;
  static void many(const Sinusoid& f, std::span<double> x) {
    for (double& v : x) v = two_pi / 0.37 * v + 1;
    vector_math::sin(x);
    for (double& v : x) v = f.a * (1 + v);
  }
};
struct StepMedium : Step {
  using Step::Step;
  static void many(const Step& f, std::span<double> x) {
    for (double& v : x) v = v < edge ? f.bound : f.a;
  }
};
struct LinearMedium : Linear {
  using Linear::Linear;
  static void many(const Linear& f, std::span<double> x) {
    for (double& v : x) v *= f.bound;
  }
};
/// An atmosphere: e^(-4 x).
struct Atmosphere {
  static constexpr const char* name = "atmosphere";
  explicit Atmosphere(double tau) : bound(tau * 4 / -std::expm1(-4)) {}
  double operator()(double x) const { return bound * std::exp(-4 * x); }
  static void many(const Atmosphere& f, std::span<double> x) {
    for (double& v : x) v *= -4;
    vector_math::exp(x);
    for (double& v : x) v *= f.bound;
  }
  double bound;
};
/// A puff: a Gaussian of width 0.15 about 0.4.
struct Puff {
  static constexpr const char* name = "puff";
  explicit Puff(double tau)
      : bound(tau / (0.15 * std::sqrt(std::acos(-1.0) / 2) * (std::erf(0.6 / s) + std::erf(0.4 / s)))) {}
  double operator()(double x) const { return bound * std::exp(-(x - 0.4) * (x - 0.4) / (s * s)); }
  static void many(const Puff& f, std::span<double> x) {
    for (double& v : x) v = -(v - 0.4) * (v - 0.4) / (s * s);
    vector_math::exp(x);
    for (double& v : x) v *= f.bound;
  }
  static constexpr double s = 0.15 * 1.4142135623730951;
  double bound;
};
/// A wall with a root: (x - 1/4)^(1/2) from 1/4 on.
struct Root {
  static constexpr const char* name = "root";
  explicit Root(double tau) : a(tau * 1.5 / std::pow(0.75, 1.5)), bound(a * std::sqrt(0.75)) {}
  double operator()(double x) const { return a * std::sqrt(std::max(x - 0.25, 0.0)); }
  static void many(const Root& f, std::span<double> x) {
    for (double& v : x) v = f.a * std::sqrt(std::max(v - 0.25, 0.0));
  }
  double a;
  double bound;
};

template <class F>
void transmittance(benchmark::State& state) {
  const F f(4);
  const auto lookups = static_cast<int>(state.range(0));
  const double a = f.bound;
  const int comb = static_cast<int>(std::lround(lookups / 1.32));
  const int base = lookups == 16 ? 2 : 3;
  const functions::ExpMinus g;
  // Walks and series take what look-ups they take; the mean of as many as fit has the same efficiency.
  const std::vector<Rival> rivals{
      rival("U-statistics", [f, comb](Stream& n, Stream& at) { return plain::u_statistics(f, comb, n, at); }),
      rival("telescoping comb",
            [f, g, base](Stream& n, Stream& at) { return plain::telescoping_comb(f, g, base, 2.0 / 3, n, at); }),
      rival("ratio tracking", [f, a](Stream& n, Stream& at) { return plain::ratio_tracking(f, a, n, at); }),
      rival("p-series cumulative", [f, a](Stream& n, Stream& at) { return plain::p_series_cumulative(f, a, n, at); }),
      rival("p-series CMF", [f, a, k = static_cast<int>(poisson_quantile(a, 0.99))](
                                Stream& n, Stream& at) { return plain::p_series_cmf(f, a, k, n, at); }),
  };
  const auto sequence = function_of_integral(Batched<F>(4), g);
  using S = std::remove_cvref_t<decltype(sequence)>;
  contest(state, strata(sequence, 2.0 / 3, base), strata(OneByOne<S>{sequence}, 2.0 / 3, base), rivals);
}
template <class F>
void register_medium() {
  benchmark::RegisterBenchmark((std::string("efficiency/transmittance/") + F::name).c_str(), transmittance<F>)
      ->Arg(16)
      ->Arg(32)
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

// ---- 1 / integral, log evidence, Neumann functional

struct Wave {
  double operator()(double x) const { return 2 + std::sin(two_pi / 0.37 * x + 1); }
  static void many(const Wave& /*f*/, std::span<double> x) {
    for (double& v : x) v = two_pi / 0.37 * v + 1;
    vector_math::sin(x);
    for (double& v : x) v += 2;
  }
};

void one_over_integral(benchmark::State& state) {
  const Wave f;
  const functions::Reciprocal g;
  const auto x = [f](Stream& rng) { return f(rng.uniform()); };
  const double mean = 2 + 0.37 / two_pi * (std::cos(1.0) - std::cos(two_pi / 0.37 + 1));
  const double a = mean + 0.5 / mean;  // E X^2 / E X, nearly
  const double s = std::sqrt(1 - mean / a);
  const std::vector<Rival> rivals{
      rival("trials",
            [x](Stream&, Stream& at) {  // [Zeltner et al. 2020]
              int n = 1;
              while (at.uniform() * 3 >= x(at)) ++n;
              return n / 3.0;
            }),
      rival("geometric series",
            [x, a, s](Stream& order, Stream& at) {  // [Booth 2007]
              double term = 1 / a;
              double sum = term;
              while (order.uniform() < s) sum += term *= (1 - x(at) / a) / s;
              return sum;
            }),
      rival("doubling",
            [x, g](Stream& n, Stream& at) {
              return plain::doubling(MeanOf<decltype(x)>{x, 2}, g, 4.0 / 7, n, at);
            }),
      rival("telescoping comb",
            [f, g](Stream& n, Stream& at) { return plain::telescoping_comb(f, g, 2, 2.0 / 3, n, at); }),
  };
  const auto sequence = reciprocal_of_integral(Batched<Wave>{});
  using S = std::remove_cvref_t<decltype(sequence)>;
  contest(state, strata(sequence, 2.0 / 3, 2), strata(OneByOne<S>{sequence}, 2.0 / 3, 2), rivals);
}

/// The likelihood of one observation at 1 under a standard normal prior.
struct Likelihood {
  double operator()(Stream& rng) const {
    const double residual = 1 - rng.normal();
    return std::exp(-residual * residual / 2);
  }
  void draws(StreamBatch& batch, std::span<double> out) const {
    batch.normals(out);
    for (double& z : out) z = -(1 - z) * (1 - z) / 2;
    vector_math::exp(out);
  }
};

void log_evidence(benchmark::State& state) {
  const Likelihood x;
  const functions::Log g;
  std::vector<Rival> rivals;
  for (const double r : {4.0 / 7, 0.6, 0.65}) {
    rivals.push_back(rival("doubling, 4 draws at least, r = " + std::to_string(r), [x, g, r](Stream& n, Stream& at) {
      return plain::doubling(MeanOf<Likelihood>{x, 4}, g, r, n, at);
    }));
  }
  const auto sequence = function_of_mean(x, g);
  using S = std::remove_cvref_t<decltype(sequence)>;
  contest(state, strata(sequence, 0.6, 2), strata(OneByOne<S>{sequence}, 0.6, 2), rivals);
}

void neumann_functional(benchmark::State& state) {
  const Eigen::Matrix2d matrix{{0.5, 0.4}, {0.2, 0.3}};
  const auto walk = neumann_walk(matrix, Eigen::Vector2d(1, 2), Eigen::Vector2d(1, 0));
  std::vector<Rival> rivals;
  for (const double survival : {0.7, 0.8, 0.9, 0.95}) {
    rivals.push_back(rival("walk, survival " + std::to_string(survival),
                           [survival](Stream& order, Stream& rng) { return plain::walk(survival, order, rng); }));
  }
  const auto e = stratified(roulette(walk, Geometric(0.1)), block);
  contest(state, e, e, rivals);
}

const bool registered = [] {
  register_medium<SinusoidMedium>();
  register_medium<StepMedium>();
  register_medium<LinearMedium>();
  register_medium<Atmosphere>();
  register_medium<Puff>();
  register_medium<Root>();
  const auto add = [](const char* name, void (*contest_of)(benchmark::State&)) {
    benchmark::RegisterBenchmark(name, contest_of)->Iterations(1)->Unit(benchmark::kMillisecond);
  };
  add("efficiency/reciprocal_of_integral", one_over_integral);
  add("efficiency/log_evidence", log_evidence);
  add("efficiency/neumann_functional", neumann_functional);
  return true;
}();

}  // namespace
}  // namespace debias::bench

// Telescoping combs against plain loops (plain/...: ratio of times, alternating in one run), and batch hooks
// on Eigen arrays against the scalar loop (batch/...). The hooks show what they are worth with
// -DCMAKE_CXX_FLAGS=-march=x86-64-v3.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>

#include <benchmark/benchmark.h>
#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <Eigen/Core>

#include <debias/core/accumulator.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/taylor.hpp>

#include "against_loops.hpp"
#include "baseline_exponential.hpp"
#include "media.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

template <class F>
void register_comb(double tau) {
  const F f(tau);
  const Geometric pmf = Geometric::with_exponent(2.5);
  register_comparison(std::string("telescoping_comb/") + F::name + "/tau_" + std::to_string(static_cast<int>(tau)),
                      single_term(function_of_integral(f, functions::ExpMinus{}), pmf, {.base_level = 2}),
                      [f, r = pmf.mass(0), base = 2](Stream& n, Stream& at) {
                        return plain::telescoping_comb(f, functions::ExpMinus{}, base, r, n, at);
                      });
}

// ---- means of independent draws: doubling and the power series at equal look-ups

template <class X, class G>
void add_rows(Table& table, const std::string& name, const X& x, const G& g, double truth, double mean, double square) {
  const Moments exact{.count = 1 << 20, .mean = mean, .m2 = (square - mean * mean) * (1 << 20)};
  const Centre c = centre(g, exact);
  const double radius = g.expand(c.at).radius;
  const double s = std::isinf(radius) ? 0.5 : std::sqrt(c.mean_square) / radius;
  const Cell series = measure("series", roulette(taylor(x, g, c), Geometric(1 - s)), truth, 1);
  for (const int lookups : {8, 16, 32}) {
    const auto sum = [&](Products products) {  // all orders below the look-ups, and one more on the average
      return taylor_sum(x, g, c, Geometric(0.5), {.products = products, .base_level = lookups - 1});
    };
    const Cell simple = measure("simple", sum(Products::simple), truth, 1);
    const Cell cyclic = measure("cyclic", sum(Products::cyclic), truth, 1);
    const Cell symmetric = measure("symmetric", sum(Products::symmetric), truth, 1);
    const MeanOf<X> unit{x, lookups / 8};  // E 2^(1 + J) = 2 r / (2 r - 1) = 8 for r = 4/7
    const Cell doubling = measure_against(
        "doubling", single_term(function_of_mean(unit, g), Geometric(4.0 / 7)),
        [unit, g](Stream& n, Stream& at) { return plain::doubling(unit, g, 4.0 / 7, n, at); }, truth, 0, unit.n);
    table.add(name + ", " + std::to_string(lookups) + " look-ups", {series, simple, cyclic, symmetric, doubling});
  }
}

void add_means(Table& table) {
  const auto zero_to_two = [](Stream& rng) { return 2 * rng.uniform(); };
  add_rows(table, "exp(-E X), X ~ U(0, 2)", zero_to_two, functions::ExpMinus{}, std::exp(-1), 1, 4.0 / 3);
  add_rows(table, "Davis, c = 1/2, X ~ U(0, 2)", zero_to_two, functions::Davis{0.5}, functions::Davis{0.5}(1), 1,
           4.0 / 3);
  const auto near_one = [](Stream& rng) { return 0.5 + rng.uniform(); };
  add_rows(table, "1 / E X, X ~ U(1/2, 3/2)", near_one, functions::Reciprocal{}, 1, 1, 13.0 / 12);
  const auto square = [](Stream& rng) {
    const double u = rng.uniform();
    return u * u;
  };
  add_rows(table, "sqrt(E U^2)", square, functions::Sqrt{}, std::sqrt(1.0 / 3), 1.0 / 3, 0.2);
  const auto likelihood = [](Stream& rng) {
    const double residual = 1 - rng.normal();
    return std::exp(-residual * residual / 2);
  };
  const double evidence = std::exp(-0.25) / std::sqrt(2.0);
  add_rows(table, "log evidence", likelihood, functions::Log{}, std::log(evidence), evidence,
           std::exp(-1.0 / 3) / std::sqrt(3.0));
  const auto normal = [](Stream& rng) { return 0.5 + rng.normal(); };
  add_rows(table, "logistic(E X), X ~ N(1/2, 1)", normal, functions::Logistic{}, functions::Logistic{}(0.5), 0.5, 1.25);
}

// ---- batches

using Array = Eigen::Map<Eigen::ArrayXd>;

inline Array array(std::span<double> x) { return {x.data(), static_cast<Eigen::Index>(x.size())}; }

/// Smooth integrands of a uniform number, for one and for an array of them.
struct ExpOf {
  static constexpr const char* name = "exp";
  static double one(double u) { return std::exp(-u); }
  static void many(Array u) { u = (-u).exp(); }
};
#ifdef __AVX2__
// The vector sine of glibc: Eigen 3.4 has none in double precision.
extern "C" __m256d _ZGVdN4v_sin(__m256d);
inline void vector_sine(Array u) {
  Eigen::Index i = 0;
  for (; i + 4 <= u.size(); i += 4) _mm256_storeu_pd(&u[i], _ZGVdN4v_sin(_mm256_loadu_pd(&u[i])));
  for (; i < u.size(); ++i) u[i] = std::sin(u[i]);
}
#else
inline void vector_sine(Array u) { u = u.sin(); }
#endif

struct SinOf {
  static constexpr const char* name = "sin";
  static double one(double u) { return 2 + std::sin(6 * u); }
  static void many(Array u) {
    u *= 6;
    vector_sine(u);
    u += 2;
  }
};
struct SqrtOf {
  static constexpr const char* name = "sqrt";
  static double one(double u) { return std::sqrt(1 + u * u); }
  static void many(Array u) { u = (1 + u.square()).sqrt(); }
};

/// All three.
struct SmoothOf {
  static constexpr const char* name = "exp_sin_sqrt";
  static double one(double u) { return std::exp(-u) * (2 + std::sin(6 * u)) * std::sqrt(1 + u * u); }
  static void many(Array u) {
    std::array<double, 256> copy;
    const Array sine(copy.data(), u.size());
    Array(copy.data(), u.size()) = 6 * u;
    vector_sine(sine);
    u = (-u).exp() * (2 + sine) * (1 + u.square()).sqrt();
  }
};

/// As a random variable: scalar, or with the batch hook.
template <class F>
struct Scalar {
  double operator()(Stream& rng) const { return F::one(rng.uniform()); }
};
template <class F>
struct Batched : Scalar<F> {
  void draws(Stream& rng, std::span<double> out) const {
    rng.fill(out);
    F::many(array(out));
  }
};
/// As an integrand.
template <class F>
struct ScalarIntegrand {
  double operator()(double x) const { return F::one(x); }
};
template <class F>
struct BatchedIntegrandOf : ScalarIntegrand<F> {
  using ScalarIntegrand<F>::operator();
  void operator()(std::span<const double> at, std::span<double> out) const {
    std::copy(at.begin(), at.end(), out.begin());
    F::many(array(out));
  }
};

template <class Sample>
auto repeated(const Sample& sample) {
  return [&sample] {
    double total = 0;
    for (std::uint64_t i = 0; i < 2048; ++i) {
      Stream rng(1, i);
      total += sample(rng);
    }
    benchmark::DoNotOptimize(total);
  };
}

/// Times a draw of level 8, 256 look-ups, or a sample of an estimator with a base of 64 points, 163 look-ups.
template <class Batch, class One>
void register_batch(const std::string& name, const Batch& batch, const One& one) {
  benchmark::RegisterBenchmark(("batch/" + name).c_str(),
                               [batch, one](benchmark::State& state) {
                                 for (auto _ : state) {
                                   report(state, paired_ratio(repeated(batch), repeated(one), 41), 2048);
                                 }
                               })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

template <class F>
void register_batches() {
  const functions::Log g;
  const std::string name = F::name;
  const auto level_8 = [](const auto& s) { return [s](Stream& rng) { return s(8, rng).value; }; };
  const auto sample = [](const auto& s) {
    return [e = single_term(s, {.base_level = 6})](Stream& rng) {
      NullRecord none;
      return e(rng, none).value;
    };
  };
  const auto comb = function_of_integral(BatchedIntegrandOf<F>{}, g);
  const auto plain_comb = function_of_integral(ScalarIntegrand<F>{}, g);
  register_batch(name + "/draws", level_8(function_of_mean(Batched<F>{}, g)),
                 level_8(function_of_mean(Scalar<F>{}, g)));
  register_batch(name + "/comb", level_8(comb), level_8(plain_comb));
  register_batch(name + "/single_term", sample(comb), sample(plain_comb));
}

const bool registered = [] {
  register_comb<Sinusoid>(4);
  register_comb<Step>(4);
  register_comb<Linear>(1);
  register_batches<ExpOf>();
  register_batches<SinOf>();
  register_batches<SqrtOf>();
  register_batches<SmoothOf>();
  register_table("means", add_means);
  return true;
}();

}  // namespace
}  // namespace debias::bench

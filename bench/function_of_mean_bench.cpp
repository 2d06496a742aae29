// Telescoping combs against plain loops (plain/...: ratio of times, alternating in one run), and batch hooks on Eigen
// arrays against the scalar loop (batch/...). The hooks show what they are worth with -DCMAKE_CXX_FLAGS=-march=x86-64-v3.

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

#include <debias/core/estimator.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>

#include "baseline_exponential.hpp"
#include "media.hpp"
#include "paired.hpp"

namespace debias::bench {
namespace {

template <class F>
void register_comb(double tau) {
  const F f(tau);
  const Geometric law = Geometric::with_exponent(2.5);
  const auto e = single_term(function_of_integral(f, functions::ExpMinus{}), law, {.base_level = 2});
  const auto plain = [f, r = law.mass(0)](Stream& rng) { return plain::telescoping_comb(f, 2, r, rng); };
  const std::string name =
      std::string("plain/telescoping_comb/") + F::name + "/tau_" + std::to_string(static_cast<int>(tau));
  benchmark::RegisterBenchmark(name.c_str(),
                               [e, plain](benchmark::State& state) { compare(state, e, plain); })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
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

// One estimate of level 8: 256 draws.
template <class S>
auto estimates(const S& s) {
  return [s] {
    double total = 0;
    for (std::uint64_t i = 0; i < 2048; ++i) {
      Stream rng(1, i);
      total += s(8, rng).value;
    }
    benchmark::DoNotOptimize(total);
  };
}

template <class Batch, class One>
void register_batch(const std::string& name, const Batch& batch, const One& one) {
  benchmark::RegisterBenchmark(("batch/" + name).c_str(),
                               [batch, one](benchmark::State& state) {
                                 for (auto _ : state)
                                   report(state, paired_ratio(estimates(batch), estimates(one), 41),
                                          2048 * 256);
                               })
      ->Iterations(1)
      ->Unit(benchmark::kMillisecond);
}

template <class F>
void register_batches() {
  const functions::Log g;
  const std::string name = F::name;
  register_batch(name + "/draws", function_of_mean(Batched<F>{}, g), function_of_mean(Scalar<F>{}, g));
  register_batch(name + "/comb", function_of_integral(BatchedIntegrandOf<F>{}, g),
                 function_of_integral(ScalarIntegrand<F>{}, g));
}

const bool registered = [] {
  register_comb<Sinusoid>(4);
  register_comb<Step>(4);
  register_comb<Linear>(1);
  register_batches<ExpOf>();
  register_batches<SinOf>();
  register_batches<SqrtOf>();
  register_batches<SmoothOf>();
  return true;
}();

}  // namespace
}  // namespace debias::bench

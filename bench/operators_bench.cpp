// Log determinants by probes and Chebyshev terms beside what else there is (operators/...).
//
//   variance_work   variance of one sample x products with A that it takes, relative to the square of the truth
//   products        of one sample
//   error_at_1e4    relative error of a mean that has taken so many products: sqrt(variance_work / products + bias^2); and 1e6
//   z               standard errors from the truth: of the power series, whose radius is close to 1, no small number
//   slq             stochastic Lanczos quadrature as a plain loop: m steps a probe, no reorthogonalisation; `bias` is the mean of
//                   its difference to 300 steps on the same probes, relative to the truth, with its own standard error
//   cholesky        seconds of a sparse Cholesky factorisation of the 2-d Laplacian, and of ours to a relative error of 1e-4
//   vectors         memory of a sample at its peak beyond the matrix, in vectors of as many numbers as there are rows
//   time            seconds of a run on one thread over those of as many plain products y = A x, alternating

#if __has_include(<malloc.h>)
#include <malloc.h>
#endif

#include <chrono>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>

#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/linear_operators.hpp>
#include <debias/operators.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/recipe.hpp>

#include "../tests/operators/matrices.hpp"

namespace debias::bench {
namespace {

using Vector = Eigen::VectorXd;
using testing::chain;
using testing::grid;
using testing::kernel;
using testing::log_det_of_chain;
using testing::log_det_of_grid;
using testing::Sparse;

double log_det_by_cholesky(const Eigen::MatrixXd& a) {
  const Eigen::LLT<Eigen::MatrixXd> llt(a);
  return 2 * llt.matrixLLT().diagonal().array().log().sum();
}

/// Mean and variance of what is added.
struct Tally {
  double count = 0;
  double mean = 0;
  double squares = 0;

  void add(double x) {
    const double gap = x - mean;
    mean += gap / ++count;
    squares += gap * (x - mean);
  }
  [[nodiscard]] double variance() const { return squares / (count - 1); }
};

double seconds_of(const auto& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Probes average noise away and leave the bias.
void report_errors(benchmark::State& state, double variance_work, double bias) {
  state.counters["variance_work"] = variance_work;
  state.counters["error_at_1e4"] = std::sqrt(variance_work / 1e4 + bias * bias);
  state.counters["error_at_1e6"] = std::sqrt(variance_work / 1e6 + bias * bias);
}

template <class Result>
void report_run(benchmark::State& state, const Result& r, double truth, double offset = 0) {
  const double samples = static_cast<double>(r.samples);
  state.counters["products"] = r.work / samples;
  report_errors(state, r.components[0].variance * r.work / samples / (truth * truth), 0);
  state.counters["z"] = (r.mean + offset - truth) / r.standard_error;
}

/// A constant, since g++ 12 warns of a temporary plan without cause.
Plan plan_of(std::int64_t samples) {
  Plan plan;
  plan.samples = samples;
  return plan;
}

/// Bytes of resident memory: "VmRSS:" now, "VmHWM:" the most since the last `forget_peak`. 0 where the system does not say.
double resident(const std::string& which) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0;
    if (word == which && status >> kilobytes) return 1024 * kilobytes;
  }
  return 0;
}
void forget_peak() {
#ifdef __GLIBC__
  malloc_trim(0);  // what others have left would hide what comes
#endif
  std::ofstream("/proc/self/clear_refs") << 5;
}

template <class Work>
void once(const std::string& name, const Work& work) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [work](benchmark::State& state) {
                                 for (auto _ : state) work(state);
                               })
      ->Iterations(1)
      ->Unit(benchmark::kSecond);
}

/// z^T log(A) z by m steps of Lanczos, and by `most`.
struct Quadrature {
  double at_m;
  double at_most;
};
Quadrature lanczos_quadrature(const Sparse& a, const Vector& z, int m, int most) {
  std::vector<double> diagonal;
  std::vector<double> beside;
  const double length = z.norm();
  Vector q = z / length;
  Vector previous = Vector::Zero(z.size());
  for (int k = 0; k < most; ++k) {
    Vector next = a * q;
    if (k > 0) next -= beside.back() * previous;
    const double along = next.dot(q);
    next -= along * q;
    diagonal.push_back(along);
    beside.push_back(next.norm());
    previous = q;
    q = next / beside.back();
  }
  const auto of = [&](int steps) {
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
    solver.computeFromTridiagonal(Eigen::Map<const Vector>(diagonal.data(), steps),
                                  Eigen::Map<const Vector>(beside.data(), steps - 1));
    const Vector first = solver.eigenvectors().row(0);
    return length * length * (first.array().square() * solver.eigenvalues().array().log()).sum();
  };
  return {of(m), most == m ? 0 : of(most)};
}

void m08() {
  const double shift = 4.0 / 999;
  const double truth = log_det_of_chain(1000, shift);
  once("operators/M08/power_series", [=](benchmark::State& state) {
    const double middle = 2 + shift / 2;
    Sparse identity(1000, 1000);
    identity.setIdentity();
    const Sparse rest = identity - chain(1000, shift) / middle;
    report_run(state, estimate(roulette(log_determinant(rest), Geometric(1.0 / 484)), plan_of(4096)), truth,
               1000 * std::log(middle));
  });
  once("operators/M08/chebyshev", [=](benchmark::State& state) {
    report_run(state, estimate(roulette(log_determinant_spd(chain(1000, shift), {.lower = shift})), plan_of(1 << 15)),
               truth);
  });
  once("operators/M08/chebyshev_recipe", [=](benchmark::State& state) {
    report_run(state, estimate(recipe(log_determinant_spd(chain(1000, shift), {.lower = shift})), plan_of(1 << 15)),
               truth);
  });
  for (const int distance : {1, 3, 7, 15}) {
    once("operators/M08/coloured_" + std::to_string(distance), [=](benchmark::State& state) {
      const auto terms = log_determinant_spd(chain(1000, shift), {.lower = shift}, Coloured{.distance = distance});
      report_run(state, estimate(recipe(terms), plan_of(1 << 13)), truth);
    });
  }
}

/// On the same probes as `most` steps, which stand for the truth of each.
void quadrature_of(const std::string& name, const Sparse& a, double truth, int most, std::uint64_t probes) {
  for (const int m : {5, 10, 20, 40}) {
    once(name + "/slq_" + std::to_string(m), [=](benchmark::State& state) {
      Tally values;
      Tally differences;
      std::vector<double> z(static_cast<std::size_t>(a.rows()));
      for (std::uint64_t i = 0; i < probes; ++i) {
        Stream rng(1, i);
        debias::detail::fill_signs(z, rng);
        const Quadrature q = lanczos_quadrature(a, Eigen::Map<const Vector>(z.data(), a.rows()), m, most);
        values.add(q.at_m);
        differences.add(q.at_m - q.at_most);
      }
      const double bias = differences.mean / truth;
      state.counters["products"] = m;
      report_errors(state, values.variance() * m / (truth * truth), bias);
      state.counters["bias"] = bias;
      state.counters["bias_error"] = std::sqrt(differences.variance() / static_cast<double>(probes)) / truth;
    });
  }
}

void quadrature() {
  quadrature_of("operators/M08", chain(1000, 4.0 / 999), log_det_of_chain(1000, 4.0 / 999), 300, 256);
  // 9 x 10^4 unknowns, condition 2000
  const Sparse a = grid(300, 0.004);
  const double truth = log_det_of_grid(300, 0.004);
  quadrature_of("operators/laplacian_300", a, truth, 160, 64);
  once("operators/laplacian_300/signs", [=](benchmark::State& state) {
    report_run(state, estimate(recipe(log_determinant_spd(a, {.lower = 0.004})), plan_of(512)), truth);
  });
  once("operators/laplacian_300/coloured_2", [=](benchmark::State& state) {
    report_run(state, estimate(recipe(log_determinant_spd(a, {.lower = 0.004}, Coloured{.distance = 2})), plan_of(128)),
               truth);
  });
}

void probes() {
  const Sparse a = grid(60, 0.08);  // condition 101
  const double truth = log_det_of_grid(60, 0.08);
  once("operators/laplacian_60/signs", [=](benchmark::State& state) {
    report_run(state, estimate(recipe(log_determinant_spd(a, {.lower = 0.08})), plan_of(8192)), truth);
  });
  for (const int distance : {1, 2, 3, 5, 7}) {
    once("operators/laplacian_60/coloured_" + std::to_string(distance), [=](benchmark::State& state) {
      const auto terms = log_determinant_spd(a, {.lower = 0.08}, Coloured{.distance = distance});
      state.counters["colours"] = static_cast<double>(terms.columns());
      report_run(state, estimate(recipe(terms), plan_of(1024)), truth);
    });
  }
  const Eigen::MatrixXd k = kernel(300, 10, 0.1);
  const double of_kernel = log_det_by_cholesky(k);
  once("operators/kernel_300/signs", [=](benchmark::State& state) {
    report_run(state, estimate(recipe(log_determinant_spd(k, {.lower = 0.1})), plan_of(2048)), of_kernel);
  });
  for (const int vectors : {20, 40, 60}) {
    once("operators/kernel_300/hutch++_" + std::to_string(vectors), [=](benchmark::State& state) {
      const auto terms = log_determinant_spd(k, {.lower = 0.1}, HutchPlusPlus{.vectors = vectors});
      report_run(state, estimate(recipe(terms), plan_of(2048)), of_kernel);
    });
  }
}

void million() {
  once("operators/laplacian_1000/time", [](benchmark::State& state) {
    const Sparse a = grid(1000, 0.004);
    const double truth = log_det_of_grid(1000, 0.004);
    const auto terms = log_determinant_spd(a, {.lower = 0.004});
    const auto e = roulette(terms, Geometric(0.08), {.base_level = 8});
    double ours = 0;
    double theirs = 0;
    double products = 0;
    Tally values;
    std::vector<double> x(static_cast<std::size_t>(a.rows()), 1.0);
    std::vector<double> y(x.size(), 0.0);
    forget_peak();
    const double before = resident("VmRSS:");
    for (std::uint64_t i = 0; i < 32; ++i) {
      double work = 0;
      ours += seconds_of([&] {
        Stream rng(1, i);
        NullRecord record;
        const auto sample = e(rng, record);
        values.add(sample.value);
        work = sample.work;
      });
      products += work;
      Eigen::Map<const Vector> from(x.data(), a.rows());
      Eigen::Map<Vector> to(y.data(), a.rows());
      theirs += seconds_of([&] {
        for (double k = 0; k < work; ++k) {
          to.noalias() = a.transpose() * from;  // by rows: the faster of the two
          benchmark::ClobberMemory();
        }
      });
    }
    state.counters["vectors"] = (resident("VmHWM:") - before) / (8 * static_cast<double>(a.rows()));
    state.counters["products"] = products / 32;
    state.counters["time"] = ours / theirs;
    state.counters["seconds_a_product"] = theirs / products;
    state.counters["relative_error"] = std::sqrt(values.variance() / 32) / truth;
    state.counters["z"] = (values.mean - truth) / std::sqrt(values.variance() / 32);
    state.counters["variance_work"] = values.variance() * products / 32 / (truth * truth);
  });
  for (const Eigen::Index side : {100, 300, 1000}) {
    once("operators/laplacian_" + std::to_string(side) + "/ours", [=](benchmark::State& state) {
      const Sparse a = grid(side, 0.004);
      const double truth = log_det_of_grid(side, 0.004);
      // the standard error falls with the root of rows x samples: 32 of 10^6 rows for 1e-4
      const auto samples = static_cast<std::int64_t>(40e6 / static_cast<double>(side * side));
      const auto r = estimate(recipe(log_determinant_spd(a, {.lower = 0.004}, Coloured{.distance = 2})),
                              plan_of(std::max<std::int64_t>(8, samples / 40)));
      report_run(state, r, truth);
      state.counters["relative_error"] = r.standard_error / truth;
      state.counters["probe_share"] = r.split.probe_share();
    });
  }
  for (const Eigen::Index side : {100, 300}) {
    once("operators/laplacian_" + std::to_string(side) + "/cholesky", [=](benchmark::State& state) {
      const Sparse a = grid(side, 0.004);
      const Eigen::SimplicialLDLT<Sparse> ldlt(a);
      const double log_det = ldlt.vectorD().array().log().sum();
      state.counters["entries_of_the_factor"] = static_cast<double>(ldlt.matrixL().nestedExpression().nonZeros());
      state.counters["error"] = log_det / log_det_of_grid(side, 0.004) - 1;
    });
  }
}

const bool registered = [] {
  m08();
  quadrature();
  probes();
  million();
  return true;
}();

}  // namespace
}  // namespace debias::bench

// Nothing allocates per sample, and the memory of a run does not grow with the number of samples.
//
// Counted by replacing operator new for the whole test program: every call, and the bytes that are alive at
// once. Left alone under the sanitizers that replace it themselves.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <span>
#include <vector>

#include <malloc.h>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/operators.hpp>
#include <debias/pmf/geometric.hpp>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define DEBIAS_TEST_SANITIZED
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define DEBIAS_TEST_SANITIZED
#endif
#endif

#ifndef DEBIAS_TEST_SANITIZED

namespace {

std::atomic<std::int64_t> calls = 0;
std::atomic<std::int64_t> alive = 0;
std::atomic<std::int64_t> peak = 0;

void* counted(void* p) {
  if (p == nullptr) throw std::bad_alloc();
  ++calls;
  const std::int64_t now = alive += static_cast<std::int64_t>(malloc_usable_size(p));
  std::int64_t seen = peak;
  while (now > seen && !peak.compare_exchange_weak(seen, now)) {
  }
  return p;
}

void release(void* p) {
  alive -= static_cast<std::int64_t>(malloc_usable_size(p));
  std::free(p);
}

}  // namespace

void* operator new(std::size_t size) { return counted(std::malloc(std::max<std::size_t>(size, 1))); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto a = static_cast<std::size_t>(alignment);
  return counted(std::aligned_alloc(a, (size + a - 1) / a * a));
}
void operator delete(void* p) noexcept { release(p); }
void operator delete(void* p, std::size_t) noexcept { release(p); }
void operator delete(void* p, std::align_val_t) noexcept { release(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { release(p); }

namespace {

using namespace debias;

/// What one run asks of the heap: calls of operator new, and the most bytes alive beyond those before it.
struct HeapUse {
  std::int64_t calls;
  std::int64_t peak;
};

template <class E>
HeapUse heap_use(const E& estimator, std::int64_t samples) {
  const std::int64_t calls_before = calls;
  const std::int64_t alive_before = alive;
  peak = alive_before;
  estimate(estimator, {.samples = samples, .seed = 3, .threads = 2});
  return {calls - calls_before, peak - alive_before};
}

}  // namespace

TEST_CASE("a million scalar samples allocate by the chunk, not by the sample, in memory that does not grow",
          "[core][estimate][exact]") {
  const auto halves = [](std::int64_t level, Stream& rng) {
    const double unit = std::ldexp(1.0, -static_cast<int>(level));
    const double u = rng.uniform();
    return level == 0 ? base(u) : coupled(u * (2 - unit), u * (2 - 2 * unit));
  };
  const auto debiased = single_term(halves, Geometric(0.6));
  // 1954 and 7813 chunks of 512. A chunk that lags leaves at most two open nodes a level of the tree of chunks, each with
  // at most 4096 values of either tail: 20 nodes of 100 kB, whatever the order in which the threads end.
  for (const std::int64_t samples : {1'000'000, 4'000'000}) {
    const HeapUse use = heap_use(debiased, samples);
    CAPTURE(samples, use.calls, use.peak);
    CHECK(use.calls < samples / 200);
    CHECK(use.peak < 2'000'000);
  }

  // three colours through a function of their mean, base and difference from shared draws
  using Color = Eigen::Array3d;
  const auto color = [](Stream& rng) {
    const double u = rng.uniform();
    return Color(u, u * u, 1 - u);
  };
  const auto fade = [](const Color& mean) -> Color { return (-mean).exp(); };
  const auto colors = single_term(function_of_mean(color, fade), Geometric(0.6));
  CHECK(heap_use(colors, 1'000'000).calls < 8000);

  const auto allocating = [&debiased](Stream& rng) {
    NullRecord record;
    const std::vector<double> on_the_heap(1, debiased(rng, record).value);
    return on_the_heap[0];
  };
  CHECK_FALSE(heap_use(allocating, 1'000'000).calls < 8000);
}

TEST_CASE("a term of an operator allocates nothing, a probe its vectors", "[operators][exact]") {
  const auto chain = symmetric_operator(100, [](std::span<const double> x, std::span<double> y) {
    for (std::size_t i = 0; i < 100; ++i) y[i] = 2.5 * x[i] - (i > 0 ? x[i - 1] : 0) - (i < 99 ? x[i + 1] : 0);
  });
  const Eigen::SparseMatrix<double> identity = Eigen::MatrixXd::Identity(100, 100).sparseView();
  const auto count = [](const auto& terms) {
    Stream rng(1, 1);
    const std::int64_t before = calls;
    auto cursor = terms(rng);
    const std::int64_t drawn = calls;
    double sum = 0;
    for (int k = 0; k < 50; ++k) sum += component(cursor().value, 0);
    CHECK(std::isfinite(sum));
    CHECK(calls == drawn);
    return drawn - before;
  };
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(100);
  CHECK(count(log_determinant_spd(chain, {.lower = 0.5})) == 3);
  CHECK(count(log_determinant_spd(identity, {.lower = 0.5})) == 2);
  CHECK(count(solve(chain, b, b, {.lower = 0.5})) == 3);
  CHECK(count(log_determinant_gradient(chain, {.lower = 0.5}, RandomSigns{}, identity)) == 4);
  // power check: an operator that makes a vector does so in every term
  const auto making = symmetric_operator(100, [](std::span<const double> x, std::span<double> y) {
    const std::vector<double> copy(x.begin(), x.end());
    for (std::size_t i = 0; i < 100; ++i) y[i] = 2 * copy[i];
  });
  const auto returning = log_determinant_spd(making, {.lower = 1});
  Stream rng(1, 1);
  auto cursor = returning(rng);
  const std::int64_t before = calls;
  cursor();
  CHECK(calls > before);
}

#endif

#include <debias/core/vector_math.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <debias/core/instructions.hpp>

#if defined(__x86_64__) && (__GLIBC__ > 2 || (__GLIBC__ == 2 && __GLIBC_MINOR__ >= 35))
#include <immintrin.h>

// glibc's libmvec, by the names of the x86-64 vector function ABI: b2 is SSE2, d4 AVX2, e8 AVX-512.
extern "C" {
__m128d _ZGVbN2v_exp(__m128d);
__m128d _ZGVbN2v_expm1(__m128d);
__m128d _ZGVbN2v_log(__m128d);
__m128d _ZGVbN2v_log1p(__m128d);
__m128d _ZGVbN2v_sin(__m128d);
[[gnu::target("avx2")]] __m256d _ZGVdN4v_exp(__m256d);
[[gnu::target("avx2")]] __m256d _ZGVdN4v_expm1(__m256d);
[[gnu::target("avx2")]] __m256d _ZGVdN4v_log(__m256d);
[[gnu::target("avx2")]] __m256d _ZGVdN4v_log1p(__m256d);
[[gnu::target("avx2")]] __m256d _ZGVdN4v_sin(__m256d);
[[gnu::target("avx512f")]] __m512d _ZGVeN8v_exp(__m512d);
[[gnu::target("avx512f")]] __m512d _ZGVeN8v_expm1(__m512d);
[[gnu::target("avx512f")]] __m512d _ZGVeN8v_log(__m512d);
[[gnu::target("avx512f")]] __m512d _ZGVeN8v_log1p(__m512d);
[[gnu::target("avx512f")]] __m512d _ZGVeN8v_sin(__m512d);
}

namespace debias::vector_math {
namespace {

// One function at each width.
struct Function {
  __m128d (*two)(__m128d);
  __m256d (*four)(__m256d);
  __m512d (*eight)(__m512d);
};

void apply_sse2(const Function& f, double* x, std::size_t n) {
  for (std::size_t i = 0; i < n; i += 2) _mm_storeu_pd(x + i, f.two(_mm_loadu_pd(x + i)));
}
[[gnu::target("avx2")]] void apply_avx2(const Function& f, double* x, std::size_t n) {
  for (std::size_t i = 0; i < n; i += 4) _mm256_storeu_pd(x + i, f.four(_mm256_loadu_pd(x + i)));
}
[[gnu::target("avx512f")]] void apply_avx512(const Function& f, double* x, std::size_t n) {
  for (std::size_t i = 0; i < n; i += 8) _mm512_storeu_pd(x + i, f.eight(_mm512_loadu_pd(x + i)));
}

void apply(const Function& f, std::span<double> x) {
  const auto some = [&](double* from, std::size_t n) {
    switch (instructions()) {
      case Instructions::avx512:
        return apply_avx512(f, from, n);
      case Instructions::avx2:
        return apply_avx2(f, from, n);
      case Instructions::sse2:
        return apply_sse2(f, from, n);
    }
  };
  constexpr std::size_t widest = 8;
  const std::size_t whole = x.size() / widest * widest;
  if (whole > 0) some(x.data(), whole);
  if (whole == x.size()) return;
  // The rest as a full vector, not by the scalar function: its last digits are others.
  std::array<double, widest> rest;
  rest.fill(0.5);
  const std::span<double> left = x.subspan(whole);
  std::copy(left.begin(), left.end(), rest.begin());
  some(rest.data(), widest);
  std::copy_n(rest.begin(), left.size(), left.begin());
}

}  // namespace

void exp(std::span<double> x) { apply({_ZGVbN2v_exp, _ZGVdN4v_exp, _ZGVeN8v_exp}, x); }
void expm1(std::span<double> x) { apply({_ZGVbN2v_expm1, _ZGVdN4v_expm1, _ZGVeN8v_expm1}, x); }
void log(std::span<double> x) { apply({_ZGVbN2v_log, _ZGVdN4v_log, _ZGVeN8v_log}, x); }
void log1p(std::span<double> x) { apply({_ZGVbN2v_log1p, _ZGVdN4v_log1p, _ZGVeN8v_log1p}, x); }
void sin(std::span<double> x) { apply({_ZGVbN2v_sin, _ZGVdN4v_sin, _ZGVeN8v_sin}, x); }

}  // namespace debias::vector_math

#else

namespace debias::vector_math {

void exp(std::span<double> x) {
  for (double& v : x) v = std::exp(v);
}
void expm1(std::span<double> x) {
  for (double& v : x) v = std::expm1(v);
}
void log(std::span<double> x) {
  for (double& v : x) v = std::log(v);
}
void log1p(std::span<double> x) {
  for (double& v : x) v = std::log1p(v);
}
void sin(std::span<double> x) {
  for (double& v : x) v = std::sin(v);
}

}  // namespace debias::vector_math

#endif

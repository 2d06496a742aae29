#include <debias/core/stream.hpp>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include <debias/core/instructions.hpp>
#include <debias/core/stream_batch.hpp>

#if defined(__x86_64__)
#include <immintrin.h>
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // of _mm512_undefined_epi32 (GCC bug 105593)
#endif
#endif

namespace debias {
namespace {

// P(r) / Q(r) with the coefficients from the constant term up; Q's constant term is 1.
struct Rational {
  double p[8];
  double q[8];

  [[gnu::always_inline]] double operator()(double r) const { return horner(p, r) / horner(q, r); }

 private:
  // Written out, so that a loop over many r is a loop over vectors.
  [[gnu::always_inline]] static double horner(const double (&c)[8], double r) {
    return ((((((c[7] * r + c[6]) * r + c[5]) * r + c[4]) * r + c[3]) * r + c[2]) * r + c[1]) * r + c[0];
  }
};

// AS 241, PPND16: |u - 1/2| <= 0.425, then sqrt(-log(tail)) up to 5, then beyond.
constexpr Rational central = {
    {3.3871328727963666080e0, 1.3314166789178437745e+2, 1.9715909503065514427e+3, 1.3731693765509461125e+4,
     4.5921953931549871457e+4, 6.7265770927008700853e+4, 3.3430575583588128105e+4, 2.5090809287301226727e+3},
    {1.0, 4.2313330701600911252e+1, 6.8718700749205790830e+2, 5.3941960214247511077e+3, 2.1213794301586595867e+4,
     3.9307895800092710610e+4, 2.8729085735721942674e+4, 5.2264952788528545610e+3}};
constexpr Rational middle = {
    {1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0, 3.64784832476320460504e0,
     1.27045825245236838258e0, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4},
    {1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1, 1.48103976427480074590e-1,
     1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9}};
constexpr Rational far = {
    {6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7},
    {1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2, 7.86869131145613259100e-4,
     1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15}};

constexpr double central_width = 0.425;

[[gnu::always_inline]] inline double central_quantile(double u) {
  const double q = u - 0.5;
  return q * central(0.180625 - q * q);
}

// What the magnitude of the quantile of a tail is a rational function of.
[[gnu::always_inline]] inline double tail_distance(double u) { return std::sqrt(-std::log(u < 0.5 ? u : 1 - u)); }

}  // namespace

double normal_quantile(double u) {
  const double q = u - 0.5;
  if (std::abs(q) <= central_width) return central_quantile(u);
  const double r = tail_distance(u);
  const double magnitude = r <= 5 ? middle(r - 1.6) : far(r - 5);
  return q < 0 ? -magnitude : magnitude;
}

// ---- many numbers at once

namespace {

r123::Philox2x64::ctr_type philox_block(std::uint64_t block, std::uint64_t index, std::uint64_t key) {
  return r123::Philox2x64()({{block, index}}, {{key}});
}

#if defined(__x86_64__)

// Philox2x64-10 of eight counters side by side, `chains` times over to hide latencies. AVX-512 only: four lanes of
// AVX2, which multiply 32 bits at a time, take longer than one multiplication of 64 bits after the other.

constexpr std::uint64_t multiplier = 0xD2B74407B1CE6E93u;
constexpr std::uint64_t weyl = 0x9E3779B97F4A7C15u;
constexpr std::size_t lanes = 8;
constexpr std::size_t chains = 4;

struct Blocks {
  __m512i first[chains];   // counters, then the first numbers
  __m512i second[chains];  // indices, then the second numbers
  __m512i key[chains];
};

// The upper 64 bits of a times the multiplier, from pieces of 52 and 12 bits.
[[gnu::target("avx512f,avx512dq,avx512vl,avx512ifma"), gnu::always_inline]] inline __m512i upper_product(__m512i a) {
  const __m512i low = _mm512_set1_epi64(static_cast<long long>(multiplier));  // an operand is its lower 52 bits
  const __m512i high = _mm512_set1_epi64(static_cast<long long>(multiplier >> 52));
  const __m512i top = _mm512_srli_epi64(a, 52);
  __m512i p = _mm512_madd52hi_epu64(_mm512_setzero_si512(), a, low);
  __m512i q = _mm512_madd52hi_epu64(_mm512_setzero_si512(), a, high);
  p = _mm512_madd52lo_epu64(p, top, low);
  q = _mm512_madd52hi_epu64(q, top, low);
  p = _mm512_madd52lo_epu64(p, a, high);
  q = _mm512_madd52lo_epu64(q, top, high);
  return _mm512_add_epi64(_mm512_srli_epi64(p, 12), _mm512_slli_epi64(q, 40));
}

[[gnu::target("avx512f,avx512dq,avx512vl,avx512ifma"), gnu::always_inline]] inline void philox(Blocks& x) {
  const __m512i m = _mm512_set1_epi64(static_cast<long long>(multiplier));
  for (int round = 0; round < 10; ++round) {
    for (std::size_t c = 0; c < chains; ++c) {
      const __m512i upper = upper_product(x.first[c]);
      const __m512i lower = _mm512_mullo_epi64(x.first[c], m);
      x.first[c] = _mm512_ternarylogic_epi64(upper, x.key[c], x.second[c], 0x96);  // exclusive or of the three
      x.second[c] = lower;
      x.key[c] = _mm512_add_epi64(x.key[c], _mm512_set1_epi64(static_cast<long long>(weyl)));
    }
  }
}

// Stream::to_uniform: the 52 bits as those of a number in [1, 2), less 1 - 2^-53. Exact, and so the same.
[[gnu::target("avx512f,avx512dq,avx512vl,avx512ifma"), gnu::always_inline]] inline __m512d to_uniforms(__m512i bits) {
  const __m512i one = _mm512_castpd_si512(_mm512_set1_pd(1));
  return _mm512_sub_pd(_mm512_castsi512_pd(_mm512_or_si512(_mm512_srli_epi64(bits, 12), one)),
                       _mm512_set1_pd(1 - 0x1p-53));
}

// The numbers from block `first` of one stream on; out.size() is a multiple of bulk.
constexpr std::size_t bulk = 2 * lanes * chains;
[[gnu::target("avx512f,avx512dq,avx512vl,avx512ifma")]] void fill_bulk(std::uint64_t first, std::uint64_t index,
                                                                       std::uint64_t key, std::span<double> out) {
  const __m512i low_half = _mm512_set_epi64(11, 3, 10, 2, 9, 1, 8, 0);
  const __m512i high_half = _mm512_set_epi64(15, 7, 14, 6, 13, 5, 12, 4);
  for (std::size_t i = 0; i < out.size(); i += bulk, first += lanes * chains) {
    Blocks x;
    for (std::size_t c = 0; c < chains; ++c) {
      x.first[c] = _mm512_add_epi64(_mm512_set1_epi64(static_cast<long long>(first + lanes * c)),
                                    _mm512_set_epi64(7, 6, 5, 4, 3, 2, 1, 0));
      x.second[c] = _mm512_set1_epi64(static_cast<long long>(index));
      x.key[c] = _mm512_set1_epi64(static_cast<long long>(key));
    }
    philox(x);
    for (std::size_t c = 0; c < chains; ++c) {
      const __m512d a = to_uniforms(x.first[c]);
      const __m512d b = to_uniforms(x.second[c]);
      double* const to = &out[i + 2 * lanes * c];
      _mm512_storeu_pd(to, _mm512_permutex2var_pd(a, low_half, b));
      _mm512_storeu_pd(to + lanes, _mm512_permutex2var_pd(a, high_half, b));
    }
  }
}

// Rows of one number a stream: row t holds the numbers at `position` + t.
[[gnu::target("avx512f,avx512dq,avx512vl,avx512ifma")]] void fill_rows(std::uint64_t position, std::uint64_t index,
                                                                       const std::uint64_t* keys, std::size_t size,
                                                                       std::span<double> out) {
  const std::size_t groups = (size + lanes - 1) / lanes;
  const std::uint64_t first = position / 2;
  const std::size_t rows = out.size() / size;
  const auto skipped = static_cast<std::size_t>(position % 2);  // a block whose first number has been drawn
  const std::size_t units = (skipped + rows + 1) / 2 * groups;  // blocks of eight streams
  for (std::size_t u = 0; u < units; u += chains) {
    Blocks x;
    std::size_t members[chains];
    __mmask8 masks[chains];
    for (std::size_t c = 0; c < chains; ++c) {  // beyond the last: numbers that are not stored
      members[c] = lanes * ((u + c) % groups);
      const std::size_t left = size - members[c];
      masks[c] = static_cast<__mmask8>(left >= lanes ? 0xff : (1 << left) - 1);
      x.first[c] = _mm512_set1_epi64(static_cast<long long>(first + (u + c) / groups));
      x.second[c] = _mm512_set1_epi64(static_cast<long long>(index));
      x.key[c] = _mm512_maskz_loadu_epi64(masks[c], keys + members[c]);
    }
    philox(x);
    for (std::size_t c = 0; c < chains && u + c < units; ++c) {
      const std::size_t member = members[c];
      const __mmask8 mask = masks[c];
      const std::size_t row = 2 * ((u + c) / groups);  // of the first number, from the first of the block on
      if (row >= skipped) _mm512_mask_storeu_pd(&out[(row - skipped) * size + member], mask, to_uniforms(x.first[c]));
      if (row + 1 - skipped < rows) {
        _mm512_mask_storeu_pd(&out[(row + 1 - skipped) * size + member], mask, to_uniforms(x.second[c]));
      }
    }
  }
}

bool wide() {
  static const bool is_wide = instructions() == Instructions::avx512 && __builtin_cpu_supports("avx512ifma") != 0;
  return is_wide;
}

#endif

// f of many numbers, in the widest vectors there are: the same bits in all of them.
template <class F>
[[gnu::always_inline]] inline void each(const double* from, double* to, std::size_t n, const F& f) {
  for (std::size_t i = 0; i < n; ++i) to[i] = f(from[i]);
}
#if defined(__x86_64__)
template <class F>
[[gnu::target("avx2")]] void each_avx2(const double* from, double* to, std::size_t n, const F& f) {
  each(from, to, n, f);
}
template <class F>
[[gnu::target("avx512f,avx512dq,avx512vl")]] void each_avx512(const double* from, double* to, std::size_t n,
                                                              const F& f) {
  each(from, to, n, f);
}
#endif
template <class F>
void each_of(const double* from, double* to, std::size_t n, const F& f) {
#if defined(__x86_64__)
  switch (instructions()) {
    case Instructions::avx512:
      return each_avx512(from, to, n, f);
    case Instructions::avx2:
      return each_avx2(from, to, n, f);
    case Instructions::sse2:
      break;
  }
#endif
  each(from, to, n, f);
}

struct Central {
  [[gnu::always_inline]] double operator()(double u) const { return central_quantile(u); }
};
struct Middle {
  [[gnu::always_inline]] double operator()(double r) const { return middle(r - 1.6); }
};

}  // namespace

void normal_quantiles(std::span<double> numbers) {
  constexpr std::size_t block = 256;
  std::array<double, block> x;
  std::array<double, block> r;
  std::array<double, block> magnitude;
  std::array<std::size_t, block> where;
  for (; !numbers.empty(); numbers = numbers.subspan(std::min(block, numbers.size()))) {
    const std::span<double> u = numbers.first(std::min(block, numbers.size()));
    each_of(u.data(), x.data(), u.size(), Central{});  // as if all were central
    std::size_t tails = 0;
    for (std::size_t i = 0; i < u.size(); ++i) {
      where[tails] = i;
      tails += std::abs(u[i] - 0.5) <= central_width ? 0 : 1;
    }
    for (std::size_t i = 0; i < tails; ++i) r[i] = tail_distance(u[where[i]]);
    each_of(r.data(), magnitude.data(), tails, Middle{});
    for (std::size_t i = 0; i < tails; ++i) {
      const double m = r[i] <= 5 ? magnitude[i] : far(r[i] - 5);
      x[where[i]] = u[where[i]] < 0.5 ? -m : m;
    }
    std::copy_n(x.begin(), u.size(), u.begin());
  }
}

Stream::Block Stream::point_block(std::uint64_t own_key, std::uint64_t position) {
  const std::uint64_t r = (position & ~point_mark) >> point_shift;
  // point_key is its own inverse, for it is an exclusive or.
  const auto bits = net_bits_of_pair(point_key(own_key, r), r, (position & dimension_mask) >> 1);
  return {{bits[0], bits[1]}};
}

std::uint64_t Stream::coordinate(std::uint64_t own_key, std::uint64_t position, std::uint64_t dimension) {
  const std::uint64_t r = (position & ~point_mark) >> point_shift;
  return net_bits(point_key(own_key, r), r, dimension);
}

void Stream::refuse_point(std::uint64_t r) {
  throw std::length_error("net: point " + std::to_string(r) + " (a net has " + std::to_string(net_points) +
                          " points); take smaller blocks, and more of them");
}

void Stream::fill(std::span<double> uniforms) {
  if (is_point()) {
    for (double& u : uniforms) u = uniform();
    return;
  }
  if (!uniforms.empty() && (position_ & 1) != 0) {
    uniforms.front() = uniform();
    uniforms = uniforms.subspan(1);
  }
#if defined(__x86_64__)
  if (const std::size_t n = uniforms.size() / bulk * bulk; n > 0 && wide()) {
    fill_bulk(position_ / 2, index_, key_, uniforms.first(n));
    position_ += n;
    uniforms = uniforms.subspan(n);
  }
#endif
  const std::uint64_t first = position_ / 2;
  const std::size_t pairs = uniforms.size() / 2;
#if defined(__clang__)
#pragma clang loop vectorize(disable)  // into multiplications of 32 bits, at a third of the speed
#endif
  for (std::size_t i = 0; i < pairs; ++i) {
    const auto block = philox_block(first + i, index_, key_);
    uniforms[2 * i] = to_uniform(block[0]);
    uniforms[2 * i + 1] = to_uniform(block[1]);
  }
  position_ += 2 * pairs;
  if (uniforms.size() % 2 != 0) uniforms.back() = uniform();
}

void StreamBatch::uniforms(std::span<double> out) {
  assert(out.size() % size_ == 0);
  if (net_.any && position_ < net_dimensions) {
    const std::size_t netted = std::min<std::size_t>(out.size() / size_, net_dimensions - position_);
    net_uniforms(net_.key, net_.first, size_, position_, out.first(netted * size_));
    position_ += netted;
    out = out.subspan(netted * size_);
    if (out.empty()) return;
  }
  const std::size_t rows = out.size() / size_;
  const bool stratified = position_ == 0 && strata_ > 1 && rows > 0;
  bool done = false;
#if defined(__x86_64__)
  if (size_ >= lanes / 2 && wide()) {
    fill_rows(position_, index_, keys_.data(), size_, out);
    done = true;
  }
#endif
  if (!done && size_ == 1) {
    Stream rng(keys_[0], index_);
    rng.seek(position_);
    rng.fill(out);
  } else if (!done) {
    const auto skipped = static_cast<std::size_t>(position_ % 2);  // a block whose first number has been drawn
    for (std::size_t b = 0; b < size_; ++b) {
      for (std::size_t t = 0; t < rows + skipped; t += 2) {
        const auto block = philox_block((position_ + t) / 2, index_, keys_[b]);
        if (t >= skipped) out[(t - skipped) * size_ + b] = Stream::to_uniform(block[0]);
        if (t + 1 - skipped < rows) out[(t + 1 - skipped) * size_ + b] = Stream::to_uniform(block[1]);
      }
    }
  }
  position_ += rows;
  if (!stratified) return;
  const double width = 1 / static_cast<double>(strata_);
  for (std::size_t b = 0; b < size_; ++b) {
    const double u = (static_cast<double>(rank_ + static_cast<std::int64_t>(b)) + out[b]) * width;
    out[b] = std::min(u, 1 - 0x1p-53);  // rounding may reach 1
  }
}

}  // namespace debias

#include <debias/core/points.hpp>

#include <algorithm>
#include <bit>
#include <cassert>

#include <debias/core/instructions.hpp>
#include <debias/core/stream.hpp>

#include "core/sobol.hpp"

namespace debias {
namespace {

constexpr std::size_t most_members = 64;

using detail::SobolTable;

[[gnu::always_inline]] inline std::uint64_t reverse(std::uint64_t x) {
  x = __builtin_bswap64(x);
  x = ((x >> 4) & 0x0f0f0f0f0f0f0f0fu) | ((x & 0x0f0f0f0f0f0f0f0fu) << 4);
  x = ((x >> 2) & 0x3333333333333333u) | ((x & 0x3333333333333333u) << 2);
  return ((x >> 1) & 0x5555555555555555u) | ((x & 0x5555555555555555u) << 1);
}

/// A permutation of 64 bits that looks random [Steele, Lea, Flood 2014].
[[gnu::always_inline]] inline std::uint64_t hash(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

/// What scrambles a dimension of a net.
struct Scramble {
  std::uint64_t seed;
  std::uint64_t shift;

  [[gnu::always_inline]] Scramble(std::uint64_t key, std::uint64_t dimension)
      : seed(hash(key + dimension * 0x9e3779b97f4a7c15u)),
        shift(hash((key ^ 0x6a09e667f3bcc909u) + dimension * 0x9e3779b97f4a7c15u)) {}

  /// Of a coordinate with its bits in opposite order. Even factors: no bit acts on itself or on one before it.
  [[gnu::always_inline]] std::uint64_t operator()(std::uint64_t x) const {
    x ^= x * 0x9e3f5a613d20adeau;
    x = (x + seed) * ((seed >> 32) | 1);
    x ^= x * 0xb5297a4d05526c56u;
    x ^= x * 0x68e31da453a22862u;
    return reverse(x) ^ shift;
  }
};

/// Stream::to_uniform by way of the bits of a number in [1, 2): exact, and so the same.
[[gnu::always_inline]] inline double to_uniform(std::uint64_t bits) {
  return std::bit_cast<double>((bits >> 12) | 0x3ff0000000000000u) - (1 - 0x1p-53);
}

/// Rows of `size` points from `first` on, in whole vectors where they do not reach into the 64 points that follow.
[[gnu::always_inline]] inline void rows_of(const SobolTable& table, std::uint64_t key, std::uint32_t first,
                                           std::size_t size, std::size_t dimension, std::span<double> out) {
  constexpr std::size_t lanes = 8;
  const std::size_t skipped = first % most_members;  // points before the first, of its 64
  const std::uint32_t whole = first - static_cast<std::uint32_t>(skipped);
  const std::uint32_t following = whole ^ static_cast<std::uint32_t>(whole + most_members);
  const std::size_t n = skipped % lanes == 0 ? std::min((size + lanes - 1) / lanes * lanes, most_members) : size;
  for (std::size_t t = dimension; !out.empty(); ++t, out = out.subspan(size)) {
    std::uint32_t words[2 * most_members];
    words[0] = 0;
    for (std::uint32_t r = whole; r != 0; r &= r - 1) words[0] ^= table.of_bit[std::countr_zero(r)][t];
    for (std::size_t width = 1, b = 0; width < most_members && width < skipped + n; width *= 2, ++b) {
      const std::uint32_t v = table.of_bit[b][t];
      for (std::size_t j = 0; j < width; ++j) words[width + j] = words[j] ^ v;
    }
    if (skipped + n > most_members) {
      std::uint32_t step = 0;
      for (std::uint32_t r = following; r != 0; r &= r - 1) step ^= table.of_bit[std::countr_zero(r)][t];
      for (std::size_t j = 0; j < most_members; ++j) words[most_members + j] = words[j] ^ step;
    }
    const Scramble scramble(key, t);
    double uniforms[most_members];
    double* const to = n == size ? out.data() : uniforms;
    for (std::size_t b = 0; b < n; ++b) to[b] = to_uniform(scramble(words[skipped + b]));
    if (n != size) std::copy_n(uniforms, size, out.data());
  }
}
#if defined(__x86_64__)
[[gnu::target("avx2")]] void rows_avx2(const SobolTable& table, std::uint64_t key, std::uint32_t first,
                                       std::size_t size, std::size_t dimension, std::span<double> out) {
  rows_of(table, key, first, size, dimension, out);
}
// In whole registers of 512 bits: half of them is the default, at half of the speed.
#if defined(__clang__)
[[gnu::target("avx512f,avx512dq,avx512vl"), clang::min_vector_width(512)]]
#else
[[gnu::target("avx512f,avx512dq,avx512vl,prefer-vector-width=512")]]
#endif
void rows_avx512(
    const SobolTable& table, std::uint64_t key, std::uint32_t first, std::size_t size, std::size_t dimension,
    std::span<double> out) {
  rows_of(table, key, first, size, dimension, out);
}
#endif

}  // namespace

std::array<std::uint64_t, 2> net_bits_of_pair(std::uint64_t key, std::uint64_t point, std::uint64_t pair) {
  assert(point < net_points);
  const std::uint64_t t = 2 * pair;
  if (t >= net_dimensions) {
    const auto block = r123::Philox2x64()({{pair, 0}}, {{point_key(key, point)}});
    return {block[0], block[1]};
  }
  const SobolTable& table = detail::sobol_table();
  std::uint32_t x = 0;
  std::uint32_t y = 0;
  for (auto r = static_cast<std::uint32_t>(point); r != 0; r &= r - 1) {
    const std::uint32_t* const v = &table.of_bit[std::countr_zero(r)][t];
    x ^= v[0];
    y ^= v[1];
  }
  return {Scramble(key, t)(x), Scramble(key, t + 1)(y)};
}

std::uint64_t net_bits(std::uint64_t key, std::uint64_t point, std::uint64_t dimension) {
  return net_bits_of_pair(key, point, dimension / 2)[dimension % 2];
}

void net_uniforms(std::uint64_t key, std::uint64_t first, std::size_t size, std::uint64_t dimension,
                  std::span<double> out) {
  assert(size >= 1 && size <= most_members && out.size() % size == 0 && first + size <= net_points);
  assert(dimension + out.size() / size <= net_dimensions);
  const auto point = static_cast<std::uint32_t>(first);
  const SobolTable& table = detail::sobol_table();
#if defined(__x86_64__)
  switch (instructions()) {
    case Instructions::avx512:
      return rows_avx512(table, key, point, size, dimension, out);
    case Instructions::avx2:
      return rows_avx2(table, key, point, size, dimension, out);
    case Instructions::sse2:
      break;
  }
#endif
  rows_of(table, key, point, size, dimension, out);
}

}  // namespace debias

#pragma once

// Points of scrambled digital nets: every coordinate is a pure function of (key, point, dimension).
//
//   bits(key, r, t) = reverse(owen(reverse(sobol(r, t)), seed(key, t))) xor shift(key, t)       t < 256
//                   = philox2x64-10(counter = (t / 2, 0), point_key(key, r))[t mod 2]           t >= 256
//   owen(x, s)      = a hash whose bit i depends on bits 0 ... i of x only: a random permutation of every subtree
//
//   Notation: key = name of the net, r = point, t = dimension, sobol(r, t) = coordinate of Sobol's sequence as 64 bits,
//   reverse = the bits in opposite order, seed and shift = hashes of key and dimension.
// Each point alone is exactly uniform, for the shift is. Together the points a 2^m ... (a + 1) 2^m - 1 of a key fill every
// elementary interval as a net does: a mean over them has a variance that falls faster than 2^-m where the integrand is smooth
// in few dimensions, and is hardly ever above that of plain numbers [Owen 1995, 1997]. Beyond 256 dimensions numbers are plain.
// Fails for what takes a varying count of numbers (rejection): the means stay right, the gain goes. A hash is no permutation
// drawn from all of them: variances are those of exact scrambling within a tenth (measured).
// Sources: Owen, Randomly permuted (t,m,s)-nets, 1995; Laine & Karras 2011 and Burley, JCGT 9(4), 2020 (hash); Joe & Kuo, SIAM
// J. Sci. Comput. 30 (2008) (direction numbers, as Boost.Random carries them under the Boost licence).

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace debias {

/// Dimensions of a net; later ones are plain numbers.
inline constexpr std::uint64_t net_dimensions = 256;

/// Points that a net can have, more than a member index of one block can use.
inline constexpr std::uint64_t net_points = std::uint64_t{1} << 27;

/// What is plain of point r has this key: its numbers beyond net_dimensions, and the children of its Stream.
constexpr std::uint64_t point_key(std::uint64_t key, std::uint64_t point) {
  return key ^ ((point + 1) * 0xd1342543de82ef95u);  // an odd factor: two points never share it
}

/// 64 random bits: coordinate `dimension` of point `point` < net_points of the net of this key.
std::uint64_t net_bits(std::uint64_t key, std::uint64_t point, std::uint64_t dimension);

/// net_bits of dimensions 2 pair and 2 pair + 1.
std::array<std::uint64_t, 2> net_bits_of_pair(std::uint64_t key, std::uint64_t point, std::uint64_t pair);

/// Uniforms in (0, 1), those of a Stream with these bits, of the points first ... first + size - 1, in rows of one dimension:
/// out[q * size + b] is coordinate dimension + q of point first + b. The rows end at net_dimensions at the latest; size is at
/// most 64. The same bits with any vector instructions.
void net_uniforms(std::uint64_t key, std::uint64_t first, std::size_t size, std::uint64_t dimension,
                  std::span<double> out);

}  // namespace debias

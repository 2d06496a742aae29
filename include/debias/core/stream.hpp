#pragma once

// Counter-based random numbers: every number is a pure function of (seed, index, branch, position).
//
//   bits(position) = philox2x64-10(counter = (position / 2, index), key)[position mod 2]
//   uniform        = (bits >> 12 + 1/2) 2^-52, an odd multiple of 2^-53 in (0, 1), never 0 or 1
//   key            = seed at the root; key(child) = mix(key(parent), branch)
//
// A stream may be a point of a scrambled net instead, `rng.point(r)`: its numbers are then the coordinates of the point in the
// order in which they are drawn, plain ones beyond the table; its splits are plain and depend on the point (core/points.hpp).
//
// Assumptions: a run draws fewer than 2^63 numbers per stream, 2^36 per point; keys of different branches are hashes, so two
// of n branches share a stream with probability n^2 / 2^65. Probabilities are resolved to 2^-52: an event
// rarer than that never happens, which shifts a mean by less than any standard error one can afford.
// The layout carries a version number and changes only with a major version of the library.
// Sources: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011 (philox);
// Steele, Lea, Flood, OOPSLA 2014 (mix); Wichura, Applied Statistics 37 (1988), AS 241 (normal).

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

// Nothing here uses its SSE types, and the intrinsics that come with them take a second to compile. Who needs them includes
// Random123 first, or sets both.
#ifndef R123_USE_SSE
#define R123_USE_SSE 0
#define R123_USE_X86INTRIN_H 0
#endif
#include <Random123/philox.h>

#include <debias/core/points.hpp>

#ifdef __FAST_MATH__
#error "debias: -ffast-math deletes the checks for non-finite samples; build without it"
#endif

namespace debias {

/// The quantile of the standard normal law at u in (0, 1); relative error about 1e-16 [AS 241, PPND16].
double normal_quantile(double u);

/// The same, bit for bit, of many numbers in place.
void normal_quantiles(std::span<double> u);

/// The random numbers of one sample. `Stream(rng)` has the same numbers once more (common random numbers), `split` has
/// independent ones. A callable that took its Stream by value would get the same numbers at every call, so a copy is
/// made only where it is written: `f(rng)` and `Stream other = rng` do not copy.
///
/// A Stream is a UniformRandomBitGenerator: `std::gamma_distribution<>(2, 1)(rng)` works. The standard does not say how
/// its distributions use the bits: their numbers differ between standard libraries, those of a Stream do not.
class Stream {
 public:
  using result_type = std::uint64_t;

  /// Changes whenever the same (seed, index, branch, position) would give another number.
  static constexpr int layout_version = 1;

  Stream(std::uint64_t seed, std::uint64_t index) : key_(seed), index_(index) {}

  explicit Stream(const Stream&) = default;
  Stream(Stream&&) = default;
  Stream& operator=(const Stream&) = delete;  // write `rng = Stream(other)`
  Stream& operator=(Stream&&) = default;
  ~Stream() = default;

  /// 64 random bits. Inlined by force: a compiler that has inlined a few may call the others, at half the speed.
  [[gnu::always_inline]] std::uint64_t bits() {
    const bool second = (position_ & 1) != 0;
    if (!second) refill();
    ++position_;
    return block_[second ? 1 : 0];
  }

  /// The same, for the distributions of the standard library: every value from min() to max() is as likely.
  [[gnu::always_inline]] result_type operator()() { return bits(); }
  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return ~result_type{0}; }

  /// Uniform in the open interval (0, 1); 1 - uniform() lies on the same lattice.
  [[gnu::always_inline]] double uniform() { return to_uniform(bits()); }

  /// Standard normal, by inversion: one uniform each, monotone in it.
  double normal() { return normal_quantile(uniform()); }

  /// Exponential with mean 1, by inversion.
  double exponential() { return -std::log(uniform()); }

  /// The same numbers as uniforms.size() calls of uniform(), in order; many at once where the machine can.
  void fill(std::span<double> uniforms);

  // A const Stream has nothing to give, and says so in one sentence.
  template <class Of = void>
  std::uint64_t bits() const {
    return refuse_const<Of>();
  }
  template <class Of = void>
  double uniform() const {
    return refuse_const<Of>();
  }
  template <class Of = void>
  double normal() const {
    return refuse_const<Of>();
  }
  template <class Of = void>
  double exponential() const {
    return refuse_const<Of>();
  }

  /// An independent stream; it does not depend on how much of this one has been used.
  [[nodiscard]] Stream split(std::uint64_t branch) const { return Stream(mix(key_, branch), index_); }

  /// The same; of a point, coordinate `dimension` is the first number of it, and the others are plain. So streams of their own
  /// gain too: no two of one point may have the same dimension.
  [[nodiscard]] Stream split(std::uint64_t branch, std::uint64_t dimension) const {
    Stream child = split(branch);
    if (is_point() && dimension < net_dimensions) [[unlikely]] {
      child.block_[1] = coordinate(key_, position_, dimension);
      child.position_ = 1;
    }
    return child;
  }

  /// Point r of the scrambled net that this stream names, whatever has been drawn from it. Each point alone is as random as
  /// any stream; points r = 0 ... 2^m - 1 together fill the cube evenly. Number t of a point is its coordinate t: draw what
  /// matters most first. A callable whose count of numbers varies (rejection, std::gamma_distribution) keeps its mean and
  /// loses the gain. The points of a point are those of another net for each.
  /// Throws std::length_error for r >= net_points.
  [[nodiscard]] Stream point(std::uint64_t r) const {
    if (r >= net_points) [[unlikely]]
      refuse_point(r);
    Stream s(point_key(net_key(key_, index_), r), index_);
    s.position_ = point_mark | (r << point_shift);
    return s;
  }

  /// Whether this is a point of a net.
  [[nodiscard]] bool is_point() const { return (position_ & point_mark) != 0; }

  /// The absolute index of the sample that this stream belongs to.
  [[nodiscard]] std::uint64_t index() const { return index_; }

 private:
  friend class StreamBatch;

  using Block = r123::Philox2x64::ctr_type;

  // The position of a point: a mark, the point, its dimension. The mark is the sign, which costs plain numbers least.
  static constexpr std::uint64_t point_mark = std::uint64_t{1} << 63;
  static constexpr int point_shift = 36;
  static constexpr std::uint64_t dimension_mask = (std::uint64_t{1} << point_shift) - 1;
  static_assert(net_points == point_mark >> point_shift);

  [[gnu::always_inline]] void refill() {
    if (static_cast<std::int64_t>(position_) < 0) [[unlikely]] {
      block_ = point_block(key_, position_);
    } else {
      block_ = r123::Philox2x64()({{position_ >> 1, index_}}, {{key_}});
    }
  }
  // By value: a stream whose address is known elsewhere would not stay in registers.
  static Block point_block(std::uint64_t own_key, std::uint64_t position);
  static std::uint64_t coordinate(std::uint64_t own_key, std::uint64_t position, std::uint64_t dimension);
  [[noreturn]] static void refuse_point(std::uint64_t r);

  template <class Of>
  static int refuse_const() {
    static_assert(!std::is_void_v<Of>,
                  "debias: this Stream is const, and a draw changes it; write (debias::Stream& rng), without const");
    return 0;
  }

  static double to_uniform(std::uint64_t bits) {
    return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52;  // 52 bits: with 53 the largest would round to 1
  }

  /// Of the net that a stream names: no branch of it has this key.
  static std::uint64_t net_key(std::uint64_t key, std::uint64_t index) { return mix(key ^ 0xbb67ae8584caa73bu, index); }

  static std::uint64_t mix(std::uint64_t key, std::uint64_t branch) {
    // The constant keeps key 0 from being its own child: seed 0, branch ~0 is Branch::pmf of the seed 0.
    std::uint64_t z = (key ^ 0x6a09e667f3bcc909u) + (branch + 1) * 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  /// To another position; a second number of a block is at hand only after its first.
  void seek(std::uint64_t position) {
    position_ = position;
    if ((position & 1) != 0) refill();
  }

  std::uint64_t key_;
  std::uint64_t index_;
  std::uint64_t position_ = 0;
  Block block_{};
};

/// Branches of a sample's stream that are not levels. Level k draws from split(k), so estimators and PMFs
/// that share a seed see the same level draws; everything else has a tag of its own up here.
enum class Branch : std::uint64_t { pmf = ~std::uint64_t{0}, pilot = ~std::uint64_t{1}, points = ~std::uint64_t{2} };

inline Stream split(const Stream& rng, Branch branch) { return rng.split(static_cast<std::uint64_t>(branch)); }

inline Stream split_level(const Stream& rng, std::int64_t level) {
  return rng.split(static_cast<std::uint64_t>(level));
}

}  // namespace debias

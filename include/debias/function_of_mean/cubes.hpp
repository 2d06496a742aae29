#pragma once

// Points of scrambled nets in the cube [0, 1]^d for the doubling of function_of_mean.hpp.
//
//   level k   the aligned block of 2^k points, a 2^k ... (a + 1) 2^k - 1 of a net, that a random point R is in
//   halves    the two aligned blocks of 2^(k-1) points that it is made of: nets again
//
// Notation and groups: function_of_mean/points.hpp. R moved by half a block is as random as R, so both halves have the law of the
// level below, exactly and whatever the scrambling; so has each group of a shared base. Mean of smooth f: its variance falls like
// 2^(-3k) in the end, with powers of k that keep it from there the longer the more coordinates matter; E D_k^2 is about its square.
// Never much worse than independent draws, nor better where f is a peak that few points meet: bring it to the middle first
// (function_of_mean/densities.hpp). No point is in step with another one, as on a comb.
// Fails beyond level 27: a net has no more points.
// Sources: Owen, Ann. Statist. 25 (1997), variance of scrambled nets; the aligned block derived here.

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>
#include <debias/function_of_mean/points.hpp>

namespace debias {

/// The cube [0, 1]^dimension, to be integrated over.
class Cube {
 public:
  /// Throws std::invalid_argument unless 1 <= dimension <= 256, the coordinates of a net.
  explicit Cube(std::int64_t dimension) : dimension_(static_cast<std::size_t>(dimension)) {
    if (dimension >= 1 && dimension <= static_cast<std::int64_t>(net_dimensions)) return;
    throw std::invalid_argument("Cube: dimension = " + std::to_string(dimension) +
                                " (must lie in 1 ... 256, the coordinates of a net)" +
                                (dimension > 0 ? "; take function_of_mean over draws of the integrand" : ""));
  }
  [[nodiscard]] std::size_t dimension() const { return dimension_; }

 private:
  std::size_t dimension_;
};

/// An integrand of the coordinates of a point, `f(x)` -> Value.
template <class F>
concept CubeIntegrand = requires(const F& f, std::span<const double> x) {
  requires Value<std::remove_cvref_t<decltype(f(x))>>;
};

/// One with a batch hook: `f(x, out)` beside f(x), the numbers at out.size() points, at most 64; coordinate t of point i is
/// x[t * out.size() + i].
template <class F>
concept BatchedCubeIntegrand = CubeIntegrand<F> &&
    requires(const F& f, std::span<const double> x, std::span<double> out) {
  f(x, out);
};

namespace detail {

/// The points of a net one after the other, from an aligned one on, and f there.
template <CubeIntegrand F>
class NetWalk {
 public:
  /// `count` points, a power of two, from a multiple of it on. f and the net must outlive the walk.
  NetWalk(const F& f, std::size_t dimension, const Stream& net, std::uint64_t first, std::int64_t count)
      : f_(&f), net_(&net), dimension_(dimension), point_(first) {
    const auto most = static_cast<std::size_t>(std::min<std::int64_t>(count, StreamBatch::capacity));
    size_ = std::min(most, std::bit_floor(coordinates / dimension));
    at_ = size_;
  }

  auto operator()() {
    if (at_ == size_) refill();
    const std::size_t i = at_++;
    if constexpr (BatchedCubeIntegrand<F>) {
      return values_[i];
    } else {
      for (std::size_t t = 0; t < dimension_; ++t) x_[t] = rows_[t * size_ + i];
      return (*f_)(std::span<const double>(x_).first(dimension_));
    }
  }

 private:
  static constexpr std::size_t coordinates = 1024;  // at a time
  struct None {};

  void refill() {
    const std::span<double> rows = std::span(rows_).first(size_ * dimension_);
    StreamBatch::points(*net_, point_, size_).uniforms(rows);
    point_ += size_;
    at_ = 0;
    if constexpr (BatchedCubeIntegrand<F>) (*f_)(std::span<const double>(rows), std::span(values_).first(size_));
  }

  static constexpr bool one_by_one = !BatchedCubeIntegrand<F>;

  const F* f_;
  const Stream* net_;
  std::size_t dimension_;
  std::uint64_t point_;
  std::size_t size_ = 0;  // points at a time
  std::size_t at_ = 0;
  std::array<double, coordinates> rows_;  // not zeroed, like those below
  [[no_unique_address]] std::conditional_t<one_by_one, std::array<double, net_dimensions>, None> x_;
  [[no_unique_address]] std::conditional_t<one_by_one, None, std::array<double, StreamBatch::capacity>> values_;
};

/// The sums over the groups of a level, in turn from its lower and its upper half.
template <CubeIntegrand F>
class NetGroups {
  using M = mean_t<std::remove_cvref_t<decltype(std::declval<NetWalk<F>&>()())>>;

 public:
  NetGroups(const F& f, std::size_t dimension, std::int64_t level, std::int64_t group_level, const Stream& net,
            std::uint64_t point)
      : half_(level > group_level ? doubled_draws(level - 1) : doubled_draws(level)),
        size_(doubled_draws(group_level)),
        lower_(f, dimension, net, point & ~(static_cast<std::uint64_t>(doubled_draws(level)) - 1), half_),
        upper_(f, dimension, net,
               (point & ~(static_cast<std::uint64_t>(doubled_draws(level)) - 1)) + static_cast<std::uint64_t>(half_),
               half_) {}

  M operator()() {
    const bool upper = is_upper_;
    is_upper_ = !is_upper_;
    return sum(upper ? upper_ : lower_, size_);
  }

  struct Halves {
    M low;
    M high;
    [[nodiscard]] M even() const { return low; }
    [[nodiscard]] M odd() const { return high; }
  };
  /// All points, the two halves one after the other.
  Halves halves() {
    M low = sum(lower_, half_);
    return {std::move(low), sum(upper_, half_)};
  }

 private:
  static M sum(NetWalk<F>& walk, std::int64_t n) {
    M total(walk());
    for (std::int64_t i = 1; i < n; ++i) total = debias::sum(std::move(total), M(walk()));
    return total;
  }

  std::int64_t half_;
  std::int64_t size_;
  NetWalk<F> lower_;
  NetWalk<F> upper_;
  bool is_upper_ = false;
};

/// Levels 0 ... 27 have 1 ... 2^27 points.
inline constexpr std::int64_t deepest_net_level = 27;

/// Throws std::length_error for a level with more points than a net has.
inline void check_net_level(std::int64_t level) {
  if (level <= deepest_net_level) [[likely]]
    return;
  throw std::length_error("doubling: level " + std::to_string(level) + " over a Cube needs 2^" + std::to_string(level) +
                          " points (a net has 2^27); choose a PMF with a lighter tail");
}

/// The place of the block of a draw.
inline std::uint64_t point_of_net(Stream& rng) { return rng.bits() >> (64 - deepest_net_level); }
static_assert(net_points == std::uint64_t{1} << deepest_net_level);

/// f at the points of a net.
template <CubeIntegrand F>
struct CubePoints {
  F f;
  std::size_t dimension;
  static constexpr double scale = 1;
  static constexpr double extra_work = 0;
  static constexpr std::int64_t deepest_level = deepest_net_level;

  auto points(std::int64_t level, std::int64_t group_level, Stream& rng) const {
    check_net_level(level);
    return NetGroups<F>(f, dimension, level, group_level, rng, point_of_net(rng));
  }
};

/// beta of smooth f and g in so many coordinates: that of the log evidence of a normal mean (catalogue I01 to I03) at 2^4 to 2^11
/// points, less what is not certain; that of independent draws beyond eight.
inline double net_decay(std::size_t dimension) {
  constexpr std::array<double, 8> measured = {5, 4.2, 3.7, 3.3, 3, 2.8, 2.5, 2.4};
  return dimension <= measured.size() ? measured[dimension - 1] : 2;
}

}  // namespace detail

/// The integral of f over a cube from one net of `points` points, as a random variable: what taylor.hpp multiplies. Each draw
/// has a net of its own.
template <CubeIntegrand F>
class NetMean {
 public:
  /// Throws std::invalid_argument unless points is a power of two, at most 2^27.
  NetMean(F f, const Cube& cube, std::int64_t points)
      : work(static_cast<double>(points)), f_(std::move(f)), dimension_(cube.dimension()), points_(points) {
    if (points >= 1 && points <= static_cast<std::int64_t>(net_points) &&
        std::has_single_bit(static_cast<std::uint64_t>(points)))
      return;
    throw std::invalid_argument("net_mean: points = " + std::to_string(points) +
                                " (must be a power of two, 1 ... 2^27: a net)");
  }

  auto operator()(Stream& rng) const {
    const Stream net = rng.split(rng.bits());
    const std::uint64_t first = detail::point_of_net(rng) & ~(static_cast<std::uint64_t>(points_) - 1);
    detail::NetWalk<F> walk(f_, dimension_, net, first, points_);
    mean_t<std::remove_cvref_t<decltype(walk())>> total(walk());
    for (std::int64_t i = 1; i < points_; ++i) total = debias::sum(std::move(total), decltype(total)(walk()));
    return debias::scaled(std::move(total), 1 / work);
  }

  double work;  ///< look-ups of a draw

 private:
  F f_;
  std::size_t dimension_;
  std::int64_t points_;
};

template <CubeIntegrand F>
NetMean<F> net_mean(F f, const Cube& cube, std::int64_t points) {
  return {std::move(f), cube, points};
}

}  // namespace debias

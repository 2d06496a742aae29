#pragma once

// g(E X), or g of an integral, by doubling: level k averages 2^k draws, its coarse partner is g of the two
// halves of the same draws, averaged (antithetic: the linear part of g cancels).
//
//   I_k = g(mean of 2^k),  D_k = I_k - (g(mean of even draws) + g(mean of odd draws)) / 2,  work 2^k
//   shared(N, m): the base is g(mean of a group of 2^m), averaged over all 2^(N-m) groups of the 2^N draws
//
// Independent draws: E D_k^2 ~ 2^(-2k) for g smooth at E X and four moments of X     [Blanchet & Glynn 2015]
// Equidistant points a + (b - a)(i + u) / 2^k, random offset u: 2^(-4k), f smooth    [Misso et al. 2022]
// Declare other rates: {1, 1} where g has a kink at E X ({2, 1} on a comb), min(4(1 - s), (1 - s) / s) for
// |x - c|^-s in f; a band-limited periodic f has no differences at all above its band. Fails where the mean
// of a few draws can lie where g has no moments (1/x near 0): start at a base level above those.
// A g with gap(mean, half_difference) (functions.hpp) gives D_k without cancellation; a plain lambda leaves a
// residue of an ulp of g, which a law divides by p_k.

#include <cmath>
#include <concepts>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

/// A function of a mean, `g(mean)` -> Value. Means of float are double.
template <class G, class M>
concept FunctionOfMean = requires(const G& g, const M& mean) {
  requires Value<std::remove_cvref_t<decltype(g(mean))>>;
};

/// A function that knows gap(m, d) = g(m) - (g(m + d) + g(m - d)) / 2 in a form without cancellation.
template <class G, class M>
concept OffersGap = FunctionOfMean<G, M> && requires(const G& g, const M& mean, const M& half_difference) {
  { g.gap(mean, half_difference) } -> std::same_as<std::remove_cvref_t<decltype(g(mean))>>;
};

/// 2^level. Throws std::invalid_argument below level 0 and std::length_error where the number of draws leaves
/// the 64-bit integers (a law that gets there has a tail of infinite work).
inline std::int64_t doubled_draws(std::int64_t level) {
  if (level < 0) {
    throw std::invalid_argument("doubling: level = " + std::to_string(level) + " (must be at least 0)");
  }
  if (level > 62) {
    throw std::length_error("doubling: level " + std::to_string(level) +
                            " needs 2^level draws (beyond int64); choose a law with a lighter tail");
  }
  return std::int64_t{1} << level;
}

namespace detail {

/// Where a doubling takes its numbers from: `points(level, rng)` begins one draw of a level and returns a
/// callable of the point's number 0 ... 2^level - 1, which is called once for each, in any order. Besides:
/// `scale`, by which their mean is multiplied, and `extra_work`, what a draw costs beside its points.
template <class P>
concept Points = requires(const P& p, std::int64_t level, Stream& rng) {
  requires Value<std::remove_cvref_t<decltype(p.points(level, rng)(level))>>;
  { p.scale } -> std::convertible_to<double>;
  { p.extra_work } -> std::convertible_to<double>;
};

/// Independent draws of X. Their numbers do not matter.
template <RandomVariable X>
struct IndependentPoints {
  X x;
  static constexpr double scale = 1;
  static constexpr double extra_work = 0;

  auto points(std::int64_t /*level*/, Stream& rng) const {
    return [this, &rng](std::int64_t /*i*/) { return x(rng); };
  }
};

/// f at equidistant points with one random offset.
template <class F>
struct CombPoints {
  F f;
  double from;
  double scale;  // the length of the interval
  static constexpr double extra_work = 0;

  auto points(std::int64_t level, Stream& rng) const {
    const double offset = rng.uniform();
    const double step = scale / static_cast<double>(doubled_draws(level));
    return [this, offset, step](std::int64_t i) {
      const double x = from + step * (static_cast<double>(i) + offset);
      return f(x);
    };
  }
};

}  // namespace detail

/// The sequence g(mean of 2^k points). Stores nothing per point: sums run group by group.
template <detail::Points P, class G>
class Doubling {
  using Point = std::remove_cvref_t<decltype(std::declval<const P&>().points(0, std::declval<Stream&>())(0))>;
  using Mean = mean_t<Point>;
  static_assert(FunctionOfMean<G, Mean>, "g(mean) must return a Value; of Eigen an array, not an expression");

 public:
  using value_type = std::remove_cvref_t<std::invoke_result_t<const G&, const Mean&>>;

  Rates rates;

  Doubling(P points, G g, const Rates& declared)
      : rates(declared), points_(std::move(points)), g_(std::move(g)) {}

  /// Throws, like the members below, std::length_error above level 62.
  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    if (level == 0) return base(value_of_one_point(rng), work(0));
    const Halves sums = halves(level, 0, rng, [](const Mean&, const Mean&) {});
    return {g_(mean(sums, level)), difference(sums, level), work(level)};
  }

  /// I_level alone.
  Term<value_type> value_at(std::int64_t level, Stream& rng) const {
    if (level == 0) return {value_of_one_point(rng), work(0)};
    return {g_(mean(halves(level, 0, rng, [](const Mean&, const Mean&) {}), level)), work(level)};
  }

  /// D_level, and I_base_level averaged over all groups of the same draws: on a comb one group alone, or
  /// those of one half, would be biased. Throws std::invalid_argument unless 0 <= base_level < level.
  SharedDraw<value_type> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    if (base_level >= level) {
      throw std::invalid_argument("doubling: base_level = " + std::to_string(base_level) +
                                  " (must lie below level = " + std::to_string(level) + ")");
    }
    const double per_point = points_.scale / static_cast<double>(doubled_draws(base_level));
    std::optional<mean_t<value_type>> values;
    const auto add = [&](const Mean& group) {
      mean_t<value_type> value(g_(scaled(group, per_point)));
      if (values) {
        values = sum(std::move(*values), value);
      } else {
        values = std::move(value);
      }
    };
    const Halves sums = halves(level, base_level, rng, [&](const Mean& even_group, const Mean& odd_group) {
      add(even_group);
      add(odd_group);
    });
    values = scaled(std::move(*values), 1 / static_cast<double>(doubled_draws(level - base_level)));
    return {static_cast<value_type>(std::move(*values)), difference(sums, level), work(level)};
  }

 private:
  /// The sums over the even and over the odd groups.
  struct Halves {
    Mean even;
    Mean odd;
  };

  /// Sums 2^level points by groups of 2^group_level < 2^level. Group r holds the points r, r + groups, ...:
  /// on a comb a coarser comb, of independent draws a consecutive block. `visit` sees the sums pair by pair.
  template <class Visit>
  Halves halves(std::int64_t level, std::int64_t group_level, Stream& rng, const Visit& visit) const {
    const std::int64_t count = doubled_draws(level);
    const std::int64_t groups = doubled_draws(level - group_level);
    const auto point = points_.points(level, rng);
    const auto group = [&](std::int64_t r) {
      Mean total(point(r));
      for (std::int64_t i = r + groups; i < count; i += groups) total = sum(std::move(total), Mean(point(i)));
      return total;
    };
    Mean even = group(0);
    Mean odd = group(1);
    visit(even, odd);
    Halves sums{std::move(even), std::move(odd)};
    for (std::int64_t r = 2; r < groups; r += 2) {
      even = group(r);
      odd = group(r + 1);
      visit(even, odd);
      sums.even = sum(std::move(sums.even), even);
      sums.odd = sum(std::move(sums.odd), odd);
    }
    return sums;
  }

  value_type value_of_one_point(Stream& rng) const {
    return g_(scaled(Mean(points_.points(0, rng)(0)), points_.scale));
  }

  Mean mean(const Halves& sums, std::int64_t level) const {
    return scaled(sum(sums.even, sums.odd), points_.scale / static_cast<double>(doubled_draws(level)));
  }

  /// Exactly zero where the halves have equal sums, with or without a gap: a factor of two does not round.
  value_type difference(const Halves& sums, std::int64_t level) const {
    const double per_point = points_.scale / static_cast<double>(doubled_draws(level));
    if constexpr (OffersGap<G, Mean>) {
      return g_.gap(mean(sums, level), scaled(debias::difference(sums.even, sums.odd), per_point));
    } else {
      const value_type even = g_(scaled(sums.even, 2 * per_point));
      const value_type odd = g_(scaled(sums.odd, 2 * per_point));
      return debias::difference(g_(mean(sums, level)), scaled(sum(even, odd), 0.5));
    }
  }

  double work(std::int64_t level) const {
    return static_cast<double>(doubled_draws(level)) + points_.extra_work;
  }

  P points_;
  G g_;
};

/// g(E X): `x(rng)` draws X, `g(mean)` is a Value. Declare `rates` where g has a kink or X heavy tails.
template <RandomVariable X, class G>
auto function_of_mean(X x, G g, const Rates& rates = {2, 1}) {
  using P = detail::IndependentPoints<X>;
  return Doubling<P, G>(P{std::move(x)}, std::move(g), rates);
}

struct IntegralOptions {
  double from = 0;
  double to = 1;
  Rates rates = {4, 1};  ///< for smooth f and g; see the head of this file for others
};

/// g(integral of f over [from, to]) on a comb: `f(x)` is a Value at a double, `g` sees the integral.
/// Throws std::invalid_argument for an interval that is not finite.
template <class F, class G>
auto function_of_integral(F f, G g, const IntegralOptions& options = {}) {
  if (!std::isfinite(options.from) || !std::isfinite(options.to)) {
    throw std::invalid_argument("function_of_integral: the interval is not finite; substitute the variable");
  }
  using P = detail::CombPoints<F>;
  P points{std::move(f), options.from, options.to - options.from};
  return Doubling<P, G>(std::move(points), std::move(g), options.rates);
}

}  // namespace debias

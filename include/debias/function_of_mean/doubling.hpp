#pragma once

// The sequence behind function_of_mean.hpp: level k is g of the mean of 2^k points, its coarse partner g of the two halves
// of the same points, averaged.
//
//   D_k = I_k - (g(mean of even points) + g(mean of odd points)) / 2 = gap(mean, half the difference of the two means)
//   shared(N, m): the base is g(mean of a group of 2^m), averaged over all 2^(N-m) groups of the 2^N points
//
// Notation: I_k = value of level k, D_k = difference, N = level, m = base level. Points: function_of_mean/points.hpp.
// Rates, where it fails, what a gap is and what NaN and infinity do: function_of_mean.hpp.
// Sources: Blanchet & Glynn, WSC 2015; Misso et al., ACM TOG 41(4), 2022.

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>
#include <debias/function_of_mean/points.hpp>

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

namespace detail {

/// A function that changes with the level: at(level, m), and gap(level, m, d) with the coarse function in the
/// halves.
template <class G, class M>
concept LevelFunction = requires(const G& g, std::int64_t level, const M& m) {
  requires Value<std::remove_cvref_t<decltype(g.at(level, m))>>;
  { g.gap(level, m, m) } -> std::same_as<std::remove_cvref_t<decltype(g.at(level, m))>>;
};

/// A function that knows its gap from the halves a = m + d and b = m - d as well: gap_of_halves(a, b), or
/// gap_of_halves(level, a, b).
template <class G, class M>
concept KnowsHalves = requires(const G& g, const M& half) {
  g.gap_of_halves(half, half);
};
template <class G, class M>
concept LevelKnowsHalves = requires(const G& g, std::int64_t level, const M& half) {
  g.gap_of_halves(level, half, half);
};

/// A function with batch forms (functions.hpp): values(m) in place, gaps(m, d) with the gap in d.
template <class G>
concept BatchedFunction = requires(const G& g, std::span<double> m) {
  g.values(m);
  g.gaps(m, m);
};

template <class G, class M>
auto value_at(const G& g, std::int64_t level, const M& m) {
  if constexpr (LevelFunction<G, M>) {
    return g.at(level, m);
  } else {
    return g(m);
  }
}

/// The sum of values that come one by one: numbers begin at zero, in a register; arrays with the first, which
/// has the shape.
template <Value V>
class RunningSum {
 public:
  void add(V v) {
    if constexpr (begins_at_zero) {
      total_ = debias::sum(std::move(total_), v);
    } else if (total_) {
      total_ = debias::sum(std::move(*total_), v);
    } else {
      total_ = std::move(v);
    }
  }
  /// After at least one.
  V total() {
    if constexpr (begins_at_zero) {
      return total_;
    } else {
      return std::move(*total_);
    }
  }

 private:
  static constexpr bool begins_at_zero = RealValue<V> || ComplexValue<V>;
  std::conditional_t<begins_at_zero, V, std::optional<V>> total_{};
};

}  // namespace detail

/// The sequence g(mean of 2^k points). Stores nothing per point: sums run group by group.
template <detail::Points P, class G>
class Doubling {
  using Mean = std::remove_cvref_t<decltype(std::declval<const P&>().points(0, 0, std::declval<Stream&>())())>;
  static_assert(FunctionOfMean<G, Mean> || detail::LevelFunction<G, Mean>,
                "g(mean) must return a Value; of Eigen an array, not an expression");

 public:
  using value_type = decltype(detail::value_at(std::declval<const G&>(), 0, std::declval<const Mean&>()));
  static constexpr bool has_gap = OffersGap<G, Mean> || detail::LevelFunction<G, Mean>;
  static constexpr bool difference_shows_all = has_gap;  // a gap of NaN is NaN

  Rates rates;
  /// g(E X), unless the mean is one given something random. Stated of points that may be in step: of independent ones no
  /// difference vanishes while values vary but of a g that is linear there.
  static constexpr Limit limit = [] {
    if constexpr (requires { P::limit; }) {
      return P::limit;
    } else {
      return detail::InStep<P> ? Limit::constant : Limit::random;
    }
  }();

  /// The points of a member are plain numbers, whatever point of a net the member is (survey/levels.hpp).
  static constexpr bool plain_inside = requires { P::plain_inside; };

  Doubling(P points, G g, const Rates& declared) : rates(declared), points_(std::move(points)), g_(std::move(g)) {}

  /// Throws, like the members below, std::length_error above level 62.
  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    if (level == 0) return debias::base(value_of_one_point(rng), work(0));
    const Halves sums = halves(level, 0, rng, NoVisit{});
    return {value_of_mean(mean(sums, level), level), difference(sums, level), work(level)};
  }

  /// I_level alone.
  Term<value_type> value_at(std::int64_t level, Stream& rng) const {
    if (level == 0) return {value_of_one_point(rng), work(0)};
    const Halves sums = halves(level, 0, rng, NoVisit{});
    return {value_of_mean(mean(sums, level), level), work(level)};
  }

  /// D_level, and I_base_level averaged over all groups of the same draws: on a comb one group alone, or
  /// those of one half, would be biased. Throws std::invalid_argument unless 0 <= base_level < level.
  [[gnu::always_inline]] SharedDraw<value_type> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    check_shared(level, base_level);
    const double per_point = points_.scale * detail::share_of_draw(base_level);
    detail::RunningSum<mean_t<value_type>> values;
    const auto add = [&](const Mean& group) {
      values.add(mean_t<value_type>(detail::value_at(g_, base_level, debias::scaled(group, per_point))));
    };
    const Halves sums = halves(level, base_level, rng, [&](const Mean& even_group, const Mean& odd_group) {
      add(even_group);
      add(odd_group);
    });
    return {static_cast<value_type>(debias::scaled(values.total(), detail::share_of_draw(level - base_level))),
            difference(sums, level), work(level)};
  }

  // ---- many members at once

  static constexpr bool batches =
      detail::BatchedPoints<P> && std::same_as<value_type, double> && !detail::LevelFunction<G, Mean>;

  void values(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    Sums sums;
    sum_up(level, 0, batch, sums, [](std::span<double>) {});
    const std::span<double> means = std::span(sums.even).first(out.size());
    const double per_point = points_.scale * detail::share_of_draw(level);
    for (std::size_t b = 0; b < out.size(); ++b) means[b] = (means[b] + sums.odd[b]) * per_point;
    apply(level, means);
    for (std::size_t b = 0; b < out.size(); ++b) out[b] = {means[b], work(level)};
  }

  void differences(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    if (level == 0) return values(level, batch, out);
    Sums sums;
    sum_up(level, 0, batch, sums, [](std::span<double>) {});
    gaps(level, sums, out.size());
    for (std::size_t b = 0; b < out.size(); ++b) out[b] = {sums.odd[b], work(level)};
  }

  void shared(std::int64_t level, std::int64_t base_level, StreamBatch& batch,
              std::span<SharedDraw<value_type>> out) const requires batches {
    check_shared(level, base_level);
    const double per_point = points_.scale * detail::share_of_draw(base_level);
    std::array<double, StreamBatch::capacity> bases{};
    Sums sums;
    sum_up(level, base_level, batch, sums, [&](std::span<double> groups) {
      for (double& x : groups) x *= per_point;
      apply(base_level, groups);
      for (std::size_t i = 0; i < groups.size(); i += out.size()) {
        for (std::size_t b = 0; b < out.size(); ++b) bases[b] += groups[i + b];
      }
    });
    gaps(level, sums, out.size());
    const double share = detail::share_of_draw(level - base_level);
    for (std::size_t b = 0; b < out.size(); ++b) out[b] = {bases[b] * share, sums.odd[b], work(level)};
  }

  [[nodiscard]] static std::int64_t deepest_level() {
    if constexpr (requires { P::deepest_level; }) {
      return P::deepest_level;
    } else {
      return 62;
    }
  }

  /// g of the mean of `draws` independent means of a level, less the mean of g of each (core/resonance.hpp).
  [[nodiscard]] mean_t<value_type> missed(std::int64_t level, std::int64_t draws, Stream& rng) const
      requires(detail::InStep<P>) {
    detail::RunningSum<Mean> means;
    detail::RunningSum<mean_t<value_type>> values;
    for (std::int64_t i = 0; i < draws; ++i) {
      Stream own = rng.split(static_cast<std::uint64_t>(i));
      Mean m = level == 0 ? debias::scaled(points_.points(0, 0, own)(), points_.scale)
                          : mean(halves(level, 0, own, NoVisit{}), level);
      values.add(mean_t<value_type>(detail::value_at(g_, level, m)));
      means.add(std::move(m));
    }
    const double share = 1 / static_cast<double>(draws);
    return debias::difference(mean_t<value_type>(detail::value_at(g_, level, debias::scaled(means.total(), share))),
                              debias::scaled(values.total(), share));
  }

  /// Of a g without gap: the sizes of the differences that are nothing but its rounding. They are what a mean
  /// may be off by, and the least variance of a run: they stay as large while the probabilities of their
  /// levels fall.
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const requires(!has_gap) {
    return bound_of_rounding(levels);
  }
  [[nodiscard]] static BiasBound bound_of_rounding(const LevelTable& levels) {
    if (levels.base().count == 0) return {};
    const auto rms = [](const LevelSums& s) { return std::sqrt(s.square / static_cast<double>(s.count)); };
    const double floor = 4 * std::numeric_limits<double>::epsilon() * rms(levels.base());
    BiasBound bound;
    std::size_t first = 0;
    for (std::size_t i = 0; i < levels.rows().size(); ++i) {
      const LevelSums& row = levels.rows()[i];
      if (row.count == 0 || !(row.square > 0) || !(rms(row) < floor)) continue;
      if (first == 0) first = i;
      bound.size += rms(row);
    }
    if (bound.size > 0) {
      bound.sentence = "from level " + std::to_string(first) + " on differences are rounding of g; give it a gap(m, d)";
    }
    return bound;
  }

 private:
  struct NoVisit {
    void operator()(const Mean& /*even*/, const Mean& /*odd*/) const {}
  };

  /// The sums over the even and over the odd groups.
  struct Halves {
    Mean even;
    Mean odd;
  };

  /// Sums 2^level points by groups of 2^group_level < 2^level; `visit` sees the sums pair by pair.
  template <class Visit>
  [[gnu::always_inline]] Halves halves(std::int64_t level, std::int64_t group_level, Stream& rng,
                                       const Visit& visit) const {
    doubled_draws(level);  // throws for a level too deep, before anything is drawn
    const std::int64_t groups = doubled_draws(level - group_level);
    auto group = points_.points(level, group_level, rng);
    if constexpr (std::same_as<Visit, NoVisit> && requires { group.halves(); }) {
      if (group_level == 0) {
        const auto sums = group.halves();
        return {sums.even(), sums.odd()};
      }
    }
    Mean even = group();
    Mean odd = group();
    visit(even, odd);
    Halves sums{std::move(even), std::move(odd)};
    for (std::int64_t r = 2; r < groups; r += 2) {
      even = group();
      odd = group();
      visit(even, odd);
      sums.even = debias::sum(std::move(sums.even), even);
      sums.odd = debias::sum(std::move(sums.odd), odd);
    }
    return sums;
  }

  static void check_shared(std::int64_t level, std::int64_t base_level) {
    if (base_level < level) return;
    throw std::invalid_argument("doubling: base_level = " + std::to_string(base_level) +
                                " (must lie below level = " + std::to_string(level) + ")");
  }

  /// Of each member: the sums over the even and over the odd groups.
  struct Sums {
    std::array<double, StreamBatch::capacity> even{};
    std::array<double, StreamBatch::capacity> odd{};
  };

  /// `visit` sees the sums of all groups, some at a time: it may overwrite them.
  template <class Visit>
  void sum_up(std::int64_t level, std::int64_t group_level, StreamBatch& batch, Sums& sums, const Visit& visit) const {
    doubled_draws(level);
    const std::int64_t groups = doubled_draws(level - group_level);
    const std::size_t members = batch.size();
    auto next = points_.batch(level, group_level, batch);
    std::array<double, detail::block_size> block;
    for (std::int64_t done = 0; done < groups;) {
      const std::int64_t some = next(std::span<double, detail::block_size>(block));
      for (std::int64_t r = 0; r < some; ++r) {
        double* const into = ((done + r) & 1) == 0 ? sums.even.data() : sums.odd.data();
        const double* const from = &block[static_cast<std::size_t>(r) * members];
        for (std::size_t b = 0; b < members; ++b) into[b] += from[b];
      }
      visit(std::span(block).first(static_cast<std::size_t>(some) * members));
      done += some;
    }
  }

  void apply(std::int64_t level, std::span<double> means) const {
    if constexpr (detail::BatchedFunction<G>) {
      g_.values(means);
    } else {
      for (double& x : means) x = value_of_mean(x, level);
    }
  }

  /// The differences of all members, where the sums over the odd groups were.
  void gaps(std::int64_t level, Sums& sums, std::size_t members) const {
    const double per_point = points_.scale * detail::share_of_draw(level);
    if constexpr (detail::BatchedFunction<G>) {
      bool any = false;
      if constexpr (detail::KnowsHalves<G, Mean>) {
        for (std::size_t b = 0; b < members; ++b) any = any | lopsided(sums.even[b], sums.odd[b]);
      }
      if (any) [[unlikely]] {
        for (std::size_t b = 0; b < members; ++b) sums.odd[b] = difference(Halves{sums.even[b], sums.odd[b]}, level);
        return;
      }
      for (std::size_t b = 0; b < members; ++b) {
        const double even = sums.even[b];
        sums.even[b] = (even + sums.odd[b]) * per_point;
        sums.odd[b] = (even - sums.odd[b]) * per_point;
      }
      g_.gaps(std::span(sums.even).first(members), std::span(sums.odd).first(members));
    } else {
      for (std::size_t b = 0; b < members; ++b) sums.odd[b] = difference(Halves{sums.even[b], sums.odd[b]}, level);
    }
  }

  value_type value_of_one_point(Stream& rng) const {
    return value_of_mean(debias::scaled(points_.points(0, 0, rng)(), points_.scale), 0);
  }

  // A comparison in g, or a component that it does not use, would hide a NaN.
  value_type value_of_mean(const Mean& m, std::int64_t level) const {
    return or_nan(detail::value_at(g_, level, m), m);
  }
  static value_type or_nan(value_type value, const Mean& m) {
    if (debias::has_nan(m)) [[unlikely]]
      return debias::nan_like(std::move(value));
    return value;
  }

  Mean mean(const Halves& sums, std::int64_t level) const {
    return debias::scaled(debias::sum(sums.even, sums.odd), points_.scale * detail::share_of_draw(level));
  }

  /// Exactly zero where the halves have equal sums, with or without a gap: a factor of two does not round.
  value_type difference(const Halves& sums, std::int64_t level) const {
    if constexpr (RealValue<Mean>) {  // nearly all pairs of numbers: nothing is NaN, or lost beside the other
      const double even = std::abs(static_cast<double>(sums.even));
      const double odd = std::abs(static_cast<double>(sums.odd));
      if (even >= 0x1p-26 * odd && odd >= 0x1p-26 * even) [[likely]]
        return plain_difference(sums, level);
    }
    return careful_difference(sums, level);
  }

  value_type plain_difference(const Halves& sums, std::int64_t level) const {
    const double per_point = points_.scale * detail::share_of_draw(level);
    if constexpr (detail::LevelFunction<G, Mean>) {
      return g_.gap(level, mean(sums, level), debias::scaled(debias::difference(sums.even, sums.odd), per_point));
    } else if constexpr (OffersGap<G, Mean>) {
      return g_.gap(mean(sums, level), debias::scaled(debias::difference(sums.even, sums.odd), per_point));
    } else {
      const value_type even = g_(debias::scaled(sums.even, 2 * per_point));
      const value_type odd = g_(debias::scaled(sums.odd, 2 * per_point));
      return debias::difference(g_(mean(sums, level)), debias::scaled(debias::sum(even, odd), 0.5));
    }
  }

  [[gnu::noinline]] value_type careful_difference(const Halves& sums, std::int64_t level) const {
    const Mean m = mean(sums, level);
    if constexpr (detail::KnowsHalves<G, Mean> || detail::LevelKnowsHalves<G, Mean>) {
      if (lopsided(sums.even, sums.odd)) return or_nan(gap_of_halves(sums, level), m);
    }
    return or_nan(plain_difference(sums, level), m);
  }

  value_type gap_of_halves(const Halves& sums, std::int64_t level) const {
    const double per_point = 2 * points_.scale * detail::share_of_draw(level);
    if constexpr (detail::LevelKnowsHalves<G, Mean>) {
      return g_.gap_of_halves(level, debias::scaled(sums.even, per_point), debias::scaled(sums.odd, per_point));
    } else {
      return g_.gap_of_halves(debias::scaled(sums.even, per_point), debias::scaled(sums.odd, per_point));
    }
  }

  double work(std::int64_t level) const { return static_cast<double>(doubled_draws(level)) + points_.extra_work; }

  P points_;
  G g_;
};

}  // namespace debias

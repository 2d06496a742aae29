#pragma once

// Nested expectations E f(E[X | Y]): the doubling of function_of_mean.hpp given Y.
//
//   I_k = f(mean of 2^k draws of X given one Y),  D_k = I_k - (f(mean of even) + f(mean of odd draws)) / 2
//   work = 2^k + 1: the inner draws and the outer one
//
// E D_k^2 ~ 2^(-2k) for smooth f and four moments. A kink of f inside the range of E[X | Y] has {1.5, 1} and
// a kurtosis that grows like 2^(k/2): declare it (the value of information, a maximum over decisions, is such
// a kink). A jump has {0.5, 1}: no PMF with finite variance and finite work.
// Nestings nest: an inner draw may be an unbiased estimate of another nested expectation (`estimated`), with
// a finite fourth moment. f has to bear what such estimates may be: under a large weight they have either sign.
// Over a Cube the inner points are a scrambled net given Y (function_of_mean/cubes.hpp): E D_k^2 falls like 2^(-4k) or so for
// smooth f of an inner expectation in few dimensions, like 2^(-3k) with a kink. With nets of members outside (`recipe`, .points)
// both expectations are on nets.
// Nets of members quiet what comes of Y; the noise of an inner net is plain. A recipe knows that (`plain_inside`).
// f may see Y: f(mean, y), with the gap f.gap(mean, d, y) if it has one. Weights that would underflow: inner draws
// exp_of(l), and functions::LogMeanExp (functions/log_weights.hpp).
// Numbers: those of Y first, then those of the draws of X in order; `estimated` draws from streams of its own, plain ones.
// Sources: Giles, Acta Numerica 24 (2015); Syed & Wang 2023 (recursion).

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/function_of_mean.hpp>

namespace debias {

namespace detail {

/// Independent draws of X given one Y, which is drawn first.
template <class Outer, class Inner>
struct ConditionalPoints {
  Outer outer;
  Inner inner;
  static constexpr double scale = 1;
  static constexpr double extra_work = 1;
  static constexpr Limit limit = Limit::random;  // f(E[X | Y])

  auto points(std::int64_t /*level*/, std::int64_t group_level, Stream& rng) const {
    return GroupSums{doubled_draws(group_level),
                     [this, &rng, y = outer(rng)] { return [&] { return inner(y, rng); }; }};
  }
};

/// Points of a net given one Y, which is drawn first.
template <class Outer, class Inner>
class NetGivenOuter {
  using Y = std::remove_cvref_t<std::invoke_result_t<const Outer&, Stream&>>;
  struct Given {
    const Inner* inner;
    const Y* y;
    auto operator()(std::span<const double> x) const { return (*inner)(*y, x); }
  };

 public:
  NetGivenOuter(const Outer& outer, const Inner& inner, std::size_t dimension, std::int64_t level,
                std::int64_t group_level, Stream& rng)
      : y_(outer(rng)), given_{&inner, &y_}, groups_(given_, dimension, level, group_level, rng, point_of_net(rng)) {}
  NetGivenOuter(const NetGivenOuter&) = delete;  // it points to itself
  NetGivenOuter& operator=(const NetGivenOuter&) = delete;

  auto operator()() { return groups_(); }
  auto halves() { return groups_.halves(); }

 private:
  Y y_;
  Given given_;
  NetGroups<Given> groups_;
};

template <class Outer, class Inner>
struct ConditionalCube {
  Outer outer;
  Inner inner;
  std::size_t dimension;
  static constexpr double scale = 1;
  static constexpr double extra_work = 1;
  static constexpr Limit limit = Limit::random;
  static constexpr bool plain_inside = true;
  static constexpr std::int64_t deepest_level = deepest_net_level;

  auto points(std::int64_t level, std::int64_t group_level, Stream& rng) const {
    check_net_level(level);
    return NetGivenOuter<Outer, Inner>(outer, inner, dimension, level, group_level, rng);
  }
};

/// f of a mean with Y given.
template <class F, class Y>
struct FunctionGiven {
  const F* f;
  const Y* y;

  template <class M>
  requires std::invocable<const F&, const M&, const Y&>
  auto operator()(const M& m) const { return (*f)(m, *y); }
  template <class M>
  requires requires(const F& f_of, const M& m, const Y& given) { f_of.gap(m, m, given); }
  auto gap(const M& m, const M& d) const { return f->gap(m, d, *y); }
  template <class M>
  requires requires(const F& f_of, const M& m, const Y& given) { f_of.gap_of_halves(m, m, given); }
  auto gap_of_halves(const M& a, const M& b) const { return f->gap_of_halves(a, b, *y); }
};

/// Draws of X with Y given.
template <class Inner, class Y>
struct DrawsGiven {
  const Inner* inner;
  const Y* y;
  static constexpr double scale = 1;
  static constexpr double extra_work = 1;

  auto points(std::int64_t /*level*/, std::int64_t group_level, Stream& rng) const {
    return GroupSums{doubled_draws(group_level), [this, &rng] { return [this, &rng] { return (*inner)(*y, rng); }; }};
  }
};

/// Points of a net with Y given.
template <class Inner, class Y>
struct CubeGiven {
  struct Integrand {
    const Inner* inner;
    const Y* y;
    auto operator()(std::span<const double> x) const { return (*inner)(*y, x); }
  };
  Integrand integrand;
  std::size_t dimension;
  static constexpr double scale = 1;
  static constexpr double extra_work = 1;
  static constexpr bool plain_inside = true;
  static constexpr std::int64_t deepest_level = deepest_net_level;

  auto points(std::int64_t level, std::int64_t group_level, Stream& rng) const {
    check_net_level(level);
    return NetGroups<Integrand>(integrand, dimension, level, group_level, rng, point_of_net(rng));
  }
};

/// E f(E[X | Y], Y): a doubling for each Y. `over(y)` are its points.
template <class Outer, class Over, class F>
class NestedGiven {
  using Y = std::remove_cvref_t<std::invoke_result_t<const Outer&, Stream&>>;
  using Inside = Doubling<std::invoke_result_t<const Over&, const Y&>, FunctionGiven<F, Y>>;

 public:
  using value_type = typename Inside::value_type;
  static constexpr bool has_gap = Inside::has_gap;
  static constexpr bool difference_shows_all = has_gap;
  static constexpr Limit limit = Limit::random;
  static constexpr bool plain_inside = Inside::plain_inside;

  Rates rates;

  NestedGiven(Outer outer, Over over, F f, const Rates& declared)
      : rates(declared), outer_(std::move(outer)), over_(std::move(over)), f_(std::move(f)) {}

  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    return with(level, rng, [&](const Inside& inside) { return inside(level, rng); });
  }
  Term<value_type> value_at(std::int64_t level, Stream& rng) const {
    return with(level, rng, [&](const Inside& inside) { return inside.value_at(level, rng); });
  }
  SharedDraw<value_type> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    return with(level, rng, [&](const Inside& inside) { return inside.shared(level, base_level, rng); });
  }
  [[nodiscard]] static std::int64_t deepest_level() { return Inside::deepest_level(); }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const requires(!has_gap) {
    return Inside::bound_of_rounding(levels);
  }

 private:
  template <class Use>
  [[gnu::always_inline]] auto with(std::int64_t level, Stream& rng, const Use& use) const {
    doubled_draws(level);  // throws before anything is drawn
    const Y y = outer_(rng);
    return use(Inside(over_(y), {&f_, &y}, rates));
  }

  Outer outer_;
  Over over_;
  F f_;
};

/// What the inner means are of: the mean type of what `inner` returns.
template <class Outer, class Inner, class From>
using inner_mean_t =
    mean_t<std::remove_cvref_t<std::invoke_result_t<const Inner&, const result_t<Outer, Stream&>&, From>>>;

/// f takes Y beside the mean.
template <class F, class M, class Y>
concept SeesOuter = !std::invocable<const F&, const M&> && std::invocable<const F&, const M&, const Y&>;

template <class Outer, class Inner>
concept NestedOverCube = std::invocable<const Outer&, Stream&> &&
    requires(const Inner& inner, std::span<const double> x, const result_t<Outer, Stream&>& y) {
  requires Value<std::remove_cvref_t<decltype(inner(y, x))>>;
};
template <class Outer, class Inner>
constexpr Mistake mistake_in_nested_cube() {
  constexpr Mistake outer = mistake_in_call<Outer, Stream&>();
  if constexpr (outer == Mistake::none) {
    return first_of(mistake_in_function<Inner, const result_t<Outer, Stream&>&, std::span<const double>>(),
                    Mistake::no_nested_integrand);
  } else {
    return first_of(outer, Mistake::no_nested_integrand);
  }
}

template <class Outer, class Inner>
concept NestedDraws = std::invocable<const Outer&, Stream&> &&
    requires(const Inner& inner, Stream& rng, const result_t<Outer, Stream&>& y) {
  requires Value<std::remove_cvref_t<decltype(inner(y, rng))>>;
};
template <class Outer, class Inner>
constexpr Mistake mistake_in_nested() {
  constexpr Mistake outer = mistake_in_call<Outer, Stream&>();
  if constexpr (outer == Mistake::none) {
    return first_of(mistake_in_function<Inner, const result_t<Outer, Stream&>&, Stream&>(), Mistake::no_nested_draws);
  } else {
    return first_of(outer, Mistake::no_nested_draws);
  }
}

}  // namespace detail

/// An unbiased estimator as an inner draw: `make(y)` returns it. Each draw has a stream of its own; its work
/// counts as one inner draw.
template <class Make>
auto estimated(Make make) {
  return [make = std::move(make)](const auto& y, Stream& rng) {
    using E = std::remove_cvref_t<decltype(make(y))>;
    if constexpr (Estimator<E>) {
      Stream own = rng.split(rng.bits());
      NullRecord unused;
      return debias::draw_sample(make(y), own, unused).value;
    } else {
      return detail::refuse<detail::mistake_in_estimator<E>(), E>();
    }
  };
}

/// `outer(rng)` draws Y, of any type; `inner(y, rng)` draws X given Y = y, a Value; `f(mean)`, or `f(mean, y)`, is a Value.
template <class Outer, class Inner, class F>
requires detail::NestedDraws<Outer, Inner>
auto nested(Outer outer, Inner inner, F f, const Rates& rates = {2, 1}) {
  using Y = std::remove_cvref_t<detail::result_t<Outer, Stream&>>;
  if constexpr (detail::SeesOuter<F, detail::inner_mean_t<Outer, Inner, Stream&>, Y>) {
    const auto over = [inner = std::move(inner)](const Y& y) { return detail::DrawsGiven<Inner, Y>{&inner, &y}; };
    return detail::NestedGiven<Outer, std::remove_const_t<decltype(over)>, F>(std::move(outer), over, std::move(f),
                                                                              rates);
  } else {
    using P = detail::ConditionalPoints<Outer, Inner>;
    return Doubling<P, F>(P{std::move(outer), std::move(inner)}, std::move(f), rates);
  }
}

/// The same with X given Y = y an integral over a cube, on nets: `inner(y, x)` is its integrand at x, the coordinates of a
/// point. Of the options rates are those of smooth f by default.
template <class Outer, class Inner, class F>
requires detail::NestedOverCube<Outer, Inner>
auto nested(Outer outer, Inner inner, const Cube& cube, F f, const CubeOptions& options = {}) {
  const Rates rates = options.rates.value_or(Rates{detail::net_decay(cube.dimension()), 1});
  using Y = std::remove_cvref_t<detail::result_t<Outer, Stream&>>;
  if constexpr (detail::SeesOuter<F, detail::inner_mean_t<Outer, Inner, std::span<const double>>, Y>) {
    const auto over = [inner = std::move(inner), dimension = cube.dimension()](const Y& y) {
      return detail::CubeGiven<Inner, Y>{{&inner, &y}, dimension};
    };
    return detail::NestedGiven<Outer, std::remove_const_t<decltype(over)>, F>(std::move(outer), over, std::move(f),
                                                                              rates);
  } else {
    using P = detail::ConditionalCube<Outer, Inner>;
    return Doubling<P, F>(P{std::move(outer), std::move(inner), cube.dimension()}, std::move(f), rates);
  }
}

template <class Outer, class Inner, class F>
requires(!detail::NestedOverCube<Outer, Inner>) auto nested(const Outer& /*outer*/, const Inner& /*inner*/,
                                                            const Cube& /*cube*/, const F& /*f*/,
                                                            const CubeOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_nested_cube<Outer, Inner>(), Outer, Inner>();
}

template <class Outer, class Inner, class F>
requires(!detail::NestedDraws<Outer, Inner>) auto nested(const Outer& /*outer*/, const Inner& /*inner*/, const F& /*f*/,
                                                         const Rates& /*rates*/ = {}) {
  return detail::refuse<detail::mistake_in_nested<Outer, Inner>(), Outer, Inner>();
}

}  // namespace debias

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
// Numbers: those of Y first, then those of the draws of X in order; `estimated` draws from streams of its own, plain ones.
// Sources: Giles, Acta Numerica 24 (2015); Syed & Wang 2023 (recursion).

#include <concepts>
#include <cstdint>
#include <type_traits>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
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

/// `outer(rng)` draws Y, of any type; `inner(y, rng)` draws X given Y = y, a Value; `f(mean)` is a Value.
template <class Outer, class Inner, class F>
requires detail::NestedDraws<Outer, Inner>
auto nested(Outer outer, Inner inner, F f, const Rates& rates = {2, 1}) {
  using P = detail::ConditionalPoints<Outer, Inner>;
  return Doubling<P, F>(P{std::move(outer), std::move(inner)}, std::move(f), rates);
}

template <class Outer, class Inner, class F>
requires(!detail::NestedDraws<Outer, Inner>) auto nested(const Outer& /*outer*/, const Inner& /*inner*/, const F& /*f*/,
                                                         const Rates& /*rates*/ = {}) {
  return detail::refuse<detail::mistake_in_nested<Outer, Inner>(), Outer, Inner>();
}

}  // namespace debias

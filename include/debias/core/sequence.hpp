#pragma once

// Sequences of biased estimates I_0, I_1, ... with E[I_k] -> I, and the draws they return.
//
//   I_k = value, D_k = I_k - I_(k-1) = difference (I_(-1) = 0), work = cost of the draw, in a unit of yours
//
// A BiasedSequence addresses its levels: `s(level, rng)` returns a coupled draw of I_k and D_k. A TermSequence
// yields the terms of a series in order along one path: `s(rng)` returns a cursor, `cursor()` the next term.
// Both are const callables of a Stream, a lambda will do; a `mutable` one, a data race in a parallel run, does
// not compile, nor does one that takes its Stream by value, whose numbers would all be equal. What is required: E D_k = E I_k -
// E I_(k-1) for every k (every run checks it where draws have values), D_0 = I_0, work > 0, and sum_k E|D_k| < infinity.
// Optional members, found by concepts:
//
//   value_at(level, rng)            -> Term: I_k alone, when the coarse partner costs extra
//   difference_at(level, rng)       -> Term: D_k alone, when I_k costs extra; no run checks the coupling then
//   shared(level, base, rng)        -> SharedDraw: I_base averaged over every point that D_level draws anyway
//   rates                           -> Rates: how E D_k^2 decays and how the work grows
//   exact_from                      -> the level beyond which every D_k is zero
//   limit                           -> Limit::constant where I_k tends to one number, whatever the draw
//   facts()                         -> SequenceFacts: the three above at once
//   deepest_level()                 -> int64: the last level that can be drawn (core/reach.hpp)
//   values / differences(level, batch, out), shared(level, base, batch, out): the same of many members at once,
//                                      out[b] from the numbers of member b, equal to one by one up to rounding
// Sources: Rhee & Glynn, Oper. Res. 63 (2015); Misso et al., ACM TOG 41(4), 2022 (shared base).

#include <concepts>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include <debias/core/coupling.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>

namespace debias {

/// A coupled draw of level k: `value` is I_k, `difference` is I_k - I_(k-1).
template <Value V>
struct Draw {
  V value;
  V difference;
  double work = 1;
};

/// One term of a series, or one number of a draw on its own.
template <Value V>
struct Term {
  V value;
  double work = 1;
};

/// A difference together with a base estimate made of the same draws.
template <Value V>
struct SharedDraw {
  V base;
  V difference;
  double work = 1;
};

/// A draw of level 0, where the difference is the value.
template <Value V>
Draw<V> base(const V& value, double work = 1) {
  return {value, value, work};
}

/// A draw of a level above 0 from the fine estimate and its coupled coarse one.
template <Value V>
Draw<V> coupled(const V& fine, const V& coarse, double work = 1) {
  return {fine, debias::difference(fine, coarse), work};
}

namespace detail {
template <class T>
inline constexpr bool is_draw = false;
template <class V>
inline constexpr bool is_draw<Draw<V>> = true;
template <class T>
inline constexpr bool is_term = false;
template <class V>
inline constexpr bool is_term<Term<V>> = true;
template <class T>
inline constexpr bool is_shared_draw = false;
template <class V>
inline constexpr bool is_shared_draw<SharedDraw<V>> = true;
}  // namespace detail

template <class S>
concept BiasedSequence = requires(const S& s, const std::int64_t level, Stream& rng) {
  requires detail::is_draw<std::remove_cvref_t<decltype(s(level, rng))>>;
};

template <class S>
concept TermSequence = requires(const S& s, Stream& rng) {
  s(rng)();
  requires detail::is_term<std::remove_cvref_t<decltype(s(rng)())>>;
};

/// A draw of X: `x(rng)` returns a Value.
template <class X>
concept RandomVariable = requires(const X& x, Stream& rng) {
  requires Value<std::remove_cvref_t<decltype(x(rng))>>;
};

template <RandomVariable X>
using draw_t = std::remove_cvref_t<std::invoke_result_t<const X&, Stream&>>;

namespace detail {
template <class S>
struct SequenceValue;
template <BiasedSequence S>
struct SequenceValue<S> {
  using type = decltype(std::declval<const S&>()(std::declval<const std::int64_t&>(), std::declval<Stream&>()).value);
};
template <TermSequence S>
requires(!BiasedSequence<S>) struct SequenceValue<S> {
  using type = decltype(std::declval<const S&>()(std::declval<Stream&>())().value);
};
}  // namespace detail

/// The value type of a sequence of either kind.
template <class S>
using sequence_value_t = typename detail::SequenceValue<S>::type;

template <class S>
concept OffersValueAt = requires(const S& s, std::int64_t level, Stream& rng) {
  requires detail::is_term<std::remove_cvref_t<decltype(s.value_at(level, rng))>>;
};
template <class S>
concept OffersDifferenceAt = requires(const S& s, std::int64_t level, Stream& rng) {
  requires detail::is_term<std::remove_cvref_t<decltype(s.difference_at(level, rng))>>;
};
template <class S>
concept OffersSharedBase = requires(const S& s, std::int64_t level, Stream& rng) {
  requires detail::is_shared_draw<std::remove_cvref_t<decltype(s.shared(level, level, rng))>>;
};

template <class S>
concept BatchesValues = requires(const S& s, std::int64_t level, StreamBatch& batch,
                                 std::span<Term<sequence_value_t<S>>> out) {
  s.values(level, batch, out);
};
template <class S>
concept BatchesDifferences = requires(const S& s, std::int64_t level, StreamBatch& batch,
                                      std::span<Term<sequence_value_t<S>>> out) {
  s.differences(level, batch, out);
};
template <class S>
concept BatchesShared = requires(const S& s, std::int64_t level, StreamBatch& batch,
                                 std::span<SharedDraw<sequence_value_t<S>>> out) {
  s.shared(level, level, batch, out);
};

/// A sequence of numbers whose members of a stratified block run together.
template <class S>
concept BatchesLevels = std::same_as < sequence_value_t<S>,
double > &&(BatchesShared<S> || (!OffersSharedBase<S> && BatchesValues<S> && BatchesDifferences<S>));

/// A sequence that says that its differences are not finite wherever its values are not: then those that nobody needs
/// are not computed.
template <class S>
concept ShowsInDifference = requires {
  requires S::difference_shows_all;
};

namespace detail {
/// Half a draw that is not finite spoils the other half: what a callable returned must not depend on which of them is
/// asked for. Throws std::invalid_argument where a draw of level 0 has another difference than its value.
template <BiasedSequence S>
[[gnu::always_inline]] inline Draw<sequence_value_t<S>> whole_draw(const S& s, std::int64_t level, Stream& rng) {
  Draw<sequence_value_t<S>> draw = s(level, rng);
  if (level == 0) check_level_zero(draw.value, draw.difference);
  if constexpr (!ShowsInDifference<S>) {
    if (!debias::is_finite(draw.value)) [[unlikely]]
      draw.difference = debias::nan_like(std::move(draw.difference));
  }
  return draw;
}
}  // namespace detail

/// I_level alone, by the cheapest way that the sequence offers. Throws, like difference_of, std::invalid_argument where a
/// draw of level 0 has another difference than its value.
template <BiasedSequence S>
Term<sequence_value_t<S>> value_of(const S& s, std::int64_t level, Stream& rng) {
  if constexpr (OffersValueAt<S>) {
    return s.value_at(level, rng);
  } else {
    auto draw = s(level, rng);
    if (level == 0) detail::check_level_zero(draw.value, draw.difference);
    if (!debias::is_finite(draw.difference)) [[unlikely]]
      draw.value = debias::nan_like(std::move(draw.value));
    return {std::move(draw.value), draw.work};
  }
}

/// D_level alone, likewise.
template <BiasedSequence S>
Term<sequence_value_t<S>> difference_of(const S& s, std::int64_t level, Stream& rng) {
  if constexpr (OffersDifferenceAt<S>) {
    return s.difference_at(level, rng);
  } else {
    auto draw = detail::whole_draw(s, level, rng);
    return {std::move(draw.difference), draw.work};
  }
}

/// A sequence that declares its rates gets its PMF for free.
template <class S>
concept DeclaresRates = requires(const S& s) {
  { s.rates } -> std::convertible_to<Rates>;
};

/// What I_k tends to as the level grows: for one draw another number than for the next, or one number. Levels of zeros
/// prove nothing about the latter while I_k still varies: what makes it vary lies between the points of the levels.
enum class Limit { random, constant };

template <class S>
concept StatesExactFrom = requires(const S& s) {
  { s.exact_from } -> std::convertible_to<std::int64_t>;
};
template <class S>
concept StatesLimit = requires(const S& s) {
  { s.limit } -> std::convertible_to<Limit>;
};

/// What a sequence of either kind states of itself.
template <class S>
SequenceFacts facts_of(const S& sequence) {
  if constexpr (StatesFacts<S>) return sequence.facts();
  SequenceFacts facts;
  if constexpr (DeclaresRates<S>) facts.declared = sequence.rates;
  if constexpr (StatesExactFrom<S>) facts.exact_from = sequence.exact_from;
  if constexpr (StatesLimit<S>) facts.constant_limit = sequence.limit == Limit::constant;
  return facts;
}

/// Adapts a TermSequence to levels: I_k is the sum of the terms 0 ... k of one path, D_k its term k. Reaching
/// term k means walking there, so a level costs all its terms.
template <TermSequence S>
class LevelsOf {
 public:
  using value_type = sequence_value_t<S>;

  explicit LevelsOf(S terms) : terms_(std::move(terms)) {}

  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    auto cursor = terms_(rng);
    Term<value_type> term = cursor();
    value_type partial = term.value;
    double work = term.work;
    detail::check_work(0, work);
    for (std::int64_t k = 1; k <= level; ++k) {
      term = cursor();
      detail::check_work(k, term.work);
      partial = debias::sum(std::move(partial), term.value);
      work += term.work;
    }
    // A term before the last one that is no number spoils the difference, too: the path is one draw.
    if (!debias::is_finite(partial)) [[unlikely]]
      term.value = debias::nan_like(std::move(term.value));
    return {std::move(partial), std::move(term.value), work};
  }

  [[nodiscard]] std::int64_t deepest_level() const requires StatesDeepestLevel<S> { return terms_.deepest_level(); }

 private:
  S terms_;
};

/// As above, with the rates of the terms: the linear growth of the work counts only beside a polynomial decay.
template <TermSequence S>
requires DeclaresRates<S>
class RatedLevelsOf : public LevelsOf<S> {
 public:
  explicit RatedLevelsOf(S terms) : LevelsOf<S>(terms), rates(terms.rates) {
    if (rates.decay == Decay::polynomial) rates.work_growth += 1;
  }
  Rates rates;
};

template <TermSequence S>
auto levels_of(S terms) {
  if constexpr (DeclaresRates<S>) {
    return RatedLevelsOf<S>(std::move(terms));
  } else {
    return LevelsOf<S>(std::move(terms));
  }
}

}  // namespace debias

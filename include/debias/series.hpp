#pragma once

// Infinite series: I = sum_(k >= 0) a_k, one term a level.
//
//   I_k = a_0 + ... + a_k,  D_k = a_k   (exact, never the difference of two partial sums)   [McLeish 2011]
//
//   Notation: a_k = term(k), or the mean of term(k, stream). Random terms of one stream are independent, and
//   term k is the same number whichever others are drawn.
// Assumes sum E|term k| < infinity; an alternating series may have it only when `paired`. A term on its own
// costs 1 whatever k, a path of terms (roulette) all of them. Fails where a_k falls like a power of k and the
// PMF is geometric: unit increments then have infinite variance, sum E a_k^2 / p_k, and no sample shows it.
// Declare `polynomial_terms` and take a zeta PMF, or take `blocks`, whose levels fall geometrically. A
// deterministic prefix before the random tail is the base level.
// Numbers: a random term draws from a stream of its own, split(k). Of the point of a net its first number is coordinate k, its
// other ones are plain.
// Source: McLeish, Monte Carlo Methods Appl. 17 (2011); Rhee & Glynn, Oper. Res. 63 (2015).

#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/text.hpp>
#include <debias/core/value.hpp>

namespace debias {

namespace detail {

template <class T>
concept PlainTerm = requires(const T& term, std::int64_t k) {
  requires Value<std::remove_cvref_t<decltype(term(k))>>;
};
template <class T>
concept RandomTerm = requires(const T& term, std::int64_t k, Stream& rng) {
  requires Value<std::remove_cvref_t<decltype(term(k, rng))>>;
};

}  // namespace detail

/// The terms of a series: `term(k)`, or `term(k, rng)` for random ones; k = 0, 1, ...
template <class T>
concept SeriesTerm = detail::PlainTerm<T> || detail::RandomTerm<T>;

namespace detail {

template <SeriesTerm T>
auto evaluate_term(const T& term, std::int64_t k, const Stream& rng) {
  if constexpr (RandomTerm<T>) {
    const auto branch = static_cast<std::uint64_t>(k);
    Stream own = rng.split(branch, branch);
    return term(k, own);
  } else {
    return term(k);
  }
}

}  // namespace detail

/// A TermSequence, and a BiasedSequence whose levels are single terms. The caller's stream stays where it is.
template <SeriesTerm T>
class Series {
 public:
  using value_type = decltype(detail::evaluate_term(std::declval<const T&>(), 0, std::declval<const Stream&>()));

  explicit Series(T term, double work_per_term = 1) : term_(std::move(term)), work_(work_per_term) {}

  /// Yields the terms in order; the series has to outlive it.
  class Cursor {
   public:
    Cursor(const Series& series, const Stream& rng) : series_(&series), rng_(rng) {}
    Term<value_type> operator()() { return series_->difference_at(k_++, rng_); }

   private:
    const Series* series_;
    Stream rng_;
    std::int64_t k_ = 0;
  };

  Cursor operator()(const Stream& rng) const { return {*this, rng}; }

  /// Term `level` alone.
  Term<value_type> difference_at(std::int64_t level, const Stream& rng) const {
    return {detail::evaluate_term(term_, level, rng), work_};
  }

  /// The sum of the terms 0 ... level.
  Term<value_type> value_at(std::int64_t level, const Stream& rng) const {
    auto draw = (*this)(level, rng);
    return {std::move(draw.value), draw.work};
  }

  /// Both, from the same terms.
  Draw<value_type> operator()(std::int64_t level, const Stream& rng) const {
    value_type term = detail::evaluate_term(term_, 0, rng);
    value_type partial = term;
    for (std::int64_t k = 1; k <= level; ++k) {
      term = detail::evaluate_term(term_, k, rng);
      partial = debias::sum(std::move(partial), term);
    }
    return {std::move(partial), std::move(term), work_ * (static_cast<double>(level) + 1)};
  }

  /// Terms that are not random are the same for all members of a batch.
  static constexpr bool batches = std::same_as<value_type, double> && !detail::RandomTerm<T>;
  void values(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    std::fill(out.begin(), out.end(), value_at(level, batch.stream(0)));
  }
  void differences(std::int64_t level, StreamBatch& batch, std::span<Term<value_type>> out) const requires batches {
    std::fill(out.begin(), out.end(), difference_at(level, batch.stream(0)));
  }

  [[nodiscard]] std::int64_t deepest_level() const requires StatesDeepestLevel<T> { return term_.deepest_level(); }
  [[nodiscard]] const T& terms() const { return term_; }
  [[nodiscard]] double work_per_term() const { return work_; }

 private:
  T term_;
  double work_;
};

/// A series that declares how its terms fall.
template <SeriesTerm T>
class RatedSeries : public Series<T> {
 public:
  RatedSeries(T term, const Rates& declared, double work_per_term = 1)
      : Series<T>(std::move(term), work_per_term), rates(declared) {}
  Rates rates;
};

/// The series of the given terms; a PMF has to be named.
template <SeriesTerm T>
Series<T> series(T term) {
  return Series<T>(std::move(term));
}

/// The series of the given terms with their rates: `series(term, geometric_terms(0.5))`.
template <SeriesTerm T>
RatedSeries<T> series(T term, const Rates& rates) {
  return {std::move(term), rates};
}

template <class T>
requires(!SeriesTerm<T>) auto series(const T& /*term*/, const Rates& /*rates*/ = {}) {
  return detail::refuse<
      detail::mistake_in_parameter_function<T, detail::Mistake::no_series_term, const std::int64_t&>(), T>();
}

/// Terms that fall like ratio^k: E a_k^2 ~ 2^(-beta k) with beta = -2 log2|ratio|.
/// Throws std::invalid_argument unless |ratio| < 1.
inline Rates geometric_terms(double ratio) {
  if (!(std::abs(ratio) < 1)) {
    throw std::invalid_argument("geometric_terms: ratio = " + detail::format("%f", ratio) +
                                " (must lie in (-1, 1)); a series that diverges has no sum to estimate");
  }
  return {-2 * std::log2(std::abs(ratio)), 0};
}

/// Terms that fall like k^-exponent. Only above 1 has some PMF finite variance and finite work.
/// Throws std::invalid_argument unless exponent > 0.
inline Rates polynomial_terms(double exponent) {
  if (!(exponent > 0)) {
    throw std::invalid_argument("polynomial_terms: exponent = " + detail::format("%f", exponent) +
                                " (must be positive: a_k ~ k^-exponent has to fall)");
  }
  return {2 * exponent, 0, Decay::polynomial};
}

/// Terms that fall faster than any geometric series, like 1 / k!.
inline constexpr Rates factorial_terms{Rates::faster_than_any, 0};

namespace detail {

template <SeriesTerm T>
struct PairOfTerms {
  T term;

  [[nodiscard]] static std::int64_t deepest_level() { return std::numeric_limits<std::int64_t>::max() / 2; }

  auto operator()(std::int64_t k) const requires(!RandomTerm<T>) {
    return debias::sum(term(first_of(k)), term(first_of(k) + 1));
  }

  auto operator()(std::int64_t k, const Stream& rng) const requires RandomTerm<T> {
    auto first = detail::evaluate_term(term, first_of(k), rng);
    return debias::sum(std::move(first), detail::evaluate_term(term, first_of(k) + 1, rng));
  }

  static std::int64_t first_of(std::int64_t k) {
    if (k > std::numeric_limits<std::int64_t>::max() / 2) {
      throw std::length_error("paired: pair " + std::to_string(k) +
                              " has terms beyond 2^63; take a PMF that falls faster");
    }
    return 2 * k;
  }
};

}  // namespace detail

/// The series of a_(2k) + a_(2k+1), with work 2. Neighbours of an alternating series nearly cancel: terms
/// like k^-s become k^-(s+1). A pair is rounded like its larger term; a formula for it, if known, is better.
template <SeriesTerm T>
auto paired(const Series<T>& s) {
  using Pair = detail::PairOfTerms<T>;
  return Series<Pair>(Pair{s.terms()}, 2 * s.work_per_term());
}

/// The same with rates for a smoothly alternating series. Random terms are independent, their noise does not
/// cancel: k^-s stays k^-s.
template <SeriesTerm T>
auto paired(const RatedSeries<T>& s) {
  using Pair = detail::PairOfTerms<T>;
  Rates rates = s.rates;
  if (rates.decay == Decay::geometric) {
    rates.variance_decay *= 2;
  } else if (!detail::RandomTerm<T>) {
    rates.variance_decay += 2;
  }
  return RatedSeries<Pair>(Pair{s.terms()}, rates, 2 * s.work_per_term());
}

/// The same series by dyadic blocks: level 0 is term 0, level k the terms 2^(k-1) ... 2^k - 1, for as much
/// work.
template <SeriesTerm T>
class Blocks {
 public:
  using value_type = typename Series<T>::value_type;

  Blocks(Series<T> s, const Rates& declared) : rates(declared), series_(std::move(s)) {}

  /// The sum of the terms of block `level`. Throws std::length_error above level 62.
  Term<value_type> difference_at(std::int64_t level, const Stream& rng) const {
    return terms(level == 0 ? 0 : end_of(level - 1), end_of(level), rng);
  }

  /// The sum of the terms 0 ... 2^level - 1.
  Term<value_type> value_at(std::int64_t level, const Stream& rng) const { return terms(0, end_of(level), rng); }

  /// Both, from the same terms.
  Draw<value_type> operator()(std::int64_t level, const Stream& rng) const {
    Term<value_type> block = difference_at(level, rng);
    if (level == 0) return debias::base(block.value, block.work);
    Term<value_type> before = value_at(level - 1, rng);
    return {debias::sum(std::move(before.value), block.value), std::move(block.value), before.work + block.work};
  }

  /// The last block whose terms the series has.
  [[nodiscard]] std::int64_t deepest_level() const {
    const auto end = static_cast<std::uint64_t>(deepest_level_of(series_)) + 1;
    return std::min<std::int64_t>(62, static_cast<std::int64_t>(std::bit_width(end)) - 1);
  }

  Rates rates;

 private:
  static std::int64_t end_of(std::int64_t level) {
    if (level > 62) {
      throw std::length_error("blocks: level " + std::to_string(level) +
                              " has terms beyond 2^62; take a PMF that falls faster");
    }
    return std::int64_t{1} << level;
  }

  Term<value_type> terms(std::int64_t first, std::int64_t last, const Stream& rng) const {
    Term<value_type> total = series_.difference_at(first, rng);
    for (std::int64_t k = first + 1; k < last; ++k) {
      const Term<value_type> term = series_.difference_at(k, rng);
      total.value = debias::sum(std::move(total.value), term.value);
      total.work += term.work;
    }
    return total;
  }

  Series<T> series_;
};

/// Blocks with rates of their own: 2^(-beta k) for the block sums.
template <SeriesTerm T>
Blocks<T> blocks(const Series<T>& s, const Rates& rates) {
  return {s, rates};
}

/// Blocks with the rates that the terms imply: a_k ~ k^-s makes blocks like 2^((1 - s) k), so that some PMF
/// has finite variance and finite work when s > 3/2; geometric terms make blocks that fall faster than any
/// rate. For terms of one sign; pair an alternating series first.
template <SeriesTerm T>
Blocks<T> blocks(const RatedSeries<T>& s) {
  if (s.rates.decay == Decay::geometric) return {s, Rates{Rates::faster_than_any, 1}};
  return {s, Rates{s.rates.variance_decay - 2, 1}};
}

namespace detail {
template <class Start, class Advance, class Read>
concept PathParts = std::invocable<const Start&, Stream&> &&
    requires(const Advance& advance, const Read& read, Stream& rng, result_t<Start, Stream&> state) {
  state = advance(std::move(state), rng);
  requires Value<std::remove_cvref_t<decltype(read(std::as_const(state)))>>;
};
template <class Start, class Advance, class Read>
constexpr Mistake mistake_in_path() {
  constexpr Mistake start = mistake_in_call<Start, Stream&>();
  if constexpr (start == Mistake::none) {
    using State = result_t<Start, Stream&>;
    constexpr Mistake advance = mistake_in_call<Advance, State, Stream&>();
    return first_of(advance, first_of(mistake_in_function<Read, const State&>(), Mistake::no_path));
  } else {
    return first_of(start, Mistake::no_path);
  }
}
}  // namespace detail

/// The terms of a series along one path: term k is read off the state that `start` gives and `advance` has
/// advanced k times. A light path is one: the state holds the vertex and the throughput, term k is what depth
/// k adds, and I_k the image at maximal path depth k. Under a geometric PMF whose survival 1 - r is the
/// albedo, `roulette` is then classical Russian roulette: the weight cancels the throughput.
template <class Start, class Advance, class Read>
class PathSeries {
  using State = std::remove_cvref_t<std::invoke_result_t<const Start&, Stream&>>;

 public:
  using value_type = std::remove_cvref_t<std::invoke_result_t<const Read&, const State&>>;

  PathSeries(Start start, Advance advance, Read read, const Rates& declared)
      : rates(declared), start_(std::move(start)), advance_(std::move(advance)), read_(std::move(read)) {}

  /// Yields the terms in order; the series has to outlive it.
  class Cursor {
   public:
    Cursor(const PathSeries& path, const Stream& rng) : path_(&path), rng_(rng), state_(path.start_(rng_)) { look(); }

    Term<value_type> operator()() {
      if (!first_) {
        state_ = path_->advance_(std::move(state_), rng_);
        look();
      }
      first_ = false;
      value_type term = path_->read_(std::as_const(state_));
      return {finite_ ? std::move(term) : debias::nan_like(std::move(term))};
    }

   private:
    // A state that is a Value and not finite spoils all that follows, whatever `advance` or `read` make of it.
    void look() {
      if constexpr (Value<State>) {
        if (!debias::is_finite(state_)) [[unlikely]]
          finite_ = false;
      }
    }

    const PathSeries* path_;
    Stream rng_;
    State state_;
    bool first_ = true;
    bool finite_ = true;
  };

  Cursor operator()(const Stream& rng) const { return {*this, rng}; }

  Rates rates;

 private:
  Start start_;
  Advance advance_;
  Read read_;
};

/// `start(rng)` -> state, `advance(state, rng)` -> the next state, `read(state)` -> a Value, the term. Work 1
/// a term. `rates` are those of the terms: geometric_terms(albedo) for a light path. Terms from a state on that is a
/// Value and not finite are NaN.
template <class Start, class Advance, class Read>
requires detail::PathParts<Start, Advance, Read> PathSeries<Start, Advance, Read> path_series(Start start,
                                                                                              Advance advance,
                                                                                              Read read,
                                                                                              const Rates& rates) {
  return {std::move(start), std::move(advance), std::move(read), rates};
}

template <class Start, class Advance, class Read>
requires(!detail::PathParts<Start, Advance, Read>) auto path_series(const Start& /*start*/, const Advance& /*advance*/,
                                                                    const Read& /*read*/, const Rates& /*rates*/) {
  return detail::refuse<detail::mistake_in_path<Start, Advance, Read>(), Start, Advance, Read>();
}

}  // namespace debias

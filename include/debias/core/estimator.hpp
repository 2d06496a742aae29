#pragma once

// An estimator: a const callable of a Stream that returns one sample, E[sample.value] = I.
//
//   e(rng, record) -> Sample     reports every level that it touches to the record, or
//   e(rng)         -> Sample     keeps no level record, or
//   e(rng)         -> Value      any random variable: plain Monte Carlo, work 1.
//
// The record sees (level, scalar of the unweighted difference, work); the base has a row of its own. A sample's
// `level` is the deepest it touched, its `work` the sum over everything it drew.

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

template <Value V>
struct Sample {
  V value;
  double work = 1;
  std::int64_t level = 0;
};

/// The record that keeps nothing, and compiles to nothing.
struct NullRecord {
  void base(std::int64_t /*level*/, double /*value*/, double /*work*/) {}
  void difference(std::int64_t /*level*/, double /*difference*/, double /*work*/) {}
};

template <class R>
concept Record = requires(R& r, std::int64_t level, double x, double work) {
  r.base(level, x, work);
  r.difference(level, x, work);
};

namespace detail {
template <class T>
inline constexpr bool is_sample = false;
template <class V>
inline constexpr bool is_sample<Sample<V>> = true;

template <class E>
concept RecordingEstimator = requires(const E& e, Stream& rng, NullRecord& record) {
  requires is_sample<std::remove_cvref_t<decltype(e(rng, record))>>;
};
template <class E>
concept SilentEstimator = requires(const E& e, Stream& rng) {
  requires is_sample<std::remove_cvref_t<decltype(e(rng))>>;
};
}  // namespace detail

template <class E>
concept Estimator = detail::RecordingEstimator<E> || detail::SilentEstimator<E> || RandomVariable<E>;

/// One sample of any estimator.
template <Estimator E, Record R>
auto draw_sample(const E& e, Stream& rng, R& record) {
  if constexpr (detail::RecordingEstimator<E>) {
    return e(rng, record);
  } else if constexpr (detail::SilentEstimator<E>) {
    return e(rng);
  } else {
    return Sample<draw_t<E>>{e(rng)};
  }
}

/// The value type of an estimator's samples.
template <Estimator E>
using estimate_value_t =
    decltype(debias::draw_sample(std::declval<const E&>(), std::declval<Stream&>(), std::declval<NullRecord&>()).value);

/// An estimator that draws several samples from one stream, a block of them: what it returns is their mean, and their work in
/// all. Plans and results count its samples, and the blocks beside them.
template <class E>
concept StatesBlock = requires(const E& e) {
  { e.block() } -> std::same_as<std::int64_t>;
};

/// Samples of a chunk of a run: so few cost less than 1 % of the cheapest ones, and leave work for all threads.
inline constexpr std::int64_t default_chunk = 512;

namespace detail {
/// Of so large blocks: about 1024 samples.
inline std::int64_t chunk_of_blocks(std::int64_t block) {
  const std::uint64_t blocks = std::bit_floor(std::uint64_t{1024} / static_cast<std::uint64_t>(block));
  return block * std::clamp<std::int64_t>(static_cast<std::int64_t>(blocks), 1, default_chunk);
}
}  // namespace detail

/// An estimator whose samples need chunks of another size: a power of two of its blocks, the same for every run of the
/// estimator.
template <class E>
concept StatesChunk = requires(const E& e) {
  { e.chunk() } -> std::same_as<std::int64_t>;
};

/// An estimator that knows by which probability it divides the difference of a level.
template <class E>
concept KnowsProbabilities = requires(const E& e, std::int64_t level) {
  { e.probability(level) } -> std::same_as<double>;
};

/// An estimator that its user has given a name.
template <class E>
concept HasName = requires(const E& e) {
  { e.name() } -> std::convertible_to<std::string>;
};

/// What an estimator calls itself, PMF and base level included; results of different ones do not merge.
template <Estimator E>
std::string description(const E& e) {
  if constexpr (requires {
                  { e.describe() } -> std::convertible_to<std::string>;
                }) {
    return e.describe();
  } else {
    return "user-defined estimator";
  }
}

namespace detail {
/// A function, which cannot be inherited from.
template <class F>
struct Function {
  F function;
  auto operator()(Stream& rng) const { return function(rng); }
};
}  // namespace detail

/// An estimator that its user has given a name: it offers all that the estimator itself offers.
template <class E>
class Named : public E {
 public:
  Named(std::string name, E estimator) : E(std::move(estimator)), name_(std::move(name)) {}
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::string name_;
};

/// The estimator under a name: `named("gas, mu = 3", single_term(s, pmf))`. Results print it, files keep it, and results of
/// another name refuse to merge. Take one where equal types stand for different data, which nothing else tells apart: one
/// lambda that captured a 3 and then a 4, two functions of one signature, the contents of a std::function.
/// Throws std::invalid_argument for an empty name.
template <Estimator E>
auto named(std::string name, E estimator) {
  static_assert(!std::is_final_v<E>, "named() inherits from the estimator: its class must not be final");
  if (name.empty()) throw std::invalid_argument("named: an empty name (tells nothing apart); leave named() out");
  if constexpr (std::is_class_v<E>) {
    return Named<E>(std::move(name), std::move(estimator));
  } else {
    return Named<detail::Function<E>>(std::move(name), {std::move(estimator)});
  }
}

}  // namespace debias

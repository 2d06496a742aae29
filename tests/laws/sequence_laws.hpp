#pragma once

// The laws that every sequence of biased estimates must keep, as one call:
//
//   CHECK(laws::sequence_laws(s) == laws::Failures{});             // prints every broken law
//   CHECK(laws::sequence_laws(wrong_s) != laws::Failures{});       // the power check beside it
//
//   replay        the same (seed, index, level) gives the same bits and uses the same random numbers
//   base          at level 0 the difference is the value
//   work          is positive and finite
//   telescoping   E I_k - E I_(k-1) = E D_k, the three means from independent streams; where hooks give differences only,
//                 no run checks its coupling (core/coupling.hpp), and these laws alone do
//   same means    value_at(k), difference_at(k) and shared(N, m), where offered, mean what I_k and D_k mean
//   batches       values, differences and shared of many members, where offered, are those of one by one
//   rates         log2 E D_k^2 and log2 E work_k have the declared slopes over the upper levels
//
// Means are compared per component, at `z_limit` standard errors. What cannot be seen here: a coupling that
// keeps the means and only loses variance, when the sequence declares no rates.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/value.hpp>

#include "failures.hpp"

namespace debias::laws {

struct SequenceLawOptions {
  std::int64_t first = 0;       // shallower levels are not looked at: their moments may be infinite
  std::int64_t last = 6;        // the deepest level
  std::int64_t samples = 4096;  // draws for every mean
  std::uint64_t seed = 20220811;
  double z_limit = 5.5;              // in standard errors; right for about 30 claims
  double rounding = 1e-14;           // relative to the numbers: the least standard error that is believed
  bool rates = true;                 // false: leave the declared rates alone
  std::int64_t rates_from = 2;       // the slopes are fitted over max(first, rates_from) ... last
  double variance_tolerance = 0.25;  // on the exponent of E D_k^2
  double work_tolerance = 0.15;      // on the exponent of the work
};

namespace detail {

/// The components of one evaluation, of all its values one after the other.
struct Numbers {
  std::vector<double> components;
  double work = 0;
};

template <Value... V>
Numbers numbers(double work, const V&... values) {
  Numbers all{{}, work};
  const auto append = [&all](const auto& v) {
    for (std::size_t i = 0; i < component_count(v); ++i) all.components.push_back(component(v, i));
  };
  (append(values), ...);
  return all;
}
template <Value V>
Numbers numbers(const Draw<V>& d) {
  return numbers(d.work, d.value, d.difference);
}
template <Value V>
Numbers numbers(const Term<V>& t) {
  return numbers(t.work, t.value);
}
template <Value V>
Numbers numbers(const SharedDraw<V>& d) {
  return numbers(d.work, d.base, d.difference);
}

/// A sequence of any type: the laws are compiled once. What it does not offer is empty.
struct AnySequence {
  using One = std::function<Numbers(std::int64_t level, Stream& rng)>;
  using Shared = std::function<Numbers(std::int64_t level, std::int64_t base_level, Stream& rng)>;
  using Batch = std::function<std::vector<Numbers>(std::int64_t level, StreamBatch& streams, std::size_t size)>;
  using SharedBatch = std::function<std::vector<Numbers>(std::int64_t level, std::int64_t base_level,
                                                         StreamBatch& streams, std::size_t size)>;
  One draw;   ///< value and difference
  One value;  ///< by whatever way is the shortest
  One difference;
  One value_at;
  One difference_at;
  Shared shared;  ///< base and difference
  Batch values;
  Batch differences;
  SharedBatch shared_batch;
  std::optional<Rates> rates;
};

Failures sequence_laws(const AnySequence& sequence, const SequenceLawOptions& options);

template <class Out, class Together>
std::vector<Numbers> numbers_of_batch(std::size_t size, const Together& together) {
  std::vector<Out> out(size);
  together(std::span(out));
  std::vector<Numbers> all;
  for (const Out& each : out) all.push_back(numbers(each));
  return all;
}

template <BiasedSequence S>
AnySequence any_sequence(const S& s) {
  using V = sequence_value_t<S>;
  AnySequence any;
  any.draw = [&s](std::int64_t k, Stream& rng) { return numbers(s(k, rng)); };
  any.value = [&s](std::int64_t k, Stream& rng) { return numbers(value_of(s, k, rng)); };
  any.difference = [&s](std::int64_t k, Stream& rng) { return numbers(difference_of(s, k, rng)); };
  if constexpr (OffersValueAt<S>)
    any.value_at = [&s](std::int64_t k, Stream& rng) { return numbers(s.value_at(k, rng)); };
  if constexpr (OffersDifferenceAt<S>) {
    any.difference_at = [&s](std::int64_t k, Stream& rng) { return numbers(s.difference_at(k, rng)); };
  }
  if constexpr (OffersSharedBase<S>) {
    any.shared = [&s](std::int64_t k, std::int64_t m, Stream& rng) { return numbers(s.shared(k, m, rng)); };
  }
  if constexpr (BatchesValues<S>) {
    any.values = [&s](std::int64_t k, StreamBatch& streams, std::size_t size) {
      return numbers_of_batch<Term<V>>(size, [&](auto out) { s.values(k, streams, out); });
    };
  }
  if constexpr (BatchesDifferences<S>) {
    any.differences = [&s](std::int64_t k, StreamBatch& streams, std::size_t size) {
      return numbers_of_batch<Term<V>>(size, [&](auto out) { s.differences(k, streams, out); });
    };
  }
  if constexpr (BatchesShared<S>) {
    any.shared_batch = [&s](std::int64_t k, std::int64_t m, StreamBatch& streams, std::size_t size) {
      return numbers_of_batch<SharedDraw<V>>(size, [&](auto out) { s.shared(k, m, streams, out); });
    };
  }
  if constexpr (DeclaresRates<S>) any.rates = s.rates;
  return any;
}

}  // namespace detail

/// Every broken law in words; empty when all are kept.
template <debias::BiasedSequence S>
Failures sequence_laws(const S& s, const SequenceLawOptions& options = {}) {
  return detail::sequence_laws(detail::any_sequence(s), options);
}

}  // namespace debias::laws

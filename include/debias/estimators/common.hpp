#pragma once

// What the estimators share: base and difference of one sample, the check of the base level, the default PMF, and
// how they name themselves.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/text.hpp>
#include <debias/core/value.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias::detail {

inline void check_base_level(const char* estimator, std::int64_t base_level) {
  if (base_level < 0) {
    throw std::invalid_argument(std::string(estimator) + ": base_level = " + std::to_string(base_level) +
                                " (levels start at 0)");
  }
}

inline Geometric default_pmf(const Rates& rates) {
  const double exponent = default_exponent(rates);
  if (rates.decay == Decay::polynomial) {
    throw std::invalid_argument(
        "pmf: the differences decay like a power of the level (under a geometric PMF their variance is infinite); "
        "name the PMF Zeta(" +
        detail::format("%f", exponent) + ")");
  }
  return Geometric::with_exponent(exponent);
}

/// A sequence whose differences come with the values of their level: its runs check the coupling.
template <class S>
concept GivesValues = BiasedSequence<S> &&(!OffersDifferenceAt<S>)&&(!OffersSharedBase<S>);

/// A sequence that has a value beside some of its differences, and then calls `report(value, difference)`.
template <class S>
concept ReportsValues = requires(const S& s, std::int64_t level, Stream& rng,
                                 void (*report)(const sequence_value_t<S>&, const sequence_value_t<S>&)) {
  s.difference_at(level, rng, report);
};

/// I_level, told to the record as its base.
template <BiasedSequence S, Record R>
[[gnu::always_inline]] inline Term<sequence_value_t<S>> recorded_base(const S& sequence, std::int64_t level,
                                                                      Stream& rng, R& record) {
  auto term = debias::value_of(sequence, level, rng);
  record.base(level, debias::as_scalar(term.value), term.work);
  if constexpr (GivesValues<S> || ReportsValues<S>) record_value(record, level, term.value);
  return term;
}

/// D_level, told to the record, with I_level where the draw has it.
template <BiasedSequence S, Record R>
[[gnu::always_inline]] inline Term<sequence_value_t<S>> recorded_difference(const S& sequence, std::int64_t level,
                                                                            Stream& rng, R& record) {
  using V = sequence_value_t<S>;
  if constexpr (ReportsValues<S>) {
    auto term =
        sequence.difference_at(level, rng, [&](const V& value, const V& d) { record_pair(record, level, value, d); });
    record.difference(level, debias::as_scalar(term.value), term.work);
    return term;
  } else if constexpr (GivesValues<S>) {
    auto draw = whole_draw(sequence, level, rng);
    record.difference(level, debias::as_scalar(draw.difference), draw.work);
    record_pair(record, level, draw.value, draw.difference);
    return {std::move(draw.difference), draw.work};
  } else {
    auto term = debias::difference_of(sequence, level, rng);
    record.difference(level, debias::as_scalar(term.value), term.work);
    return term;
  }
}

/// I_m + weight D_level, both from the draws of the level where the sequence shares them.
template <BiasedSequence S, Record R>
Sample<sequence_value_t<S>> base_and_difference(const S& sequence, std::int64_t m, std::int64_t level, double weight,
                                                const Stream& rng, R& record) {
  Stream level_stream = split_level(rng, level);
  if constexpr (OffersSharedBase<S>) {
    auto both = sequence.shared(level, m, level_stream);
    record.base(m, debias::as_scalar(both.base), 0.0);
    record.difference(level, debias::as_scalar(both.difference), both.work);
    return {debias::sum(std::move(both.base), debias::scaled(std::move(both.difference), weight)), both.work, level};
  } else {
    Stream base_stream = split_level(rng, m);
    // Nearly every base is level 0: known to the compiler, it leaves no trace of the level in the sequence.
    auto base =
        m == 0 ? recorded_base(sequence, 0, base_stream, record) : recorded_base(sequence, m, base_stream, record);
    auto term = recorded_difference(sequence, level, level_stream, record);
    return {debias::sum(std::move(base.value), debias::scaled(std::move(term.value), weight)), base.work + term.work,
            level};
  }
}

/// Members first, first + 1, ... of a sample that draw the same level: `rank` is the place of the first of them among
/// the `strata` members of that level.
struct Members {
  const Stream& sample;
  std::int64_t first;
  std::size_t size;  // at most StreamBatch::capacity
  std::int64_t rank;
  std::int64_t strata;
  bool are_points = false;  // rank, rank + 1, ... of the net of the level

  [[nodiscard]] StreamBatch streams(std::int64_t level) const {
    if (are_points) return StreamBatch::points(split_level(sample, level), static_cast<std::uint64_t>(rank), size);
    return {sample, static_cast<std::uint64_t>(first), size, static_cast<std::uint64_t>(level), rank, strata};
  }
};

/// base_and_difference of many members: out[b] is the sample of member b.
template <BatchesLevels S, Record R>
void base_and_difference(const S& sequence, std::int64_t m, std::int64_t level, double weight, const Members& members,
                         std::span<Sample<sequence_value_t<S>>> out, R& record) {
  using V = sequence_value_t<S>;
  StreamBatch level_streams = members.streams(level);
  if constexpr (BatchesShared<S>) {
    std::array<SharedDraw<V>, StreamBatch::capacity> both;
    const std::span<SharedDraw<V>> draws = std::span(both).first(out.size());
    sequence.shared(level, m, level_streams, draws);
    for (std::size_t b = 0; b < out.size(); ++b) {
      record.base(m, draws[b].base, 0.0);
      record.difference(level, draws[b].difference, draws[b].work);
      out[b] = {draws[b].base + draws[b].difference * weight, draws[b].work, level};
    }
  } else {
    std::array<Term<V>, StreamBatch::capacity> bases;
    std::array<Term<V>, StreamBatch::capacity> differences;
    StreamBatch base_streams = members.streams(m);
    sequence.values(m, base_streams, std::span(bases).first(out.size()));
    sequence.differences(level, level_streams, std::span(differences).first(out.size()));
    for (std::size_t b = 0; b < out.size(); ++b) {
      record.base(m, bases[b].value, bases[b].work);
      record.difference(level, differences[b].value, differences[b].work);
      out[b] = {bases[b].value + differences[b].value * weight, bases[b].work + differences[b].work, level};
    }
  }
}

template <Pmf P>
std::string describe(const std::string& estimator, const P& pmf, std::int64_t base_level) {
  std::string name = "user-defined PMF";
  if constexpr (DescribedPmf<P>) name = pmf.spec();
  return estimator + ", " + name + ", base level " + std::to_string(base_level);
}

}  // namespace debias::detail

#pragma once

// Single-term debiasing: one random level, one coupled difference, weighted by its probability.
//
//   Base::every_sample   Z = I_m + D_N / p(N - m - 1),  N = m + 1, m + 2, ...          [Misso et al. 2022]
//   Base::one_outcome    Z = D_N / p(N - m),  N = m, m + 1, ..., D_m read as I_m       [Rhee & Glynn 2015 (2)]
//
//   Notation: m = base_level, p = pmf.mass, D_k = difference of level k.
// E Z = I for every PMF that is positive wherever a difference is not zero, if sum E|D_k| < infinity. The
// variance, sum E D_k^2 / p_k, and the work, sum work_k p_k, are finite only if the PMF fits the sequence
// (core/rates.hpp). Base::one_outcome saves a base that is expensive, at the price of the variance of choosing it.
// A sequence that offers `shared` gives base and difference from one draw: less work and a far quieter base.

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/bias.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/reach.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/resonance.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/common.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias {

/// Whether every sample evaluates the base, or the base is one outcome of the PMF.
enum class Base { every_sample, one_outcome };

struct SingleTermOptions {
  std::int64_t base_level = 0;
  Base base = Base::every_sample;
};

template <BiasedSequence S, Pmf P>
class SingleTerm {
 public:
  using value_type = sequence_value_t<S>;

  /// Throws std::invalid_argument for a negative base level.
  SingleTerm(S levels, P pmf, const SingleTermOptions& options)
      : sequence_(std::move(levels)), pmf_(std::move(pmf)), options_(options) {
    detail::check_base_level("single_term", options.base_level);
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream pmf_stream = split(rng, Branch::pmf);
    return draw(level_at(pmf_stream.uniform()), rng, record);
  }

  /// The level that a uniform in (0, 1] stands for; deep levels lie at small ones.
  [[nodiscard]] std::int64_t level_at(double u) const { return first_level() + pmf_.sample(u); }

  /// The sample that a draw of `level` from the PMF gives.
  template <Record R>
  Sample<value_type> draw(std::int64_t level, const Stream& rng, R& record) const {
    if (options_.base == Base::one_outcome) {
      Stream level_stream = split_level(rng, level);
      return draw_from(level, level_stream, record);
    }
    const double weight = inverse_weight(mass_of(level), level);
    return detail::base_and_difference(sequence_, options_.base_level, level, weight, rng, record);
  }

  /// Whether one stream has all numbers of a sample, so that it can be a point of a net.
  [[nodiscard]] bool draws_from_one_stream() const { return options_.base == Base::one_outcome; }

  /// The sample whose level draws the numbers of this stream, with Base::one_outcome.
  template <Record R>
  Sample<value_type> draw_from(std::int64_t level, Stream& level_stream, R& record) const {
    const double weight = inverse_weight(mass_of(level), level);
    auto term = level == options_.base_level ? detail::recorded_base(sequence_, level, level_stream, record)
                                             : detail::recorded_difference(sequence_, level, level_stream, record);
    return {debias::scaled(std::move(term.value), weight), term.work, level};
  }

  /// The same of several members of a sample; there is one kind of batch for numbers, arrays go one by one.
  template <Record R>
  void draw(std::int64_t level, const detail::Members& members, std::span<Sample<value_type>> out,
            R& record) const requires BatchesLevels<S> {
    const double weight = inverse_weight(mass_of(level), level);
    const std::int64_t m = options_.base_level;
    if (options_.base == Base::every_sample) {
      return detail::base_and_difference(sequence_, m, level, weight, members, out, record);
    }
    if constexpr (BatchesValues<S> && BatchesDifferences<S>) {
      std::array<Term<double>, StreamBatch::capacity> terms;
      StreamBatch streams = members.streams(level);
      const std::span<Term<double>> some = std::span(terms).first(out.size());
      level == m ? sequence_.values(level, streams, some) : sequence_.differences(level, streams, some);
      for (std::size_t b = 0; b < out.size(); ++b) {
        level == m ? record.base(m, some[b].value, some[b].work)
                   : record.difference(level, some[b].value, some[b].work);
        out[b] = {some[b].value * weight, some[b].work, level};
      }
    } else {
      const StreamBatch streams = members.streams(level);
      for (std::size_t b = 0; b < out.size(); ++b) {
        Stream level_stream = streams.stream(b);
        out[b] = draw_from(level, level_stream, record);
      }
    }
  }

  /// What the difference of a level is divided by; 0 for a level that is not drawn.
  [[nodiscard]] double probability(std::int64_t level) const { return level < first_level() ? 0 : mass_of(level); }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const requires StatesBias<S> {
    return sequence_.bias_bound(levels);
  }
  [[nodiscard]] auto missed(std::int64_t level, std::int64_t draws, Stream& rng) const requires ChecksPoints<S> {
    return sequence_.missed(level, draws, rng);
  }
  [[nodiscard]] SequenceFacts facts() const { return debias::facts_of(sequence_); }
  [[nodiscard]] Reach reach(std::int64_t /*last*/) const {
    return detail::reach_of(sequence_, pmf_, options_.base_level, first_level());
  }
  [[nodiscard]] const P& pmf() const { return pmf_; }
  [[nodiscard]] const S& sequence() const { return sequence_; }

  [[nodiscard]] std::string describe() const {
    return detail::describe(options_.base == Base::one_outcome ? "single_term, base one outcome" : "single_term", pmf_,
                            options_.base_level);
  }

 private:
  [[nodiscard]] double mass_of(std::int64_t level) const { return pmf_.mass(level - first_level()); }
  // The level that outcome 0 of the PMF stands for.
  [[nodiscard]] std::int64_t first_level() const {
    return options_.base_level + (options_.base == Base::every_sample ? 1 : 0);
  }

  S sequence_;
  P pmf_;
  SingleTermOptions options_;
};

/// Single-term estimator of the limit of `sequence` with levels drawn from `pmf`.
template <BiasedSequence S, Pmf P>
SingleTerm<S, P> single_term(S sequence, P pmf, const SingleTermOptions& options = {}) {
  return {std::move(sequence), std::move(pmf), options};
}

/// The same with the PMF that the declared rates of the sequence ask for.
/// Throws std::invalid_argument when there is none, or when it is not geometric.
template <BiasedSequence S>
requires DeclaresRates<S> SingleTerm<S, Geometric> single_term(S sequence, const SingleTermOptions& options = {}) {
  const Rates rates = sequence.rates;
  return {std::move(sequence), detail::default_pmf(rates), options};
}

// What is neither.
template <class S, class P>
requires(!(BiasedSequence<S> &&
           Pmf<P>)&&!std::same_as<P, SingleTermOptions>) auto single_term(const S& /*sequence*/, const P& /*pmf*/,
                                                                          const SingleTermOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_levels_and_pmf<S, P>(), S, P>();
}
template <class S>
requires(!(BiasedSequence<S> && DeclaresRates<S>)) auto single_term(const S& /*sequence*/,
                                                                    const SingleTermOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_rated_levels<S>(), S>();
}

}  // namespace debias

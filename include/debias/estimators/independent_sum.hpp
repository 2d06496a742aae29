#pragma once

// Independent-sum debiasing: all levels up to a random one, each weighted by the probability of reaching it.
//
//   Z = I_m + sum_{j=1}^{J} D_(m+j) / P(J' >= j),   J ~ pmf, all D independent      [Rhee & Glynn 2015, section 2]
//
//   Notation: m = base_level, P(J' >= j) = pmf.tail(j).
// E Z = I for every PMF that reaches every level with a difference that is not zero, if sum E|D_k| < infinity.
// Variance and work are finite under the conditions of single_term; the weights are smaller (tails, not
// masses), and one sample pays for every level below its deepest.

#include <cstdint>
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

struct IndependentSumOptions {
  std::int64_t base_level = 0;
};

template <BiasedSequence S, Pmf P>
class IndependentSum {
 public:
  using value_type = sequence_value_t<S>;

  /// Throws std::invalid_argument for a negative base level.
  IndependentSum(S sequence, P pmf, const IndependentSumOptions& options)
      : sequence_(std::move(sequence)), pmf_(std::move(pmf)), base_level_(options.base_level) {
    detail::check_base_level("independent_sum", base_level_);
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream pmf_stream = split(rng, Branch::pmf);
    return draw(level_at(pmf_stream.uniform()), rng, record);
  }

  /// The deepest level, for a uniform in (0, 1]; deep levels lie at small ones.
  [[nodiscard]] std::int64_t level_at(double u) const { return base_level_ + pmf_.sample(u); }

  /// The sample that ends at `deepest`.
  template <Record R>
  Sample<value_type> draw(std::int64_t deepest, const Stream& rng, R& record) const {
    Stream base_stream = split_level(rng, base_level_);
    auto base = detail::recorded_base(sequence_, base_level_, base_stream, record);
    Sample<value_type> sample{std::move(base.value), base.work, deepest};
    for (std::int64_t level = base_level_ + 1; level <= deepest; ++level) {
      Stream level_stream = split_level(rng, level);
      auto term = detail::recorded_difference(sequence_, level, level_stream, record);
      const double weight = inverse_weight(probability(level), level);
      sample.value = debias::sum(std::move(sample.value), debias::scaled(std::move(term.value), weight));
      sample.work += term.work;
    }
    return sample;
  }

  /// What the difference of a level is divided by.
  [[nodiscard]] double probability(std::int64_t level) const { return pmf_.tail(level - base_level_); }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const requires StatesBias<S> {
    return sequence_.bias_bound(levels);
  }
  [[nodiscard]] auto missed(std::int64_t level, std::int64_t draws, Stream& rng) const requires ChecksPoints<S> {
    return sequence_.missed(level, draws, rng);
  }
  [[nodiscard]] SequenceFacts facts() const { return debias::facts_of(sequence_); }
  [[nodiscard]] Reach reach(std::int64_t /*last*/) const {
    return detail::reach_of(sequence_, pmf_, base_level_, base_level_);
  }
  [[nodiscard]] const P& pmf() const { return pmf_; }
  [[nodiscard]] std::string describe() const { return detail::describe("independent_sum", pmf_, base_level_); }

 private:
  S sequence_;
  P pmf_;
  std::int64_t base_level_;
};

/// Independent-sum estimator of the limit of `sequence`; `pmf` is that of the number of levels above the base.
template <BiasedSequence S, Pmf P>
IndependentSum<S, P> independent_sum(S sequence, P pmf, const IndependentSumOptions& options = {}) {
  return {std::move(sequence), std::move(pmf), options};
}

/// The same with the PMF that the declared rates of the sequence ask for.
/// Throws std::invalid_argument when there is none, or when it is not geometric.
template <BiasedSequence S>
requires DeclaresRates<S> IndependentSum<S, Geometric> independent_sum(S sequence,
                                                                       const IndependentSumOptions& options = {}) {
  const Rates rates = sequence.rates;
  return {std::move(sequence), detail::default_pmf(rates), options};
}

// What is neither.
template <class S, class P>
requires(!(BiasedSequence<S> && Pmf<P>)&&!std::same_as<P, IndependentSumOptions>) auto independent_sum(
    const S& /*sequence*/, const P& /*pmf*/, const IndependentSumOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_levels_and_pmf<S, P>(), S, P>();
}
template <class S>
requires(!(BiasedSequence<S> && DeclaresRates<S>)) auto independent_sum(const S& /*sequence*/,
                                                                        const IndependentSumOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_rated_levels<S>(), S>();
}

}  // namespace debias

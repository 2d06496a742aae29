#pragma once

// Russian roulette, the coupled sum: the terms of a series in order along one path, up to a random one.
//
//   Z = sum_{k=0}^{m} T_k + sum_{j=1}^{J} T_(m+j) / P(J' >= j),   J ~ law    [McLeish 2011; Rhee & Glynn 2015 (3)]
//
//   Notation: m = base_level (the terms 0 ... m are always taken), P(J' >= j) = law.tail(j).
// E Z = sum E T_k for every law that reaches every term, if sum E|T_k| < infinity. Finite variance needs the
// tail of the law to fall slower than E T_k^2 (more precisely, sum nu_k / tail_k < infinity with
// nu_k = ||I - I_(k-1)||^2 - ||I - I_k||^2), finite work needs it to be summable against the work of a term.

#include <cstdint>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/common.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias {

struct RouletteOptions {
  std::int64_t base_level = 0;
};

template <TermSequence S, Pmf P>
class Roulette {
 public:
  using value_type = decltype(std::declval<const S&>()(std::declval<Stream&>())().value);

  /// Throws std::invalid_argument for a negative base level.
  Roulette(S terms, P law, const RouletteOptions& options)
      : terms_(std::move(terms)), law_(std::move(law)), base_level_(options.base_level) {
    detail::check_base_level("roulette", base_level_);
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream law_stream = split(rng, Branch::law);
    const std::int64_t beyond = law_.sample(law_stream.uniform());
    Stream path = split_level(rng, 0);
    auto cursor = terms_(path);
    auto term = cursor();
    Sample<value_type> sample{std::move(term.value), term.work, base_level_ + beyond};
    for (std::int64_t k = 1; k <= base_level_; ++k) {
      term = cursor();
      sample.value = sum(std::move(sample.value), term.value);
      sample.work += term.work;
    }
    record.base(base_level_, as_scalar(sample.value), sample.work);
    for (std::int64_t j = 1; j <= beyond; ++j) {
      term = cursor();
      const std::int64_t level = base_level_ + j;
      record.difference(level, as_scalar(term.value), term.work);
      sample.value = sum(std::move(sample.value), scaled(std::move(term.value), inverse_weight(law_.tail(j), level)));
      sample.work += term.work;
    }
    return sample;
  }

  [[nodiscard]] const P& law() const { return law_; }
  [[nodiscard]] std::string describe() const { return detail::describe("roulette", law_, base_level_); }

 private:
  S terms_;
  P law_;
  std::int64_t base_level_;
};

/// Roulette estimator of the sum of `terms`; `law` is that of the number of terms beyond the base.
template <TermSequence S, Pmf P>
Roulette<S, P> roulette(S terms, P law, const RouletteOptions& options = {}) {
  return {std::move(terms), std::move(law), options};
}

/// The same with the law that the declared rates of the terms ask for.
/// Throws std::invalid_argument when there is none, or when it is not geometric.
template <TermSequence S>
  requires DeclaresRates<S>
Roulette<S, Geometric> roulette(S terms, const RouletteOptions& options = {}) {
  const Rates rates = terms.rates;
  return {std::move(terms), detail::default_law(rates), options};
}

}  // namespace debias

#pragma once

// What the estimators share: base and difference of one sample, the check of the base level, the default law, and
// how they name themselves.

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias::detail {

inline void check_base_level(const char* estimator, std::int64_t base_level) {
  if (base_level < 0) {
    throw std::invalid_argument(std::string(estimator) + ": base_level = " + std::to_string(base_level) +
                                " (levels start at 0)");
  }
}

inline Geometric default_law(const Rates& rates) {
  const double exponent = default_exponent(rates);
  if (rates.decay == Decay::polynomial) {
    throw std::invalid_argument(
        "law: the differences decay like a power of the level (under a geometric law their variance is infinite); "
        "name the law Zeta(" +
        std::to_string(exponent) + ")");
  }
  return Geometric::with_exponent(exponent);
}

/// I_m + weight D_level, both from the draws of the level where the sequence shares them.
template <BiasedSequence S, Record R>
Sample<sequence_value_t<S>> base_and_difference(const S& sequence, std::int64_t m, std::int64_t level, double weight,
                                                const Stream& rng, R& record) {
  Stream level_stream = split_level(rng, level);
  if constexpr (OffersSharedBase<S>) {
    auto both = sequence.shared(level, m, level_stream);
    record.base(m, as_scalar(both.base), 0.0);
    record.difference(level, as_scalar(both.difference), both.work);
    return {sum(std::move(both.base), scaled(std::move(both.difference), weight)), both.work, level};
  } else {
    Stream base_stream = split_level(rng, m);
    auto base = value_of(sequence, m, base_stream);
    auto term = difference_of(sequence, level, level_stream);
    record.base(m, as_scalar(base.value), base.work);
    record.difference(level, as_scalar(term.value), term.work);
    return {sum(std::move(base.value), scaled(std::move(term.value), weight)), base.work + term.work, level};
  }
}

template <Pmf P>
std::string describe(const std::string& estimator, const P& law, std::int64_t base_level) {
  std::string name = "user-defined law";
  if constexpr (DescribedPmf<P>) name = law.spec();
  return estimator + ", " + name + ", base level " + std::to_string(base_level);
}

}  // namespace debias::detail

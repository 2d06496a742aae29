#pragma once

// What the estimators share: the check of the base level, the default law, and how they name themselves.

#include <cstdint>
#include <stdexcept>
#include <string>

#include <debias/core/pmf.hpp>
#include <debias/core/rates.hpp>
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

template <Pmf P>
std::string describe(const std::string& estimator, const P& law, std::int64_t base_level) {
  std::string name = "user-defined law";
  if constexpr (DescribedPmf<P>) name = law.spec();
  return estimator + ", " + name + ", base level " + std::to_string(base_level);
}

}  // namespace debias::detail

#include <debias/core/rates.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace debias {

ExponentRange finite_exponents(const Rates& r) {
  if (r.decay == Decay::geometric) return {r.work, r.variance};
  return {r.work + 1, r.variance - 1};
}

bool law_exists(const Rates& rates) {
  const ExponentRange range = finite_exponents(rates);
  return range.low < range.high;
}

double default_exponent(const Rates& rates) {
  const ExponentRange range = finite_exponents(rates);
  if (!(range.low < range.high)) {
    std::ostringstream text;
    text << "law: E D_k^2 decays with exponent " << rates.variance << " and the work grows with exponent "
         << rates.work
         << " (no law has both finite variance and finite work); a better coupling, a smoother integrand or "
            "extrapolation may raise the decay, `truncated` accepts a bias";
    throw std::invalid_argument(text.str());
  }
  if (std::isinf(range.high)) return range.low + 1;
  const double best = (rates.variance + rates.work) / 2;
  // 2^(3 rho k) 2^(-2 beta k), or k^(3 rho) k^(-2 beta), must be summable.
  const double fourth = rates.decay == Decay::geometric ? 2 * rates.variance / 3 : (2 * rates.variance - 1) / 3;
  return fourth > range.low ? std::min(best, range.low + 0.9 * (fourth - range.low)) : best;
}

}  // namespace debias

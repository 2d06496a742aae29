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

namespace {

// `fourth` is the decay of E D^4.
double exponent_below(const Rates& rates, double fourth) {
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
  // 2^(3 rho k) 2^(-fourth k), or k^(3 rho) k^(-fourth), must be summable.
  const double bound = rates.decay == Decay::geometric ? fourth / 3 : (fourth - 1) / 3;
  return bound > range.low ? std::min(best, range.low + 0.9 * (bound - range.low)) : best;
}

}  // namespace

double default_exponent(const Rates& rates) { return exponent_below(rates, 2 * rates.variance); }

double default_exponent(const MeasuredRates& m) { return exponent_below(rates_of(m), m.fourth.value); }

}  // namespace debias

#include <debias/core/rates.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/text.hpp"

namespace debias {

ExponentRange finite_exponents(const Rates& r) {
  if (r.decay == Decay::geometric) return {r.work_growth, r.variance_decay};
  return {r.work_growth + 1, r.variance_decay - 1};
}

bool pmf_exists(const Rates& rates) {
  const ExponentRange range = finite_exponents(rates);
  return range.low < range.high;
}

namespace {

constexpr double least_room = 0.2;       // between the bounds of an exponent, of work and fourth moment
constexpr double comfortable = 7.0 / 8;  // of the way to the latter: tail index 1/7, where 1/4 is the bound

// `fourth` is the decay of E D^4.
double exponent_below(const Rates& rates, double fourth) {
  const ExponentRange range = finite_exponents(rates);
  if (!(range.low < range.high)) {
    throw std::invalid_argument("pmf: E D_k^2 decays with exponent " + format("%g", rates.variance_decay) +
                                " and the work grows with exponent " + format("%g", rates.work_growth) +
                                " (no PMF has both finite variance and finite work); a better coupling, a smoother "
                                "integrand or extrapolation may raise the decay, `truncated` accepts a bias");
  }
  if (std::isinf(range.high)) return range.low + 1;
  const double best = (rates.variance_decay + rates.work_growth) / 2;
  // 2^(3 rho k) 2^(-fourth k), or k^(3 rho) k^(-fourth), must be summable.
  const double border = rates.decay == Decay::geometric ? 0 : 1;
  const double bound = (fourth - border) / 3;
  // A bound that leaves next to no room above the work's would buy the fourth moment with endless work.
  if (bound < range.low + least_room) return best;
  return std::min(best, std::max((range.low + bound) / 2, border + comfortable * (bound - border)));
}

}  // namespace

double default_exponent(const Rates& rates) { return exponent_below(rates, 2 * rates.variance_decay); }

double default_exponent(const MeasuredRates& m) { return exponent_below(rates_of(m), m.fourth_decay.value); }

}  // namespace debias

#include <debias/core/rates.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/no_pmf.hpp>

#include "core/words.hpp"

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

constexpr const char* what_helps =
    "a better coupling, a smoother integrand or extrapolation may raise the decay, `truncated` accepts a bias";

void refuse_unknown(const Rates& rates) {
  if (!std::isnan(rates.variance_decay) && !std::isnan(rates.work_growth)) return;
  throw std::invalid_argument(
      "pmf: the " + std::string(std::isnan(rates.variance_decay) ? "decay of E D_k^2" : "growth of the work") +
      " is not known (it is no number); name a PMF, or survey more levels");
}

[[noreturn]] void refuse(const FittedRate& decay, const FittedRate& growth, Decay unit, NoPmfError::Grade grade) {
  NoPmfError::Facts facts{.variance_decay = decay, .work_growth = growth, .decay = unit, .grade = grade};
  facts.reason = decay_words("E D_k^2", decay, unit) + " and " + growth_words("work", growth, unit);
  facts.help = what_helps;
  const std::string what = "pmf: " + facts.reason + " (no PMF has both finite variance and finite work); " + facts.help;
  throw NoPmfError(what, std::move(facts));
}

// `fourth` is the decay of E D^4, for rates with a PMF.
double exponent_below(const Rates& rates, double fourth) {
  const ExponentRange range = finite_exponents(rates);
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

double default_exponent(const Rates& rates) {
  refuse_unknown(rates);
  constexpr double unknown = NoPmfError::unknown;
  if (!pmf_exists(rates)) {
    refuse({rates.variance_decay, unknown}, {rates.work_growth, unknown}, rates.decay, NoPmfError::Grade::declared);
  }
  return exponent_below(rates, 2 * rates.variance_decay);
}

double default_exponent(const MeasuredRates& m) {
  const Rates rates = rates_of(m);
  refuse_unknown(rates);
  if (!pmf_exists(rates)) {
    constexpr double surely = 2.6;  // errors: wrong once in 200
    const ExponentRange range = finite_exponents(rates);
    const double error = std::hypot(m.variance_decay.error, m.work_growth.error);
    refuse(m.variance_decay, m.work_growth, rates.decay,
           range.low - range.high > surely * error ? NoPmfError::Grade::shown : NoPmfError::Grade::likely);
  }
  return exponent_below(rates, m.fourth_decay.value);
}

}  // namespace debias

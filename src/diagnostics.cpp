#include <debias/diagnostics.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace debias {
namespace {

// The rho of the law in the unit in which the rates count: a law that falls geometrically is infinitely steep
// on a polynomial scale, a power law infinitely flat on a geometric one.
double exponent_beside(const Rates& rates, const TailExponent& law) {
  if (rates.decay == law.decay || std::isinf(law.exponent)) return law.exponent;
  return law.decay == Decay::geometric ? std::numeric_limits<double>::infinity() : 0.0;
}

// E|Z|^q = sum p E|D|^q p^(-q) is finite iff q < 1 / xi.
double tail_index(const Rates& rates, double rho) {
  if (std::isinf(rates.variance)) return 0;
  if (std::isinf(rho)) return 1;  // the limit of both formulas
  const double half = rates.variance / 2;
  const double xi = rates.decay == Decay::geometric ? 1 - half / rho : (rho - half) / (rho - 1);
  return rho > 0 ? std::max(0.0, xi) : 0.0;
}

}  // namespace

Verdict judge(const Rates& rates, const TailExponent& law) {
  const ExponentRange range = finite_exponents(rates);
  const double rho = exponent_beside(rates, law);
  Verdict v;
  v.finite_variance = std::isinf(rates.variance) || rho < range.high;
  // Beside geometric rates a power law reaches every depth too often, unless the work does not grow.
  v.finite_work = rho > range.low || (rates.decay == Decay::geometric && rates.work <= 0);
  v.tail_index = tail_index(rates, rho);

  std::ostringstream text;
  text.precision(3);
  const char* sign = v.finite_variance ? " < " : " >= ";
  text << (v.finite_variance ? "variance finite" : "variance INFINITE") << " (law exponent " << rho << sign
       << range.high << "), " << (v.finite_work ? "work finite" : "work INFINITE") << " (" << rho
       << (v.finite_work ? " > " : " <= ") << range.low << "), tail index " << v.tail_index;
  if (!v.finite_variance || !v.finite_work) {
    text << (v.finite_variance ? ": no run ends its expected work"
                               : ": the standard error is too small most of the time");
    if (range.low < range.high) {
      text << "; take a law with exponent between " << range.low << " and " << range.high;
    } else {
      text << "; no law has both finite";
    }
  } else if (v.tail_index >= 0.25) {
    text << ": the fourth moment is infinite, so the standard error converges slowly";
  }
  v.sentence = text.str();
  return v;
}

}  // namespace debias

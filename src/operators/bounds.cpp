#include <debias/operators/bounds.hpp>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <stdexcept>

#include <debias/core/text.hpp>

namespace debias {

std::ostream& operator<<(std::ostream& out, const Spectrum& s) {
  return out << "spectrum      in [" << detail::format("%.6g", s.lower) << ", " << detail::format("%.6g", s.upper)
             << "], condition " << detail::format("%.4g", s.condition()) << "; lower bound by " << s.lower_by
             << ", upper by " << s.upper_by << "; Lanczos saw " << detail::format("%.6g", s.lowest_ritz) << " to "
             << detail::format("%.6g", s.highest_ritz) << '\n';
}

namespace detail {

namespace {

[[noreturn]] void refuse(const char* name, const std::string& why) {
  throw std::invalid_argument(std::string(name) + ": " + why);
}

std::string number(double x) { return format("%.6g", x); }

}  // namespace

double unseen_spread(std::size_t rows, int steps) {
  const double root = std::log(1.648 * std::sqrt(static_cast<double>(rows)) * 1e6) / (2.0 * steps - 1);
  return std::min(1.0, root * root);
}

Spectrum judge_bounds(const char* name, const SpectrumBounds& bounds, const std::optional<Interval>& gershgorin,
                      const RitzValues& ritz, double unseen, bool positive) {
  const double tiny = 1e-10 * std::max(std::abs(ritz.lowest), std::abs(ritz.highest));  // rounding of the steps
  if (bounds.lower && !std::isfinite(*bounds.lower)) {
    refuse(name, "lower bound of the spectrum = " + number(*bounds.lower) + " (must be finite)");
  }
  if (bounds.upper && !std::isfinite(*bounds.upper)) {
    refuse(name, "upper bound of the spectrum = " + number(*bounds.upper) + " (must be finite)");
  }
  const std::string seen =
      "some eigenvalue is at most " + number(ritz.lowest) + ", some at least " + number(ritz.highest);
  if (positive && !(ritz.lowest > 0)) {
    refuse(name,
           "the operator is not positive definite (" + seen +
               "); add a nugget or a shift, or take `log_determinant` and `neumann` of linear_operators.hpp, which "
               "need no positive spectrum but a spectral radius of I - A below 1 (here at least " +
               number(std::max(1 - ritz.lowest, ritz.highest - 1)) + ")");
  }
  if (bounds.lower && *bounds.lower > ritz.lowest + tiny) {
    refuse(name, "lower bound of the spectrum = " + number(*bounds.lower) + " (refuted: some eigenvalue is at most " +
                     number(ritz.lowest) + ", so the condition is at least " + number(ritz.highest / ritz.lowest) +
                     "); did you mean the nugget or the shift alone?");
  }
  if (bounds.upper && *bounds.upper < ritz.highest - tiny) {
    refuse(name, "upper bound of the spectrum = " + number(*bounds.upper) + " (refuted: some eigenvalue is at least " +
                     number(ritz.highest) + "); leave it out, and Lanczos finds one");
  }
  if (positive && bounds.lower && !(*bounds.lower > 0)) {
    refuse(name, "lower bound of the spectrum = " + number(*bounds.lower) +
                     " (must be positive for a function that is singular at 0); add a nugget or a shift");
  }
  Spectrum s;
  s.lowest_ritz = ritz.lowest;
  s.highest_ritz = ritz.highest;
  s.residual = ritz.residual;

  // By Lanczos the spectrum has at most this spread, but for a probability of 1e-6 at each end.
  const double spread =
      unseen < 0.5 ? (ritz.highest - ritz.lowest) / (1 - 2 * unseen) : std::numeric_limits<double>::infinity();
  if (bounds.lower) {
    s.lower = *bounds.lower;
    s.lower_by = "the caller";
  } else if (gershgorin && (gershgorin->lower > 0 || !positive)) {
    s.lower = gershgorin->lower;
    s.lower_by = "Gershgorin";
  } else if (!positive && std::isfinite(spread)) {
    s.lower = ritz.lowest - unseen * spread;
    s.lower_by = "Lanczos";
  } else {
    refuse(name, std::string("no lower bound of the spectrum is known (") +
                     (gershgorin ? "Gershgorin gives " + number(gershgorin->lower)
                                 : std::string("of an operator only products are")) +
                     ", and Lanczos can refute one, not prove one: it saw " + number(ritz.lowest) + " to " +
                     number(ritz.highest) +
                     "); pass {.lower = ...}: the nugget of a kernel, the shift of a Laplacian, or a number below all "
                     "eigenvalues");
  }
  if (bounds.upper) {
    s.upper = *bounds.upper;
    s.upper_by = "the caller";
  } else {
    double highest = std::numeric_limits<double>::infinity();
    if (unseen < 1) {  // lambda - theta <= unseen (lambda - lower)
      highest = std::max(ritz.highest + ritz.residual, ritz.highest + unseen * (ritz.highest - s.lower) / (1 - unseen));
    }
    s.upper = highest;
    s.upper_by = "Lanczos";
    if (gershgorin && gershgorin->upper <= highest) {
      s.upper = gershgorin->upper;
      s.upper_by = "Gershgorin";
    }
    if (!std::isfinite(s.upper)) {
      refuse(name, "no upper bound of the spectrum from so few steps of Lanczos (they saw " + number(ritz.highest) +
                       "); pass {.upper = ...}, or more .steps");
    }
  }
  if (!(s.lower < s.upper)) {  // a multiple of the identity, or bounds in each other's place
    if (bounds.lower && bounds.upper) {
      refuse(name, "bounds of the spectrum [" + number(s.lower) + ", " + number(s.upper) +
                       "] (the lower must be below the upper)");
    }
    const double room = 1e-3 * std::max(std::abs(s.upper), 1e-300);
    s.upper += room;
    if (!positive) s.lower -= room;
  }
  return s;
}

}  // namespace detail

}  // namespace debias

#pragma once

// Properties that hold for any input: RapidCheck draws inputs, and makes one that fails as small as it can.
//
//   holds("what holds", [] { const int n = *rc::gen::inRange(1, 9); RC_ASSERT(...); });
//
// The seed is fixed, so that a run says the same every time; RC_PARAMS in the environment takes others:
//   RC_PARAMS="seed=7 max_success=10000" build/dev/debias_tests "[property]"

#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include <rapidcheck.h>

#include "../catch_shim.hpp"

#include <debias/pmf/any.hpp>

namespace debias::properties {

template <class Property>
void holds(const std::string& what, Property&& property) {
  setenv("RC_PARAMS", "seed=1 verbose_shrinking=0", /*overwrite=*/0);
  INFO(what);
  CHECK(rc::check(what, std::forward<Property>(property)));
}

/// A number of [low, high), evenly in its logarithm.
inline double any_number(double low, double high) {
  const double share = *rc::gen::inRange(0, 1 << 20) / static_cast<double>(1 << 20);
  return low * std::pow(high / low, share);
}

/// Any PMF of the command line.
inline AnyPmf any_pmf() {
  switch (*rc::gen::inRange(0, 4)) {
    case 0:
      return AnyPmf(Geometric(any_number(0.01, 0.99)));
    case 1:
      return AnyPmf(Zeta(1 + any_number(0.1, 8)));
    case 2:
      return AnyPmf(Poisson(any_number(1e-2, 300)));
    default:
      break;
  }
  std::vector<double> masses;
  for (int n = *rc::gen::inRange(1, 9); n > 0; --n) masses.push_back(any_number(1e-6, 1e6));
  return AnyPmf(Tabulated(std::move(masses), any_number(0.01, 0.99)));
}

}  // namespace debias::properties

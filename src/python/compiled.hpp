#pragma once

// Problems of compiled functions: C function pointers that need nothing of Python. They run like the catalogue's, on all threads.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "problem.hpp"

namespace debias::python {

/// A C function with a last argument for data of its user, or without.
template <class R, class... Arguments>
struct CFunction {
  std::uintptr_t address = 0;
  std::optional<std::uintptr_t> user{};

  R operator()(Arguments... arguments) const {
    if (user) {
      return reinterpret_cast<R (*)(Arguments..., void*)>(address)(arguments..., reinterpret_cast<void*>(*user));
    }
    return reinterpret_cast<R (*)(Arguments...)>(address)(arguments...);
  }
};

/// f(n, x): of x[0] ... x[n - 1], uniform in the unit cube, or of a point.
using CIntegrand = CFunction<double, int, const double*>;
/// f(level, n, u, out) writes the fine and the coarse estimate; the first alone at level 0.
using CLevels = CFunction<void, std::int64_t, std::int64_t, const double*, double*>;

UserProblem compiled_mean(const Facts& facts, const CIntegrand& f, std::size_t dimension, const std::string& g,
                          const std::string& points, double from, double to);
/// `sizes` holds dimension and work of the levels 0, 1, ...; there are no others.
UserProblem compiled_levels(const Facts& facts, const CLevels& f, std::vector<Lookups::Size> sizes);

}  // namespace debias::python

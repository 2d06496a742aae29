#pragma once

// Problems of compiled functions: C function pointers that need nothing of Python. They run like the catalogue's, on all threads.

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "problem.hpp"

namespace debias::python {

/// f(n, x, user): of x[0] ... x[n - 1], uniform in the unit cube, or of a point. Callers of a two-argument function ignore the
/// third, as compilers of this house pass arguments in registers.
using IntegrandPointer = double (*)(int n, const double* x, void* user);
/// f(level, n, u, out, user) writes the fine and the coarse estimate; the first alone at level 0.
using LevelPointer = void (*)(std::int64_t level, std::int64_t n, const double* u, double* out, void* user);

UserProblem compiled_mean(const Facts& facts, IntegrandPointer f, void* user, std::size_t dimension,
                          const std::string& g, const std::string& points, double from, double to);
/// `sizes` holds dimension and work of the levels 0, 1, ...; there are no others.
UserProblem compiled_levels(const Facts& facts, LevelPointer f, void* user, std::vector<Lookups::Size> sizes);

}  // namespace debias::python

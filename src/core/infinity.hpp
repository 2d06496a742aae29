#pragma once

#include <limits>

namespace debias {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace debias

#pragma once

// The direction numbers of Sobol's sequence in the first 256 dimensions, with their bits in opposite order.

#include <cstdint>

#include <debias/core/points.hpp>

namespace debias::detail {

/// By bit of the point, then dimension: the half is bit 0, the quarter bit 1. Coordinate t of point r is the exclusive or of
/// of_bit[b][t] over the bits b of r.
struct SobolTable {
  alignas(64) std::uint32_t of_bit[32][net_dimensions];
};

const SobolTable& sobol_table();

}  // namespace debias::detail

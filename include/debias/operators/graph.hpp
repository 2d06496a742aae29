#pragma once

// What the setup of probes computes on plain arrays: colours of a graph, and an orthonormal basis.
//
// Greedy colours are as many as the largest neighbourhood within the distance at most, and often half of that.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace debias::detail {

/// Colours such that rows of equal colour are more than `distance` edges apart: greedily, in order.
/// The graph by rows: the neighbours of i are inner[outer[i]] ... inner[outer[i + 1] - 1].
std::vector<int> colour_graph(std::span<const std::int64_t> outer, std::span<const std::int32_t> inner, int distance);

/// The number of colours. Throws std::invalid_argument for a colour below 0, and for rows without one.
int count_colours(const char* name, std::span<const int> colours, std::size_t rows);

/// Makes `basis` orthonormal, vector by vector and twice; drops vectors that lie in the span of those before.
void orthonormalise(std::vector<double>& basis, std::size_t rows);

}  // namespace debias::detail

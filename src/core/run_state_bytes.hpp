#pragma once

// The sums of a run as bytes, and back: what a file holds, and what ranks send each other.

#include <cstddef>
#include <span>

#include <debias/core/run_state.hpp>

#include "bytes.hpp"

namespace debias {

/// Equal states have equal bytes.
Bytes encode(RunState state);
/// Throws std::invalid_argument for bytes that are none.
/// Sums that are not `whole` have left out of their tails what earlier ones, to be merged with them, made superfluous.
RunState decode(std::span<const std::byte> bytes, bool whole = true);

}  // namespace debias

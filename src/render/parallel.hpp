#pragma once

// Pieces of work on threads; which thread does a piece cannot matter, since each writes its own results.

#include <functional>

namespace debias::render {

/// body(0) ... body(pieces - 1), in about this order, on `threads` threads (0: all cores); the caller works too.
/// `more` is asked, by the caller's thread only, before each of its pieces: false leaves out what has not begun.
/// Rethrows the first exception.
void in_parallel(int pieces, int threads, const std::function<void(int)>& body,
                 const std::function<bool(int finished)>& more);

}  // namespace debias::render

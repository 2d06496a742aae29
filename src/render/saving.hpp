#pragma once

// The sums of an image that is not finished, for a later run to go on from.

#include <functional>
#include <span>
#include <stdexcept>

#include "core/bytes.hpp"

namespace debias::render {

struct Saving {
  /// Called between passes and at the end (`last`, finished or interrupted); `sums` makes the bytes.
  std::function<void(const std::function<Bytes()>& sums, bool last)> save;
  /// What such a call has made, of the same plan and method.
  std::span<const std::byte> earlier;

  /// Throws std::invalid_argument for the bytes of another plan.
  template <class State, class Layout>
  void take_up(State& state, const Layout& layout) const {
    if (earlier.empty()) return;
    ByteReader r(earlier);
    layout(r, state);
    if (r.left() != 0) throw std::invalid_argument("no checkpoint: the sums are of another image");
  }
  template <class State, class Layout>
  void keep(State& state, const Layout& layout, bool last) const {
    if (!save) return;
    save(
        [&] {
          ByteWriter w;
          layout(w, state);
          return std::move(w.bytes);
        },
        last);
  }
};

}  // namespace debias::render

#pragma once

// Brownian paths, step by step: in the order of time from plain numbers, by bridges from the points of a net.
//
//   plain    number i is the increment of step i:                       dW_i = sqrt(h) z_i
//   bridges  number 0 is the end, then come midpoints, the coarse first: W_T = sqrt(T) z_0
//            W_(s + d/2) = (W_s + W_(s+d)) / 2 + sqrt(d) / 2 z,  d = T, T/2, ...        [Levy; Caflisch & Moskowitz 1995]
//
//   Notation: T = horizon, h = T / steps, z = independent standard normals.
// The law is the same. The end and the first midpoints carry most of the variance of a payoff, and also of the difference of a
// level: as the first dimensions of a net, its best ones, they lower it many times more than increments do.
// The bridges go down to 256 nodes, or the largest power of two that divides the steps; within the last intervals increments come in
// the order of time, each given those before it and the end: memory is bounded, and dimensions beyond the net's are plain anyway.
// A path from a net draws the numbers of its nodes at once when it is made: number t of the net is node t, and whatever the
// caller draws besides (a uniform for each bridge, say) comes after the nodes, in the order in which it is drawn.
// Fails to help where the payoff depends on no smooth function of the path's large moves: extremes gain little.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>
#include <debias/core/text.hpp>

namespace debias {

namespace detail {

/// The nodes of a bridge, a power of two, and the steps of each of its last intervals.
struct BridgeNodes {
  static constexpr std::int64_t most = static_cast<std::int64_t>(net_dimensions);

  std::int64_t count;
  std::int64_t inner;

  explicit BridgeNodes(std::int64_t steps)
      : count(std::min(most, std::int64_t{1} << std::countr_zero(static_cast<std::uint64_t>(steps)))),
        inner(steps / count) {}

  /// `middle(from, to, sd)` for each midpoint, in the order of their numbers.
  template <class Middle>
  void each(double horizon, const Middle& middle) const {
    for (std::int64_t width = count; width > 1; width /= 2) {
      const double sd = std::sqrt(horizon * static_cast<double>(width) / static_cast<double>(count)) / 2;
      for (std::int64_t i = 0; i < count; i += width) {
        middle(static_cast<std::size_t>(i), static_cast<std::size_t>(i + width), sd);
      }
    }
  }
};

/// What remains of an interval of a bridge: its increment, and the steps that share it.
template <class Noise>
struct Remainder {
  Noise increment;
  std::int64_t steps = 0;

  /// The next of them. `draw(sd)` is a normal of this standard deviation.
  template <class Draw>
  Noise next(double sqrt_h, const Draw& draw) {
    const auto n = static_cast<double>(steps--);
    if (steps == 0) return increment;
    Noise dw = increment * (1 / n) + draw(sqrt_h * std::sqrt((n - 1) / n));
    increment -= dw;
    return dw;
  }
};

/// A path by bridges; `draw(sd)` is a normal of this standard deviation, a number or a vector.
template <class Draw>
class BridgedPath {
 public:
  using Noise = std::remove_cvref_t<std::invoke_result_t<const Draw&, double>>;

  BridgedPath(const Draw& draw, std::int64_t steps, double horizon)
      : draw_(draw), nodes_(steps), sqrt_h_(std::sqrt(horizon / static_cast<double>(steps))) {
    w_[static_cast<std::size_t>(nodes_.count)] = draw_(std::sqrt(horizon));
    w_[0] = w_[static_cast<std::size_t>(nodes_.count)] * 0.0;
    nodes_.each(horizon, [&](std::size_t from, std::size_t to, double sd) {
      const Noise z = draw_(sd);
      w_[(from + to) / 2] = (w_[from] + w_[to]) * 0.5 + z;
    });
  }

  Noise next() {
    if (rest_.steps == 0) {
      rest_ = {w_[node_ + 1] - w_[node_], nodes_.inner};
      ++node_;
    }
    return rest_.next(sqrt_h_, draw_);
  }

 private:
  Draw draw_;
  BridgeNodes nodes_;
  double sqrt_h_;
  std::size_t node_ = 0;
  Remainder<Noise> rest_{};
  std::array<Noise, BridgeNodes::most + 1> w_;  // not set beyond the nodes
};

/// The increments of the paths of a batch of points and, with `bridges`, a uniform number after each, step by step.
template <bool bridges>
class BridgedPathNumbers {
 public:
  BridgedPathNumbers(StreamBatch& batch, std::int64_t steps, double horizon)
      : batch_(&batch), size_(batch.size()), nodes_(steps), sqrt_h_(std::sqrt(horizon / static_cast<double>(steps))) {
    std::array<double, 4 * StreamBatch::capacity> buffer;
    std::size_t row = 0;
    std::size_t end = 0;
    std::int64_t left = nodes_.count;
    const auto normals = [&] {
      if (row == end) {
        const auto rows = static_cast<std::size_t>(std::min<std::int64_t>(left, 4));
        left -= static_cast<std::int64_t>(rows);
        row = 0;
        end = rows * size_;
        batch_->normals(std::span(buffer).first(end));
      }
      return &buffer[std::exchange(row, row + size_)];
    };
    double* const first = node(0);
    double* const last = node(static_cast<std::size_t>(nodes_.count));
    const double* const z = normals();
    for (std::size_t b = 0; b < size_; ++b) {
      first[b] = 0;
      last[b] = std::sqrt(horizon) * z[b];
    }
    nodes_.each(horizon, [&](std::size_t from, std::size_t to, double sd) {
      const double* const x = node(from);
      const double* const y = node(to);
      double* const middle = node((from + to) / 2);
      const double* const number = normals();
      for (std::size_t b = 0; b < size_; ++b) middle[b] = (x[b] + y[b]) * 0.5 + sd * number[b];
    });
  }

  /// To the next step. The numbers of steps 2 i and 2 i + 1 are there together.
  void next() {
    now_ = 1 - now_;
    double* const dw = increments_[now_].data();
    if (rest_[0].steps == 0) {
      const double* const x = node(at_);
      const double* const y = node(++at_);
      for (std::size_t b = 0; b < size_; ++b) rest_[b] = {y[b] - x[b], nodes_.inner};
    }
    std::array<double, StreamBatch::capacity> z;
    if (rest_[0].steps > 1) batch_->normals(std::span(z).first(size_));
    for (std::size_t b = 0; b < size_; ++b) {
      dw[b] = rest_[b].next(sqrt_h_, [&](double sd) { return sd * z[b]; });
    }
    if constexpr (bridges) batch_->uniforms(std::span(uniforms_[now_]).first(size_));
  }
  [[nodiscard]] const double* increments() const { return increments_[now_].data(); }
  [[nodiscard]] const double* uniforms() const { return bridges ? uniforms_[now_].data() : nullptr; }

 private:
  double* node(std::size_t i) { return &w_[i * size_]; }

  StreamBatch* batch_;
  std::size_t size_;
  BridgeNodes nodes_;
  double sqrt_h_;
  std::size_t at_ = 0;
  std::size_t now_ = 0;
  std::array<Remainder<double>, StreamBatch::capacity> rest_{};
  std::array<std::array<double, StreamBatch::capacity>, 2> increments_;
  std::array<std::array<double, StreamBatch::capacity>, 2> uniforms_;
  std::array<double, (BridgeNodes::most + 1) * StreamBatch::capacity> w_;  // not set beyond the nodes
};

}  // namespace detail

/// The increments of a Brownian path over [0, horizon], for a path of your own:
///
///   const auto call = [](std::int64_t level, Stream& rng) {
///     const std::int64_t steps = std::int64_t{1} << level;
///     BrownianPath w(rng, steps, 1.0);
///     ...  const double dw = w.next();  ...
///
/// From a plain stream number i is increment i, the ones that rng.normal() would be times sqrt(h); from the point of a net the
/// path takes as many numbers, in the order of bridges. The stream must outlive the path.
class BrownianPath {
 public:
  /// Throws std::invalid_argument unless there is a step and the horizon is positive and finite.
  BrownianPath(Stream& rng, std::int64_t steps, double horizon = 1) : draw_{&rng} {
    if (steps < 1) throw std::invalid_argument("BrownianPath: " + std::to_string(steps) + " steps (at least one)");
    if (!(horizon > 0) || !std::isfinite(horizon)) {
      throw std::invalid_argument("BrownianPath: horizon = " + detail::format("%g", horizon) +
                                  " (must be positive and finite)");
    }
    sqrt_h_ = std::sqrt(horizon / static_cast<double>(steps));
    if (rng.is_point()) {
      bridged_ = true;
      std::construct_at(&bridges_, draw_, steps, horizon);
    }
  }
  BrownianPath(const BrownianPath&) = delete;
  BrownianPath& operator=(const BrownianPath&) = delete;
  ~BrownianPath() = default;

  /// W at the end of the next step less W at its beginning.
  double next() { return bridged_ ? bridges_.next() : draw_(sqrt_h_); }

 private:
  struct Normals {
    Stream* rng;
    double operator()(double sd) const { return sd * rng->normal(); }
  };
  using Bridges = detail::BridgedPath<Normals>;
  static_assert(std::is_trivially_destructible_v<Bridges>);

  Normals draw_;
  double sqrt_h_ = 0;
  bool bridged_ = false;
  union {
    Bridges bridges_;  // of a net
  };
};

}  // namespace debias

#pragma once

// A mixture of kernels: each step is one of them, drawn with fixed probabilities, the same one for both chains.
//
//   step = kernel i with probability w_i
//
// All kernels leave the same law invariant. What a kernel carries with a point (a density) is made anew after another kernel
// has moved it: densities need not be normalised alike. Helps where one kernel moves between modes and another one meets.

#include <array>
#include <cstddef>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>

#include <debias/chains/kernel.hpp>
#include <debias/core/stream.hpp>

namespace debias {

namespace detail {
/// Probabilities up to each kernel; throws std::invalid_argument unless weights are positive and finite.
void accumulate_weights(std::span<double> weights);
}  // namespace detail

template <class... K>
class Mixture {
 public:
  static constexpr bool checks_points = (detail::ChecksItsPoints<K> && ...);

  template <class Point>
  struct State {
    std::tuple<detail::chain_state_t<K, Point>...> states;
    std::size_t last;  ///< which of them is the state; the others are old
  };

  /// Throws std::invalid_argument unless all weights are positive and finite.
  Mixture(const std::array<double, sizeof...(K)>& weights, K... kernels)
      : up_to_(weights), kernels_(std::move(kernels)...) {
    detail::accumulate_weights(up_to_);
  }

  template <class P>
  auto begin(const P& start) const {
    const auto first = detail::begin_state(std::get<0>(kernels_), start);
    const auto& point = detail::point_of(std::get<0>(kernels_), first);
    return std::apply(
        [&](const K&... kernel) {
          return State<std::remove_cvref_t<decltype(point)>>{{detail::begin_state(kernel, point)...}, 0};
        },
        kernels_);
  }
  template <class P>
  const P& point(const State<P>& state) const {
    const P* found = nullptr;
    visit(state.last, [&]<std::size_t i>(Index<i>) {
      found = &detail::point_of(std::get<i>(kernels_), std::get<i>(state.states));
    });
    return *found;
  }

  template <class P>
  void step(State<P>& x, Stream& rng) const {
    visit(drawn(rng), [&]<std::size_t i>(Index<i>) {
      turn_to<i>(x);
      std::get<i>(kernels_).step(std::get<i>(x.states), rng);
    });
  }
  template <class P>
  void coupled_step(State<P>& x, State<P>& y, Stream& rng) const {
    visit(drawn(rng), [&]<std::size_t i>(Index<i>) {
      turn_to<i>(x);
      turn_to<i>(y);
      std::get<i>(kernels_).coupled_step(std::get<i>(x.states), std::get<i>(y.states), rng);
    });
  }

 private:
  template <std::size_t i>
  using Index = std::integral_constant<std::size_t, i>;

  template <std::size_t i = 0, class F>
  static void visit(std::size_t which, const F& f) {
    if constexpr (i + 1 < sizeof...(K)) {
      if (which != i) return visit<i + 1>(which, f);
    }
    f(Index<i>{});
  }

  std::size_t drawn(Stream& rng) const {
    const double u = rng.uniform();
    std::size_t i = 0;
    while (i + 1 < up_to_.size() && u >= up_to_[i]) ++i;
    return i;
  }

  template <std::size_t i, class P>
  void turn_to(State<P>& x) const {
    if (x.last == i) return;
    std::get<i>(x.states) = detail::begin_state(std::get<i>(kernels_), P(point(x)));
    x.last = i;
  }

  std::array<double, sizeof...(K)> up_to_;
  std::tuple<K...> kernels_;
};

/// `mixture({0.9, 0.1}, random_walk(log_density, 0.5), random_walk(log_density, 5))`: weights are relative.
/// Throws std::invalid_argument unless all are positive and finite.
template <class... K>
Mixture<K...> mixture(const std::array<double, sizeof...(K)>& weights, K... kernels) {
  return {weights, std::move(kernels)...};
}

}  // namespace debias

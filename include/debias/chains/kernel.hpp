#pragma once

// A step of a Markov chain, and of two chains that come together: what coupled_chain takes.
//
//   kernel.step(x, rng)             x becomes the next state
//   kernel.coupled_step(x, y, rng)  both do, each as by `step`, together so that they may become equal, and then stay equal
//
//   Notation: a state is what the kernel carries from step to step; its point is what the user sees of it, f(point).
// Three members are optional: begin(point) makes the state of a point, which may hold its density; point(state) gives the point
// back; checks_points says that no step of the kernel makes a point that is not finite, without throwing.
// Fails where a coupled step moves a chain otherwise than a step would: every estimate is biased then. check_coupling
// (chains/check.hpp) looks for that.
// Source: Jacob, O'Leary, Atchade, J. R. Stat. Soc. B 82 (2020).

#include <cmath>
#include <concepts>
#include <cstddef>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

/// A kernel on states of type State: a const `step` and a const `coupled_step`.
template <class K, class State>
concept CoupledKernel = std::copyable<State> && requires(const K& kernel, State& x, State& y, Stream& rng) {
  kernel.step(x, rng);
  kernel.coupled_step(x, y, rng);
};

namespace detail {

template <class K, class Point>
auto begin_state(const K& kernel, Point point) {
  if constexpr (requires { kernel.begin(std::move(point)); }) {
    return kernel.begin(std::move(point));
  } else {
    return point;
  }
}
template <class K, class Point>
using chain_state_t = decltype(begin_state(std::declval<const K&>(), std::declval<Point>()));

template <class K, class State>
[[gnu::always_inline]] inline decltype(auto) point_of(const K& kernel, const State& state) {
  if constexpr (requires { kernel.point(state); }) {
    return kernel.point(state);
  } else {
    return (state);
  }
}

// Coordinates of a point: a number has one; of others x.size() of them, x[i].
template <class P>
concept PointOfMany = requires(P& x, std::size_t i) {
  { x.size() } -> std::convertible_to<std::size_t>;
  requires std::is_arithmetic_v<std::remove_cvref_t<decltype(x[i])>>;
};
template <class P>
concept HasCoordinates = std::is_arithmetic_v<P> || PointOfMany<P>;

template <HasCoordinates P>
std::size_t coordinate_count(const P& x) {
  if constexpr (std::is_arithmetic_v<P>) {
    return 1;
  } else {
    return static_cast<std::size_t>(x.size());
  }
}
template <HasCoordinates P>
[[gnu::always_inline]] inline auto& coordinate(P& x, std::size_t i) {
  if constexpr (std::is_arithmetic_v<P>) {
    return x;
  } else {
    using Index = std::conditional_t<ArrayValue<std::remove_const_t<P>>, std::ptrdiff_t, std::size_t>;
    return x[static_cast<Index>(i)];
  }
}

/// Equal points; a NaN is equal to nothing.
template <class P>
[[gnu::always_inline]] inline bool same_point(const P& x, const P& y) {
  if constexpr (HasCoordinates<const P>) {
    const std::size_t n = coordinate_count(x);
    if (n != coordinate_count(y)) return false;
    for (std::size_t i = 0; i < n; ++i) {
      if (!(coordinate(x, i) == coordinate(y, i))) return false;
    }
    return true;
  } else if constexpr (Value<P> && !std::equality_comparable<P>) {
    for (std::size_t i = 0; i < component_count(x); ++i) {
      if (!(component(x, i) == component(y, i))) return false;
    }
    return true;
  } else {
    return x == y;
  }
}

/// No coordinate is NaN or infinite; of points without coordinates nobody knows.
template <class P>
bool finite_point(const P& x) {
  if constexpr (HasCoordinates<const P>) {
    for (std::size_t i = 0; i < coordinate_count(x); ++i) {
      if constexpr (std::is_floating_point_v<std::remove_cvref_t<decltype(coordinate(x, i))>>) {
        if (!std::isfinite(coordinate(x, i))) return false;
      }
    }
  } else if constexpr (Value<P>) {
    return debias::is_finite(x);
  }
  return true;
}

template <class K>
concept ChecksItsPoints = requires {
  requires K::checks_points;
};

}  // namespace detail

/// A kernel of two callables, each in place or by value: step(x, rng) and coupled_step(x, y, rng) change their states, or
/// return the next one, the next two as a pair.
template <class Step, class Coupled>
class KernelOf {
 public:
  KernelOf(Step one, Coupled both) : step_(std::move(one)), coupled_(std::move(both)) {}

  /// The state is what a step returns: a start of 0 does not make it an integer.
  template <class Point>
  auto begin(Point point) const {
    if constexpr (by_value<Point>) {
      return std::remove_cvref_t<std::invoke_result_t<const Step&, Point, Stream&>>(std::move(point));
    } else if constexpr (std::is_integral_v<Point> && std::invocable<const Step&, double&, Stream&> &&
                         !std::invocable<const Step&, Point&, Stream&>) {
      return static_cast<double>(point);
    } else {
      return point;
    }
  }

  template <class State>
  void step(State& x, Stream& rng) const {
    if constexpr (std::is_void_v<decltype(step_(x, rng))>) {
      step_(x, rng);
    } else {
      x = step_(std::move(x), rng);
    }
  }
  template <class State>
  void coupled_step(State& x, State& y, Stream& rng) const {
    if constexpr (std::is_void_v<decltype(coupled_(x, y, rng))>) {
      coupled_(x, y, rng);
    } else {
      auto next = coupled_(std::move(x), std::move(y), rng);
      x = std::move(next.first);
      y = std::move(next.second);
    }
  }

 private:
  template <class Point>
  static constexpr bool by_value = [] {
    if constexpr (std::invocable<const Step&, Point, Stream&>) {
      return !std::is_void_v<std::invoke_result_t<const Step&, Point, Stream&>>;
    } else {
      return false;
    }
  }();

  Step step_;
  Coupled coupled_;
};

/// `kernel_of([](double& x, Stream& rng) {...}, [](double& x, double& y, Stream& rng) {...})`.
template <class Step, class Coupled>
KernelOf<Step, Coupled> kernel_of(Step step, Coupled coupled_step) {
  return {std::move(step), std::move(coupled_step)};
}

}  // namespace debias

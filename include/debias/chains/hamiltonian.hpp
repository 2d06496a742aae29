#pragma once

// Hamiltonian steps of two chains: the same momentum and the same acceptance uniform for both.
//
//   p ~ N(0, I);  n times: p += h/2 g(x), x += h p, p += h/2 g(x);  accepted if log U <= H(x, p) - H(x', p'),
//   H(x, p) = |p|^2 / 2 - log pi(x),  g = grad log pi                                            [Heng & Jacob 2019]
//
//   Notation: h = step, n = steps. One call is one step of work, of n gradients.
// Where log pi is concave, chains that share their momenta come together like a contraction, and fast in many dimensions; they
// meet exactly by no such step. So take it in a mixture with a random walk of small steps, which meets where they are near:
// mixture({0.9, 0.1}, hamiltonian(log_density, gradient, h, n), random_walk(log_density, 0.5)); `coupled_chain` of Hamiltonian
// steps alone would go on for ever. Fails, in that chains do not come together, between modes.
// Source: Heng & Jacob, Biometrika 106 (2019).

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <debias/chains/kernel.hpp>
#include <debias/chains/metropolis.hpp>
#include <debias/core/stream.hpp>

namespace debias {

namespace detail {
void check_leapfrog(double step, int steps);
}  // namespace detail

template <class D, class G>
class Hamiltonian {
 public:
  static constexpr bool checks_points = true;

  template <class Point>
  struct State {
    Point point;
    Point slope;  ///< the gradient there
    double log_density;
    Point proposal;
    Point proposed_slope;
    Point momentum;
  };

  /// Throws std::invalid_argument unless the step is positive and finite, and steps are at least 1.
  Hamiltonian(D log_density, G gradient, double step, int steps)
      : log_density_(std::move(log_density)), gradient_(std::move(gradient)), h_(step), steps_(steps) {
    detail::check_leapfrog(step, steps);
  }

  template <class P>
  auto begin(P start) const {
    auto point = detail::real_point(std::move(start));
    const double log_density = density(point);
    if (!(log_density > -std::numeric_limits<double>::infinity())) detail::refuse_start("hamiltonian");
    State<decltype(point)> state{point, point, log_density, point, point, point};
    look(state.point, state.slope);
    return state;
  }
  template <class P>
  const P& point(const State<P>& state) const {
    return state.point;
  }

  template <class P>
  void step(State<P>& x, Stream& rng) const {
    for (std::size_t i = 0; i < detail::coordinate_count(x.point); ++i) {
      detail::coordinate(x.momentum, i) = rng.normal();
    }
    move(x, rng.exponential());
  }
  template <class P>
  void coupled_step(State<P>& x, State<P>& y, Stream& rng) const {
    for (std::size_t i = 0; i < detail::coordinate_count(x.point); ++i) {
      detail::coordinate(y.momentum, i) = detail::coordinate(x.momentum, i) = rng.normal();
    }
    const double threshold = rng.exponential();
    move(x, threshold);
    move(y, threshold);
  }

 private:
  template <class P>
  double density(const P& x) const {
    return detail::checked_density("hamiltonian", log_density_(x));
  }
  template <class P>
  void look(const P& point, P& slope) const {
    const auto& g = gradient_(point);
    for (std::size_t i = 0; i < detail::coordinate_count(point); ++i) {
      const double s = detail::coordinate(g, i);
      if (!std::isfinite(s)) [[unlikely]]
        detail::refuse_gradient("hamiltonian");
      detail::coordinate(slope, i) = s;
    }
  }
  template <class P>
  static double energy(const P& momentum) {
    double squares = 0;
    for (std::size_t i = 0; i < detail::coordinate_count(momentum); ++i) {
      squares += detail::coordinate(momentum, i) * detail::coordinate(momentum, i);
    }
    return 0.5 * squares;
  }

  template <class P>
  void move(State<P>& x, double threshold) const {
    const std::size_t n = detail::coordinate_count(x.point);
    const double before = energy(x.momentum);
    for (std::size_t i = 0; i < n; ++i) {
      detail::coordinate(x.proposal, i) = detail::coordinate(x.point, i);
      detail::coordinate(x.momentum, i) += 0.5 * h_ * detail::coordinate(x.slope, i);
    }
    for (int s = 1; s <= steps_; ++s) {
      for (std::size_t i = 0; i < n; ++i) {
        detail::coordinate(x.proposal, i) += h_ * detail::coordinate(x.momentum, i);
      }
      look(x.proposal, x.proposed_slope);
      const double kick = s < steps_ ? h_ : 0.5 * h_;
      for (std::size_t i = 0; i < n; ++i) {
        detail::coordinate(x.momentum, i) += kick * detail::coordinate(x.proposed_slope, i);
      }
    }
    const double log_density = density(x.proposal);
    if (!(threshold >= x.log_density - before - log_density + energy(x.momentum))) return;
    std::swap(x.point, x.proposal);
    std::swap(x.slope, x.proposed_slope);
    x.log_density = log_density;
  }

  D log_density_;
  G gradient_;
  double h_;
  int steps_;
};

/// `hamiltonian(log_density, gradient, step, steps)`, for mixtures. Throws std::invalid_argument unless the step is positive
/// and finite, and steps are at least 1.
template <class D, class G>
Hamiltonian<D, G> hamiltonian(D log_density, G gradient, double step, int steps) {
  return {std::move(log_density), std::move(gradient), step, steps};
}

}  // namespace debias

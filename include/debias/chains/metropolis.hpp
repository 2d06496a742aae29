#pragma once

// Metropolis kernels whose chains meet: random walk and Langevin (MALA), proposals coupled by reflection.
//
//   x' = mu(x) + h W,  accepted if log U <= log pi(x') + log q(x', x) - log pi(x) - log q(x, x')
//   two chains, Z = (mu(x) - mu(y)) / h:  y' = x' with probability min(1, phi(W + Z) / phi(W)),
//                                          else y' = mu(y) + h (W - 2 <Z, W> Z / |Z|^2); one U for both
//
//   Notation: mu(x) = x for the random walk, x + h^2/2 grad log pi(x) for Langevin; q(x, .) = density of N(mu(x), h^2 I), phi =
// that of N(0, I), W ~ N(0, I), U uniform. The proposals are equal as often as two laws allow (a maximal coupling), else they
// are mirror images: chains far apart step towards each other.
// log pi need not be normalised; -infinity is outside, NaN and +infinity throw std::domain_error. Points are numbers, std::array
// or std::vector of numbers, Eigen vectors. Fails, in that chains take very long to meet, where modes lie many h apart, and in
// many dimensions unless h shrinks like d^(-1/2), for which the meeting time grows like d (random walk).
// Sources: Jacob, O'Leary, Atchade 2020, section 4 (after Bou-Rabee, Eberle, Zimmer 2020); Roberts & Tweedie 1996 (MALA).

#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include <debias/chains/kernel.hpp>
#include <debias/core/stream.hpp>

namespace debias {

namespace detail {

[[noreturn]] void refuse_density(const char* kernel, double log_density);
[[noreturn]] void refuse_start(const char* kernel);
[[noreturn]] void refuse_gradient(const char* kernel);
void check_step(const char* kernel, double step);

/// Integers walk on the real line.
template <class Point>
auto real_point(Point point) {
  if constexpr (std::is_integral_v<Point>) {
    return static_cast<double>(point);
  } else {
    return point;
  }
}

inline double checked_density(const char* kernel, double log_density) {
  if (!(log_density < std::numeric_limits<double>::infinity())) [[unlikely]]
    refuse_density(kernel, log_density);
  return log_density;
}

/// a + h W into x, and b + h W', or the very same, into y; true where they are the same.
template <class P>
[[gnu::always_inline]] inline bool reflection_maximal(const P& a, const P& b, double h, double inverse_h, P& x, P& y,
                                                      Stream& rng) {
  const std::size_t n = coordinate_count(a);
  double zz = 0;
  double wz = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double w = rng.normal();
    const double z = (coordinate(a, i) - coordinate(b, i)) * inverse_h;
    coordinate(x, i) = w;
    zz += z * z;
    wz += w * z;
  }
  const bool same = rng.exponential() >= wz + 0.5 * zz;  // log U <= log phi(w + z) - log phi(w)
  if (same) {
    for (std::size_t i = 0; i < n; ++i) coordinate(y, i) = coordinate(x, i) = coordinate(a, i) + h * coordinate(x, i);
  } else {
    const double twice = 2 * wz / zz;
    for (std::size_t i = 0; i < n; ++i) {
      const double w = coordinate(x, i);
      const double z = (coordinate(a, i) - coordinate(b, i)) * inverse_h;
      coordinate(x, i) = coordinate(a, i) + h * w;
      coordinate(y, i) = coordinate(b, i) + h * (w - twice * z);
    }
  }
  return same;
}

}  // namespace detail

/// Random-walk Metropolis with normal steps of standard deviation h in each coordinate.
template <class D>
class RandomWalk {
 public:
  static constexpr bool checks_points = true;

  template <class Point>
  struct State {
    Point point;
    double log_density;
    Point proposal;
  };

  /// Throws std::invalid_argument unless the step is positive and finite.
  RandomWalk(D log_density, double step) : log_density_(std::move(log_density)), h_(step), inverse_h_(1 / step) {
    detail::check_step("random_walk", step);
  }

  template <class P>
  auto begin(P start) const {
    auto point = detail::real_point(std::move(start));
    const double log_density = density(point);
    if (!(log_density > -std::numeric_limits<double>::infinity())) detail::refuse_start("random_walk");
    auto proposal = point;
    return State<decltype(point)>{std::move(point), log_density, std::move(proposal)};
  }
  template <class P>
  const P& point(const State<P>& state) const {
    return state.point;
  }

  template <class P>
  void step(State<P>& x, Stream& rng) const {
    const std::size_t n = detail::coordinate_count(x.point);
    for (std::size_t i = 0; i < n; ++i) {
      detail::coordinate(x.proposal, i) = detail::coordinate(x.point, i) + h_ * rng.normal();
    }
    const double log_density = density(x.proposal);
    decide(x, log_density, rng.exponential());
  }

  template <class P>
  void coupled_step(State<P>& x, State<P>& y, Stream& rng) const {
    const bool same = detail::reflection_maximal(x.point, y.point, h_, inverse_h_, x.proposal, y.proposal, rng);
    const double at_x = density(x.proposal);
    const double at_y = same ? at_x : density(y.proposal);
    const double threshold = rng.exponential();
    decide(x, at_x, threshold);
    decide(y, at_y, threshold);
  }

 private:
  template <class P>
  double density(const P& x) const {
    return detail::checked_density("random_walk", log_density_(x));
  }
  template <class P>
  static void decide(State<P>& x, double log_density, double threshold) {
    if (!(threshold >= x.log_density - log_density)) return;
    std::swap(x.point, x.proposal);
    x.log_density = log_density;
  }

  D log_density_;
  double h_;
  double inverse_h_;
};

/// `random_walk([](double x) { return -x * x / 2; }, 2.4)`: log density up to a constant, standard deviation of a step.
/// Throws std::invalid_argument unless the step is positive and finite.
template <class D>
RandomWalk<D> random_walk(D log_density, double step) {
  return {std::move(log_density), step};
}

/// The Metropolis-adjusted Langevin algorithm.
template <class D, class G>
class Langevin {
 public:
  static constexpr bool checks_points = true;

  template <class Point>
  struct Place {
    Point point;
    Point mean;  ///< of the proposals
    double log_density;
  };
  template <class Point>
  struct State {
    Place<Point> at;
    Place<Point> proposal;
  };

  /// Throws std::invalid_argument unless the step is positive and finite.
  Langevin(D log_density, G gradient, double step)
      : log_density_(std::move(log_density)), gradient_(std::move(gradient)), h_(step), inverse_h_(1 / step) {
    detail::check_step("mala", step);
  }

  template <class P>
  auto begin(P start) const {
    auto point = detail::real_point(std::move(start));
    Place<decltype(point)> place{point, point, 0};
    look(place);
    if (!(place.log_density > -std::numeric_limits<double>::infinity())) detail::refuse_start("mala");
    return State<decltype(point)>{place, place};
  }
  template <class P>
  const P& point(const State<P>& state) const {
    return state.at.point;
  }

  template <class P>
  void step(State<P>& x, Stream& rng) const {
    const std::size_t n = detail::coordinate_count(x.at.point);
    for (std::size_t i = 0; i < n; ++i) {
      detail::coordinate(x.proposal.point, i) = detail::coordinate(x.at.mean, i) + h_ * rng.normal();
    }
    look(x.proposal);
    decide(x, rng.exponential());
  }

  template <class P>
  void coupled_step(State<P>& x, State<P>& y, Stream& rng) const {
    const bool same =
        detail::reflection_maximal(x.at.mean, y.at.mean, h_, inverse_h_, x.proposal.point, y.proposal.point, rng);
    look(x.proposal);
    if (same) {
      y.proposal = x.proposal;
    } else {
      look(y.proposal);
    }
    const double threshold = rng.exponential();
    decide(x, threshold);
    decide(y, threshold);
  }

 private:
  template <class P>
  void look(Place<P>& place) const {
    place.log_density = detail::checked_density("mala", log_density_(std::as_const(place.point)));
    if (!(place.log_density > -std::numeric_limits<double>::infinity())) return;  // never accepted
    const auto& slope = gradient_(std::as_const(place.point));
    for (std::size_t i = 0; i < detail::coordinate_count(place.point); ++i) {
      const double s = detail::coordinate(slope, i);
      if (!std::isfinite(s)) [[unlikely]]
        detail::refuse_gradient("mala");
      detail::coordinate(place.mean, i) = detail::coordinate(place.point, i) + 0.5 * h_ * h_ * s;
    }
  }
  /// -log q(a, b), up to a constant.
  template <class P>
  double distance(const Place<P>& a, const Place<P>& b) const {
    double squares = 0;
    for (std::size_t i = 0; i < detail::coordinate_count(a.point); ++i) {
      const double d = (detail::coordinate(b.point, i) - detail::coordinate(a.mean, i)) * inverse_h_;
      squares += d * d;
    }
    return 0.5 * squares;
  }
  template <class P>
  void decide(State<P>& x, double threshold) const {
    if (!(x.proposal.log_density > -std::numeric_limits<double>::infinity())) return;
    const double forth = distance(x.at, x.proposal);
    const double back = distance(x.proposal, x.at);
    if (!(threshold >= x.at.log_density - x.proposal.log_density + back - forth)) return;
    std::swap(x.at, x.proposal);
  }

  D log_density_;
  G gradient_;
  double h_;
  double inverse_h_;
};

/// `mala(log_density, gradient, step)`: gradient(x) is that of log_density, a point; `step` is h.
/// Throws std::invalid_argument unless the step is positive and finite.
template <class D, class G>
Langevin<D, G> mala(D log_density, G gradient, double step) {
  return {std::move(log_density), std::move(gradient), step};
}

}  // namespace debias

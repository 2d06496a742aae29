#pragma once

// The terms of the power series of g(E X) about a centre, and what makes a good centre.
//
//   T_k = c_k prod_(i <= k) (X_i - a),  sum_k E T_k = g(E X)            [Blanchet, Chen & Glynn 2015]
//
//   Notation: a = centre, R = radius of convergence at a, b = E (X - a)^2 / R^2. T_0 costs 1, a draw 1 or
// x.work. E T_k^2 falls like b^k: finite variance needs b < s < 1, s = the ratio by which the tail of the PMF
// falls. The least b for 1/x, log and powers is at a = E X^2 / E X; there b = Var X / E X^2 < 1. Bounds or
// the moments of a pilot (Centre) let this be checked; a bare a is taken as it is. For exp, any a will do: R
// is infinite. Source: Chopin, Crucinio & Singh 2024 (centre and conditions).

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/accumulator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/text.hpp>

namespace debias {

/// The power series of a function about a point: its calls return c_0 s^0, c_1 s^1, ... in order, in a
/// `scale` s where none of them overflows; `radius` is that of convergence.
template <class E>
concept PowerSeries = std::copyable<E> && requires(E& e) {
  { e() } -> std::same_as<double>;
  { e.scale } -> std::convertible_to<double>;
  { e.radius } -> std::convertible_to<double>;
};

/// A function that knows its power series: g.expand(a). Those of functions.hpp do; see taylor/autodiff.hpp
/// for yours.
template <class G>
concept Expandable = requires(const G& g, double a) {
  { g.expand(a) } -> PowerSeries;
};

/// An expansion point with what is known of X around it.
struct Centre {
  double at;
  double mean_square;  ///< E (X - at)^2, or a bound of it
};

/// The middle of bounds low <= X <= high. Throws std::invalid_argument unless low < high are finite.
inline Centre centre_between(double low, double high) {
  if (!(low < high) || !std::isfinite(low) || !std::isfinite(high)) {
    throw std::invalid_argument("centre_between: [" + detail::format("%f", low) + ", " + detail::format("%f", high) +
                                "] (must be a finite interval that bounds X from both sides)");
  }
  const double half = (high - low) / 2;
  return {low + half, half * half};
}

namespace detail {

inline double mean_square_about(const Moments& pilot, double a) {
  return pilot.m2 / static_cast<double>(pilot.count) + (pilot.mean - a) * (pilot.mean - a);
}

/// b: how fast the squares of the terms fall.
template <Expandable G>
double decay(const G& g, const Centre& c) {
  const double radius = g.expand(c.at).radius;
  return std::isinf(radius) ? 0.0 : c.mean_square / (radius * radius);
}

/// The two points at distance Var / R from the mean; 1/x, log and powers have their best centre at one of
/// them.
template <Expandable G>
Centre best_centre(const G& g, const Moments& pilot) {
  const double shift = pilot.m2 / static_cast<double>(pilot.count) / g.expand(pilot.mean).radius;
  Centre best{pilot.mean, mean_square_about(pilot, pilot.mean)};
  for (const double a : {pilot.mean - shift, pilot.mean + shift}) {
    const Centre other{a, mean_square_about(pilot, a)};
    if (!(g.expand(a).radius > g.expand(pilot.mean).radius)) continue;  // towards the singularity
    if (detail::decay(g, other) < detail::decay(g, best)) best = other;
  }
  return best;
}

}  // namespace detail

/// The centre with the fastest terms, from the moments of a pilot run of X: E X for exp, E X^2 / E X for 1/x,
/// log and powers. Throws std::invalid_argument without two draws, and where g is not defined at their mean.
template <Expandable G>
Centre centre(const G& g, const Moments& pilot) {
  if (pilot.count < 2) throw std::invalid_argument("centre: the pilot has fewer than 2 draws; run 1000 or so");
  return detail::best_centre(g, pilot);
}

/// The centre `at`, checked against a pilot. Throws std::invalid_argument where the terms would not fall,
/// with a centre where they do.
template <Expandable G>
Centre centre(const G& g, const Moments& pilot, double at) {
  const Centre best = debias::centre(g, pilot);
  const Centre chosen{at, detail::mean_square_about(pilot, at)};
  const double b = detail::decay(g, chosen);
  if (!(b < 1)) {
    throw std::invalid_argument("centre: at = " + detail::format("%f", at) + " (E (X - a)^2 / R^2 = " +
                                detail::format("%f", b) + " must be below 1, else no PMF has finite variance); " +
                                detail::format("%f", best.at) + " has " + std::to_string(detail::decay(g, best)));
  }
  return chosen;
}

namespace detail {

/// What a draw of X costs: its member `work`, or 1.
template <class X>
double work_of(const X& x) {
  if constexpr (requires {
                  { x.work } -> std::convertible_to<double>;
                }) {
    return x.work;
  } else {
    return 1;
  }
}

/// Values whose components take part in the series one by one. The number of them has to be known beforehand.
template <class V>
concept Separable = Value<V> && !ComplexValue<V> && std::default_initializable<V>;

template <Separable V>
V constant(double c) {
  V v{};
  for (std::size_t i = 0; i < component_count(v); ++i) set_component(v, i, c);
  return v;
}

/// What a series of yours says of itself: a scale of infinity would make all factors zero.
inline double inverse_of_scale(double scale, double at) {
  const double inverse = 1 / scale;
  if (std::isfinite(scale) && std::isfinite(inverse)) return inverse;
  throw std::domain_error("taylor: the scale of the series at " + detail::format("%g", at) + " is " +
                          detail::format("%g", scale) + " (must be finite and not 0)");
}

/// A mean square is at least 0, whatever the radius.
inline void require_mean_square(const Centre& c) {
  if (c.mean_square >= 0 && std::isfinite(c.mean_square)) return;
  throw std::invalid_argument("taylor: Centre{" + detail::format("%g", c.at) + ", mean_square = " +
                              detail::format("%g", c.mean_square) + "} (must be at least 0 and finite)");
}

/// Checks b < survival ratio < 1 as far as b is known.
inline void require_decay(double b) {
  if (b >= 0 && b < 1) return;
  throw std::invalid_argument("taylor: E (X - a)^2 / R^2 = " + detail::format("%f", b) +
                              " (must be below 1, else the terms do not fall and no PMF has finite variance); X has to "
                              "stay on one side of the singularity, and centre(g, pilot moments) is the best centre");
}
inline void require_survival(double b, const TailExponent& pmf) {
  const double survival = pmf.decay == Decay::polynomial ? 1 : std::exp2(-pmf.exponent);
  if (b == 0 || (b < survival && survival < 1)) return;
  throw std::invalid_argument("taylor: the PMF goes on with probability " + detail::format("%f", survival) +
                              " a term (must lie in (" + detail::format("%f", b) +
                              ", 1) for finite variance and work: E (X - a)^2 / R^2 = " + detail::format("%f", b) +
                              "); Geometric(" + detail::format("%f", 1 - std::sqrt(b)) + ") is the best");
}

}  // namespace detail

/// The terms of the series: a TermSequence, and a BiasedSequence whose levels are partial sums.
template <RandomVariable X, Expandable G>
class Taylor {
 public:
  using value_type = mean_t<draw_t<X>>;
  static_assert(detail::Separable<value_type>, "X must be real, or an array of fixed size");

  /// Throws std::invalid_argument where g has no series at `at`, or X no fixed number of components.
  Taylor(X x, const G& g, double at)
      : x_(std::move(x)), series_(g.expand(at)), at_(at), inverse_scale_(detail::inverse_of_scale(series_.scale, at)) {
    if (component_count(value_type{}) == 0) {
      throw std::invalid_argument("taylor: X has no fixed number of components (use an array of fixed size)");
    }
  }

  /// Yields the terms in order; the sequence and the stream have to outlive it.
  class Cursor {
    using Series = decltype(std::declval<const G&>().expand(0.0));

   public:
    Cursor(const Taylor& taylor, Stream& rng)
        : taylor_(&taylor), rng_(&rng), series_(taylor.series_), inverse_scale_(taylor.inverse_scale_) {}

    Term<value_type> operator()() {
      if (at_start_) {
        at_start_ = false;
        return {detail::constant<value_type>(series_()), 1};
      }
      taylor_->multiply(power_, value_type(taylor_->x_(*rng_)), inverse_scale_);
      return {debias::scaled(power_, series_()), detail::work_of(taylor_->x_)};
    }

    /// True when a factor of zero leaves nothing for all later terms.
    [[nodiscard]] bool ended() const { return debias::as_scalar(power_) == 0; }

   private:
    const Taylor* taylor_;
    Stream* rng_;
    Series series_;
    double inverse_scale_;
    value_type power_ = detail::constant<value_type>(1);
    bool at_start_ = true;
  };

  Cursor operator()(Stream& rng) const { return {*this, rng}; }

  /// The last order of the series.
  [[nodiscard]] std::int64_t deepest_level() const requires
      StatesDeepestLevel<decltype(std::declval<const G&>().expand(0.0))> {
    return series_.deepest_level();
  }

  /// T_level alone; it takes `level` draws.
  Term<value_type> difference_at(std::int64_t level, Stream& rng) const {
    auto series = series_;
    double c = series();
    value_type power = detail::constant<value_type>(1);
    double of_all = 0;  // stays 0 while coefficients are finite, those of the terms before, too
    for (std::int64_t k = 0; k < level; ++k) {
      of_all += 0 * c;
      multiply(power, value_type(x_(rng)), inverse_scale_);
      c = series();
    }
    if (of_all != 0) c = of_all;
    return {debias::scaled(std::move(power), c), 1 + static_cast<double>(level) * detail::work_of(x_)};
  }

  /// T_0 + ... + T_level, and T_level.
  Draw<value_type> operator()(std::int64_t level, Stream& rng) const {
    Cursor cursor(*this, rng);
    Term<value_type> term = cursor();
    Draw<value_type> draw{term.value, term.value, term.work};
    for (std::int64_t k = 1; k <= level; ++k) {
      term = cursor();
      draw.value = debias::sum(std::move(draw.value), term.value);
      draw.work += term.work;
    }
    draw.difference = std::move(term.value);
    return draw;
  }

 private:
  /// Multiplies each component of a power by that of (x - a) / scale.
  void multiply(value_type& power, const value_type& x, double inverse_scale) const {
    for (std::size_t i = 0; i < component_count(power); ++i) {
      set_component(power, i, component(power, i) * ((component(x, i) - at_) * inverse_scale));
    }
  }

  X x_;
  decltype(std::declval<const G&>().expand(0.0)) series_;
  double at_;
  double inverse_scale_;
};

/// The same about a centre that is known to be good: it declares its rates, and refuses a PMF that does not
/// fit.
template <RandomVariable X, Expandable G>
class RatedTaylor : public Taylor<X, G> {
 public:
  /// Throws std::invalid_argument where the squares of the terms do not fall.
  RatedTaylor(X x, const G& g, const Centre& c)
      : Taylor<X, G>(std::move(x), g, c.at), rates{-std::log2(detail::decay(g, c)), 0}, decay_(detail::decay(g, c)) {
    detail::require_mean_square(c);
    detail::require_decay(decay_);
  }
  /// Throws std::invalid_argument for a PMF with infinite variance or work.
  void require(const TailExponent& pmf) const { detail::require_survival(decay_, pmf); }

  Rates rates;

 private:
  double decay_;
};

/// g(E X) about the point `at`: `x(rng)` draws X. A PMF has to be named.
template <RandomVariable X, Expandable G>
Taylor<X, G> taylor(X x, const G& g, double at) {
  return {std::move(x), g, at};
}
template <RandomVariable X, Expandable G>
RatedTaylor<X, G> taylor(X x, const G& g, const Centre& centre) {
  return {std::move(x), g, centre};
}

namespace detail {
template <class X, class G>
constexpr Mistake mistake_in_taylor() {
  if constexpr (RandomVariable<X>) {
    return Mistake::no_power_series;
  } else {
    return mistake_in_draws<X>();
  }
}
}  // namespace detail

template <class X, class G, class At>
requires(!(RandomVariable<X> && Expandable<G>)) auto taylor(const X& /*x*/, const G& /*g*/, const At& /*at*/) {
  return detail::refuse<detail::mistake_in_taylor<X, G>(), X, G>();
}

}  // namespace debias

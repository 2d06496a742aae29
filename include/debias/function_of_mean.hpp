#pragma once

// g(E X), or g of an integral, by doubling: level k averages 2^k draws, its coarse partner is g of the two
// halves of the same draws, averaged (antithetic: the linear part of g cancels).
//
//   I_k = g(mean of 2^k),  D_k = I_k - (g(mean of even draws) + g(mean of odd draws)) / 2,  work 2^k
//   shared(N, m): the base is g(mean of a group of 2^m), averaged over all 2^(N-m) groups of the 2^N draws
//
// Independent draws: E D_k^2 ~ 2^(-2k) for g smooth at E X and four moments of X     [Blanchet & Glynn 2015]
// Equidistant points a + (b - a)(i + u) / 2^k, random offset u: 2^(-4k), f smooth    [Misso et al. 2022]
// Scrambled nets over [0, 1]^d, f smooth: 2^(-4.2k) to 2^(-2.4k) for d = 2 to 8       [Owen 1997]
// Declare other rates: {1, 1} where g has a kink at E X ({2, 1} on a comb), min(4(1 - s), (1 - s) / s) for
// |x - c|^-s in f; a band-limited periodic f has no differences at all above its band. Fails where the mean
// of a few draws can lie where g has no moments (1/x near 0): start above those (base_level_for_pole).
// A comb sees nothing of a period that is a whole multiple of its spacing: runs, surveys, recipes and multilevel warn where
// combs of independent offsets tell (core/resonance.hpp); function_of_jittered_integral has no such period.
// A g with gap(mean, half_difference) (functions.hpp) gives D_k without cancellation; a plain lambda leaves a
// residue of an ulp of g, which a PMF divides by p_k.
// Numbers: those of the draws one after the other, even and odd in turn; of a comb its offset alone, number 0; of jittered points
// one a part, in the order of the groups. As a point of a net a comb gains most, 2^k independent draws little.
// A NaN among the draws makes value and difference NaN, whatever g makes of it. Of a mean that is infinite I_k is what g
// says (e^-inf = 0, 1 / inf = 0), and D_k is NaN where g has a gap.

#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/text.hpp>
#include <debias/function_of_mean/comb_mean.hpp>
#include <debias/function_of_mean/cubes.hpp>
#include <debias/function_of_mean/densities.hpp>
#include <debias/function_of_mean/doubling.hpp>
#include <debias/function_of_mean/independent.hpp>
#include <debias/function_of_mean/intervals.hpp>

namespace debias {

/// The least base level at which a g that grows like m^-pole towards m = 0 has the moments it needs, for X >=
/// 0 with a density like x^(power - 1) there (power 1: positive at 0). The mean of n draws to the power -q is
/// integrable for n power > q only; the lowest difference beyond base level m is made of halves of 2^m draws.
/// The fourth moment is for standard errors to trust; 1/x needs base level 3 for it, 2 for a finite variance.
/// Throws std::invalid_argument unless pole >= 0, and moments and power are positive and finite.
inline std::int64_t base_level_for_pole(double pole, double moments = 4, double power = 1) {
  if (!(pole >= 0 && moments > 0 && power > 0) || !std::isfinite(pole * moments / power)) {
    throw std::invalid_argument("base_level_for_pole: pole = " + detail::format("%f", pole) + ", moments = " +
                                detail::format("%f", moments) + ", power = " + detail::format("%f", power) +
                                " (must be positive and finite; a pole of 0, a logarithm, needs nothing)");
  }
  std::int64_t level = 0;
  while (static_cast<double>(doubled_draws(level)) * power <= pole * moments) ++level;
  return level;
}

/// g(E X): `x(rng)` draws X, `g(mean)` is a Value. Declare `rates` where g has a kink or X heavy tails.
template <RandomVariable X, class G>
auto function_of_mean(X x, G g, const Rates& rates = {2, 1}) {
  using P = detail::IndependentPoints<X>;
  return Doubling<P, G>(P{std::move(x)}, std::move(g), rates);
}

template <class X, class G>
requires(!RandomVariable<X>) auto function_of_mean(const X& /*x*/, const G& /*g*/, const Rates& /*rates*/ = {}) {
  return detail::refuse<detail::mistake_in_draws<X>(), X>();
}

struct IntegralOptions {
  double from = 0;
  double to = 1;
  Rates rates = {4, 1};  ///< for smooth f and g; see the head of this file for others
};

/// g(integral of f over [from, to]) on a comb: `f(x)` is a Value at a double, `g` sees the integral.
/// Throws std::invalid_argument for an interval that is not finite.
template <class F, class G>
auto function_of_integral(F f, G g, const IntegralOptions& options = {}) {
  detail::check_interval("function_of_integral", options.from, options.to);
  using P = detail::IntervalPoints<F, detail::CombPositions>;
  P points{std::move(f), options.from, options.to - options.from};
  return Doubling<P, G>(std::move(points), std::move(g), options.rates);
}

struct JitteredOptions {
  double from = 0;
  double to = 1;
  Rates rates = {6, 1};  ///< for smooth f and g; {4, 1} where f jumps
};

/// The same with one independent point in each of 2^k equal parts: for f that does not continue periodically.
template <class F, class G>
auto function_of_jittered_integral(F f, G g, const JitteredOptions& options = {}) {
  detail::check_interval("function_of_jittered_integral", options.from, options.to);
  using P = detail::IntervalPoints<F, detail::JitteredPositions>;
  P points{std::move(f), options.from, options.to - options.from};
  return Doubling<P, G>(std::move(points), std::move(g), options.rates);
}

struct CubeOptions {
  /// {1, 1} at least where g has a kink at the integral; by default those of smooth f and g in so many dimensions.
  std::optional<Rates> rates{};
};

/// g(integral of f over [0, 1]^d), `Cube(d)`, on scrambled nets: `f(x)` is a Value at x, the coordinates of a point as a
/// std::span<const double>; `g` sees the integral. Over the line, or R^d, f is
/// brought to the cube by a density (function_of_mean/densities.hpp). In one dimension a net is as good as jittered points.
template <CubeIntegrand F, class G>
auto function_of_integral(F f, const Cube& cube, G g, const CubeOptions& options = {}) {
  using P = detail::CubePoints<F>;
  const Rates rates = options.rates.value_or(Rates{detail::net_decay(cube.dimension()), 1});
  return Doubling<P, G>(P{std::move(f), cube.dimension()}, std::move(g), rates);
}

template <class F, class G>
requires(!CubeIntegrand<F>) auto function_of_integral(const F& /*f*/, const Cube& /*cube*/, const G& /*g*/,
                                                      const CubeOptions& /*options*/ = {}) {
  constexpr detail::Mistake m = detail::mistake_in_function<F, std::span<const double>>();
  return detail::refuse<detail::first_of(m == detail::Mistake::not_callable ? detail::Mistake::no_cube_function : m,
                                         detail::Mistake::no_cube_function),
                        F>();
}

}  // namespace debias

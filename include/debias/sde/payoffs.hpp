#pragma once

// Payoffs of the end of a path that know their expectation over a normal law, for the conditional last step.
//
//   E (X - K)^+ = (m - K) Phi(d) + s phi(d),   P(X > K) = Phi(d),   d = (m - K) / s,   X ~ N(m, s^2)
//   E (X - K)^+ = (m - K) Phi(d) + s (Phi(d + q) - Phi(d)) / q,     d = -log(1 + q (K - m) / s) / q - q / 2,
//                                                                  X = m + s (exp(q Z - q^2 / 2) - 1) / q,  Z ~ N(0, 1)
//
// and over a lognormal one, Black's formula: p.lognormal(forward, deviation of the logarithm).
// Notation: K = strike, m = mean, s = deviation, q = skew, phi and Phi = density and distribution of N(0, 1). A payoff of yours
// takes part with two members, `p(x)` and `p.expected(mean, deviation)`, of any number type, and with
// `p.expected(mean, deviation, skew)` in the quieter last step of Milstein's scheme (sde/schemes.hpp); one that depends on the
// model has `p.at(model)`, which returns such a payoff.
// Fails where s = 0, with NaN. Sources: Glasserman, Monte Carlo Methods in Financial Engineering, 2003, section 7.2.3;
// Burgos & Giles, arXiv 1102.1348.

#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>

#include <debias/sde/dual.hpp>

namespace debias {

/// How often a payoff can be differentiated before it jumps: 0 for a jump of its own, 1 for a kink, as of a payoff that does not
/// say; more is smooth.
template <class F>
constexpr int smoothness_of() {
  if constexpr (requires { F::smoothness; }) {
    return F::smoothness;
  } else {
    return 1;
  }
}

namespace detail {

inline double expected_call(double gap, double deviation) {
  const double d = gap / deviation;
  return gap * normal_distribution(d) + deviation * normal_density(d);
}
template <std::size_t n, class T>
Dual<n, T> expected_call(const Dual<n, T>& gap, const Dual<n, T>& deviation) {
  const T d = gap.value / deviation.value;
  const T above = normal_distribution(d);
  const T density = normal_density(d);
  return chain<n, T>(gap.value * above + deviation.value * density, above, gap, density, deviation);
}

/// -d of the law with a skew, for a level that lies `gap` below its mean; infinite where the law does not reach the level.
template <class X>
X skewed_quantile(const X& gap, const X& deviation, const X& skew) {
  const X below = -gap / deviation;
  const X u = skew * below;
  if (static_cast<double>(u) <= -1) {
    const double infinity = std::numeric_limits<double>::infinity();
    return X(static_cast<double>(skew) > 0 ? -infinity : infinity);
  }
  return below * log_ratio(u) + skew / 2;
}
template <class X>
X skewed_call(const X& gap, const X& deviation, const X& skew) {
  const X z = skewed_quantile(gap, deviation, skew);
  if (std::isinf(static_cast<double>(z))) return static_cast<double>(z) < 0 ? gap : X(0);
  return gap * normal_distribution(X(-z)) + deviation * mean_density(z, skew);
}

/// d_2 of Black's formula.
template <class X>
X log_moneyness(const X& forward, double strike, const X& deviation) {
  using std::log;
  return log(X(forward / strike)) / deviation - deviation / 2;
}

}  // namespace detail

/// (x - strike)^+.
struct CallPayoff {
  static constexpr int smoothness = 1;
  double strike;

  template <class X>
  X operator()(const X& x) const {
    return positive_part(X(x - strike));
  }
  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return detail::expected_call(X(mean - strike), deviation);
  }
  template <class X>
  X expected(const X& mean, const X& deviation, const X& skew) const {
    return detail::skewed_call(X(mean - strike), deviation, skew);
  }
  template <class X>
  X lognormal(const X& forward, const X& deviation) const {
    const X d = detail::log_moneyness(forward, strike, deviation);
    return forward * normal_distribution(X(d + deviation)) - strike * normal_distribution(d);
  }
};

/// (strike - x)^+.
struct PutPayoff {
  static constexpr int smoothness = 1;
  double strike;

  template <class X>
  X operator()(const X& x) const {
    return positive_part(X(strike - x));
  }
  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return detail::expected_call(X(strike - mean), deviation);
  }
  template <class X>
  X expected(const X& mean, const X& deviation, const X& skew) const {
    return detail::skewed_call(X(strike - mean), deviation, X(-skew));
  }
  template <class X>
  X lognormal(const X& forward, const X& deviation) const {
    const X d = detail::log_moneyness(forward, strike, deviation);
    return strike * normal_distribution(X(-d)) - forward * normal_distribution(X(-d - deviation));
  }
};

/// `paid` where x > strike: a slope it has only as an expectation.
struct DigitalPayoff {
  static constexpr int smoothness = 0;
  double strike;
  double paid = 1;

  double operator()(double x) const { return x > strike ? paid : std::isnan(x) ? x : 0; }
  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return paid * normal_distribution(X((mean - strike) / deviation));
  }
  template <class X>
  X expected(const X& mean, const X& deviation, const X& skew) const {
    const X z = detail::skewed_quantile(X(mean - strike), deviation, skew);
    if (std::isinf(static_cast<double>(z))) return X(static_cast<double>(z) < 0 ? paid : 0);
    return paid * normal_distribution(X(-z));
  }
  template <class X>
  X lognormal(const X& forward, const X& deviation) const {
    return paid * normal_distribution(detail::log_moneyness(forward, strike, deviation));
  }
};

namespace detail {
template <class X, class P>
struct Scaled {
  X factor;
  P payoff;

  template <class Y>
  auto operator()(const Y& x) const requires std::invocable<const P&, const Y&> {
    return factor * payoff(x);
  }
  template <class Y>
  auto expected(const Y& mean, const Y& deviation) const requires requires(const P& p) {
    p.expected(mean, deviation);
  }
  { return factor * payoff.expected(mean, deviation); }
  template <class Y>
  auto expected(const Y& mean, const Y& deviation, const Y& skew) const requires requires(const P& p) {
    p.expected(mean, deviation, skew);
  }
  { return factor * payoff.expected(mean, deviation, skew); }
};
}  // namespace detail

/// exp(-rate horizon) times a payoff, with the rate and the horizon of the model: both count in its slopes.
template <class P>
struct Discounted {
  static constexpr int smoothness = smoothness_of<P>();
  P payoff;

  /// The payoff on this model.
  template <class M>
  auto at(const M& model) const {
    using std::exp;
    const auto factor = exp(-model.rate * model.horizon);
    return detail::Scaled<std::remove_cv_t<decltype(factor)>, P>{factor, payoff};
  }
};
template <class P>
Discounted<P> discounted(P payoff) {
  return {std::move(payoff)};
}

}  // namespace debias

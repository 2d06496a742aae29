#pragma once

// Models of markets whose coefficients are not smooth everywhere, and what they need to stay defined.
//
//   CoxIngersollRoss   dX = reversion (mean - X) dt + volatility sqrt(X) dW, in steps of Y = sqrt X that are implicit in the drift:
//                      (1 + reversion h / 2) Y'^2 - (Y + volatility dW / 2) Y' - a h = 0,  a = (4 reversion mean - volatility^2) / 8
//   LocalVolatility    dX = rate X dt + f(X, t) X dW, with f and its derivative in X of a user's function
//   heston             dS = rate S dt + sqrt(V) S dW', V as X above, correlation rho: given V's path, S_T is lognormal, so that
//                      E payoff(S_T) = E[Black's formula of V_T and the integral of V]             [Romano & Touzi 1997]
//
// Y stays positive where a > 0. E D_k^2 ~ 2^(-2 k) if 2 reversion mean > 3 volatility^2 [Alfonsi 2013], which `rates()` declares;
// from level 7 or so on; else 2^-k is all that is known, and no PMF. A model that is not defined throws std::invalid_argument before the first draw.
// Only payoffs of S_T have Black's formula: others take paths of S and V (sde/heston.hpp).
// Sources: Alfonsi, Statist. Probab. Lett. 83 (2013); Dereich, Neuenkirch, Szpruch, Proc. R. Soc. A 468 (2012); Romano &
// Touzi, Math. Finance 7 (1997).

#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/rates.hpp>
#include <debias/core/text.hpp>
#include <debias/sde/dual.hpp>
#include <debias/sde/levels.hpp>
#include <debias/sde/models.hpp>
#include <debias/sde/payoffs.hpp>
#include <debias/sde/schemes.hpp>

namespace debias {

/// For OwnStep: `own_steps(CoxIngersollRoss<>{...}, payoff)`.
template <class X = double>
struct CoxIngersollRoss {
  X start = X(1);
  X reversion = X(1);
  X mean = X(1);
  X volatility = X(0.5);
  double horizon = 1;

  [[nodiscard]] X drift(const X& x, double /*t*/) const { return reversion * (mean - x); }
  [[nodiscard]] X diffusion(const X& x, double /*t*/) const {
    using std::sqrt;
    return volatility * sqrt(x);
  }
  [[nodiscard]] X step(const X& x, double /*t*/, double h, double dw) const {
    using std::sqrt;
    const X stiff = 1 + reversion * (h / 2);
    const X known = sqrt(x) + volatility * (dw / 2);
    const X a = (4 * reversion * mean - volatility * volatility) / 8;
    const X root = (known + sqrt(X(known * known + 4 * h * stiff * a))) / (2 * stiff);
    return root * root;
  }
  [[nodiscard]] Rates rates() const {
    const auto sigma = static_cast<double>(volatility);
    return {2 * static_cast<double>(reversion) * static_cast<double>(mean) > 3 * sigma * sigma ? 2.0 : 1.0, 1};
  }
  /// Throws std::invalid_argument unless all are positive and 4 reversion mean > volatility^2.
  void check() const {
    detail::require_positive("CoxIngersollRoss: start", static_cast<double>(start));
    detail::require_positive("CoxIngersollRoss: reversion", static_cast<double>(reversion));
    detail::require_positive("CoxIngersollRoss: mean", static_cast<double>(mean));
    detail::require_positive("CoxIngersollRoss: volatility", static_cast<double>(volatility));
    const double sigma = static_cast<double>(volatility);
    const double pull = 4 * static_cast<double>(reversion) * static_cast<double>(mean);
    if (!(pull > sigma * sigma)) {
      throw std::invalid_argument("CoxIngersollRoss: 4 reversion mean = " + detail::format("%g", pull) +
                                  ", volatility^2 = " + detail::format("%g", sigma * sigma) +
                                  " (must be less: else the root of a path has no step that stays real)");
    }
  }
};

/// E payoff(X_T), or of a summary that takes steps, in the model's own steps, with the rates that it declares.
template <ScalarSde M, class F>
auto own_steps(M model, F payoff, const Rates& rates) {
  return SdeLevels<OwnStep, M, detail::EndOnly, F>(std::move(model), {}, std::move(payoff), rates);
}
template <ScalarSde M, class F>
auto own_steps(M model, F payoff) {
  const Rates rates = model.rates();
  return debias::own_steps(std::move(model), std::move(payoff), rates);
}

/// `LocalVolatility{f, 100.0, 0.05}`: f(x, t) of any number type, `[](const auto& x, double t) { return 2 / sqrt(x); }`.
template <class F, class X = double>
struct LocalVolatility {
  F volatility;
  X start;
  X rate;
  double horizon = 1;

  LocalVolatility(F f, X s, X r, double t = 1) : volatility(std::move(f)), start(s), rate(r), horizon(t) {}

  [[nodiscard]] X drift(const X& x, double /*t*/) const { return rate * x; }
  [[nodiscard]] X diffusion(const X& x, double t) const { return volatility(x, t) * x; }
  [[nodiscard]] X diffusion_derivative(const X& x, double t) const {
    const auto y = Dual<1, X>::parameter(0, x);
    return (volatility(y, t) * y).slopes[0];
  }
  /// Throws std::invalid_argument unless start and the volatility there are positive, and all is finite.
  void check() const {
    detail::require_positive("LocalVolatility: start", static_cast<double>(start));
    detail::require_positive("LocalVolatility: volatility(start, 0)", static_cast<double>(volatility(start, 0.0)));
    detail::require_finite("LocalVolatility: rate", static_cast<double>(rate));
  }
};

/// S under a variance of its own.
template <class X = double>
struct Heston {
  X start = X(1);
  X rate = X(0);
  CoxIngersollRoss<X> variance;  ///< its horizon is that of the payoff
  X correlation = X(0);
};

namespace detail {

template <class X>
struct VariancePath {
  X terminal{};
  X integral{};
  void add(const X& from, const X& to, double length) {
    terminal = to;
    integral = integral + (from + to) * (length / 2);
  }
};

template <class X, class P>
struct GivenVariance {
  Heston<X> model;
  P payoff;

  X operator()(const VariancePath<X>& v) const {
    using std::exp;
    using std::sqrt;
    const auto& c = model.variance;
    // the integral of sqrt(V) dW, W the noise of V
    const X common = (v.terminal - c.start - c.reversion * (c.mean * c.horizon - v.integral)) / c.volatility;
    const X rho = model.correlation;
    const X forward = model.start * exp(X(model.rate * c.horizon + rho * common - rho * rho * v.integral / 2));
    return exp(X(-model.rate * c.horizon)) * payoff.lognormal(forward, X(sqrt(X((1 - rho * rho) * v.integral))));
  }
};

template <class X>
void check_heston(const Heston<X>& model) {
  require_positive("heston: start", static_cast<double>(model.start));
  const auto rho = static_cast<double>(model.correlation);
  if (!(rho > -1 && rho < 1)) {
    throw std::invalid_argument("heston: correlation = " + format("%g", rho) + " (must lie in (-1, 1))");
  }
}

}  // namespace detail

/// Discounted E payoff(S_T) of CallPayoff, PutPayoff, DigitalPayoff or a payoff with `lognormal`; of dual numbers with its
/// derivatives, all smooth: `heston(Heston<Dual<1>>{.start = Dual<1>::parameter(0, 100), ...}, CallPayoff{100})`.
/// Throws std::invalid_argument as CoxIngersollRoss does, and unless the start is positive and the correlation in (-1, 1).
template <class X, class P>
auto heston(const Heston<X>& model, P payoff) {
  detail::check_heston(model);
  using F = detail::GivenVariance<X, P>;
  return SdeLevels<OwnStep, CoxIngersollRoss<X>, detail::VariancePath<X>, F>(
      model.variance, {}, F{model, std::move(payoff)}, model.variance.rates());
}

}  // namespace debias

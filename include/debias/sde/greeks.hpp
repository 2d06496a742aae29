#pragma once

// Value, delta, vega, rho and theta of a payoff under Black and Scholes, by their names.
//
//   delta = dV/d start, vega = dV/d volatility, rho = dV/d rate, theta = -dV/d horizon
//
// Notation: V = E payoff(X_T), discounted by the payoff: `discounted(CallPayoff{100})`. The sensitivities of sde/sensitivities.hpp
// under other names: what holds and fails there holds and fails here. All five come from one path, with
// with_covariance (covariance.hpp) and their covariance. Gamma: second_sensitivities. Source: Hull, Options, Futures, and Other
// Derivatives, for the names.

#include <cstddef>
#include <cstdint>
#include <utility>

#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/sde/models.hpp>
#include <debias/sde/sensitivities.hpp>

namespace debias {

/// A Value (core/value.hpp) of five components.
struct Greeks {
  double value = 0;
  double delta = 0;
  double vega = 0;
  double rho = 0;
  double theta = 0;

  friend std::size_t component_count(const Greeks&) { return 5; }
  friend double component(const Greeks& g, std::size_t i) { return g.*members[i]; }
  friend void set_component(Greeks& g, std::size_t i, double x) { g.*members[i] = x; }
  friend Greeks operator+(const Greeks& a, const Greeks& b) {
    return {a.value + b.value, a.delta + b.delta, a.vega + b.vega, a.rho + b.rho, a.theta + b.theta};
  }
  friend Greeks operator-(const Greeks& a, const Greeks& b) {
    return {a.value - b.value, a.delta - b.delta, a.vega - b.vega, a.rho - b.rho, a.theta - b.theta};
  }

 private:
  static double Greeks::*const members[5];
};
inline double Greeks::*const Greeks::members[5] = {&Greeks::value, &Greeks::delta, &Greeks::vega, &Greeks::rho,
                                                   &Greeks::theta};

/// The sequence behind `greeks`: slopes under their names.
template <BiasedSequence S>
class GreeksOf {
 public:
  explicit GreeksOf(S sequence) : rates(sequence.rates), sequence_(std::move(sequence)) {}

  Draw<Greeks> operator()(std::int64_t level, Stream& rng) const {
    const auto draw = sequence_(level, rng);
    return {named(draw.value), named(draw.difference), draw.work};
  }
  Term<Greeks> value_at(std::int64_t level, Stream& rng) const {
    const auto term = debias::value_of(sequence_, level, rng);
    return {named(term.value), term.work};
  }
  [[nodiscard]] std::int64_t deepest_level() const { return deepest_level_of(sequence_); }

  Rates rates;

 private:
  static Greeks named(const Dual<4>& d) { return {d.value, d.slopes[0], d.slopes[1], d.slopes[2], -d.slopes[3]}; }

  S sequence_;
};

/// `greeks(Branched<Smoothed<MilsteinStep>>{}, BlackScholes<>{...}, discounted(CallPayoff{100}))`: its mean has .delta, .vega, ...
template <class Step, class P>
auto greeks(Step scheme, const BlackScholes<>& market, const P& payoff) {
  const auto model = []<class X>(const X& start, const X& volatility, const X& rate, const X& horizon) {
    return BlackScholes<X, X>{.start = start, .rate = rate, .volatility = volatility, .horizon = horizon};
  };
  return GreeksOf(
      debias::sensitivities(scheme, model, payoff, market.start, market.volatility, market.rate, market.horizon));
}

}  // namespace debias

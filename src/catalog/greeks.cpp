// Payoffs that jump, and derivatives in the parameters of the market: S = K = 100, r = 0.05, sigma = 0.2, T = 1.

#include <cmath>
#include <cstddef>
#include <utility>

#include <debias/sde.hpp>
#include <debias/sde/sensitivities.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

const auto market = []<class X>(const X& spot, const X& volatility, const X& rate, const X& horizon) {
  return BlackScholes<X, X>{.start = spot, .rate = rate, .volatility = volatility, .horizon = horizon};
};

// Component 1 is d/d spot, 2 d/d volatility, 3 d/d rate, 4 d/d horizon.
template <class P>
auto derivative(const P& payoff, std::size_t component) {
  const auto all = sensitivities(Branched<Smoothed<MilsteinStep>>{}, market, discounted(payoff), 100.0, 0.2, 0.05, 1.0);
  return component_of(all, component);
}

const auto of_spot = []<class X>(const X& spot) {
  return BlackScholes<X>{.start = spot, .rate = X(0.05), .volatility = X(0.2)};
};

// d/d spot of a payoff of a summary.
template <class Step, class Summary, class P>
auto slope(Step scheme, const Summary& summary, const P& payoff, const Rates& rates) {
  return component_of(sensitivities(scheme, of_spot, summary, discounted(payoff), rates, 100.0), 1);
}

Problem call_derivative(Facts facts, std::size_t component) {
  facts.module = "sde/sensitivities.hpp";
  facts.formula += " of the call of E02, dual numbers and a conditional last step on trees: Black-Scholes";
  return make(std::move(facts), derivative(CallPayoff{100}, component));
}

// With a last step of Euler's, as it was published: its law is normal, and nothing else is known.
struct NormalDigital {
  DigitalPayoff payoff;

  double operator()(double x) const { return payoff(x); }
  template <class X>
  X expected(const X& mean, const X& deviation) const {
    return payoff.expected(mean, deviation);
  }
};

}  // namespace

Problem digital_call() {
  const BlackScholes<> stock{.start = 100, .rate = 0.05, .volatility = 0.2};
  const double paid = 100 * std::exp(-0.05);
  return make({.id = "E13",
               .name = "digital-call",
               .module = "sde.hpp",
               .truth = 53.23248154537634034067,
               .formula = "100 where S_T > 100, Milstein and a conditional last step on trees: 100 exp(-r T) Phi(d_2)"},
              milstein(stock, DigitalPayoff{100, paid}, Branching{}));
}

Problem call_delta() {
  return call_derivative({.id = "E14", .name = "call-delta", .truth = 0.6368306511756190712233, .formula = "delta"}, 1);
}

Problem call_vega() {
  return call_derivative({.id = "E15", .name = "call-vega", .truth = 37.52403469169378783742, .formula = "vega"}, 2);
}

Problem digital_delta() {
  return make({.id = "E16",
               .name = "digital-delta",
               .module = "sde/sensitivities.hpp",
               .truth = 1.876201734584689391871,
               .formula = "delta of the digital of E13, dual numbers and a conditional last step on trees"},
              derivative(DigitalPayoff{100, 100}, 1));
}

Problem call_rho() {
  return call_derivative({.id = "E17", .name = "call-rho", .truth = 53.23248154537634034067, .formula = "rho"}, 3);
}

Problem call_theta() {
  return call_derivative(
      {.id = "E18", .name = "call-theta", .truth = 6.414027546438195800775, .formula = "minus theta, d/dT"}, 4);
}

Problem lookback_delta() {
  const auto payoff = [](const auto& path) { return path.terminal - path.minimum; };
  return make({.id = "E19",
               .name = "lookback-delta",
               .module = "sde/sensitivities.hpp",
               .truth = 0.1721680223736086576685,
               .formula = "delta of the lookback of E04, dual numbers and bridges: a hundredth of the price"},
              slope(MilsteinStep{}, Minimum{}, payoff, Rates{2, 1}));
}

Problem barrier_delta() {
  const auto payoff = [](const auto& path) { return positive_part(path.terminal - 100) * path.probability; };
  return make({.id = "E20",
               .name = "barrier-delta",
               .module = "sde/sensitivities.hpp",
               .truth = 0.7016046530346511818327,
               .formula = "delta of the barrier call of E05, dual numbers and bridges: Merton; no PMF exists"},
              slope(MilsteinStep{}, StaysAbove{85}, payoff, Rates{0.5, 1}));
}

Problem asian_delta() {
  const auto payoff = [](const auto& path) { return positive_part(path.average() - 100); };
  return make({.id = "E21",
               .name = "asian-delta",
               .module = "sde/sensitivities.hpp",
               .truth = 0.5889156857754732609413,
               .formula = "delta of the Asian call of E03, dual numbers and bridges on trees: Geman and Yor"},
              slope(Branched<MilsteinStep>{}, Average{}, payoff, Rates{1.67, 1.2}));
}

Problem smoothed_digital_call() {
  const BlackScholes<> stock{.start = 100, .rate = 0.05, .volatility = 0.2};
  const NormalDigital payoff{{100, 100 * std::exp(-0.05)}};
  using Paths = SdeLevels<Smoothed<MilsteinStep>, BlackScholes<>, debias::detail::EndOnly, NormalDigital>;
  return make(
      {.id = "E22",
       .name = "smoothed-digital-call",
       .module = "sde.hpp",
       .truth = 53.23248154537634034067,
       .formula = "100 where S_T > 100, Milstein with a conditional last step of Euler: 100 exp(-r T) Phi(d_2)"},
      Paths(stock, {}, payoff, Rates{1.5, 1}));
}

}  // namespace debias::catalog

// exp(-tau) through a sinusoid with a non-integer number of periods, a step and a linear medium, tau = 1, 4,
// 16.

#include <cmath>
#include <numbers>
#include <string>

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>

#include "exponential.hpp"
#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

// Combs of 2^m points whose exp(-sum) still has its mean near exp(-tau).
std::int64_t lowest_base(double tau) { return tau < 2 ? 0 : tau < 8 ? 2 : 4; }

template <class F>
Problem medium(Facts facts, double tau, const F& extinction, double majorant, const Rates& jittered) {
  facts.module = "function_of_mean.hpp";
  facts.truth = std::exp(-tau);
  facts.lowest_base = lowest_base(tau);
  const std::int64_t base_level = facts.lowest_base;
  Problem p = make(std::move(facts), function_of_integral(extinction, functions::ExpMinus{}));
  add_exponential_methods(p, extinction, majorant, jittered, base_level);
  return p;
}

Problem sinusoid(const std::string& id, int tau) {
  constexpr double period = 0.37;
  constexpr double two_pi = 2 * std::numbers::pi;
  const double integral = 1 + period / two_pi * (std::cos(1.0) - std::cos(two_pi / period + 1));
  const double a = tau / integral;
  const auto extinction = [a](double x) { return a * (1 + std::sin(two_pi / period * x + 1)); };
  return medium({.id = id,
                 .name = "sinusoid-tau-" + std::to_string(tau),
                 .formula = "exp(-tau), extinction A (1 + sin(2 pi x / 0.37 + 1))"},
                tau, extinction, 2 * a, {6, 1});
}

Problem step(const std::string& id, int tau) {
  const double low = 0.3 * tau;
  const auto extinction = [low](double x) { return x < 1.0 / 3 ? 8 * low : low; };
  return medium({.id = id,
                 .name = "step-tau-" + std::to_string(tau),
                 .formula = "exp(-tau), extinction 2.4 tau on [0, 1/3), 0.3 tau beyond"},
                tau, extinction, 8 * low, {4, 1});
}

Problem linear(const std::string& id, int tau) {
  const double slope = 2 * tau;
  const auto extinction = [slope](double x) { return slope * x; };
  return medium({.id = id, .name = "linear-tau-" + std::to_string(tau), .formula = "exp(-tau), extinction 2 tau x"},
                tau, extinction, slope, {6, 1});
}

}  // namespace

Problem sinusoid_tau_1() { return sinusoid("B21", 1); }
Problem sinusoid_tau_4() { return sinusoid("B22", 4); }
Problem sinusoid_tau_16() { return sinusoid("B23", 16); }
Problem step_tau_1() { return step("B24", 1); }
Problem step_tau_4() { return step("B25", 4); }
Problem step_tau_16() { return step("B26", 16); }
Problem linear_tau_1() { return linear("B27", 1); }
Problem linear_tau_4() { return linear("B28", 4); }
Problem linear_tau_16() { return linear("B29", 16); }

}  // namespace debias::catalog

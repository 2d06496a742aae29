// Finance: what the default of a counterparty may cost (CVA), E[D max(E[V | X], 0)]: V = later payments, X = the market at default.
//
//   At time 1 a counterparty that owes the forward S_2 - K at time 2 defaults with probability p; recovered is a part R.
//   loss = (1 - R) p e^-r E max(E[e^-r (S_2 - K) | S_1], 0)
//
// Given S_1 the forward is worth S_1 - K e^-r: the loss is that of a call on S_1 with this strike, by Black and Scholes. The
// simulation does not know that: it draws S_2 given S_1, on nets.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <numbers>
#include <span>

#include <debias/debias.hpp>

namespace {

constexpr double start = 100;
constexpr double strike = 105;
constexpr double rate = 0.03;
constexpr double volatility = 0.25;
constexpr double lost = 0.6 * 0.02;  // (1 - R) p

// The stock a year later.
double next(double stock, double normal) {
  return stock * std::exp(rate - volatility * volatility / 2 + volatility * normal);
}
double normal_probability(double x) { return std::erfc(-x / std::numbers::sqrt2) / 2; }

}  // namespace

int main() {
  const auto at_default = [](debias::Stream& rng) { return next(start, rng.normal()); };
  const auto payment = [](double stock, std::span<const double> u) {
    return std::exp(-rate) * (next(stock, debias::normal_quantile(u[0])) - strike);
  };
  const auto loss = [](double value) { return lost * std::exp(-rate) * std::max(value, 0.0); };
  const auto problem = debias::nested(at_default, payment, debias::Cube(1), loss, {.rates = debias::Rates{3, 1}});
  const auto result = debias::estimate(debias::recipe(problem), {.samples = 1 << 16, .seed = 1});

  const double due = strike * std::exp(-rate);
  const double z = (std::log(start / due) + rate + volatility * volatility / 2) / volatility;
  const double call = start * normal_probability(z) - due * std::exp(-rate) * normal_probability(z - volatility);
  std::cout << "loss_by_default " << result.mean << " +- " << result.standard_error << ", exact " << lost * call
            << '\n';
}

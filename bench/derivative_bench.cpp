// Finite differences against plain loops: plain/..., ratio of times, alternating in one run.

#include <cmath>
#include <cstdint>

#include <benchmark/benchmark.h>

#include <debias/derivative.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>

#include "against_loops.hpp"

namespace debias::bench {
namespace {

// The published setting: first step 1.5, r = 1/2, the level by logarithms [Misso et al. 2022].
template <class F>
double plain_forward(const F& f, double x, Stream& order) {
  const auto level = static_cast<int>(std::log(order.uniform()) / std::log(0.5)) + 1;
  const double p = std::ldexp(1.0, -level);
  const double here = f(x);
  const double coarse = std::ldexp(1.5, 1 - level);
  const double fine = coarse / 2;
  const double first = (f(x + 1.5) - here) / 1.5;
  return first + ((f(x + fine) - here) / fine - (f(x + coarse) - here) / coarse) / p;
}

void plain_sine() {
  const auto f = [](double x) { return std::sin(x); };
  register_comparison("finite_difference/sine", single_term(finite_difference(f, 1.0), Geometric(0.5)),
                      [f](Stream& order, Stream&) { return plain_forward(f, 1.0, order); });
}
// A random function: base and difference draw random numbers of their own.
void plain_random_sine() {
  const auto f = [](double x, Stream& rng) { return std::sin(x * rng.uniform()); };
  const auto plain = [](Stream& order, Stream& rng) {
    const auto level = static_cast<int>(std::log(order.uniform()) / std::log(0.5)) + 1;
    const double p = std::ldexp(1.0, -level);
    const double coarse = std::ldexp(1.5, 1 - level);
    const double fine = coarse / 2;
    const double u = rng.uniform();
    const double first = (std::sin(2.5 * u) - std::sin(u)) / 1.5;
    const double v = rng.uniform();
    const double here = std::sin(v);
    return first + ((std::sin((1 + fine) * v) - here) / fine - (std::sin((1 + coarse) * v) - here) / coarse) / p;
  };
  register_comparison("finite_difference/random_sine", single_term(finite_difference(f, 1.0), Geometric(0.5)), plain);
}

const bool registered = [] {
  plain_sine();
  plain_random_sine();
  return true;
}();

}  // namespace
}  // namespace debias::bench

// What debias_test.py computes in NumPy, computed in C++: one line a problem, its means and standard errors.

#include <cstdint>
#include <iostream>
#include <vector>

#include <debias/debias.hpp>
#include <debias/functions.hpp>
#include <Eigen/Core>

#include "core/text.hpp"

namespace {

// (mean)^2 of 2^k uniforms, and (mean)^3 for a second component.
struct Powers {
  template <class Value>
  static auto draw(std::int64_t level, debias::Stream& rng, const Value& value) {
    const auto n = static_cast<std::size_t>(1) << level;
    std::vector<double> u(n);
    rng.fill(u);
    double even = 0;
    double odd = 0;
    for (std::size_t i = 0; i < n; i += 2) even += u[i];
    for (std::size_t i = 1; i < n; i += 2) odd += u[i];
    const auto size = static_cast<double>(n);
    if (level == 0) return debias::base(value(even), 1);
    return debias::coupled(value((even + odd) / size),
                           debias::scaled(debias::sum(value(2 * even / size), value(2 * odd / size)), 0.5), size);
  }
};

void print(const char* name, const debias::Statistics& s) {
  std::cout << name;
  for (const auto& c : s.components) {
    std::cout << ' ' << debias::to_text(c.mean) << ' ' << debias::to_text(c.standard_error);
  }
  std::cout << ' ' << debias::to_text(s.work) << '\n';
}

}  // namespace

int main() {
  using namespace debias;
  const Plan plan{.samples = 30000, .seed = 11};
  const auto scalar = [](std::int64_t level, Stream& rng) {
    return Powers::draw(level, rng, [](double m) { return m * m; });
  };
  const auto vector = [](std::int64_t level, Stream& rng) {
    return Powers::draw(level, rng, [](double m) {
      Eigen::ArrayXd v(2);
      v << m * m, m * m * m;
      return v;
    });
  };
  const auto x = [](double t) { return 1 + t * t; };
  const auto draw = [x](Stream& rng) { return x(rng.uniform()); };
  print("scalar", estimate(single_term(scalar, AnyPmf(Geometric(0.6))), plan));
  print("drawn",
        estimate(single_term(scalar, AnyPmf(Geometric(0.6)), {.base_level = 1, .base = Base::one_outcome}), plan));
  print("sum", estimate(independent_sum(scalar, AnyPmf(Geometric(0.6))), plan));
  print("block", estimate(stratified(single_term(scalar, AnyPmf(Geometric(0.6))), 8), plan));
  print("vector", estimate(single_term(vector, AnyPmf(Geometric(0.6))), plan));
  print("mean", estimate(single_term(function_of_mean(draw, functions::Reciprocal{}), AnyPmf(Geometric(0.6))), plan));
  print("comb", estimate(single_term(function_of_integral(x, functions::Log{}), AnyPmf(Geometric(0.8))), plan));
  print("jittered",
        estimate(single_term(function_of_jittered_integral(x, functions::Power{1.5}), AnyPmf(Geometric(0.8))), plan));
  print("recipe", estimate(recipe(scalar, {.rates = Rates{2, 1}}), plan));
  std::cout << "sample " << to_text(trace(single_term(scalar, AnyPmf(Geometric(0.6))), 11, 12345).sample.value) << '\n';
}

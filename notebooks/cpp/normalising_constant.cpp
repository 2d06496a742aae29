// Physics: 1/Z of a density exp(-x^2) on [0, 1], known up to its integral Z.

#include <cmath>
#include <iostream>

#include <debias/debias.hpp>

int main() {
  const auto density = [](double x) { return std::exp(-x * x); };
  const auto estimator = debias::single_term(debias::reciprocal_of_integral(density), {.base_level = 2});
  const auto result = debias::estimate(estimator, {.samples = 100'000, .seed = 1});
  const double z = std::sqrt(std::acos(-1.0)) / 2 * std::erf(1.0);
  std::cout << "normalising_constant " << result.mean << " +- " << result.standard_error << ", exact " << 1 / z << '\n';
}

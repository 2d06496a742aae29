// Optics: what passes a layer at three wavelengths, exp(-optical depth), from the same points of the ray.

#include <cmath>
#include <iostream>

#include <Eigen/Core>

#include <debias/debias.hpp>

int main() {
  const auto extinction = [](double x) -> Eigen::Array3d {
    return Eigen::Array3d(1, 2, 4) * (1 + std::sin(6 * x));  // red, green, blue
  };
  const auto transmittance = debias::functions::componentwise(debias::functions::ExpMinus{});
  const auto levels = debias::function_of_integral(extinction, transmittance);
  const auto estimator = debias::single_term(levels, {.base_level = 3});
  const auto result = debias::estimate(estimator, {.samples = 50'000, .seed = 1});
  const char* const names[] = {"red", "green", "blue"};
  for (int i = 0; i < 3; ++i) {
    const double depth = std::exp2(i) * (1 + (1 - std::cos(6.0)) / 6);
    std::cout << names[i] << ' ' << result.mean[i] << " +- " << result.standard_error[i] << ", exact "
              << std::exp(-depth) << '\n';
  }
}

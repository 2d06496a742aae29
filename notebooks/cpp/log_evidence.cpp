// Statistics: the log evidence of a Bayesian model, and its gradient in the mean mu of the prior, in one run.
//
//   theta ~ N(mu, 1), y ~ N(theta, 1):  log Z = log E w,  d log Z / d mu = E[w (theta - mu)] / E w,  w = exp(-(y - theta)^2 / 2)

#include <cmath>
#include <iostream>

#include <Eigen/Core>

#include <debias/debias.hpp>

int main() {
  const double y = 1;
  const double mu = 0;
  const auto draw = [=](debias::Stream& rng) {
    const double z = rng.normal();
    const double weight = std::exp(-(y - mu - z) * (y - mu - z) / 2);
    return Eigen::Array2d(weight, weight * z);
  };
  const auto g = [](const Eigen::Array2d& mean) { return Eigen::Array2d(std::log(mean[0]), mean[1] / mean[0]); };

  // A mean of few weights may lie near 0, where the logarithm has no moments: start from 8 draws.
  const auto estimator = debias::single_term(debias::function_of_mean(draw, g), {.base_level = 3});
  const auto result = debias::estimate(estimator, {.samples = 200'000, .seed = 1});
  const double exact[] = {-std::log(2.0) / 2 - (y - mu) * (y - mu) / 4, (y - mu) / 2};
  const char* const names[] = {"log_evidence", "gradient"};
  for (int i = 0; i < 2; ++i) {
    std::cout << names[i] << ' ' << result.mean[i] << " +- " << result.standard_error[i] << ", exact " << exact[i]
              << '\n';
  }
}

#include <iostream>

#include <debias/debias.hpp>

int main() {
  const auto x = [](debias::Stream& rng) {  // E X = 4/3
    const double u = rng.uniform();
    return 1 + u * u;
  };
  const auto estimator = debias::single_term(debias::reciprocal(x));  // of 1 / E X = 3/4
  std::cout << debias::estimate(estimator, {.samples = 1'000'000, .seed = 7});
}

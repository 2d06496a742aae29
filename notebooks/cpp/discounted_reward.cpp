// Operations research: the discounted reward of a machine that breaks and is repaired, by paths of random length.
//
//   E sum_t discount^t reward(s_t),  s = works or broken

#include <iostream>

#include <debias/debias.hpp>

struct Machine {
  bool works;
  double weight;  // discount^t
};

int main() {
  const double discount = 0.9;
  const double breaks = 0.2;
  const double repaired = 0.5;
  const auto start = [](debias::Stream&) { return Machine{true, 1}; };
  const auto advance = [=](Machine m, debias::Stream& rng) {
    const double u = rng.uniform();
    return Machine{m.works ? u >= breaks : u < repaired, m.weight * discount};
  };
  const auto reward = [](const Machine& m) { return m.weight * (m.works ? 10.0 : -5.0); };

  const auto rewards = debias::path_series(start, advance, reward, debias::geometric_terms(discount));
  const auto result = debias::estimate(debias::roulette(rewards), {.samples = 200'000, .seed = 1});
  // v = r + discount P v, for two states by hand.
  const double a = 1 - discount * (1 - breaks);
  const double b = 1 - discount * (1 - repaired);
  const double exact = (10 * b - 5 * discount * breaks) / (a * b - discount * breaks * discount * repaired);
  std::cout << "discounted_reward " << result.mean << " +- " << result.standard_error << ", exact " << exact << '\n';
}

// Chains that meet: no kernel, no start and no function hides a NaN or an infinity.

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <debias/chains.hpp>

#include "faults.hpp"

using namespace debias;
using namespace debias::faults;

namespace {

double itself(double x) { return x; }
double density(double x) { return -0.5 * x * x; }
double slope(double x) { return -x; }
double bad_density(double x) { return bad(-0.5 * x * x); }
const ChainOptions options{.burn_in = 2, .length = 20};

double halve(double x, Stream& rng) { return bad(0.5 * x + rng.uniform()); }
std::pair<double, double> halve_both(double x, double y, Stream& rng) {
  const double u = rng.uniform();
  if (rng.uniform() < 0.3) return {u, u};
  const double next_x = bad(0.5 * x + u);
  return {next_x, 0.5 * y + u};
}

}  // namespace

TEST_CASE("coupled_chain shows what its callables return that is no number", "[nan][chains]") {
  check("coupled_chain", "f",
        coupled_chain(
            random_walk(density, 2.4), 1.0, [](double x) { return bad(x); }, options));
  const auto steps = kernel_of(halve, halve_both);
  check("coupled_chain", "step", coupled_chain(steps, 1.0, itself, options));
  check("kernel_of", "step", coupled_chain(steps, 1.0, itself, options));
  check("coupled_chain", "start",
        coupled_chain(
            random_walk(density, 2.4), [](Stream& rng) { return bad(rng.normal()); }, itself, options));
  // -infinity is a density: that of a point outside.
  check("random_walk", "log_density", coupled_chain(random_walk(bad_density, 2.4), 1.0, itself, options),
        Infinity::has_a_limit);
  check("mala", "log_density", coupled_chain(mala(bad_density, slope, 1.0), 1.0, itself, options),
        Infinity::has_a_limit);
  check("mala", "gradient",
        coupled_chain(mala(
                          density, [](double x) { return bad(-x); }, 1.0),
                      1.0, itself, options));
  check("mixture", "log_density",
        coupled_chain(mixture({0.5, 0.5}, random_walk(bad_density, 2.4), random_walk(density, 1.0)), 1.0, itself,
                      options),
        Infinity::has_a_limit);
  const auto with_walk = [](const auto& other) {
    return coupled_chain(mixture({0.5, 0.5}, other, random_walk(density, 1.0)), 1.0, itself, options);
  };
  check("hamiltonian", "log_density", with_walk(hamiltonian(bad_density, slope, 0.7, 2)), Infinity::has_a_limit);
  check("hamiltonian", "gradient",
        with_walk(hamiltonian(
            density, [](double x) { return bad(-x); }, 0.7, 2)));
  const auto given = [](std::size_t, const std::array<double, 1>& x) { return NormalLaw{bad(0.5 * x[0]), 1}; };
  check("gibbs", "conditional",
        coupled_chain(
            gibbs(given), std::array<double, 1>{1.0}, [](const std::array<double, 1>& x) { return x[0]; }, options));
  const auto draws = draws_of(coupled_chain(
      random_walk(density, 2.4), 1.0, [](double x) { return bad(x); }, options));
  check("draws_of", "f", draws);
}

TEST_CASE("check_coupling does not pass a function that returns no numbers", "[nan][chains]") {
  const auto no_number = [](double x) { return x > 0 ? std::nan("") : x; };
  CHECK_FALSE(check_coupling(random_walk(density, 2.4), std::vector<double>{-1, 1}, no_number).passed());
  covers("check_coupling", "f");
}

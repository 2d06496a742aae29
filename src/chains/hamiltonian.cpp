#include <debias/chains/hamiltonian.hpp>

#include <stdexcept>
#include <string>

namespace debias::detail {

void check_leapfrog(double step, int steps) {
  check_step("hamiltonian", step);
  if (steps >= 1) return;
  throw std::invalid_argument("hamiltonian: steps = " + std::to_string(steps) + " (must be at least 1)");
}

}  // namespace debias::detail

#pragma once

// One step of a scheme for a scalar equation.
//
//   euler      X <- X + a h + b dW                                                    [Maruyama 1955]
//   milstein   X <- X + a h + b dW + b b_x (dW^2 - h) / 2                             [Milstein 1974]
//
// Notation: a = drift, b = diffusion, b_x = diffusion_derivative, h = length of the step. Unstable while a_x h < -2.

#include <cstdint>

#include <debias/core/stream.hpp>
#include <debias/sde/models.hpp>

namespace debias {

/// A scheme: how noise is drawn, how a step goes, and what a Bridge needs to know of it.
struct EulerStep {
  static constexpr bool is_antithetic = false;

  template <ScalarSde M>
  static std::int64_t noises(const M& /*model*/) {
    return 1;
  }
  template <ScalarSde M>
  static double increment(std::int64_t /*noises*/, double sqrt_h, Stream& rng) {
    return sqrt_h * rng.normal();
  }
  template <ScalarSde M>
  static double diffusion(const M& model, double x, double t) {
    return model.diffusion(x, t);
  }
  template <ScalarSde M>
  static double advance(const M& model, double x, double t, double h, double b, double dw) {
    return x + model.drift(x, t) * h + b * dw;
  }
};

struct MilsteinStep : EulerStep {
  template <DifferentiableSde M>
  static double advance(const M& model, double x, double t, double h, double b, double dw) {
    return x + model.drift(x, t) * h + b * dw + b * model.diffusion_derivative(x, t) * (dw * dw - h) / 2;
  }
};

}  // namespace debias

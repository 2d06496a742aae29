#pragma once

// One step of a scheme for a scalar equation.
//
//   euler      X <- X + a h + b dW                                                    [Maruyama 1955]
//   milstein   X <- X + a h + b dW + b b_x (dW^2 - h) / 2                             [Milstein 1974]
//
// Notation: a = drift, b = diffusion, b_x = diffusion_derivative, h = length of the step. Unstable while a_x h < -2.

#include <bit>
#include <cstdint>

#include <debias/core/stream.hpp>
#include <debias/sde/models.hpp>

namespace debias {

/// A scheme: how noise is drawn, how a step goes, and what a Bridge needs to know of it. Time and noise are numbers of the
/// horizon's type, the state is one of its own.
struct EulerStep {
  static constexpr bool is_antithetic = false;
  static constexpr bool is_branched = false;
  static constexpr bool is_smoothed = false;
  static constexpr bool has_skew = false;          ///< in the last step of Smoothed
  static constexpr bool needs_derivative = false;  ///< of the diffusion in x

  template <ScalarSde M>
  static std::int64_t noises(const M& /*model*/) {
    return 1;
  }
  template <ScalarSde M, class H>
  static H increment(std::int64_t /*noises*/, const H& sqrt_h, Stream& rng) {
    return sqrt_h * rng.normal();
  }
  template <ScalarSde M, class T>
  static detail::state_of<M> diffusion(const M& model, const detail::state_of<M>& x, const T& t) {
    return model.diffusion(x, t);
  }
  template <ScalarSde M, class T, class H>
  static detail::state_of<M> advance(const M& model, const detail::state_of<M>& x, const T& t, const H& h,
                                     const detail::state_of<M>& b, const H& dw) {
    return x + model.drift(x, t) * h + b * dw;
  }
};

struct MilsteinStep : EulerStep {
  static constexpr bool has_skew = true;
  static constexpr bool needs_derivative = true;

  template <DifferentiableSde M, class T, class H>
  static detail::state_of<M> advance(const M& model, const detail::state_of<M>& x, const T& t, const H& h,
                                     const detail::state_of<M>& b, const H& dw) {
    return x + model.drift(x, t) * h + b * dw + b * model.diffusion_derivative(x, t) * (dw * dw - h) / 2;
  }
};

/// The model's own step, `step(x, t, h, dw)`, of strong order one like Milstein's.
struct OwnStep : MilsteinStep {
  static constexpr bool needs_derivative = false;

  template <ScalarSde M, class T, class H>
  static detail::state_of<M> advance(const M& model, const detail::state_of<M>& x, const T& t, const H& h,
                                     const detail::state_of<M>& /*b*/, const H& dw) {
    return model.step(x, t, h, dw);
  }
};

/// The same scheme, but for its last step: not drawn, it is what the payoff takes its expectation over. The coarse path
/// of a level does so given the first half of the increment, and keeps its mean by that.         [Burgos & Giles 2012]
/// That step is Euler's; under Milstein's scheme, where model and payoff know of it (diffusion_derivative, sde/payoffs.hpp),
///
///   X <- X + a h + b (exp(b_x dW - b_x^2 h / 2) - 1) / b_x,
///
/// Milstein's but for h^(3/2), and increasing in dW. Euler's differs by b b_x h / 2, which is most of D_k at small volatilities.
template <class Step>
struct Smoothed : Step {
  static constexpr bool is_smoothed = true;
};

/// The same scheme on a tree: every path splits in two at T (1 - 2^-j), j = 1, 2, ..., and the payoff is the mean over
/// the leaves. The last fork is a coarse step before the end.                         [Giles & Haji-Ali 2022]
template <class Step>
struct Branched : Step {
  static constexpr bool is_branched = true;

  /// Steps of all branches of a tree whose paths have `steps` of them, 2^k: (k + 1) 2^(k - 1).
  static double steps_of_tree(std::int64_t steps) {
    if (steps == 1) return 1;
    const int level = std::countr_zero(static_cast<std::uint64_t>(steps));
    return static_cast<double>(level + 1) * static_cast<double>(steps) / 2;
  }
};

}  // namespace debias

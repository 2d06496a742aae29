#pragma once

// A vector-valued stochastic differential equation dX = a(X, t) dt + B(X, t) dW, in 2^k steps at level k.
//
//   euler       X <- X + a h + B dW
//   milstein    ... + [(B dW . grad) B dW - h sum_j (b_j . grad) b_j] / 2, b_j = columns of B; no Levy areas
//   antithetic_milstein   the mean of that path and of its twin with the two increments of each pair swapped,
//                         against the coarse path                                 [Giles & Szpruch 2014]
//
//   Notation: a = drift, B = diffusion, (v . grad) B = diffusion_along(x, t, v).
// E D_k^2 ~ 2^-k under euler and, where the noise does not commute ((b_i . grad) b_j != (b_j . grad) b_i),
// under milstein; 2^(-2 k) under milstein where it does. antithetic_milstein needs no such condition:
// 2^(-2 k) for payoffs with two derivatives, 2^(-1.5 k) for those with kinks (declare it). It costs 5/3 of
// milstein.
// Source: Giles & Szpruch, Ann. Appl. Probab. 24 (2014).

#include <concepts>
#include <limits>
#include <type_traits>
#include <utility>

#include <Eigen/Core>

#include <debias/core/stream.hpp>
#include <debias/sde.hpp>

namespace debias {

/// A struct with `start` (a column vector of Eigen), `horizon`, `drift(x, t)`, a vector, and `diffusion(x,
/// t)`, a matrix with a row for each component and a column for each Brownian motion. Of fixed size, nothing
/// allocates.
template <class M>
concept VectorSde = requires(const M& m, double t) {
  requires std::derived_from<detail::state_of<M>, Eigen::MatrixBase<detail::state_of<M>>>;
  { m.horizon } -> std::convertible_to<double>;
  { m.drift(m.start, t) } -> std::convertible_to<detail::state_of<M>>;
  { m.diffusion(m.start, t).cols() } -> std::convertible_to<Eigen::Index>;
};

/// The same with `diffusion_along(x, t, v)`, the derivative of the diffusion matrix along v.
template <class M>
concept DifferentiableVectorSde = VectorSde<M> && requires(const M& m, const detail::state_of<M>& v, double t) {
  { m.diffusion_along(v, t, v).cols() } -> std::convertible_to<Eigen::Index>;
};

struct VectorEulerStep {
  static constexpr bool is_antithetic = false;
  static constexpr bool is_branched = false;
  static constexpr bool is_smoothed = false;
  static constexpr bool has_skew = false;

  template <VectorSde M>
  static auto diffusion(const M& model, const detail::state_of<M>& x, double t) {
    return model.diffusion(x, t).eval();
  }
  template <VectorSde M>
  static std::int64_t noises(const M& model) {
    return model.diffusion(model.start, 0).cols();
  }
  template <VectorSde M>
  static auto increment(std::int64_t noises, double sqrt_h, Stream& rng) {
    using Matrix = decltype(diffusion(std::declval<const M&>(), std::declval<const detail::state_of<M>&>(), 0));
    Eigen::Matrix<double, Matrix::ColsAtCompileTime, 1> dw(noises);
    for (Eigen::Index j = 0; j < dw.size(); ++j) dw[j] = sqrt_h * rng.normal();
    return dw;
  }
  template <VectorSde M, class B, class Noise>
  static detail::state_of<M> advance(const M& model, const detail::state_of<M>& x, double t, double h, const B& b,
                                     const Noise& dw) {
    return x + model.drift(x, t) * h + b * dw;
  }
};

struct VectorMilsteinStep : VectorEulerStep {
  template <DifferentiableVectorSde M, class B, class Noise>
  static detail::state_of<M> advance(const M& model, const detail::state_of<M>& x, double t, double h, const B& b,
                                     const Noise& dw) {
    using State = detail::state_of<M>;
    const State moved = b * dw;
    State correction = model.diffusion_along(x, t, moved) * dw;
    for (Eigen::Index j = 0; j < b.cols(); ++j) {
      const State column = b.col(j);
      const auto along = model.diffusion_along(x, t, column).eval();
      correction -= h * along.col(j);
      if (!along.allFinite()) [[unlikely]]  // in another column, too
        correction.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
    return x + model.drift(x, t) * h + moved + correction / 2;
  }
};

struct AntitheticMilsteinStep : VectorMilsteinStep {
  static constexpr bool is_antithetic = true;
};

namespace detail {

template <class Step, class M, class Summary, class F>
auto vector_levels(M model, Summary summary, F payoff, const Rates& rates) {
  return SdeLevels<Step, M, Summary, F>(std::move(model), std::move(summary), std::move(payoff), rates);
}

}  // namespace detail

/// E payoff(X_T), or of a summary that takes steps, by Euler's scheme.
/// Throws, like those below, std::invalid_argument for a horizon that is not positive and finite.
template <VectorSde M, TerminalPayoff<detail::state_of<M>> F>
auto euler(M model, F payoff, const Rates& rates = {1, 1}) {
  return detail::vector_levels<VectorEulerStep>(std::move(model), detail::EndOnly{}, std::move(payoff), rates);
}
template <VectorSde M, PathSummary<detail::state_of<M>> Summary, TerminalPayoff<Summary> F>
auto euler(M model, Summary summary, F payoff, const Rates& rates = {1, 1}) {
  return detail::vector_levels<VectorEulerStep>(std::move(model), std::move(summary), std::move(payoff), rates);
}

/// The same by Milstein's scheme, for noise that commutes; declare {1, 1} where it does not.
template <DifferentiableVectorSde M, TerminalPayoff<detail::state_of<M>> F>
auto milstein(M model, F payoff, const Rates& rates = {2, 1}) {
  return detail::vector_levels<VectorMilsteinStep>(std::move(model), detail::EndOnly{}, std::move(payoff), rates);
}
template <DifferentiableVectorSde M, PathSummary<detail::state_of<M>> Summary, TerminalPayoff<Summary> F>
auto milstein(M model, Summary summary, F payoff, const Rates& rates = {2, 1}) {
  return detail::vector_levels<VectorMilsteinStep>(std::move(model), std::move(summary), std::move(payoff), rates);
}

/// The same by Milstein's scheme with an antithetic twin, for any noise.
template <DifferentiableVectorSde M, TerminalPayoff<detail::state_of<M>> F>
auto antithetic_milstein(M model, F payoff, const Rates& rates = {2, 1}) {
  return detail::vector_levels<AntitheticMilsteinStep>(std::move(model), detail::EndOnly{}, std::move(payoff), rates);
}
template <DifferentiableVectorSde M, PathSummary<detail::state_of<M>> Summary, TerminalPayoff<Summary> F>
auto antithetic_milstein(M model, Summary summary, F payoff, const Rates& rates = {2, 1}) {
  return detail::vector_levels<AntitheticMilsteinStep>(std::move(model), std::move(summary), std::move(payoff), rates);
}

/// Both on trees, for payoffs that jump.
template <DifferentiableVectorSde M, TerminalPayoff<detail::state_of<M>> F>
auto milstein(M model, F payoff, Branching /*tree*/, const Rates& rates = {2, 1.2}) {
  return detail::vector_levels<Branched<VectorMilsteinStep>>(std::move(model), detail::EndOnly{}, std::move(payoff),
                                                             rates);
}
template <DifferentiableVectorSde M, PathSummary<detail::state_of<M>> Summary, TerminalPayoff<Summary> F>
auto milstein(M model, Summary summary, F payoff, Branching /*tree*/, const Rates& rates = {2, 1.2}) {
  return detail::vector_levels<Branched<VectorMilsteinStep>>(std::move(model), std::move(summary), std::move(payoff),
                                                             rates);
}
template <DifferentiableVectorSde M, TerminalPayoff<detail::state_of<M>> F>
auto antithetic_milstein(M model, F payoff, Branching /*tree*/, const Rates& rates) {
  return detail::vector_levels<Branched<AntitheticMilsteinStep>>(std::move(model), detail::EndOnly{}, std::move(payoff),
                                                                 rates);
}

}  // namespace debias

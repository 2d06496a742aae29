#pragma once

// The steady state of a Markov chain that forgets where it came from: level k starts k steps in the past.
//
//   I_k = f(phi_1(phi_2(... phi_k(x)))),  D_k = I_k - f(phi_1(... phi_(k-1)(x)))    [Glynn & Rhee 2014]
//
//   Notation: phi_j = the step at time -j with the innovations of time -j, x = start. Fine and coarse chain
//   share all innovations; the fine one has taken one step more, the first.
// Assumes that a step contracts in mean square, E|phi(x) - phi(y)|^2 <= c^2 |x - y|^2 with c < 1, and that f
// is Lipschitz: E D_k^2 ~ c^(2 k). (For a power of x the moments have to contract as well.) The work, 2 k - 1
// steps, grows linearly, which beside a geometric decay counts as exponent 0. Fails where only the laws of
// the two chains come together, not their paths. A state that is a Value and not finite makes the sample NaN.
// Numbers: the step at time -j draws from a stream of its own, split(j). Of the point of a net its first number is coordinate
// j, that of the oldest step k coordinate 0: all of D_k is what this one leaves, and nets are best in their first coordinates.
// A step's other numbers are plain.
// Source: Glynn & Rhee, J. Appl. Probab. 51A (2014).

#include <cmath>
#include <concepts>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/text.hpp>
#include <debias/core/value.hpp>

namespace debias {

namespace detail {

/// The state of the chain is what a step returns: a start of `0` does not make it an integer.
template <class Step, class Start>
using state_t = std::remove_cvref_t<std::invoke_result_t<const Step&, Start, Stream&>>;

template <class F, class State>
using observed_t = std::remove_cvref_t<std::invoke_result_t<const F&, const State&>>;

}  // namespace detail

/// `step(state, rng)` returns the next state; any copyable type will do.
template <class Step, class State>
concept MarkovStep = std::copyable<State> && requires(const Step& step, State x, Stream& rng) {
  { step(std::move(x), rng) } -> std::convertible_to<State>;
};

/// What is wanted of the state: `f(state)` returns a Value.
template <class F, class State>
concept Observable = Value<detail::observed_t<F, State>>;

/// A BiasedSequence; the work is the number of steps, fine and coarse alike, and 1 at level 0. Branch j of
/// the stream has the innovations of time -j: all levels of one stream share them, and it stays where it is.
template <class State, MarkovStep<State> Step, Observable<State> F>
class SteadyState {
 public:
  using value_type = detail::observed_t<F, State>;

  SteadyState(Step step, State start, F f, const Rates& declared)
      : rates(declared), step_(std::move(step)), start_(std::move(start)), f_(std::move(f)) {
    if constexpr (Value<State>) {
      if (!debias::is_finite(start_)) throw std::invalid_argument("steady_state: the start is not finite");
    }
  }

  Draw<value_type> operator()(std::int64_t level, const Stream& rng) const {
    if (level == 0) return debias::base<value_type>(f_(start_));
    bool finite = true;
    State fine = next(start_, level, 0, rng, finite);
    State coarse = start_;
    for (std::int64_t j = level - 1; j > 0; --j) {
      fine = next(std::move(fine), j, j, rng, finite);
      coarse = next(std::move(coarse), j, j, rng, finite);
    }
    return debias::coupled<value_type>(observed(fine, finite), f_(coarse), 2 * static_cast<double>(level) - 1);
  }

  /// I_level alone, in `level` steps (work 1 at level 0).
  Term<value_type> value_at(std::int64_t level, const Stream& rng) const {
    State x = start_;
    bool finite = true;
    for (std::int64_t j = level; j > 0; --j) x = next(std::move(x), j, j == level ? 0 : j, rng, finite);
    return {observed(x, finite), level > 0 ? static_cast<double>(level) : 1.0};
  }

  Rates rates;

 private:
  // A stream for every step, not one for the path: a step may use more random numbers here than there.
  // `finite` remembers a state that was not: a later step, or f, may hide it behind a comparison.
  State next(State x, std::int64_t j, std::int64_t coordinate, const Stream& rng, bool& finite) const {
    Stream innovations = rng.split(static_cast<std::uint64_t>(j), static_cast<std::uint64_t>(coordinate));
    State moved = step_(std::move(x), innovations);
    if constexpr (Value<State>) {
      if (!debias::is_finite(moved)) [[unlikely]]
        finite = false;
    }
    return moved;
  }

  value_type observed(const State& x, bool finite) const {
    value_type value = f_(x);
    return finite ? value : debias::nan_like(std::move(value));
  }

  Step step_;
  State start_;
  F f_;
};

namespace detail {
template <class Step, class Start, class F>
concept ChainParts = std::invocable<const Step&, Start, Stream&> && MarkovStep<Step, state_t<Step, Start>> &&
    Observable<F, state_t<Step, Start>>;
template <class Step, class Start, class F>
constexpr Mistake mistake_in_chain() {
  constexpr Mistake step = mistake_in_call<Step, Start, Stream&>();
  if constexpr (step == Mistake::none) {
    return first_of(mistake_in_function<F, const state_t<Step, Start>&>(), Mistake::no_markov_step);
  } else {
    return first_of(step, Mistake::no_markov_step);
  }
}
}  // namespace detail

/// E f(X) for X in the steady state of the chain; throws std::invalid_argument for a start that is not finite:
/// `steady_state([](double x, Stream& rng) { return 0.5 * x + rng.normal(); }, 0.0, f, contraction(0.5))`.
template <class Step, class Start, class F>
requires detail::ChainParts<Step, Start, F>
auto steady_state(Step step, Start start, F f, const Rates& rates) {
  using State = detail::state_t<Step, Start>;
  return SteadyState<State, Step, F>(std::move(step), State(std::move(start)), std::move(f), rates);
}

template <class Step, class Start, class F>
requires(!detail::ChainParts<Step, Start, F>) auto steady_state(const Step& /*step*/, const Start& /*start*/,
                                                                const F& /*f*/, const Rates& /*rates*/) {
  return detail::refuse<detail::mistake_in_chain<Step, Start, F>(), Step, Start, F>();
}

/// The rates of a chain whose step contracts by `c` in mean square: E D_k^2 ~ c^(2 k).
/// Throws std::invalid_argument unless 0 <= c < 1.
inline Rates contraction(double c) {
  if (!(c >= 0 && c < 1)) {
    throw std::invalid_argument("contraction: c = " + detail::format("%f", c) +
                                " (must lie in [0, 1)); a chain that does not contract needs more than this");
  }
  return {-2 * std::log2(c), 0};
}

}  // namespace debias

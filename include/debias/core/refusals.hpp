#pragma once

// What is tried first and cannot work, in one sentence at compile time.
//
//   template <class X>
//   requires(!RandomVariable<X>) auto reciprocal(const X&, const Rates& = {}) {
//     return detail::refuse<detail::mistake_in_draws<X>(), X>();
//   }
//
// A door is a function that takes a callable of a user's. Beside the door for what fits its concept stands one for what
// does not: it looks for the mistake and says it, instead of the notes on all constraints of all candidates. It returns
// Refused, which later doors take without a second sentence. The concepts themselves are as they were: a program
// may ask them; a door that is asked in a requires-expression for what it refuses ends the compilation.
// Fails, with the compiler's own words, where a generic callable does not bear the types that it is tried with:
// `estimate` tries (Stream&, record) before anything else, so a sequence [](auto level, auto& rng) has an error of its own.

#include <concepts>
#include <cstdint>
#include <type_traits>

#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias::detail {

/// What a door returns that has refused.
struct Refused {
  template <class Out>
  friend Out& operator<<(Out& out, const Refused& /*refused*/) {
    return out;
  }
};

enum class Mistake {
  none,
  said_before,
  not_callable,
  // of a call
  by_value,
  is_mutable,
  no_stream,
  level_by_reference,
  exchanged_arguments,
  // of what it returns
  returns_nothing,
  returns_integer,
  returns_expression,
  returns_no_value,
  returns_draw,
  returns_term,
  returns_sample,
  returns_no_draw,
  cursor_without_terms,
  records_without_sample,
  // of base and coupled
  integer_value,
  expression_value,
  no_value,
  two_types,
  // of the door
  sequence_to_estimate,
  terms_to_estimate,
  recipe_to_others,
  not_stratifiable,
  estimator_to_levels,
  random_variable_to_levels,
  terms_to_levels,
  levels_to_terms,
  sequence_to_draws,
  function_to_draws,
  pmf_first,
  number_for_pmf,
  no_rates,
  no_pmf,
  no_sequence,
  no_terms,
  no_estimator,
  no_draws,
  no_function_of_parameter,
  no_series_term,
  no_markov_step,
  no_path,
  no_nested_draws,
  no_photons,
  no_complex_function,
  no_power_series,
  no_cube_function,
  no_nested_integrand
};

/// One sentence a mistake; `Of` is what it was made with, for one sentence each time.
template <Mistake m, class... Of>
constexpr Refused refuse() {
  static_assert(m != Mistake::by_value,
                "debias: this callable takes its Stream by value, so that every call would get the same numbers; "
                "write (debias::Stream& rng)");
  static_assert(m != Mistake::is_mutable,
                "debias: this callable is mutable: what it changes would be shared by all samples and threads; "
                "leave out `mutable`, and draw from its Stream");
  static_assert(m != Mistake::no_stream,
                "debias: this callable takes no Stream; write (debias::Stream& rng), and draw from it");
  static_assert(m != Mistake::level_by_reference,
                "debias: this sequence takes its level by reference, as if to change it; "
                "write (std::int64_t level, debias::Stream& rng)");
  static_assert(m != Mistake::exchanged_arguments,
                "debias: this sequence takes Stream and level in the wrong order; "
                "write (std::int64_t level, debias::Stream& rng)");
  static_assert(m != Mistake::returns_nothing, "debias: this callable returns nothing; return a value, a double say");
  static_assert(m != Mistake::returns_integer,
                "debias: this callable returns an integer or a bool, which is no value to take a mean of; "
                "return a double, 1.0 or 0.0 say");
  static_assert(m != Mistake::returns_expression,
                "debias: this callable returns an Eigen expression, whose numbers may be gone; "
                "return an array: write -> Eigen::ArrayXd, or the like");
  static_assert(m != Mistake::returns_no_value,
                "debias: what this callable returns is no value: double, float, std::complex, an Eigen array, or a "
                "type with +, - and component_count, component, set_component (debias/core/value.hpp)");
  static_assert(m != Mistake::returns_draw,
                "debias: this callable returns a Draw without taking a level; "
                "a sequence takes (std::int64_t level, debias::Stream& rng)");
  static_assert(m != Mistake::returns_term,
                "debias: this callable returns a Term where a plain value is due; return its value");
  static_assert(m != Mistake::returns_sample,
                "debias: this callable is an estimator: it returns a Sample where a plain value is due; "
                "return the value of its sample");
  static_assert(m != Mistake::returns_no_draw,
                "debias: this sequence does not return a Draw; return debias::base(value) at level 0 and "
                "debias::coupled(fine, coarse) above");
  static_assert(m != Mistake::cursor_without_terms,
                "debias: the cursor of these terms does not return a Term; return debias::Term<double>{value}");
  static_assert(m != Mistake::records_without_sample,
                "debias: this estimator takes a record and does not return a debias::Sample; "
                "return debias::Sample<double>{value, work, level}");
  static_assert(m != Mistake::integer_value,
                "debias: an integer is no value to take a mean of; write base(1.0), coupled(1.0, 0.5)");
  static_assert(m != Mistake::expression_value,
                "debias: an Eigen expression is no value; name the array: debias::base<Eigen::ArrayXd>(...), "
                "debias::coupled<Eigen::ArrayXd>(fine, coarse)");
  static_assert(m != Mistake::no_value,
                "debias: this is no value: double, float, std::complex, an Eigen array, or a type with +, - and "
                "component_count, component, set_component (debias/core/value.hpp)");
  static_assert(
      m != Mistake::two_types,
      "debias: fine and coarse are of two types; make them one, or name it: debias::coupled<V>(fine, coarse)");
  static_assert(m != Mistake::sequence_to_estimate,
                "debias: a sequence is no estimator; write single_term(sequence, pmf) or recipe(sequence) around it");
  static_assert(m != Mistake::terms_to_estimate,
                "debias: the terms of a series are no estimator; write roulette(terms, pmf) around them");
  static_assert(m != Mistake::recipe_to_others,
                "debias: only estimate takes a recipe; elsewhere take estimator_of(sequence, result.advice)");
  static_assert(m != Mistake::not_stratifiable,
                "debias: the level of this estimator cannot be drawn from outside; stratified takes a single_term, or "
                "a roulette or independent_sum with a PMF");
  static_assert(m != Mistake::estimator_to_levels,
                "debias: this is an estimator, not a sequence; give it to estimate as it is");
  static_assert(m != Mistake::random_variable_to_levels,
                "debias: this is a random variable, not a sequence: it takes no level; give it to estimate, or make a "
                "sequence of it: reciprocal(x), function_of_mean(x, g)");
  static_assert(m != Mistake::terms_to_levels,
                "debias: these are terms in order, without levels; write roulette(terms, pmf), or levels_of(terms)");
  static_assert(m != Mistake::levels_to_terms,
                "debias: this is a sequence of levels, not of terms in order; write single_term(sequence, pmf)");
  static_assert(m != Mistake::sequence_to_draws,
                "debias: this is a sequence, where draws of X are due: a callable of (debias::Stream& rng)");
  static_assert(m != Mistake::function_to_draws,
                "debias: this is a function of a number, where draws of X are due: (debias::Stream& rng); for an "
                "integral take function_of_integral or reciprocal_of_integral");
  static_assert(m != Mistake::pmf_first,
                "debias: PMF and sequence are exchanged; the sequence comes first: single_term(sequence, pmf)");
  static_assert(m != Mistake::number_for_pmf,
                "debias: a number is no PMF of the level; write debias::Geometric(0.5), for a ratio of 0.5");
  static_assert(m != Mistake::no_rates,
                "debias: this sequence declares no rates, so its PMF has to be named: debias::Geometric(0.5), say; or "
                "write estimate(recipe(sequence)), which finds one");
  static_assert(m != Mistake::no_pmf,
                "debias: this is no PMF of the level; take debias::Geometric(0.5), debias::Zeta(2.5), or a type with "
                "mass(j), tail(j) and sample(u) (debias/core/pmf.hpp)");
  static_assert(m != Mistake::no_sequence,
                "debias: this is no sequence: a const callable of (std::int64_t level, debias::Stream& rng) that "
                "returns debias::base(value) or debias::coupled(fine, coarse)");
  static_assert(m != Mistake::no_terms,
                "debias: this is no sequence of terms: a const callable of (debias::Stream& rng) that returns a "
                "cursor, whose calls return debias::Term<double>{value}");
  static_assert(m != Mistake::no_estimator,
                "debias: this is no estimator: a const callable of (debias::Stream& rng) that returns a value");
  static_assert(m != Mistake::no_draws,
                "debias: this is no random variable: a const callable of (debias::Stream& rng) that returns a value");
  static_assert(m != Mistake::no_function_of_parameter,
                "debias: this is no function of a parameter: a const callable of (x) or (x, debias::Stream& rng) that "
                "returns a value");
  static_assert(m != Mistake::no_series_term,
                "debias: this is no term of a series: a const callable of (std::int64_t k) or "
                "(std::int64_t k, debias::Stream& rng) that returns a value");
  static_assert(m != Mistake::no_markov_step,
                "debias: this is no step of a Markov chain: a const callable of (state, debias::Stream& rng) that "
                "returns the next state, and f(state) a value");
  static_assert(m != Mistake::no_path,
                "debias: a path takes start(debias::Stream& rng), advance(state, debias::Stream& rng), which returns "
                "the next state, and read(state), which returns a value");
  static_assert(m != Mistake::no_nested_draws,
                "debias: a nested expectation takes outer(debias::Stream& rng), which returns y, and "
                "inner(y, debias::Stream& rng), which returns a value");
  static_assert(m != Mistake::no_photons,
                "debias: this is no photon source: a const callable of (debias::Stream& rng) that returns a "
                "debias::Photon");
  static_assert(m != Mistake::no_complex_function,
                "debias: a complex step takes f(z) or f(z, debias::Stream& rng), a std::complex<double> of one");
  static_assert(m != Mistake::no_cube_function,
                "debias: an integrand over a Cube takes the coordinates of a point, (std::span<const double> x), and "
                "returns a value");
  static_assert(m != Mistake::no_nested_integrand,
                "debias: a nested expectation over a Cube takes outer(debias::Stream& rng), which returns y, and "
                "inner(y, std::span<const double> x), which returns a value");
  static_assert(m != Mistake::no_power_series,
                "debias: this function has no power series; take one of debias::functions, or autodiff<order>(g)");
  return {};
}

template <class T>
using moved_stream_t = std::conditional_t<std::same_as<T, Stream&>, Stream, T>;

/// What keeps f from being called.
template <class F, class... Args>
constexpr Mistake mistake_in_call() {
  if constexpr (std::same_as<F, Refused>) {
    return Mistake::said_before;
  } else if constexpr (std::invocable<const F&, Args...>) {
    return Mistake::none;
  } else if constexpr (std::invocable<F&, Args...>) {
    return Mistake::is_mutable;
  } else if constexpr (std::invocable<F&, moved_stream_t<Args>...>) {
    return Mistake::by_value;
  } else {
    return Mistake::not_callable;
  }
}

constexpr bool is_said(Mistake m) { return m != Mistake::none && m != Mistake::not_callable; }

template <class F, class... Args>
using result_t = std::remove_cvref_t<std::invoke_result_t<const F&, Args...>>;

/// What keeps a type from being a Value.
template <class R>
constexpr Mistake mistake_in_value() {
  if constexpr (std::same_as<R, Refused>) {
    return Mistake::said_before;
  } else if constexpr (std::is_void_v<R>) {
    return Mistake::returns_nothing;
  } else if constexpr (Value<R>) {
    return Mistake::none;
  } else if constexpr (std::integral<R>) {
    return Mistake::returns_integer;
  } else if constexpr (is_draw<R>) {
    return Mistake::returns_draw;
  } else if constexpr (is_term<R>) {
    return Mistake::returns_term;
  } else if constexpr (is_sample<R>) {
    return Mistake::returns_sample;
  } else if constexpr (requires { typename R::PlainObject; }) {
    return Mistake::returns_expression;
  } else {
    return Mistake::returns_no_value;
  }
}

/// What keeps a callable from returning a Value.
template <class F, class... Args>
constexpr Mistake mistake_in_function() {
  constexpr Mistake call = mistake_in_call<F, Args...>();
  if constexpr (call != Mistake::none) {
    return call;
  } else {
    return mistake_in_value<result_t<F, Args...>>();
  }
}

constexpr Mistake first_of(Mistake m, Mistake otherwise) { return is_said(m) ? m : otherwise; }

/// Only one that is no template can be asked whether it takes its arguments in another order.
template <class F>
concept TakesStreamFirst = std::is_pointer_v<F> || requires {
  &F::operator();
};

/// What keeps F from being a BiasedSequence.
template <class S>
constexpr Mistake mistake_in_levels() {
  constexpr Mistake call = mistake_in_call<S, const std::int64_t&, Stream&>();
  if constexpr (Pmf<S>) {
    return Mistake::pmf_first;
  } else if constexpr (call == Mistake::none) {
    return mistake_in_value<result_t<S, const std::int64_t&, Stream&>>() == Mistake::said_before
               ? Mistake::said_before
               : Mistake::returns_no_draw;
  } else if constexpr (call != Mistake::not_callable) {
    return call;
  } else if constexpr (std::invocable<S&, std::int64_t&, Stream&> || std::invocable<S&, int&, Stream&>) {
    return Mistake::level_by_reference;
  } else if constexpr (TermSequence<S>) {
    return Mistake::terms_to_levels;
  } else if constexpr (RandomVariable<S>) {
    return Mistake::random_variable_to_levels;
  } else if constexpr (Estimator<S>) {
    return Mistake::estimator_to_levels;
  } else if constexpr (is_said(mistake_in_call<S, Stream&>())) {
    return mistake_in_call<S, Stream&>();
  } else if constexpr (TakesStreamFirst<S>) {
    if constexpr (std::invocable<S&, Stream&, std::int64_t> || std::invocable<S&, Stream, std::int64_t>) {
      return Mistake::exchanged_arguments;
    } else if constexpr (std::invocable<S&, std::int64_t>) {
      return Mistake::no_stream;
    } else {
      return Mistake::no_sequence;
    }
  } else {
    return Mistake::no_sequence;
  }
}

/// What keeps S from being a TermSequence.
template <class S>
constexpr Mistake mistake_in_terms() {
  constexpr Mistake call = mistake_in_call<S, Stream&>();
  if constexpr (Pmf<S>) {
    return Mistake::pmf_first;
  } else if constexpr (call == Mistake::none) {
    if constexpr (requires(const S& s, Stream& rng) { s(rng)(); }) {
      return Mistake::cursor_without_terms;
    } else {
      return Mistake::no_terms;
    }
  } else if constexpr (call != Mistake::not_callable) {
    return call;
  } else if constexpr (BiasedSequence<S>) {
    return Mistake::levels_to_terms;
  } else {
    return first_of(mistake_in_call<S, const std::int64_t&, Stream&>(), Mistake::no_terms);
  }
}

/// What keeps P from being a PMF (of a sequence that is one).
template <class P>
constexpr Mistake mistake_in_pmf() {
  if constexpr (std::same_as<P, Refused>) return Mistake::said_before;
  return std::is_arithmetic_v<P> ? Mistake::number_for_pmf : Mistake::no_pmf;
}

/// Of a door that takes a sequence and a PMF.
template <class S, class P>
constexpr Mistake mistake_in_levels_and_pmf() {
  if constexpr (BiasedSequence<S>) {
    return mistake_in_pmf<P>();
  } else {
    return mistake_in_levels<S>();
  }
}
template <class S, class P>
constexpr Mistake mistake_in_terms_and_pmf() {
  if constexpr (TermSequence<S>) {
    return mistake_in_pmf<P>();
  } else {
    return mistake_in_terms<S>();
  }
}
/// Of one that takes a sequence with its rates.
template <class S>
constexpr Mistake mistake_in_rated_levels() {
  if constexpr (BiasedSequence<S>) {
    return Mistake::no_rates;
  } else {
    return mistake_in_levels<S>();
  }
}
template <class S>
constexpr Mistake mistake_in_rated_terms() {
  if constexpr (TermSequence<S>) {
    return Mistake::no_rates;
  } else {
    return mistake_in_terms<S>();
  }
}

/// What keeps X from being a RandomVariable.
template <class X>
constexpr Mistake mistake_in_draws() {
  if constexpr (BiasedSequence<X> || TermSequence<X>) {
    return Mistake::sequence_to_draws;
  } else {
    constexpr Mistake m = mistake_in_function<X, Stream&>();
    if constexpr (m != Mistake::not_callable) {
      return m;
    } else if constexpr (std::invocable<X&>) {
      return Mistake::no_stream;
    } else if constexpr (std::invocable<X&, double>) {
      return Mistake::function_to_draws;
    } else {
      return first_of(mistake_in_call<X, const std::int64_t&, Stream&>(), Mistake::no_draws);
    }
  }
}

template <class E>
inline constexpr bool is_recipe = false;  // recipe.hpp knows one

/// What keeps E from being an Estimator.
template <class E>
constexpr Mistake mistake_in_estimator() {
  constexpr Mistake draws = mistake_in_function<E, Stream&>();
  constexpr Mistake records = mistake_in_call<E, Stream&, NullRecord&>();
  if constexpr (is_recipe<E>) {
    return Mistake::recipe_to_others;
  } else if constexpr (BiasedSequence<E>) {
    return Mistake::sequence_to_estimate;
  } else if constexpr (TermSequence<E>) {
    return Mistake::terms_to_estimate;
  } else if constexpr (is_said(draws)) {
    return draws;
  } else if constexpr (is_said(records)) {
    return records;
  } else if constexpr (records == Mistake::none) {
    return Mistake::records_without_sample;
  } else if constexpr (std::invocable<E&>) {
    return Mistake::no_stream;
  } else if constexpr (is_said(mistake_in_call<E, const std::int64_t&, Stream&>())) {
    return mistake_in_call<E, const std::int64_t&, Stream&>();
  } else if constexpr (std::invocable<E&, const std::int64_t&, Stream&>) {
    return mistake_in_levels<E>();
  } else {
    return Mistake::no_estimator;
  }
}

/// What keeps `f(args...)` or `f(args..., rng)` from being a Value.
template <class F, Mistake otherwise, class... Args>
constexpr Mistake mistake_in_parameter_function() {
  constexpr Mistake with = mistake_in_function<F, Args..., Stream&>();
  return is_said(with) ? with : first_of(mistake_in_function<F, Args...>(), otherwise);
}

/// What keeps numbers from being those of a Draw.
template <class T, class U>
constexpr Mistake mistake_in_numbers() {
  if constexpr (std::integral<T> || std::integral<U>) {
    return Mistake::integer_value;
  } else if constexpr (
      requires { typename T::PlainObject; } || requires { typename U::PlainObject; }) {
    return Mistake::expression_value;
  } else {
    return std::same_as<T, U> ? Mistake::no_value : Mistake::two_types;
  }
}
template <class T, class U>
constexpr auto refuse_numbers() {
  if constexpr (std::is_arithmetic_v<T> &&
                std::is_arithmetic_v<U>) {  // so that the sequence is one, and nothing else is said
    refuse<mistake_in_numbers<T, U>(), T, U>();
    return Draw<double>{};
  } else {
    return refuse<mistake_in_numbers<T, U>(), T, U>();
  }
}

}  // namespace debias::detail

namespace debias {

// The first parameter leaves base<V>(...) and coupled<V>(...), which convert, to the others.
template <int = 0, class T>
requires(!Value<T>) auto base(const T& /*value*/, double /*work*/ = 1) { return detail::refuse_numbers<T, T>(); }
template <int = 0, class T, class U>
requires(!Value<T> || !std::same_as<T, U>) auto coupled(const T& /*fine*/, const U& /*coarse*/, double /*work*/ = 1) {
  return detail::refuse_numbers<T, U>();
}

template <class S>
requires(!TermSequence<S>) auto levels_of(const S& /*terms*/) {
  return detail::refuse<detail::mistake_in_terms<S>(), S>();
}

}  // namespace debias

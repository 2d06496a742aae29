#pragma once

// From a sequence to a Problem: the estimators that apply to it, erased to one call a run.

#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/estimate.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/roulette.hpp>

#include "../catalog.hpp"
#include "any_levels.hpp"

namespace debias::catalog {

inline double squared(double x) { return x * x; }

/// What a problem is called and what is known of it.
struct Facts {
  std::string id = {};
  std::string name = {};
  std::string module = {};
  double truth = 0;
  std::string formula = {};
  std::int64_t lowest_base = 0;
};

namespace detail {

/// In catalog.cpp, once for all problems: `run` and `trace` of a problem, and one more method of it.
void set_runs(Problem& p, std::function<void(const Choice&, Task&)> work);
void add_special(Problem& p, Special special, std::function<void(Task&)> work);

/// `terms` is the same sequence as a series, or NoTerms.
template <class Terms, BiasedSequence S>
Problem make(Facts facts, const S& sequence, [[maybe_unused]] const Terms& terms, const Rates& rates) {
  Problem p;
  p.id = std::move(facts.id);
  p.name = std::move(facts.name);
  p.module = std::move(facts.module);
  p.truth = facts.truth;
  p.formula = std::move(facts.formula);
  p.lowest_base = facts.lowest_base;
  p.rates = rates;
  p.methods = {Method::single_term, Method::single_term_outcome, Method::independent_sum};
  if constexpr (TermSequence<Terms>) p.methods.push_back(Method::roulette);
  p.methods.push_back(Method::truncated);
  const auto levels = any_levels(sequence);
  if constexpr (TermSequence<Terms>) {
    set_runs(p, [levels, terms](const Choice& choice, Task& task) {
      if (choice.method != Method::roulette || !choice.special.empty()) return levels.carry_out(choice, task);
      carry_out(roulette(terms, choice.pmf, {.base_level = choice.base_level}), task);
    });
  } else {
    set_runs(p, [levels](const Choice& choice, Task& task) { levels.carry_out(choice, task); });
  }
  p.pilot = [levels](std::int64_t level, std::int64_t draws, std::uint64_t seed) {
    return levels.pilot(level, draws, seed);
  };
  p.levels = levels.runs();
  if constexpr (requires { S::plain_inside; }) p.levels.plain_inside = S::plain_inside;
  return p;
}

struct NoTerms {};

}  // namespace detail

/// A problem from a sequence that declares its rates; from a series, roulette applies too.
template <class S>
requires DeclaresRates<S> Problem make(Facts facts, const S& sequence) {
  if constexpr (BiasedSequence<S> && TermSequence<S>) {
    return detail::make(std::move(facts), sequence, sequence, sequence.rates);
  } else if constexpr (BiasedSequence<S>) {
    return detail::make(std::move(facts), sequence, detail::NoTerms{}, sequence.rates);
  } else {
    const auto levels = levels_of(sequence);
    return detail::make(std::move(facts), levels, sequence, levels.rates);
  }
}

/// A problem from a callable that declares no rates of its own, or those of another g.
template <BiasedSequence S>
Problem make(Facts facts, S sequence, const Rates& rates) {
  if constexpr (DeclaresRates<S>) sequence.rates = rates;
  return detail::make(std::move(facts), sequence, detail::NoTerms{}, rates);
}

/// Gives a problem a method of its own: an estimator that needs neither PMF nor level from outside.
template <Estimator E>
void add(Problem& p, Special special, const E& e) {
  detail::add_special(p, std::move(special), [e](detail::Task& task) { detail::carry_out(e, task); });
}

}  // namespace debias::catalog

#pragma once

// From a sequence to a Problem: the estimators that apply to it, erased to one call a run.

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <debias/core/estimate.hpp>
#include <debias/core/sequence.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/estimators/truncated.hpp>

#include "../catalog.hpp"

namespace debias::catalog {

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

template <BiasedSequence S>
LevelSums pilot(const S& sequence, std::int64_t level, std::int64_t draws, std::uint64_t seed) {
  LevelSums sums;
  for (std::int64_t i = 0; i < draws; ++i) {
    const Stream sample = split(Stream(seed, static_cast<std::uint64_t>(i)), Branch::pilot);
    Stream rng = split_level(sample, level);
    const auto term = difference_of(sequence, level, rng);
    debias::detail::check_work(level, term.work);
    sums.add(as_scalar(term.value), term.work);
  }
  return sums;
}

/// A run or a trace. Both are asked for in one call: the estimators of a problem are made in one place, once.
struct Task {
  const Plan* plan = nullptr;  ///< of a run; null for a trace
  std::uint64_t seed = 0;
  std::int64_t index = 0;
  Statistics statistics = {};
  Trace<double> trace = {};
};

template <Estimator E>
void carry_out(const E& e, Task& task) {
  if (task.plan != nullptr) {
    task.statistics = estimate(e, *task.plan);
  } else {
    task.trace = debias::trace(e, task.seed, task.index);
  }
}

/// In catalog.cpp, once for all problems: `run` and `trace` of a problem, and one more method of it.
void set_runs(Problem& p, std::function<void(const Choice&, Task&)> work);
void add_special(Problem& p, Special special, std::function<void(Task&)> work);

// Calls `use` with the estimator that a choice names. `terms` is the same sequence as a series, or void.
template <class Terms, BiasedSequence S, class Use>
void with_estimator(const S& sequence, const Terms& terms, const Choice& c, const Use& use) {
  switch (c.method) {
    case Method::single_term:
    case Method::single_term_outcome: {
      const Base base = c.method == Method::single_term ? Base::every_sample : Base::one_outcome;
      const auto member = single_term(sequence, c.pmf, {.base_level = c.base_level, .base = base});
      const bool counts = c.points == Points::nets && c.pmf.block() > 0;
      return c.block > 1 ? use(stratified(member, c.block, counts ? Strata::residual : Strata::systematic, c.points))
                         : use(member);
    }
    case Method::independent_sum:
      return use(independent_sum(sequence, c.pmf, {.base_level = c.base_level}));
    case Method::roulette:
      if constexpr (TermSequence<Terms>) {
        return use(roulette(terms, c.pmf, {.base_level = c.base_level}));
      } else {
        throw std::invalid_argument(
            "roulette: this problem has levels, not terms in order (roulette needs a series); try "
            "independent_sum");
      }
    case Method::truncated:
      break;
  }
  return use(truncated(sequence, c.base_level));
}

template <class Terms, BiasedSequence S>
Problem make(Facts facts, const S& sequence, const Terms& terms, const Rates& rates) {
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
  set_runs(p, [sequence, terms](const Choice& choice, Task& task) {
    with_estimator(sequence, terms, choice, [&task](const auto& e) { carry_out(e, task); });
  });
  p.pilot = [sequence](std::int64_t level, std::int64_t draws, std::uint64_t seed) {
    return pilot(sequence, level, draws, seed);
  };
  p.levels = level_runs(sequence);
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

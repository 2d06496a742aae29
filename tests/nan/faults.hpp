#pragma once

// Callables that now and then return what is no number, and the check that no estimator hides it.
//
//   const auto x = [](Stream& rng) { return bad(rng.uniform()); };      // in one call of a hundred NaN or infinity
//   check("function_of_mean", "x", single_term(function_of_mean(x, functions::Log{})));
//
// A sample in which a callable returned NaN is not finite, or throws; infinity likewise, unless the header names the
// finite limit. The faults are drawn from a stream of their own and counted here, sample by sample, so that nobody but
// the test says how many there were. tests/nan_covered_test.sh holds the names of factories against the headers.

#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <set>
#include <string>
#include <type_traits>

#include "../catch_shim.hpp"

#include <debias/core/estimator.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/progressive.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/pmf/geometric.hpp>

#include "catalog/any_levels.hpp"

namespace debias::faults {

class Faults {
 public:
  void begin(double poison) {
    poison_ = poison;
    returned_ = 0;
    on_ = true;
  }
  /// How many times the poison was returned since.
  std::int64_t end() {
    on_ = false;
    return returned_;
  }
  double operator()(double right) {
    if (!on_ || !(decisions_.uniform() < probability)) return right;
    ++returned_;
    return poison_;
  }

 private:
  static constexpr double probability = 0.01;
  double poison_ = 0;
  bool on_ = false;
  std::int64_t returned_ = 0;
  Stream decisions_{2026, 18};
};

/// One thread draws here.
inline Faults faults;

/// What a callable returns; in the samples of a check, in one call of a hundred, something else.
inline double bad(double right) { return faults(right); }

/// What became of an infinity: a header may name its finite limit.
enum class Infinity { reaches_the_mean, has_a_limit };

inline constexpr double poisons[] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                                     -std::numeric_limits<double>::infinity()};

/// Samples with a fault, and those of them that did not show it.
struct Outcome {
  int faulty = 0;
  int silent = 0;
};

template <Estimator E>
Outcome outcome_of(const E& e, double poison, int most_samples = 3000) {
  Outcome outcome;
  for (int i = 0; i < most_samples && outcome.faulty < 25; ++i) {
    Stream rng(7, static_cast<std::uint64_t>(i));
    NullRecord record;
    bool shows = false;
    faults.begin(poison);
    try {
      const auto sample = draw_sample(e, rng, record);
      shows = !std::isfinite(as_scalar(sample.value));
    } catch (const std::exception&) {
      shows = true;
    }
    if (faults.end() == 0) continue;
    ++outcome.faulty;
    if (!shows) ++outcome.silent;
  }
  return outcome;
}

/// The factories and callables of a file.
struct Covered {
  std::set<std::string> factories;
  std::set<std::string> callables;
};
inline Covered covered;

/// Counts a callable of a factory as covered.
inline void covers(const std::string& factory, const std::string& callable) {
  covered.factories.insert(factory);
  covered.callables.insert(factory + ": " + callable);
}

template <Estimator E>
void check(const std::string& factory, const std::string& callable, const E& e,
           Infinity infinity = Infinity::reaches_the_mean) {
  covers(factory, callable);
  for (const double poison : poisons) {
    if (std::isinf(poison) && infinity == Infinity::has_a_limit) continue;
    INFO(factory << ", " << callable << " returns " << poison << " in " << description(e));
    const Outcome outcome = outcome_of(e, poison);
    CHECK(outcome.faulty > 0);
    CHECK(outcome.silent == 0);
  }
}

/// A sequence under every estimator of sequences: batches, shared bases and bases alone are code paths of their own.
template <BiasedSequence S>
void check_sequence(const std::string& factory, const std::string& callable, const S& sequence,
                    Infinity infinity = Infinity::reaches_the_mean) {
  // Those of double are erased: each estimator is compiled once for all of a file.
  const auto s = [&] {
    if constexpr (std::is_same_v<sequence_value_t<S>, double> && !debias::detail::ReportsValues<S>) {
      return catalog::detail::any_levels(sequence);
    } else {
      return sequence;
    }
  }();
  const Geometric pmf(0.6);
  check(factory, callable, single_term(s, pmf), infinity);
  check(factory, callable, single_term(s, pmf, {.base_level = 1, .base = Base::one_outcome}), infinity);
  check(factory, callable, independent_sum(s, pmf), infinity);
  check(factory, callable, stratified(single_term(s, pmf), 8), infinity);
  check(factory, callable, stratified(single_term(s, pmf, {.base = Base::one_outcome}), 8, Strata::residual), infinity);
  check(factory, callable, truncated(s, 2), infinity);
  check(factory, callable, biased_progressive(s, {.first_step = 4}), infinity);
  check(factory, callable, progressive(s, pmf, {.first_step = 512}), infinity);
}

/// The same for the terms of a series.
template <TermSequence S>
void check_terms(const std::string& factory, const std::string& callable, const S& terms,
                 Infinity infinity = Infinity::reaches_the_mean) {
  const Geometric pmf(0.4);
  check(factory, callable, roulette(terms, pmf), infinity);
  check(factory, callable, roulette(terms, pmf, {.base_level = 2}), infinity);
  if constexpr (!requires { terms.require(TailExponent{}); }) {  // terms that fall like powers refuse it
    check(factory, callable, roulette(terms, IndexRoulette(2)), infinity);
  }
  check(factory, callable, roulette(terms, RunningWeight(0.5)), infinity);
  check(factory, callable, stratified(roulette(terms, pmf), 8), infinity);
  check(factory, callable, single_term(levels_of(terms), pmf), infinity);
}

}  // namespace debias::faults

#pragma once

// Counts what runs with different seeds said of one truth.

#include <algorithm>
#include <cstdint>
#include <stdexcept>

#include <debias/core/estimate.hpp>
#include <debias/recipe.hpp>

namespace debias::test {

struct Tally {
  int runs = 0;
  int refused = 0;
  int covered = 0;
  int reliable = 0;
  int reliable_and_missed = 0;
  int finite = 0;
  int finite_shown = 0;
  int infinite = 0;
  int shown = 0;  // answers of the pilot
  int open = 0;
  double widest = 0;  // half-width of an interval
};

template <Value V>
void count(Tally& t, const Result<V>& r, double truth) {
  const RunVerdict v = r.verdict();
  const Interval i = r.interval(v);
  const bool in = i.low <= truth && truth <= i.high;
  t.covered += in;
  t.reliable += v.interval_reliable();
  t.reliable_and_missed += v.interval_reliable() && !in;
  t.finite += v.variance == Finiteness::finite;
  t.finite_shown += v.variance == Finiteness::finite && v.grade == Grade::shown;
  t.infinite += v.variance == Finiteness::infinite;
  t.widest = std::max(t.widest, (i.high - i.low) / 2);
}

template <BiasedSequence S>
Tally by_recipe(const S& sequence, double truth, const Plan& plan, int seeds, const RecipeOptions& options = {}) {
  Tally t;
  for (int seed = 1; seed <= seeds; ++seed) {
    ++t.runs;
    try {
      Plan one = plan;
      one.seed = static_cast<std::uint64_t>(seed);
      const auto r = estimate(recipe(sequence, options), one);
      t.shown += r.advice.survey.grade == Grade::shown;
      t.open += r.advice.survey.grade == Grade::open;
      count(t, r, truth);
    } catch (const std::invalid_argument&) {
      ++t.refused;
    }
  }
  return t;
}

}  // namespace debias::test

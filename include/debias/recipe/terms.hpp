#pragma once

// From a series of random terms to its roulette: how many terms to take before it, and how fast to stop after.
//
//   Z = sum_(k <= m) T_k + sum_(k > m) T_k / s^(k - m),  on with probability s a term
//   Var Z = Var I + sum_(k > m) nu_k (s^(m - k) - 1),  nu_k = E (I - I_(k-1))^2 - E (I - I_k)^2   [Rhee & Glynn 2015 (5)]
//
//   Notation: I = all terms of one path (of one probe), m = base level, s = survival.
// Var I is the noise of the probes, which no number of terms lowers; the rest is that of stopping, which no quieter probe
// lowers. A pilot measures both on a few paths, and takes the m and s with the least variance x work: little roulette where
// probes are the noise already, much prefix where they are not. Work per sample and shares are printed.
// Assumes that the terms of a path fall as declared beyond those that the pilot saw. The pilot draws from streams of its own,
// so the run knows nothing of it. Paths: 8 know a variance to a factor of 1.5, and the product of variance and work is flat.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/pmf/geometric.hpp>

namespace debias {

/// What the pilot measured, and the roulette that it chose.
struct WorkSplit {
  std::int64_t base_level = 0;   ///< the terms 0 ... base_level are always taken
  double survival = 0.5;         ///< of each term beyond
  double probe_variance = 0;     ///< of a sample that takes all terms
  double stopping_variance = 0;  ///< what the roulette adds
  double work = 0;               ///< of a sample, expected
  double pilot_work = 0;
  std::int64_t paths = 0;  ///< of the pilot

  /// The part of the variance that more or quieter probes lower, and longer paths do not.
  [[nodiscard]] double probe_share() const {
    const double all = probe_variance + stopping_variance;
    return all > 0 ? probe_variance / all : 1;
  }
  /// Which of the two is the noise, and what would help.
  [[nodiscard]] std::string sentence() const;
};

std::ostream& operator<<(std::ostream& out, const WorkSplit& split);

struct WorkSplitOptions {
  std::uint64_t seed = 1;
  std::int64_t paths = 8;  ///< of the pilot: more know the shares better, and cost as many samples without roulette
};

namespace detail {

/// The terms of one path, as far as the pilot went: by level, component by component.
struct PathTerms {
  std::vector<double> terms;
  std::vector<double> work;
};
/// The choice from paths of equal length; `decay` = E D_k^2 over that of the level before, beyond them.
WorkSplit choose_split(std::span<const PathTerms> paths, std::size_t components, double decay);

[[noreturn]] void refuse_split(const std::string& why);

template <TermSequence S>
class PilotPath {
 public:
  PilotPath(const S& terms, std::uint64_t seed, std::int64_t index)
      : rng_(split_level(split(Stream(seed, static_cast<std::uint64_t>(index)), Branch::pilot), 0)),
        cursor_(terms(rng_)) {}
  PilotPath(const PilotPath&) = delete;
  PilotPath& operator=(const PilotPath&) = delete;

  void advance() {
    auto term = cursor_();
    components_ = component_count(term.value);
    if (sum_.empty()) sum_.resize(components_);
    last_ = 0;
    for (std::size_t c = 0; c < components_; ++c) {
      const double x = component(term.value, c);
      found_.terms.push_back(x);
      sum_[c] += x;
      if (!std::isfinite(x)) refuse_split("a term is not finite (the operator, or f, is not)");
      last_ = std::max(last_, std::abs(x));
    }
    found_.work.push_back(term.work);
  }
  [[nodiscard]] std::size_t levels() const { return found_.work.size(); }
  [[nodiscard]] std::size_t components() const { return components_; }
  [[nodiscard]] const std::vector<double>& sum() const { return sum_; }
  [[nodiscard]] double last() const { return last_; }
  [[nodiscard]] const PathTerms& found() const { return found_; }

 private:
  Stream rng_;
  decltype(std::declval<const S&>()(std::declval<Stream&>())) cursor_;
  PathTerms found_;
  std::vector<double> sum_;
  std::size_t components_ = 0;
  double last_ = 0;
};

}  // namespace detail

/// Runs the pilot and chooses. Throws std::invalid_argument for fewer than two paths, terms that are not finite, and terms that do
/// not fall within 10^6 of them.
template <TermSequence S>
requires DeclaresRates<S> WorkSplit split_work(const S& terms, const WorkSplitOptions& options = {}) {
  if (options.paths < 2) {
    detail::refuse_split("paths = " + std::to_string(options.paths) + " (two or more show a variance)");
  }
  constexpr std::size_t longest = 1'000'000;
  // Two paths side by side show how far the terms have to fall: below a twentieth of what the paths differ by.
  std::vector<detail::PathTerms> paths;
  std::size_t levels = 0;
  std::size_t components = 0;
  {
    detail::PilotPath<S> one(terms, options.seed, 0);
    detail::PilotPath<S> two(terms, options.seed, 1);
    for (int small = 0; small < 3;) {
      one.advance();
      two.advance();
      double apart = 0;
      double size = 0;
      for (std::size_t c = 0; c < one.components(); ++c) {
        apart = std::max(apart, std::abs(one.sum()[c] - two.sum()[c]));
        size = std::max(size, std::abs(one.sum()[c]));
      }
      const double last = std::max(one.last(), two.last());
      small = one.levels() > 1 && last <= std::max(apart / 20, 1e-13 * size) ? small + 1 : 0;
      if (one.levels() == longest)
        detail::refuse_split("10^6 terms do not fall (is the interval of the spectrum true?)");
    }
    levels = one.levels();
    components = one.components();
    paths.push_back(one.found());
    paths.push_back(two.found());
  }
  for (std::int64_t i = 2; i < options.paths; ++i) {
    detail::PilotPath<S> path(terms, options.seed, i);
    while (path.levels() < levels) path.advance();
    paths.push_back(path.found());
  }
  const Rates rates = terms.rates;
  return detail::choose_split(paths, components, std::exp2(-rates.variance_decay));
}

/// The roulette that a split names.
template <TermSequence S>
Roulette<S, Geometric> estimator_of(S terms, const WorkSplit& split) {
  return roulette(std::move(terms), Geometric(1 - split.survival), {.base_level = split.base_level});
}

/// The description of an estimate of a series that chooses its own roulette.
template <TermSequence S>
struct TermRecipe {
  S terms;
  WorkSplitOptions options;
};

template <TermSequence S>
requires(!BiasedSequence<S> && DeclaresRates<S>) TermRecipe<S> recipe(S terms, const WorkSplitOptions& options = {}) {
  return {std::move(terms), options};
}

/// A result with the split that it followed. `slow_terms` of it belongs to what is printed.
template <Value V>
struct TermRecipeResult : Result<V> {
  WorkSplit split;
};

/// What the levels of a run say against the declared decay of its terms: a sentence, or nothing. A straight line through
/// log2 E D_k^2 of the upper half of the levels, more than 4.5 standard errors and a tenth below the declared one. Of terms of an
/// operator it means that an eigenvalue lies outside of the interval: the mean stays right, variance and work do not.
std::string slow_terms(const Statistics& result);

/// Result, split, and what speaks against the declared decay.
void print_terms(std::ostream& out, const Statistics& result, const WorkSplit& split);

template <Value V>
std::ostream& operator<<(std::ostream& out, const TermRecipeResult<V>& result) {
  print_terms(out, result, result.split);
  return out;
}

/// Pilot, choice and run. The pilot counts in the work and the seconds of the result. Throws as split_work and `estimate` do.
template <TermSequence S>
TermRecipeResult<sequence_value_t<S>> estimate(const TermRecipe<S>& recipe, const Plan& plan = {}) {
  WorkSplitOptions options = recipe.options;
  options.seed = plan.seed;
  const auto start = std::chrono::steady_clock::now();
  WorkSplit split = split_work(recipe.terms, options);
  const double pilot_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  Plan run = plan;
  run.pilot += {split.pilot_work, pilot_seconds};
  auto result = debias::estimate(debias::estimator_of(recipe.terms, split), run);
  return {std::move(result), std::move(split)};
}

}  // namespace debias

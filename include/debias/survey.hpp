#pragma once

// The table of a sequence, level by level, and what it says: how fast do differences decay and does work grow?
//
//   per level   mean and variance of I_k and D_k, E D_k^2, kurtosis E D_k^4 / (E D_k^2)^2, work, seconds
//   z           E[I_k - D_k] = E[I_(k-1)], from independent draws, in standard errors: 0 +- 1 for a right coupling
//   rates       weighted regression of log2 E D_k^2, |E D_k|, E D_k^4, work on k (or on log2(k + 1))
//   answer      a law with finite variance and work exists when beta > gamma: yes, no, or cannot tell yet
//
//   Notation: alpha, beta, beta4, gamma = MeasuredRates::mean, variance, fourth, work.
// A level votes when it has ten times its kurtosis in draws; shallow levels leave the fit until chi-square passes.
// Fails, as any extrapolation does, when the levels that were drawn are not yet asymptotic: it then says so.
// Sources: Giles, Acta Numerica 24 (2015), section 3 (table and consistency check); the rest derived here.

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream_batch.hpp>

namespace debias {

enum class Answer { yes, no, cannot_tell };
/// "yes", "no", "cannot tell".
const char* name_of(Answer answer);
/// "geometric", "polynomial", "exact zero", "super-exponential".
const char* name_of(RateKind kind);

/// What was measured of one level. Of a value with several components: means by norm, variances by sum.
struct SurveyRow {
  std::int64_t level = 0;
  std::int64_t draws = 0;
  double mean = 0;      ///< of I_k
  double variance = 0;  ///< of I_k
  double mean_error = 0;
  double difference = 0;  ///< E D_k
  double difference_error = 0;
  double difference_variance = 0;
  double second_moment = 0;  ///< E D_k^2
  double second_moment_error = 0;
  double kurtosis = 0;           ///< E D_k^4 / (E D_k^2)^2; 0 where no difference was seen
  double nonzero = 0;            ///< share of the draws with a difference that is not zero
  double consistency = 0;        ///< z of E[I_k - D_k] = E[I_(k-1)]; 0 at the first level
  double difference_work = 0;    ///< of a draw of D_k
  double value_work = 0;         ///< of a draw of I_k alone
  double seconds = 0;            ///< of a draw of both, on one thread or all
  bool votes = false;            ///< draws >= 10 x kurtosis, and not all of them zero
  bool fitted = false;           ///< takes part in the fitted rates
  std::vector<ComponentEstimate> values{};  ///< of I_k, by component
  std::vector<ComponentEstimate> coarse{};  ///< of its coarse partner, I_k - D_k
};

struct Survey {
  std::vector<SurveyRow> rows;
  MeasuredRates rates;
  Answer law_exists = Answer::cannot_tell;
  std::vector<std::string> remarks;  ///< in words: pre-asymptotic levels, exact zeros, a coupling that is wrong
  std::uint64_t seed = 0;
  double work = 0;     ///< of all draws
  double seconds = 0;  ///< of all draws
};

/// The table, the rates and the remarks, as text.
std::ostream& operator<<(std::ostream& out, const Survey& survey);

/// A base and a difference that share their draws.
struct SharedMoments {
  double base_variance = 0;  ///< of the base
  double covariance = 0;     ///< of base and difference
  double work = 0;           ///< of a draw
};

/// What is left of the variance of a draw where 1, 2, 4, ... members of a level run together, stratified by their first
/// number: shares of the first entry. Empty where nobody has looked.
struct StrataMoments {
  static constexpr std::int64_t most_members = 1024;
  std::vector<double> base_left;        ///< of I_m, or of the base that is shared
  std::vector<double> difference_left;  ///< of D_k
  double work = 0;                      ///< of all draws
};

/// The levels of a sequence behind one call a level, whatever its type. Level k of sample i draws from the pilot
/// streams: no sample of an estimator ever sees them.
struct LevelRuns {
  /// Draws plan.samples times (I_k, D_k).
  std::function<Statistics(std::int64_t level, const Plan& plan)> draw;
  /// Mean work of I_k alone and of D_k alone over a few draws.
  std::function<std::pair<double, double>(std::int64_t level, const Plan& plan)> work;
  /// Empty where the sequence has no shared base.
  std::function<SharedMoments(std::int64_t level, std::int64_t base_level, const Plan& plan)> shared;
  /// Draws plan.samples times that many members (a power of two, at most StrataMoments::most_members) of a level, and of
  /// its base. Empty where the members of a stratified block do not run together.
  std::function<StrataMoments(std::int64_t level, std::int64_t base_level, std::int64_t members, const Plan& plan)> together;
};

namespace detail {

/// Some values and numbers as one value, so that one run gives the moments of each.
template <Value V, std::size_t n>
struct Several {
  std::array<V, n> parts;
  double flag = 0;

  friend Several operator+(Several a, const Several& b) {
    for (std::size_t i = 0; i < n; ++i) a.parts[i] = sum(std::move(a.parts[i]), b.parts[i]);
    a.flag += b.flag;
    return a;
  }
  friend Several operator-(Several a, const Several& b) {
    for (std::size_t i = 0; i < n; ++i) a.parts[i] = debias::difference(std::move(a.parts[i]), b.parts[i]);
    a.flag -= b.flag;
    return a;
  }
  friend std::size_t component_count(const Several& s) { return n * debias::component_count(s.parts[0]) + 1; }
  friend double component(const Several& s, std::size_t i) {
    const std::size_t each = debias::component_count(s.parts[0]);
    return i / each < n ? debias::component(s.parts[i / each], i % each) : s.flag;
  }
  friend void set_component(Several& s, std::size_t i, double x) {
    const std::size_t each = debias::component_count(s.parts[0]);
    if (i / each < n) {
      debias::set_component(s.parts[i / each], i % each, x);
    } else {
      s.flag = x;
    }
  }
};

/// I_k, its coarse partner, D_k, and whether D_k is not zero.
template <BiasedSequence S>
struct LevelDraw {
  using V = sequence_value_t<S>;
  const S& sequence;
  std::int64_t level;

  template <Record R>
  Sample<Several<V, 3>> operator()(Stream& rng, R& record) const {
    Stream own = split_level(split(rng, Branch::pilot), level);
    auto draw = sequence(level, own);
    const double size = as_scalar(draw.difference);
    record.difference(level, size, draw.work);
    V coarse = debias::difference(draw.value, draw.difference);
    return {{{std::move(draw.value), std::move(coarse), std::move(draw.difference)}, size != 0 ? 1.0 : 0.0},
            draw.work,
            level};
  }
};

/// The shared base, D_k, and their sum.
template <BiasedSequence S>
struct SharedLevelDraw {
  using V = sequence_value_t<S>;
  const S& sequence;
  std::int64_t level;
  std::int64_t base_level;

  Sample<Several<V, 3>> operator()(Stream& rng) const {
    Stream own = split_level(split(rng, Branch::pilot), level);
    auto both = sequence.shared(level, base_level, own);
    V total = sum(both.base, both.difference);
    return {{{std::move(both.base), std::move(both.difference), std::move(total)}, 0}, both.work, level};
  }
};

constexpr std::size_t strata_octaves = std::bit_width(static_cast<std::uint64_t>(StrataMoments::most_members)) - 1;

/// Variances within 1, 2, 4, ... strata, of values in the order of these; a power of two of them, which are lost.
void variances_within_strata(std::span<double> values, std::span<double> variances);
StrataMoments strata_moments(const Statistics& statistics, std::int64_t members);

/// Members of a level that run together: the variances of base and difference within strata.
template <BatchesLevels S>
struct TogetherDraw {
  const S& sequence;
  std::int64_t level;
  std::int64_t base_level;
  std::int64_t members;

  Sample<Several<double, 2 * strata_octaves>> operator()(Stream& rng) const {
    const Stream own = split(rng, Branch::pilot);
    std::vector<double> bases;
    std::vector<double> differences;
    double work = 0;
    for (std::int64_t j = 0; j < members;) {
      const auto n = static_cast<std::size_t>(std::min<std::int64_t>(members - j, StreamBatch::capacity));
      const auto streams_of = [&](std::int64_t k) {
        return StreamBatch(own, static_cast<std::uint64_t>(j), n, static_cast<std::uint64_t>(k), j, members);
      };
      StreamBatch streams = streams_of(level);
      if constexpr (BatchesShared<S>) {
        std::array<SharedDraw<double>, StreamBatch::capacity> both;
        sequence.shared(level, base_level, streams, std::span(both).first(n));
        for (const SharedDraw<double>& draw : std::span(both).first(n)) {
          bases.push_back(draw.base);
          differences.push_back(draw.difference);
          work += draw.work;
        }
      } else {
        std::array<Term<double>, StreamBatch::capacity> terms;
        const std::span<Term<double>> some = std::span(terms).first(n);
        StreamBatch base_streams = streams_of(base_level);
        sequence.values(base_level, base_streams, some);
        for (const Term<double>& term : some) {
          bases.push_back(term.value);
          work += term.work;
        }
        if (level > 0) sequence.differences(level, streams, some);
        for (const Term<double>& term : some) {
          differences.push_back(term.value);
          if (level > 0) work += term.work;
        }
      }
      j += static_cast<std::int64_t>(n);
    }
    Several<double, 2 * strata_octaves> variances{};
    variances_within_strata(bases, std::span(variances.parts).first(strata_octaves));
    variances_within_strata(differences, std::span(variances.parts).last(strata_octaves));
    return {variances, work, level};
  }
};

constexpr std::int64_t draws_for_work = 16;

template <BiasedSequence S>
std::pair<double, double> mean_work(const S& sequence, std::int64_t level, const Plan& plan) {
  double value = 0;
  double difference = 0;
  for (std::int64_t i = 0; i < draws_for_work; ++i) {
    const Stream sample = split(Stream(plan.seed, static_cast<std::uint64_t>(i)), Branch::pilot);
    Stream one = split_level(sample, level);
    Stream two = split_level(sample, level);
    value += value_of(sequence, level, one).work;
    difference += difference_of(sequence, level, two).work;
  }
  constexpr double n = draws_for_work;
  return {value / n, difference / n};
}

SharedMoments shared_moments(const Statistics& statistics);

}  // namespace detail

/// The erased levels of a sequence, which is copied.
template <BiasedSequence S>
LevelRuns level_runs(const S& sequence) {
  LevelRuns runs;
  runs.draw = [sequence](std::int64_t level, const Plan& plan) -> Statistics {
    return estimate(detail::LevelDraw<S>{sequence, level}, plan);
  };
  runs.work = [sequence](std::int64_t level, const Plan& plan) {
    return detail::mean_work(sequence, level, plan);
  };
  if constexpr (OffersSharedBase<S>) {
    runs.shared = [sequence](std::int64_t level, std::int64_t base_level, const Plan& plan) {
      return detail::shared_moments(
          estimate(detail::SharedLevelDraw<S>{sequence, level, base_level}, plan));
    };
  }
  if constexpr (BatchesLevels<S>) {
    runs.together = [sequence](std::int64_t level, std::int64_t base_level, std::int64_t members, const Plan& plan) {
      return detail::strata_moments(estimate(detail::TogetherDraw<S>{sequence, level, base_level, members}, plan), members);
    };
  }
  return runs;
}

/// One row; its consistency is left at 0.
SurveyRow survey_level(const LevelRuns& runs, std::int64_t level, const Plan& plan);

/// The rates, the answer and the remarks that rows of neighbouring levels give, with their consistency.
Survey conclude(std::vector<SurveyRow> rows, std::uint64_t seed);

/// Levels 0 ... levels - 1, plan.samples draws of each.
/// Throws std::invalid_argument for fewer than two levels or draws, and what the sequence throws (SampleError).
/// Interrupted by plan.progress, it returns the levels that are complete, if there are any, and says so.
Survey survey(const LevelRuns& runs, std::int64_t levels, const Plan& plan = {.samples = 4096});

template <BiasedSequence S>
Survey survey(const S& sequence, std::int64_t levels, const Plan& plan = {.samples = 4096}) {
  return survey(level_runs(sequence), levels, plan);
}

/// As many levels as `work` pays for (at most 24), each with about the same share of it, but at most
/// plan.samples draws and at least 1/512 of that. Stops before a level that the sequence refuses (std::length_error).
Survey survey_within(const LevelRuns& runs, double work, const Plan& plan = {.samples = 1 << 16});

}  // namespace debias

#pragma once

// How long chains have to be: burn_in, length and lag of coupled_chain from a pilot of meeting times.
//
//   L = 99 % quantile of tau at lag 1,  k = 99 % quantile of tau - L at lag L,  m = 20 k
//   TV(law of X_t, steady state) <= E max(0, ceil((tau - L - t) / L))                      [Biswas, Jacob, Vanetti 2019]
//   inefficiency = E work x Var H / (n Var of the average of X_k ... X_m),  n = m - k + 1
//
//   Notation: k = burn_in, m = length, L = lag, tau = meeting time. The inefficiency compares with a plain chain in its steady
// state, without end: 1 is the least, and 1.05 of that is the burn-in, which the averages leave out.
// The pilot has streams of its own, so a run of the same seed stays unbiased. Fails like the chains themselves, where none of
// the pilot has seen a mode; a pilot waits for chains that do not meet, unless it is given a limit.
// Source: Jacob, O'Leary, Atchade 2020 (choice of k and m).

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <utility>
#include <vector>

#include <debias/chains/coupled_chain.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/statistics/meeting.hpp>

namespace debias {

struct ChainAdviceOptions {
  std::int64_t chains = 1000;  ///< of the pilot; the tail of the meeting times is seen as far as so many reach
  std::uint64_t seed = 1;
  std::int64_t limit = 0;      ///< steps after which the pilot gives up a chain; 0: none, it waits
  std::int64_t multiple = 20;  ///< length in units of burn_in: longer ones are nearer to the plain chain, and fewer
};

/// A bound on the distance of X_t from the steady state, in total variation.
struct DistanceBound {
  std::int64_t time = 0;
  double bound = 0;
};

struct ChainAdvice {
  ChainOptions options;                   ///< for coupled_chain(...); all zero where more than 1 % had not met
  std::vector<MeetingInterval> meetings;  ///< at that lag: each time up to 4096, then octaves
  MeetingTail tail;
  double inefficiency = 0;
  double inefficiency_error = 0;
  double work = 0;                      ///< of a sample, in steps of the kernel
  std::vector<DistanceBound> distance;  ///< by time; empty where chains were cut
  double pilot_work = 0;

  [[nodiscard]] bool available() const { return options.length > 0; }
  /// The first time in `distance` from which on a plain chain is that close to its steady state: how long a burn-in would
  /// have had to be. -1 where none is.
  [[nodiscard]] std::int64_t burn_in_for(double distance_bound) const;
};

/// Advice, meeting times, inefficiency, and the bounds as a plot.
std::ostream& operator<<(std::ostream& out, const ChainAdvice& advice);

namespace detail {

struct PilotChain {
  std::vector<double> estimate;  ///< H, by component
  std::vector<double> average;   ///< of X_k ... X_m alone
  double work = 0;
  std::int64_t meeting = 0;
  bool cut = false;
};
/// The chains 0 ... count - 1 of pilot `stage`.
using ChainPilot =
    std::function<std::vector<PilotChain>(const ChainOptions& options, std::uint64_t stage, std::int64_t count)>;
ChainAdvice advise_chain(const ChainPilot& pilot, const ChainAdviceOptions& options);
inline Stream pilot_stream(const ChainAdviceOptions& options, std::uint64_t stage, std::int64_t chain) {
  return split(Stream(options.seed, static_cast<std::uint64_t>(chain)), Branch::pilot).split(stage);
}

}  // namespace detail

/// Advice on the chains of an estimator; its own options do not matter. `estimate(chain.with(advise(chain).options), plan)`.
/// Throws std::invalid_argument for fewer than 100 chains.
template <class K, class Start, class F>
ChainAdvice advise(const CoupledChain<K, Start, F>& chain, const ChainAdviceOptions& options = {}) {
  const auto pilot = [&](ChainOptions of, std::uint64_t stage, std::int64_t count) {
    of.progress = chain.options().progress;
    const CoupledChain<K, Start, F> piloted = chain.with(of);
    const double share = 1 / static_cast<double>(of.length - of.burn_in + 1);
    std::vector<detail::PilotChain> results;
    for (std::int64_t i = 0; i < count; ++i) {
      Stream rng = detail::pilot_stream(options, stage, i);
      const auto run = piloted.draw(rng);
      detail::PilotChain result;
      for (std::size_t c = 0; c < component_count(run.total); ++c) {
        const double average = share * component(run.total, c);
        result.average.push_back(average);
        result.estimate.push_back(run.correction ? average + share * component(*run.correction, c) : average);
      }
      result.work = static_cast<double>(run.steps + run.behind);
      result.meeting = run.meeting;
      result.cut = run.cut;
      results.push_back(std::move(result));
    }
    return results;
  };
  return detail::advise_chain(pilot, options);
}

}  // namespace debias

#pragma once

// Can a run be drawn? Decided from PMF, base level and number of samples before it starts, never from the seed.
//
//   chance = 1 - (1 - t)^N <= 1 / 1000,   t = P(a member needs a level beyond the deepest that can be drawn)
//
//   Notation: N = samples of the whole run (in blocks, their members).
// A run that dies at such a level, and is repeated with another seed, is biased; within the chance it may still die. What
// that leaves out is small beside the noise: |E[Z; too deep]| <= sqrt(E Z^2 t) is at most 3 % of a standard error, sqrt(1 /
// 1000), where the variance is finite (Cauchy-Schwarz).
// A sequence states its deepest level by a member, `std::int64_t deepest_level() const`; a lambda gets one by
// `with_deepest_level(sequence, 24)`. Levels are 64-bit integers: none has more than 2^62 - 1.
// Fails where a sequence does not say what it cannot draw, and for roulette by a policy, which has no PMF of the level: both
// throw when they get there (SampleError).

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/pmf.hpp>
#include <debias/core/rates.hpp>

namespace debias {

/// A sequence, of levels or of terms, that knows the deepest one it can draw.
template <class S>
concept StatesDeepestLevel = requires(const S& s) {
  { s.deepest_level() } -> std::convertible_to<std::int64_t>;
};

/// Of any sequence: PMFs draw levels below 2^62.
inline constexpr std::int64_t deepest_of_all = (std::int64_t{1} << 62) - 1;

template <class S>
std::int64_t deepest_level_of(const S& sequence) {
  if constexpr (StatesDeepestLevel<S>) {
    return std::min<std::int64_t>(sequence.deepest_level(), deepest_of_all);
  } else {
    return deepest_of_all;
  }
}

/// The sequence with a deepest level; all else that it offers stays.
template <class S>
class WithDeepestLevel : public S {
 public:
  WithDeepestLevel(S sequence, std::int64_t last_that_can) : S(std::move(sequence)), deepest_(last_that_can) {
    if (last_that_can >= 0) return;
    throw std::invalid_argument("with_deepest_level: " + std::to_string(last_that_can) + " (levels start at 0)");
  }
  [[nodiscard]] std::int64_t deepest_level() const {
    return std::min(deepest_, deepest_level_of(static_cast<const S&>(*this)));
  }

 private:
  std::int64_t deepest_;
};

/// `with_deepest_level(lambda, 24)`. Throws std::invalid_argument for a negative level.
template <class S>
WithDeepestLevel<S> with_deepest_level(S sequence, std::int64_t deepest) {
  return {std::move(sequence), deepest};
}

/// What a run of an estimator asks of its sequence.
struct Reach {
  std::int64_t deepest = deepest_of_all;  ///< level that can be drawn
  std::int64_t first_level = 0;           ///< of outcome 0 of the PMF
  double beyond = 0;                      ///< P(a member needs a deeper one)
  std::int64_t block = 1;                 ///< samples that come together
  std::string pmf = {};
  Decay decay = Decay::geometric;  ///< of its tail
  std::optional<Rates> rates{};    ///< of the sequence, where it declares them

  /// The chance that it may take.
  static constexpr double threshold = 1e-3;
};

/// An estimator that knows what its level takes; `last` is the index of the last stream of the run: of its last sample, or
/// block.
template <class E>
concept StatesReach = requires(const E& e, std::int64_t last) {
  { e.reach(last) } -> std::same_as<Reach>;
};

/// A run was refused: with this PMF and so many samples, the chance that one of them needs a level that cannot be drawn is
/// too large.
class UndrawableError : public std::invalid_argument {
 public:
  UndrawableError(const std::string& what, std::int64_t deepest, double chance, std::int64_t most_samples,
                  std::string pmf)
      : std::invalid_argument(what),
        deepest_(deepest),
        chance_(chance),
        most_samples_(most_samples),
        pmf_(std::move(pmf)) {}
  [[nodiscard]] std::int64_t deepest_level() const { return deepest_; }
  [[nodiscard]] double chance() const { return chance_; }
  [[nodiscard]] std::int64_t most_samples() const { return most_samples_; }  ///< in whole blocks; 0: not even one
  [[nodiscard]] const std::string& pmf() const { return pmf_; }  ///< one that can be drawn; empty: none, at this base

 private:
  std::int64_t deepest_;
  double chance_;
  std::int64_t most_samples_;
  std::string pmf_;
};

namespace detail {

/// 1 - (1 - beyond)^members.
double chance_beyond(double beyond, double members);
/// The largest P(a member is too deep) that so many members may have.
double allowed_beyond(double members);
/// A PMF of the same kind that falls just fast enough: its exponent, to two digits, and its spec; or none. The room of the
/// PMFs has it (src/pmf/any.cpp), since core knows none of them.
struct Steeper {
  double exponent = 0;
  std::string pmf;
};
Steeper steeper_pmf(const Reach& reach, double allowed);
/// Throws UndrawableError where a run of so many samples is too likely to die.
void require_reach(const Reach& reach, std::int64_t samples);

template <class S>
std::optional<Rates> declared_rates(const S& sequence) {
  if constexpr (StatesFacts<S>) {
    return sequence.facts().declared;
  } else if constexpr (requires {
                         { sequence.rates } -> std::convertible_to<Rates>;
                       }) {
    return Rates(sequence.rates);
  } else {
    return std::nullopt;
  }
}

/// Of an estimator that draws level first_level + J, J from the PMF, and nothing below base_level.
template <class S, Pmf P>
Reach reach_of(const S& sequence, const P& pmf, std::int64_t base_level, std::int64_t first_level) {
  Reach reach;
  reach.deepest = deepest_level_of(sequence);
  reach.first_level = first_level;
  reach.rates = declared_rates(sequence);
  if constexpr (DescribedPmf<P>) {
    reach.pmf = pmf.spec();
    reach.decay = pmf.tail_exponent().decay;
  }
  // A PMF of a user's own that names no tail may draw any int64, and its `tail` may be what a sum divides by and no more:
  // it is judged only where the sequence itself ends.
  if (!DescribedPmf<P> && reach.deepest == deepest_of_all) return reach;
  // Levels count from the base on; a PMF has no more than 2^62 outcomes itself.
  const bool some = base_level <= reach.deepest && first_level <= reach.deepest;
  const std::int64_t outcome = std::min(reach.deepest - first_level, deepest_of_all - 1) + 1;  // the first too deep
  reach.beyond = some ? pmf.tail(outcome) : 1;
  if (some && !DescribedPmf<P> && reach.beyond > 0 && pmf.sample(reach.beyond) < outcome) reach.beyond = 0;
  return reach;
}

/// Of an estimator that draws this one level.
template <class S>
Reach reach_of_level(const S& sequence, std::int64_t level) {
  Reach reach;
  reach.deepest = deepest_level_of(sequence);
  reach.first_level = level;
  reach.beyond = level > reach.deepest ? 1 : 0;
  return reach;
}

}  // namespace detail

}  // namespace debias

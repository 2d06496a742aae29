#pragma once

// Points in step with what they look at: does a run miss what no level that it draws can show?
//
//   B(k) = g(mean of n independent means of level k) - mean of g of each;  E B(k) = (1 - 1/n) (g(I) - E I_k), to leading order
//
// Notation: k = level, I_k = its value, g(I) = limit. An equidistant comb sees nothing of a period that is a whole multiple of its
// spacing: fine and coarse means agree, all differences up to some level fall or vanish, and the answer is E I_k of that level
// instead of g(I). Independent combs have independent offsets, so B(k) shows it, whatever the period and the number of points.
// The check reads B at the base level, at the last one that the run draws well, and between them, and compares it with T, what the
// levels above have added to the answer: g(I) - E I_k, too. Where B lies further out than T, by three times the error of the answer
// and the noise of B together, and does so again in three times as many batches of their own, the run is warned of: one batch
// that is far off is no finding. Shallow levels pay for many means, which values that are rare need; at deep
// ones a B of its own falls to nothing, and what is in step stays. A B below T misses what is rare, and says nothing.
// A linear g has B = 0, and no bias: where all differences vanish and no batch is off by more than rounding, g is taken for
// linear, and the levels end. Numbers come from streams of the check's own and change no result; it takes at most a sixteenth of
// the look-ups of the run, or 4096 if these are less than half of them, for each level that is doubted once as much again, and
// they count in its work.
// Fails where values are so rare that n of them miss them. Optional hook of a sequence, forwarded by the estimators:
// `missed(level, n, rng)` is one B(level). Source: derived here.

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

struct Statistics;

/// A sequence, or an estimator of one, whose levels have points of their own that may be in step with the integrand.
template <class T>
concept ChecksPoints = requires(const T& t, std::int64_t level, Stream& rng) {
  requires Value<std::remove_cvref_t<decltype(t.missed(level, level, rng))>>;
};

namespace detail {

/// Independent batches: those that find, and those that confirm.
struct Batches {
  std::int64_t first;
  std::int64_t count;
};
inline constexpr Batches batches_of_missed = {0, 8};
inline constexpr Batches batches_again = {8, 24};

/// B of a level by component, in each of the batches of `draws` means.
using MissedBatches = std::vector<std::vector<double>>;
using Missed = std::function<MissedBatches(std::int64_t level, std::int64_t draws, Batches which)>;

/// What batches say beside what deeper levels have added already: the rest, and the standard error of B.
struct LeftOut {
  double size = 0;
  double noise = 0;

  /// Beyond chance, for an answer with this error.
  [[nodiscard]] bool is_seen(double error) const;
};
/// Of batches of `draws` means. Size 0 where they see less than was added, or a NaN.
LeftOut left_out(const std::vector<double>& batches, std::int64_t draws, double added);

/// What is known of a component of the answer: its error, and what the levels above have added to it.
struct Answered {
  double error = 0;
  double added = 0;
  bool sign_is_known = true;  ///< of `added`
};
/// What a level leaves out, by component; 0 where two sets of batches do not both see it. Adds to `work` what that took.
std::vector<double> seen_beyond(const Missed& missed, std::int64_t level, std::int64_t draws,
                                const std::vector<Answered>& answer, double& work);

template <ChecksPoints S>
MissedBatches missed_of(const S& sequence, std::int64_t level, std::int64_t draws, Batches which, std::uint64_t seed) {
  MissedBatches batches;
  for (std::int64_t b = which.first; b < which.first + which.count; ++b) {
    Stream rng = split_level(split(Stream(seed, static_cast<std::uint64_t>(b)), Branch::points), level);
    const auto value = sequence.missed(level, draws, rng);
    batches.resize(component_count(value));
    for (std::size_t c = 0; c < batches.size(); ++c) batches[c].push_back(component(value, c));
  }
  return batches;
}

/// The levels that a check reads, without repetitions, shallow ones first.
std::vector<std::int64_t> levels_to_check(std::int64_t base_level, std::int64_t last);
/// Means of a level in each batch, for so many look-ups in all; 0: they do not pay for a batch.
std::int64_t draws_of_missed(std::int64_t level, double lookups);
/// The look-ups of the batches that find.
double work_of_missed(std::int64_t level, std::int64_t draws);

/// Whether g is linear as far as the values of a level reach: no batch is off by more than rounding beside these sizes of values.
bool is_linear(const Missed& missed, std::int64_t level, const std::vector<double>& sizes);

/// What is said where the answer misses `size`, so many standard errors, beyond a level.
std::string resonance_words(std::int64_t level, double size, double errors);

/// Warns of a run whose levels leave out more than its error says; the check counts in its work. Levels of a linear g
/// end at the base.
void judge_points(Statistics& statistics, const Missed& missed);

}  // namespace detail

}  // namespace debias

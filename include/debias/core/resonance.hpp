#pragma once

// Points in step with what they look at: does a run miss what no level that it draws can show?
//
//   B(k) = g(mean of n independent means of level k) - mean of g of each;  E B(k) = (1 - 1/n) (g(I) - E I_k), to leading order
//
// Notation: k = level, I_k = its value, g(I) = limit. An equidistant comb sees nothing of a period that is a whole multiple of its
// spacing: fine and coarse means agree, all differences up to some level fall or vanish, and the answer is E I_k of that level
// instead of g(I). Independent combs have independent offsets, so B(k) shows it, whatever the period and the number of points.
// The check reads B at levels that a run draws hardly or not: where its variance is finite, what they leave out is no
// more than sqrt(c) standard errors, c = draws expected beyond them (Cauchy-Schwarz on sum E D_k and sum E D_k^2 / p_k); more
// is a warning. At a shallower level it compares B with T, what the levels above have added to the answer: g(I) - E I_k, too.
// A linear g has B = 0, and no bias. Numbers come from streams of the check's own and change no result; it takes at most a
// sixteenth of the look-ups of the run, or 4096 if these are less than half of them, and they count in its work.
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

/// B of a level by component, in each of batches_of_missed independent batches of `draws` means.
using MissedBatches = std::vector<std::vector<double>>;
using Missed = std::function<MissedBatches(std::int64_t level, std::int64_t draws)>;

inline constexpr std::int64_t batches_of_missed = 4;
/// Means in a batch from which on it is compared with what deeper levels have added.
inline constexpr std::int64_t sharp_draws = 48;

/// What two of the batches reach, on the same side of zero; a NaN stays out.
double agreed(std::vector<double> batches);

/// What batches of `draws` means say beside `added`, which deeper levels have found already: by how much more than they differ
/// by they all lie beyond it; 0 where they see less than was found, for then they miss what is rare.
double left_out(std::vector<double> batches, std::int64_t draws, double added);

template <ChecksPoints S>
MissedBatches missed_of(const S& sequence, std::int64_t level, std::int64_t draws, std::uint64_t seed) {
  MissedBatches batches;
  for (std::int64_t b = 0; b < batches_of_missed; ++b) {
    Stream rng = split_level(split(Stream(seed, static_cast<std::uint64_t>(b)), Branch::points), level);
    const auto value = sequence.missed(level, draws, rng);
    batches.resize(component_count(value));
    for (std::size_t c = 0; c < batches.size(); ++c) batches[c].push_back(component(value, c));
  }
  return batches;
}

/// Means of a level in each batch, for so many look-ups in all; 0: they do not pay for a batch.
std::int64_t draws_of_missed(std::int64_t level, double lookups);
/// The look-ups of all batches.
double work_of_missed(std::int64_t level, std::int64_t draws);

/// What is said where the answer misses `size`, so many standard errors, beyond a level.
std::string resonance_words(std::int64_t level, double size, double errors);

/// Warns of a run whose levels leave out more than its error says; the check counts in its work.
void judge_points(Statistics& statistics, const Missed& missed);

}  // namespace detail

}  // namespace debias

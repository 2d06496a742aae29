#pragma once

// How heavy is the tail of a meeting time? From the numbers of chains that met in intervals of time.
//
//   alpha_j = -log2 P(tau >= 2 a_j | tau >= a_j),  a_j = 2^j
//
//   Notation: tau = meeting time, S(a) = P(tau >= a), alpha_j = local exponent: S falls like a^-alpha there. A geometric tail
// has alpha_j = -log2 S(a_j), which doubles from octave to octave and is above 3 where S < 1/8; a power a^-alpha has the same
// one in all of them. H of coupled_chain grows like tau, so that its variance needs alpha > 2.
//   light   the deepest octave that 30 chains entered has alpha - 1.5 se > 2, and those beyond it do not contradict
//   heavy   alpha of all octaves from S <= 1/8 on, at least three, is below 2 by 1.5 se, and does not rise
//   open    else: too few chains, chains that were cut, a second scale of time that few chains show
// Fails where all chains started in one of two modes and none has left it: nobody can see those that would.
// Sources: Jacob, O'Leary, Atchade 2020 (geometric tails); Middleton, Deligiannidis, Doucet, Jacob 2020 (powers); rule: here.

#include <cstdint>
#include <limits>
#include <span>
#include <string>

namespace debias {

/// Chains that met at times first ... last.
struct MeetingInterval {
  std::int64_t first = 0;
  std::int64_t last = 0;
  std::int64_t chains = 0;
};

enum class MeetingKind { open, light, heavy };
/// "open", "light", "heavy".
const char* name_of(MeetingKind kind);

/// What meeting times say of their tail.
struct MeetingTail {
  MeetingKind kind = MeetingKind::open;
  std::int64_t chains = 0;                                     ///< 0: nothing is known
  std::int64_t cut = 0;                                        ///< of them, had not met at the limit
  double exponent = std::numeric_limits<double>::quiet_NaN();  ///< alpha of the octaves that decided
  double error = std::numeric_limits<double>::infinity();
  double median = 0;  ///< of the meeting times, as intervals tell it
  double late = 0;    ///< their 99 % quantile
  double last = 0;    ///< the latest of all
  /// "meeting times have a light tail: half of 1000 chains met by 12, 99 % by 61, the last by 80".
  [[nodiscard]] std::string sentence() const;
};

/// The tail of the meeting times in intervals in ascending order; those that begin beyond `limit` hold the chains that were
/// cut there.
MeetingTail meeting_tail(std::span<const MeetingInterval> times,
                         std::int64_t limit = std::numeric_limits<std::int64_t>::max());

}  // namespace debias

#pragma once

// What single levels may say, and how a trend through them may go on.
//
//   b_(k+dx) = b_k - s_k dx,  s_(k+dx) = s_k + N(0, tau^2 4^(-q x) dx),  seen: b_k + N(0, sigma_k^2 + omega^2)
//   in x = k, or in x = log2(k + 1), for each (tau, omega, q) of a grid with prior (1 + tau/.1)^-1/2 (1 + omega/.1)^-1/2
//
// The posterior is a mixture of normal laws of (b, s) at the last level. It is told as equally likely courses from a
// fixed low-discrepancy sequence: no random numbers.
// Sources: Harvey 1989 (trend, filter); Roberts 2018, the R sequence; the rest derived.

#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <debias/statistics/evidence.hpp>

namespace debias::statistics {

constexpr double few = 8;                       // effective hits below which a level says nothing
constexpr double octaves = 1.4426950408889634;  // 1 / ln 2
constexpr double shown_p = 0.005;               // of a wrong answer, where it is called shown
constexpr double likely_p = 0.1;                // where it is called likely

inline bool is_zero(const LevelVoice& v) { return std::isinf(v.log2_second); }
inline bool is_finite(const LevelVoice& v) { return !std::isnan(v.log2_second); }

/// Makes zeros of a difference that is no more than the rounding of the values beside it.
void drop_rounding(LevelFacts& facts);

/// R1.
std::vector<LevelVoice> voices_of(std::span<const LevelFacts> facts);

struct Observation {
  double level;
  double value;
  double error;
};

/// Levels that contradict declared rates, follow them, or neither, where they are not there yet.
struct RatedCourses {
  std::vector<Course> courses;
  std::vector<Course> unaided;  ///< by the levels alone; empty unless they follow the rates
  std::optional<Contradiction> contradiction;
};
/// Observations in order of their levels: at least three, or one and rates that they follow.
RatedCourses courses_of(std::span<const Observation> seen, bool may_be_polynomial,
                        const std::optional<Rates>& declared);
/// Without rates.
std::vector<Course> courses_of(std::span<const Observation> seen, bool may_be_polynomial);

/// How fast the earlier and the later half of them fall, a level; at least three. `scatter`: of single ones, beside their error.
struct Halves {
  FittedRate early;
  FittedRate late;
  [[nodiscard]] double bend() const { return late.value - early.value; }
  [[nodiscard]] double bend_error() const { return std::hypot(early.error, late.error); }
};
Halves halves_of(std::span<const Observation> seen, double scatter);

/// The chance that so many draws of what is as rare as the differences of this level are zeros alone.
double chance_of_zeros(const LevelFacts& level, double draws);

/// Of single levels about the trend, in octaves: the median.
double scatter_of(std::span<const Course> courses);

/// A level beyond the last usable one, as far from it as courses of both kinds count: in levels, or in octaves.
class Ahead {
 public:
  Ahead(std::int64_t last_usable, std::int64_t level);
  [[nodiscard]] std::int64_t level() const { return level_; }
  /// b of a course. The slope settles within some levels.
  [[nodiscard]] double on(const Course& c) const {
    const Way& way = c.polynomial ? octaves_ : levels_;
    return c.at_last - (c.limit + (c.slope - c.limit) * way.unsettled) * way.length;
  }

 private:
  struct Way {
    double length;
    double unsettled;
  };
  static Way way(double length);

  std::int64_t level_;
  Way levels_;
  Way octaves_;
};

/// Of the levels beyond the last usable one whose b is computed, the one after `level`: far beyond a few an octave. Lines are between.
inline std::int64_t node_after(std::int64_t last_usable, std::int64_t level) {
  const std::int64_t beyond = level - last_usable;
  return level + (beyond < 32 ? 1 : beyond / 8);
}
/// The first of them that is no shallower than `level`.
inline std::int64_t node_from(std::int64_t last_usable, std::int64_t level) {
  std::int64_t node = last_usable + 1;
  while (node < level) node = node_after(last_usable, node);
  return node;
}

/// Levels beyond the last usable one: 32 single ones, then two an octave.
using Horizon = std::vector<Ahead>;
Horizon horizon_of(std::int64_t last_usable);

/// sum over the levels beyond of 2^(factor b_k + offset_k), for offsets at the levels of the horizon; what lies beyond
/// it falls like 2^(-lambda k), or k^(-lambda - 1).
double sum_beyond(const Course& course, std::int64_t last_usable, const Horizon& horizon, double factor,
                  std::span<const double> offsets, double lambda);

inline double normal_cdf(double x) { return 0.5 * std::erfc(-x / 1.4142135623730951); }

}  // namespace debias::statistics

#pragma once

// Does the coarse partner of level k have the mean of level k - 1? If not, every estimate from the sequence is biased.
//
//   neighbours      gap = mean C_k - mean I_(k-1)
//   from the base   gap = mean C_k - mean I_m - sum of mean D_j over m < j < k
//   alarm           |gap| / s > q (1 + q g / 3 + (q g)^2 / 25),   q = normal quantile of 1e-6 / (2 x comparisons)
//
//   Notation: C_k = I_k - D_k, m = the lowest level with values, s = standard error of the gap (its means are of
//   different draws), g = the most that one draw, seen or not yet, moves a mean, in units of s.
// Assumes levels whose draws come with their values. Heavy tails make g large, and the alarm late: the bracket is what a
// rare event of Poisson's PMF needs, the worst there is among those that a mean of n draws can see; where g > 1 there is no
// comparison. Of a value with several components three fixed linear functionals are compared.
// Sources: Giles, Acta Numerica 24 (2015), section 3 (the identity); compare Maurer & Pontil, COLT 2009 (bounds by the
// variance and the range that were seen); the bracket is derived here.

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <debias/core/value.hpp>
#include <debias/core/warning.hpp>

namespace debias {

namespace detail {
struct Codec;  // src/core/run_state_bytes.cpp
}

class LevelTable;

/// The moments of one number of the draws of a level.
struct CouplingSide {
  std::int64_t count = 0;
  double mean = 0;
  double m2 = 0;     ///< sum of (x - mean)^2
  double reach = 0;  ///< at least the largest |x - mean|

  void merge(const CouplingSide& other);
};

struct CouplingRow {
  CouplingSide value;       ///< I_k, of levels and of bases
  CouplingSide coarse;      ///< I_k - D_k
  CouplingSide difference;  ///< D_k, of values with several components
};

/// Of some chunks of a run, the rows of levels 0 ... 63, for each view of a value: itself, where it is a number; its first component, the sum of
/// all, and their sum with fixed signs, where it has some.
class CouplingTable {
 public:
  static constexpr std::size_t views = 3;
  static constexpr std::int64_t levels = 64;
  /// Whether a chunk of a run, by its absolute number, is looked at: all of the first 32, then each eighth.
  static constexpr bool looks_at(std::int64_t chunk) { return chunk < 32 || chunk % 8 == 0; }

  void merge(const CouplingTable& other);
  void clear() {  // keeps the memory
    for (auto& rows : rows_) rows.clear();
  }
  [[nodiscard]] std::span<const CouplingRow> rows(std::size_t view) const { return rows_[view]; }

 private:
  friend struct detail::Codec;
  friend class CouplingSums;
  std::array<std::vector<CouplingRow>, views> rows_;
};

/// The sums of a chunk, about the first number of each row: no digits cancel, and nothing divides per draw.
class CouplingSums {
 public:
  CouplingSums();

  void base(std::size_t view, std::int64_t level, double x) {
    if (level >= CouplingTable::levels) return;
    row(view, level).base.add({x});
  }
  /// The difference is left to the LevelTable, where it is a number.
  void pair(std::int64_t level, double x, double difference) {
    if (level >= CouplingTable::levels) return;
    row(0, level).pair.add({x, x - difference});
  }
  void pair(std::size_t view, std::int64_t level, double x, double difference) {
    if (level >= CouplingTable::levels) return;
    Row& r = row(view, level);
    r.pair.add({x, x - difference});
    r.difference.add({difference});
  }
  /// Writes the moments to `table`, and forgets the sums.
  void finish(CouplingTable& table);

 private:
  // Some numbers that come together.
  template <std::size_t n>
  struct Sums {
    std::int64_t count = 0;
    std::array<double, n> pivot{};
    std::array<double, n> sum{};
    std::array<double, n> squares{};
    std::array<double, n> largest{};

    void add(const std::array<double, n>& x) {
      if (count++ == 0) pivot = x;
      for (std::size_t i = 0; i < n; ++i) {
        const double d = x[i] - pivot[i];
        const double square = d * d;
        sum[i] += d;
        squares[i] += square;
        largest[i] = square > largest[i] ? square : largest[i];  // a NaN stays in the sums
      }
    }
    [[nodiscard]] CouplingSide moments(std::size_t i) const;
  };
  struct Row {
    Sums<1> base;
    Sums<2> pair;  // of I_k and of its coarse partner
    Sums<1> difference;
  };
  Row& row(std::size_t view, std::int64_t level) {
    const auto k = static_cast<std::size_t>(level);
    used_[view] = k < used_[view] ? used_[view] : k + 1;
    return rows_[view * static_cast<std::size_t>(CouplingTable::levels) + k];
  }

  std::array<std::size_t, CouplingTable::views> used_{};  // rows of each view
  std::vector<Row> rows_;
};

/// What a run says of the coupling of its levels.
struct Coupling {
  enum class State {
    no_levels,  ///< the estimator has no differences
    no_values,  ///< differences came without their values: hooks, series, batches
    too_few,    ///< no two neighbouring levels with enough draws, or tails too heavy
    right,      ///< no gap beyond chance
    wrong       ///< a gap beyond chance
  };
  State state = State::no_levels;
  std::int64_t first_level = 0;  ///< of those compared with the level below
  std::int64_t last_level = 0;
  std::int64_t level = 0;  ///< with the largest gap, beside its threshold
  double z = 0;            ///< of that gap
  double threshold = 0;    ///< of an alarm there
  bool all_equal = false;  ///< all differences are zero, though draws vary, no less at deep levels
};

/// "no levels", "not checked", "too few draws", "right", "wrong".
const char* name_of(Coupling::State state);
/// One line for a report; empty where there are no levels.
std::string text_of(const Coupling& coupling);
/// The warning that a coupling is worth, if any.
std::optional<Warning> warning_of(const Coupling& coupling);

namespace detail {

/// From the sums of a run; `epsilon` is the relative spacing of the numbers that the values are made of.
Coupling judge_coupling(const CouplingTable& table, const LevelTable& levels, double epsilon);

/// Throws std::invalid_argument for work that is negative or not finite.
[[noreturn]] void refuse_work(std::int64_t level, double work);
inline void check_work(std::int64_t level, double work) {
  // Negative numbers, infinity and NaN have the largest patterns of bits. Minus zero is none of them.
  if (std::bit_cast<std::uint64_t>(work) >= 0x7ff0'0000'0000'0000 && work != 0) [[unlikely]]
    refuse_work(level, work);
}

[[noreturn]] void refuse_level_zero(double value, double difference);
/// Throws std::invalid_argument where a draw of level 0 has another difference than its value.
template <Value V>
void check_level_zero(const V& value, const V& difference) {
  for (std::size_t i = 0; i < component_count(value); ++i) {
    const double x = component(value, i);
    const double d = component(difference, i);
    if (!(x == d) && !(std::isnan(x) && std::isnan(d))) [[unlikely]]
      refuse_level_zero(x, d);
  }
}

/// A value as the views see it, in `seen`; returns how many there are.
template <Value V>
std::size_t see(const V& v, std::array<double, CouplingTable::views>& seen) {
  if constexpr (RealValue<V>) {
    seen[0] = static_cast<double>(v);
    return 1;
  } else {
    const std::size_t n = component_count(v);
    seen = {};
    for (std::size_t i = 0; i < n; ++i) {
      const double x = component(v, i);
      if (i == 0) seen[0] = x;
      seen[1] += x;
      seen[2] += std::popcount(i) % 2 == 0 ? x : -x;
    }
    return n < 2 ? n : CouplingTable::views;
  }
}

/// A record that wants values beside differences.
template <class R>
concept RecordsValues = requires(R& r, std::size_t view, std::int64_t level, double x) {
  r.value(view, level, x);
  r.pair(level, x, x);
  r.pair(view, level, x, x);
};

template <Value V, class R>
void record_value(R& record, std::int64_t level, const V& value) {
  if constexpr (RecordsValues<R>) {
    std::array<double, CouplingTable::views> seen;
    const std::size_t n = see(value, seen);
    for (std::size_t view = 0; view < n; ++view) record.value(view, level, seen[view]);
  }
}
template <Value V, class R>
void record_pair(R& record, std::int64_t level, const V& value, const V& difference) {
  if constexpr (RecordsValues<R> && RealValue<V>) {
    record.pair(level, static_cast<double>(value), static_cast<double>(difference));
  } else if constexpr (RecordsValues<R>) {
    std::array<double, CouplingTable::views> seen;
    std::array<double, CouplingTable::views> differences;
    const std::size_t n = see(value, seen);
    if (see(difference, differences) != n) return;
    for (std::size_t view = 0; view < n; ++view) record.pair(view, level, seen[view], differences[view]);
  }
}

}  // namespace detail
}  // namespace debias

#pragma once

// What a run remembers of its samples, in memory that does not grow with their number.
//
//   Moments      count, mean and central sums of (x - mean)^2, ^3, ^4            [Pebay, SAND2008-6212]
//   LevelTable   per level: count, sums of D, D^2, D^4 and of the work; the base on a row of its own
//   CouplingTable  per level: moments of I_k and of its coarse partner, where draws have values (core/coupling.hpp)
//   Extremes     the 4096 largest and smallest values, the 32 largest in magnitude with index and level,
//                and the samples that are not finite
//   Accumulator  moments, components, levels and work of one range of samples; ranges merge left to right
//   Recorder     what the sample loop writes to; it fills Accumulators chunk by chunk
//
// A buffer of 256 values is summed in two passes (mean, then central sums), so no digits cancel and nothing
// divides per sample. Extremes are sets: how samples were spread over threads cannot matter to them.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <debias/core/coupling.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/value.hpp>

namespace debias {

namespace detail {
struct Codec;  // src/core/run_state_bytes.cpp
}

/// Count, mean and central sums sum (x - mean)^q of real numbers; m3 and m4 in a unit of their own where deviations are beyond
/// 2^+-240, so ask for `skewness` and `kurtosis`.
struct Moments {
  std::int64_t count = 0;
  double mean = 0;
  double m2 = 0;
  double m3 = 0;
  double m4 = 0;

  static Moments of(std::span<const double> values);
  void merge(const Moments& other);

  /// Unbiased sample variance; NaN below two values.
  [[nodiscard]] double variance() const;
  /// Standard error of the mean; NaN below two values.
  [[nodiscard]] double standard_error() const;
  /// Third standardised moment; 0 where all values are equal.
  [[nodiscard]] double skewness() const;
  /// Fourth standardised moment, 3 for a normal law; 0 where all values are equal.
  [[nodiscard]] double kurtosis() const;
};

/// Mean and central sum of squares of each component of a value with more than one.
class ComponentMoments {
 public:
  struct Entry {
    double mean = 0;
    double m2 = 0;
  };

  template <Value V>
  void add(const V& v) {
    const std::size_t n = component_count(v);
    if (count_ == 0) entries_.assign(n, Entry{});
    if (n != entries_.size()) size_mismatch(n);
    ++count_;
    const double share = 1.0 / static_cast<double>(count_);
    for (std::size_t i = 0; i < n; ++i) {
      Entry& e = entries_[i];
      const double x = component(v, i);
      const double delta = x - e.mean;
      e.mean += delta * share;
      e.m2 += delta * (x - e.mean);
    }
  }
  void merge(const ComponentMoments& other);
  void clear() {  // keeps the memory
    count_ = 0;
    entries_.clear();
  }
  [[nodiscard]] std::span<const Entry> entries() const { return entries_; }

 private:
  friend struct detail::Codec;
  [[noreturn]] void size_mismatch(std::size_t components) const;

  std::int64_t count_ = 0;
  std::vector<Entry> entries_;
};

/// Sums over the draws of one level.
struct LevelSums {
  std::int64_t count = 0;
  double difference = 0;
  double square = 0;
  double fourth = 0;  // of d^2 unit
  double unit = 1;    // a power of 2, where fourth powers would leave the range of doubles
  double work = 0;

  void add(double d, double work_of_draw) {
    const double d2 = d * d;
    ++count;
    difference += d;
    if (square == 0) unit = unit_for(d2);
    square += d2;
    const double q = d2 * unit;
    fourth += q * q;
    work += work_of_draw;
  }
  void merge(const LevelSums& other);
  /// E D^4 / (E D^2)^2; 0 where all are zero.
  [[nodiscard]] double kurtosis() const;

 private:
  static double unit_for(double d2) {
    if ((d2 > 0x1p-400 && d2 < 0x1p400) || d2 == 0) [[likely]]
      return 1;
    return far_unit(d2);
  }
  static double far_unit(double d2);
};

/// One row a level up to 63, then one row an octave (64 ... 127, 128 ... 255, ...), and the base.
class LevelTable {
 public:
  static constexpr std::int64_t single_levels = 64;

  void add_base(std::int64_t level, double value, double work) {
    base_level_ = level;
    base_.add(value, work);
  }
  void add(std::int64_t level, double d, double work) {
    const std::size_t i = row_of(level);
    if (i >= rows_.size()) [[unlikely]]
      rows_.resize(i + 1);
    rows_[i].add(d, work);
  }
  void merge(const LevelTable& other);
  void clear() {  // keeps the memory
    base_level_ = 0;
    base_ = {};
    rows_.clear();
  }

  [[nodiscard]] std::int64_t base_level() const { return base_level_; }
  [[nodiscard]] const LevelSums& base() const { return base_; }
  [[nodiscard]] std::span<const LevelSums> rows() const { return rows_; }
  /// The first and the last level of a row.
  static std::pair<std::int64_t, std::int64_t> levels_of_row(std::size_t row);

 private:
  friend struct detail::Codec;
  static std::size_t row_of(std::int64_t level) {
    if (level < single_levels) return static_cast<std::size_t>(level);
    constexpr int bits = std::bit_width(static_cast<std::uint64_t>(single_levels));
    return static_cast<std::size_t>(single_levels + std::bit_width(static_cast<std::uint64_t>(level)) - bits);
  }

  std::int64_t base_level_ = 0;
  LevelSums base_;
  std::vector<LevelSums> rows_;  // those that were touched, at most 121
};

/// The `capacity` first elements, by a strict total order, of all that were added.
template <class T, class Before, std::size_t capacity>
class Leading {
 public:
  void add(const T& x) {
    if (full_ && !Before{}(x, last_)) return;
    kept_.push_back(x);
    if (kept_.size() == 2 * capacity) prune();
  }
  void merge(const Leading& other) {
    for (const T& x : other.kept_) add(x);
  }
  /// Moves all elements to `others`, and keeps only a mark of what those would not take.
  void hand_over(Leading& others) {
    others.merge(*this);
    kept_.clear();
    full_ = others.full_;
    last_ = others.last_;
  }
  /// False when adding x would change nothing.
  [[nodiscard]] bool wants(const T& x) const { return !full_ || Before{}(x, last_); }
  [[nodiscard]] std::vector<T> sorted() const {
    std::vector<T> result = kept_;
    std::sort(result.begin(), result.end(), Before{});
    if (result.size() > capacity) result.erase(result.begin() + capacity, result.end());
    return result;
  }

 private:
  friend struct detail::Codec;
  void prune() {
    const auto last = kept_.begin() + (capacity - 1);
    std::nth_element(kept_.begin(), last, kept_.end(), Before{});
    last_ = *last;
    kept_.erase(last + 1, kept_.end());
    full_ = true;
  }

  std::vector<T> kept_;
  T last_{};
  bool full_ = false;
};

/// A sample that can be replayed alone: its absolute index, deepest level, and scalar value. Of a block, the index of its
/// first sample and the mean of all.
struct LargeSample {
  std::int64_t index = 0;
  std::int64_t level = 0;
  double value = 0;

  friend bool operator==(const LargeSample&, const LargeSample&) = default;
};

/// The tails, the largest samples, and the samples that are not finite.
class Extremes {
 public:
  static constexpr std::size_t tail_capacity = 4096;
  static constexpr std::size_t largest_capacity = 32;

  /// `values[i]` is the scalar of sample first_index + i step, `levels[i]` its deepest level.
  void add(std::span<const double> values, std::span<const std::int64_t> levels, std::int64_t first_index,
           std::int64_t step = 1);
  void merge(const Extremes& other);
  /// Moves all that is here to `others`.
  void hand_over(Extremes& others);

  [[nodiscard]] std::vector<double> upper_tail() const { return upper_.sorted(); }
  [[nodiscard]] std::vector<double> lower_tail() const { return lower_.sorted(); }
  [[nodiscard]] std::vector<LargeSample> largest() const { return largest_.sorted(); }
  [[nodiscard]] std::int64_t nonfinite() const { return nonfinite_; }
  /// The smallest index of a sample that is not finite; -1 if there is none.
  [[nodiscard]] std::int64_t first_nonfinite() const { return first_nonfinite_; }

 private:
  friend struct detail::Codec;
  struct Greater {
    bool operator()(double a, double b) const { return a > b; }
  };
  struct Less {
    bool operator()(double a, double b) const { return a < b; }
  };
  struct LargerMagnitude {
    bool operator()(const LargeSample& a, const LargeSample& b) const {
      const double x = std::abs(a.value);
      const double y = std::abs(b.value);
      return x != y ? x > y : a.index < b.index;
    }
  };

  void add_nonfinite(std::int64_t index);

  Leading<double, Greater, tail_capacity> upper_;
  Leading<double, Less, tail_capacity> lower_;
  Leading<LargeSample, LargerMagnitude, largest_capacity> largest_;
  std::int64_t nonfinite_ = 0;
  std::int64_t first_nonfinite_ = -1;
};

/// The sums over one range of samples.
struct Accumulator {
  Moments moments;
  ComponentMoments components;
  LevelTable levels;
  CouplingTable coupling;
  double work = 0;

  /// Adds the sums of the range that follows this one.
  void merge(const Accumulator& right);
  /// Forgets the sums, and keeps their memory.
  void clear() {
    moments = {};
    components.clear();
    levels.clear();
    coupling.clear();
    work = 0;
  }
};

/// The sample loop's end of the statistics, one for each thread: the Record of the estimator, and the samples.
class Recorder {
 public:
  /// Samples before `known` are in the extremes already. What `checks` the coupling costs a tenth of the cheapest draws, so
  /// that not all chunks of a long run do. What is added stands for `block` samples.
  void begin_chunk(std::int64_t first_index, std::int64_t known = 0, bool checks = true, std::int64_t block = 1) {
    checks_ = checks;
    sums_.clear();
    block_ = block;
    first_ = first_index;
    known_ = known;
    filled_ = 0;
  }

  /// All three throw std::invalid_argument for work that is negative or not finite.
  void base(std::int64_t level, double value, double work) {
    detail::check_work(level, work);
    sums_.levels.add_base(level, value, work);
  }
  void difference(std::int64_t level, double d, double work) {
    detail::check_work(level, work);
    sums_.levels.add(level, d, work);
  }
  /// I_level and D_level as a view sees them, where a draw has both; the value of a base, where it has only that.
  void pair(std::size_t view, std::int64_t level, double value, double d) {
    if (checks_) coupling_.pair(view, level, value, d);
  }
  void pair(std::int64_t level, double value, double d) {
    if (checks_) coupling_.pair(level, value, d);
  }
  void value(std::size_t view, std::int64_t level, double x) {
    if (checks_) coupling_.base(view, level, x);
  }

  template <Value V>
  void add(const Sample<V>& sample) {
    detail::check_work(sample.level, sample.work);
    if constexpr (!RealValue<V>) sums_.components.add(sample.value);
    values_[filled_] = debias::as_scalar(sample.value);
    levels_[filled_] = sample.level;
    sums_.work += sample.work;
    if (++filled_ == buffer_size) flush();
  }

  /// The index of the sample that comes next: the one that is being drawn when a callable throws; the first of its block.
  [[nodiscard]] std::int64_t next_index() const { return first_ + static_cast<std::int64_t>(filled_) * block_; }

  [[nodiscard]] const Accumulator& end_chunk() {
    flush();
    coupling_.finish(sums_.coupling);
    return sums_;
  }
  [[nodiscard]] Extremes& extremes() { return extremes_; }

 private:
  static constexpr std::size_t buffer_size = 256;

  void flush();

  Accumulator sums_;
  CouplingSums coupling_;
  bool checks_ = true;
  Extremes extremes_;
  std::int64_t block_ = 1;
  std::int64_t first_ = 0;  // index of values_[0]
  std::int64_t known_ = 0;
  std::size_t filled_ = 0;
  std::array<double, buffer_size> values_;
  std::array<std::int64_t, buffer_size> levels_;
};

}  // namespace debias

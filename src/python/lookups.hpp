#pragma once

// Calls of a slow function, gathered. In a first pass over the draws each call leaves its arguments here and goes on
// with zero; then one call answers all of a level at once; then the draws that count read the answers in the same order.
//
// Which questions are asked must not depend on the answers. A level asks with rows of a fixed width. Beyond
// `most_pending` numbers a level is answered early, so that memory grows with the answers alone.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <debias/core/reach.hpp>
#include <debias/core/stream.hpp>

#include "collecting.hpp"

namespace debias::python {

class Lookups {
 public:
  /// What a draw of a level asks for, and what it costs.
  struct Size {
    std::size_t width = 0;
    double work = 1;
  };
  /// Appends the answers to `rows` rows of questions; returns the numbers per answer.
  using Answer = std::function<std::size_t(std::int64_t level, std::span<const double> questions, std::size_t rows,
                                           std::vector<double>& answers)>;
  using SizeOf = std::function<Size(std::int64_t level)>;

  Lookups(Answer answer, SizeOf size_of) : answer_(std::move(answer)), size_of_(std::move(size_of)) {}

  static constexpr std::int64_t deepest_doubling = 26;  ///< level of 2^level rows that one draw may ask for at once

  [[nodiscard]] bool collecting() const { return collecting_; }
  /// In a first pass that has no second one: who reads answers there reads zeros.
  [[nodiscard]] bool answers_with_zeros() const { return unanswered_; }
  /// Of first passes, which one: what a draw has left elsewhere in it is stale in the next one.
  [[nodiscard]] std::uint64_t pass() const { return pass_; }

  /// Samples of a run at once. Problems of one level ask once for all: fewer samples stay in the cache.
  [[nodiscard]] std::int64_t ahead() const { return ahead_; }
  void set_ahead(std::int64_t samples) { ahead_ = samples; }

  Size size(std::int64_t level) { return rows_of(level).size; }

  /// The last level whose rows are not too wide, if they grow: found by asking for one level after the other, then for
  /// twice as deep ones. Any other refusal is no limit, and comes again when the level is drawn; nor is work that nobody
  /// will wait for, whose exact number may take as long.
  std::int64_t deepest_level() {
    bool is_endless = false;
    const auto fits = [&](std::int64_t level) {
      try {
        is_endless = size_of_(level).work >= 0x1p62;
      } catch (const std::length_error&) {
        return false;
      }
      return true;
    };
    try {
      constexpr std::int64_t one_by_one = 64;
      for (std::int64_t level = 0; level <= one_by_one; ++level) {
        if (!fits(level)) return level > 0 ? level - 1 : deepest_of_all;
      }
      std::int64_t low = one_by_one;
      std::int64_t high = 2 * low;
      for (; fits(high); high *= 2) {
        low = high;
        if (is_endless || high > deepest_of_all / 2) return deepest_of_all;
      }
      while (high - low > 1) {
        const std::int64_t middle = low + (high - low) / 2;
        (fits(middle) ? low : high) = middle;
      }
      return low;
    } catch (const std::exception&) {
      return deepest_of_all;
    }
  }

  /// Room for one row of questions.
  std::span<double> ask(std::int64_t level) { return room(level, rows_of(level), 1); }

  /// Asks with so many rows of the next numbers of a stream.
  void ask(std::int64_t level, std::int64_t count, Stream& rng) {
    Rows& rows = rows_of(level);
    if (unanswered_) return;
    const auto at_once = static_cast<std::int64_t>(most_pending / (rows.size.width + 1) + 1);
    for (; count > 0; count -= std::min(count, at_once)) {
      rng.fill(room(level, rows, static_cast<std::size_t>(std::min(count, at_once))));
    }
  }

  /// The answers to the next row, or to the next rows.
  std::span<const double> next(std::int64_t level, std::size_t count = 1) {
    Rows& rows = rows_of(level);
    if (unanswered_) {
      rows.answers.assign(count, 0.0);
      return rows.answers;
    }
    const std::size_t begin = rows.read * rows.answer_width;
    const std::size_t size = count * rows.answer_width;
    if (begin + size > rows.answers.size() || size == 0) {
      throw std::logic_error("lookups: a draw asks for more than in its first pass");
    }
    rows.read += count;
    return std::span(rows.answers).subspan(begin, size);
  }

  /// Runs the draws for their questions, and has them answered.
  void collect_queries(const std::function<void()>& draws) {
    for (auto& [level, rows] : rows_) rows.clear();
    ++pass_;
    ask_by(collecting_, draws);
    for (auto& [level, rows] : rows_) {
      if (rows.asked > 0) answer(level, rows);
    }
  }

  /// f(), for what does not depend on answers, such as the work of a draw: nobody is asked.
  template <class F>
  auto unanswered(const F& f) {
    unanswered_ = true;
    std::invoke_result_t<const F&> result{};
    try {
      collect_queries([&] { result = f(); });
    } catch (...) {
      unanswered_ = false;
      throw;
    }
    unanswered_ = false;
    return result;
  }

 private:
  static constexpr std::size_t most_pending = std::size_t{1} << 20;
  static constexpr std::size_t most_answers = std::size_t{1} << 27;

  struct Rows {
    std::int64_t level = 0;
    Size size;
    std::vector<double> questions;
    std::vector<double> answers;
    std::size_t asked = 0;
    std::size_t read = 0;
    std::size_t answer_width = 0;

    void clear() {
      questions.clear();
      answers.clear();
      asked = read = 0;
    }
  };

  std::span<double> room(std::int64_t level, Rows& rows, std::size_t count) {
    if (unanswered_) {  // of no use to anybody
      rows.questions.resize(count * rows.size.width);
      return rows.questions;
    }
    if (rows.questions.size() > most_pending) answer(level, rows);
    rows.asked += count;
    rows.questions.resize(rows.questions.size() + count * rows.size.width);
    return std::span(rows.questions).last(count * rows.size.width);
  }

  Rows& rows_of(std::int64_t level) {
    Rows*& near = near_[static_cast<std::size_t>(level) % near_.size()];
    if (near != nullptr && near->level == level) [[likely]]
      return *near;
    auto found = rows_.find(level);
    if (found == rows_.end()) {
      Rows rows;
      rows.level = level;
      rows.size = size_of_(level);
      found = rows_.emplace(level, std::move(rows)).first;
    }
    near = &found->second;
    return *near;
  }

  void answer(std::int64_t level, Rows& rows) {
    if (rows.answers.size() + rows.asked > most_answers) {
      throw std::length_error("level " + std::to_string(level) + " asks for more than 2^27 numbers within one chunk " +
                              "(1 GiB); choose a PMF that falls faster");
    }
    const bool again = !rows.answers.empty();
    const std::size_t width = answer_(level, rows.questions, rows.asked, rows.answers);
    if (again && width != rows.answer_width) {
      throw std::invalid_argument("level " + std::to_string(level) +
                                  " was answered in two forms (a level has one: " + "differences, or fine and coarse)");
    }
    rows.answer_width = width;
    rows.questions.clear();
    rows.asked = 0;
  }

  Answer answer_;
  SizeOf size_of_;
  std::map<std::int64_t, Rows> rows_;
  std::array<Rows*, 64> near_{};  // by level
  bool collecting_ = false;
  bool unanswered_ = false;
  std::uint64_t pass_ = 0;
  std::int64_t ahead_ = std::int64_t{1} << 16;
};

}  // namespace debias::python

#pragma once

// Draws of levels that grow from stage to stage: each level about the same work, nothing drawn twice.
//
//   levels 0 ... 8, then every level where the work grows by powers of 2, else four an octave
//
// Throws std::invalid_argument, "state the work", at the first level whose time grows 24 times beyond its stated work: that
// of the few draws that tell its work is enough. Asks plan.progress before each of them.
// Where the work of a level grows by ever smaller factors, that of up to six levels is looked at, drawn or not.
// A level is drawn while the budget leaves it 64 draws beside the others. Stops before a level that the sequence refuses
// (std::length_error).

#include <cstdint>
#include <exception>
#include <map>
#include <utility>

#include <debias/survey.hpp>

namespace debias {

/// Whether an error of a draw says that its level is too deep for the sequence: a std::length_error is behind it.
bool refuses_level(const std::exception& error);

class Pilot {
 public:
  Pilot(const LevelRuns& runs, const Plan& plan) : runs_(runs), plan_(plan) {}

  /// Draws until the levels up to `deepest` have cost `work` in all.
  void grow(double work, std::int64_t deepest);
  /// What the levels say. `budget_spent`: a no may be said.
  [[nodiscard]] Survey survey(bool budget_spent) const;
  /// Of all draws so far.
  [[nodiscard]] double work() const { return work_; }
  /// Work of the draws that told the work of levels beyond; none of `work`.
  [[nodiscard]] double looked_ahead() const { return looked_ahead_; }
  [[nodiscard]] std::int64_t levels() const { return static_cast<std::int64_t>(drawn_.size()); }

 private:
  std::pair<double, double> work_of(std::int64_t level);
  /// Does work grow by ever smaller factors?
  [[nodiscard]] bool work_bends() const;
  /// Then it looks at the next levels, as long as that takes no more than so much work.
  void follow_work(double most);
  void draw(std::int64_t level, std::int64_t draws);
  void check_time(std::int64_t level) const;
  [[noreturn]] void refuse_time(std::int64_t level, double seconds) const;

  const LevelRuns& runs_;
  Plan plan_;
  std::map<std::int64_t, Statistics> drawn_;
  std::map<std::int64_t, std::pair<double, double>> work_of_;
  std::map<std::int64_t, double> seconds_of_;  // of the processor, that finding this out took
  int unexplained_levels_ = 0;                 ///< the last ones, in a row
  double work_ = 0;
  double looked_ahead_ = 0;
  std::int64_t end_ = -1;  // the first level that the sequence refuses; -1: none known
};

}  // namespace debias

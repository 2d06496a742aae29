#include "survey/pilot.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/text.hpp"
#include "survey/resonance.hpp"
#include "survey/survey_of.hpp"

namespace debias {
namespace {

constexpr std::int64_t contiguous = 8;
constexpr double fewest_draws = 64;
constexpr std::int64_t most_draws = std::int64_t{1} << 20;
constexpr double growing = 0.25;  // octaves of work a level: every level then counts
constexpr double patience = 5;    // seconds for the draws of one level whose stated work does not explain them
constexpr double unexplained = 64;
constexpr double unexplained_by_processor = 24;
constexpr double least_time = 2e-5;   // seconds of the processor that a clock can tell
constexpr double enough_time = 4e-3;  // to speak of a level
constexpr std::int64_t rising = 3;    // levels over which the time has grown
constexpr double steep = 1;           // octaves by which work grows at a level ...
constexpr double bend = 0.01;         // ... and at least so much less than before: a line would go on too steeply
constexpr std::size_t settled = 6;    // levels above the first, whose deeper half tells how work goes on

// Of the processor, for this thread: neither a busy machine nor other threads count as work.
double processor_seconds() {
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec t{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t) == 0) {
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }
#endif
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

double of_both(const std::pair<double, double>& work) { return std::max(work.first, work.second); }

}  // namespace

bool refuses_level(const std::exception& e) {
  try {
    std::rethrow_if_nested(e);
  } catch (const std::length_error&) {
    return true;
  } catch (...) {
  }
  return false;
}

std::pair<double, double> Pilot::work_of(std::int64_t level) {
  const auto known = work_of_.find(level);
  if (known != work_of_.end()) return known->second;
  if (plan_.progress && !plan_.progress(0)) throw Interrupted("pilot: interrupted by the caller");
  const double start = processor_seconds();
  work_of_[level] = runs_.work(level, plan_);
  if (!(of_both(work_of_[level]) > 0)) {
    throw std::invalid_argument("pilot: a draw of level " + std::to_string(level) +
                                " states no work (must be positive); count the numbers that it draws, say");
  }
  const double seconds = processor_seconds() - start;
  const auto is_explained = [&] {
    if (plan_.ranks.size() > 1 || seconds < enough_time) return true;
    for (const auto& [k, before] : seconds_of_) {
      if (k == 0 || k + rising > level) continue;
      const double work = of_both(work_of_.at(level)) / of_both(work_of_.at(k));
      if (seconds > unexplained_by_processor * work * std::max(before, least_time)) return false;
    }
    return true;
  };
  seconds_of_[level] = seconds;
  // What is done once only is none of the work: two levels in a row have to show it.
  unexplained_levels_ = is_explained() ? 0 : unexplained_levels_ + 1;
  if (unexplained_levels_ >= 2) refuse_time(level, seconds / static_cast<double>(2 * detail::draws_for_work));
  return work_of_[level];
}

void Pilot::refuse_time(std::int64_t level, double seconds) const {
  throw std::invalid_argument("pilot: a draw of level " + std::to_string(level) + " takes " + format("%.2g", seconds) +
                              " seconds (its stated work is " + format("%.4g", of_both(work_of_.at(level))) +
                              ", and shallower levels state as much for a small part of that time); state the work of "
                              "a draw (`work`, with its value)");
}

void Pilot::grow(double work, std::int64_t deepest) {
  std::vector<std::int64_t> levels;
  deepest = std::min(deepest, runs_.deepest_level);
  for (std::int64_t k = 0; k <= deepest && (end_ < 0 || k < end_);) {
    try {
      const double each = of_both(work_of(k));
      const bool is_new = drawn_.find(k) == drawn_.end();
      if (is_new && k > 2 && fewest_draws * each > work / static_cast<double>(levels.size() + 1)) break;
    } catch (const std::length_error&) {
      if (levels.size() < 2) throw;
      end_ = k;
      break;
    }
    levels.push_back(k);
    std::int64_t step = 1;
    if (k >= contiguous) {
      const double growth = std::log2(of_both(work_of(k)) / of_both(work_of(k / 2))) / static_cast<double>(k - k / 2);
      if (growth < growing)
        step = std::max<std::int64_t>(
            1, static_cast<std::int64_t>(std::exp2(std::floor(std::log2(static_cast<double>(k) / 4)))));
    }
    k += step;
  }
  double left = std::max(0.0, work - work_);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const double each = of_both(work_of(levels[i]));
    const auto found = drawn_.find(levels[i]);
    const std::int64_t have = found == drawn_.end() ? 0 : found->second.samples;
    const double share = left / static_cast<double>(levels.size() - i);
    const double more = std::min(share / each, static_cast<double>(most_draws - have));
    std::int64_t draws = have + static_cast<std::int64_t>(std::max(0.0, more));
    if (have == 0) draws = std::max(draws, static_cast<std::int64_t>(fewest_draws));
    if (draws <= have) continue;
    try {
      draw(levels[i], draws);
    } catch (const SampleError& e) {
      if (drawn_.size() < 2 || !refuses_level(e)) throw;
      end_ = levels[i];
      break;
    }
    // A chunk that was cut is drawn once more.
    const double spent = static_cast<double>(draws - have + have % default_chunk) * each;
    work_ += spent;
    left = std::max(0.0, left - spent);
  }
  follow_work(2 * work);
}

bool Pilot::work_bends() const {
  if (work_of_.size() < 4) return false;
  const std::int64_t last = work_of_.rbegin()->first;
  if (work_of_.find(last - 1) == work_of_.end() || work_of_.find(last - 2) == work_of_.end()) return false;
  const auto growth = [&](std::int64_t k) { return std::log2(of_both(work_of_.at(k)) / of_both(work_of_.at(k - 1))); };
  return growth(last) > steep && growth(last) < growth(last - 1) - bend;
}

void Pilot::follow_work(double most) {
  while (work_bends() && work_of_.size() <= settled) {
    const auto [last, work] = *work_of_.rbegin();
    if (last == runs_.deepest_level || last + 1 == end_) return;
    const double next = of_both(work) * of_both(work) / of_both(work_of_.at(last - 1));
    if (!(next * static_cast<double>(2 * detail::draws_for_work) <= most)) return;
    try {
      const std::pair<double, double> each = work_of(last + 1);
      looked_ahead_ += (each.first + each.second) * static_cast<double>(detail::draws_for_work);
    } catch (const std::length_error&) {
      end_ = last + 1;
    }
  }
}

void Pilot::draw(std::int64_t level, std::int64_t draws) {
  Plan part = plan_;
  part.samples = draws;
  part.save = {};
  part.earlier = {};
  part.pilot = {};
  part.whole = 0;
  const auto found = drawn_.find(level);
  if (found != drawn_.end()) part.earlier = std::make_shared<RunState>(found->second.state);
  drawn_[level] = runs_.draw(level, part);
  check_time(level);
}

// The time of a level, beside that of the first ones, against its stated work.
void Pilot::check_time(std::int64_t level) const {
  const Statistics& here = drawn_.at(level);
  if (plan_.ranks.size() > 1 || here.seconds < patience) return;
  double least = std::numeric_limits<double>::infinity();  // seconds for a unit of work
  for (const auto& [k, s] : drawn_) {
    if (k < level && s.seconds > 0)
      least = std::min(least, s.seconds / (static_cast<double>(s.samples) * of_both(work_of_.at(k))));
  }
  const double each = here.seconds / static_cast<double>(here.samples);
  if (!(each / of_both(work_of_.at(level)) > unexplained * least)) return;
  refuse_time(level, each);
}

Survey Pilot::survey(bool budget_spent) const {
  std::vector<SurveyRow> rows;
  for (const auto& [level, s] : drawn_) rows.push_back(row_of(s, level, work_of_.at(level)));
  std::vector<LevelFacts> beyond;
  if (work_bends() && rows.back().second_moment > 0) {
    for (auto known = work_of_.upper_bound(rows.back().level); known != work_of_.end(); ++known) {
      LevelFacts f;
      f.level = known->first;
      f.work = known->second.second;
      beyond.push_back(f);
    }
  }
  const SequenceFacts facts = facts_beside(runs_, rows, plan_.seed);
  return survey_of(std::move(rows), plan_.seed, facts, budget_spent, beyond);
}

}  // namespace debias

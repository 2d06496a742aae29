#include <debias/core/resonance.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/result.hpp>

#include "core/text.hpp"

namespace debias::detail {
namespace {

constexpr double share_of_run = 1.0 / 16;  // of its look-ups
constexpr double least_lookups = 4096;     // as long as they are at most half of the run's
constexpr std::int64_t fewest_draws = 4;
constexpr std::int64_t most_draws = 512;
constexpr std::int64_t few_beyond = 8;  // draws of deeper levels, up to which a level is the last
constexpr double room = 3;              // standard errors
constexpr double rounding = 1e-12;

// The largest that was found.
struct Finding {
  double errors = 0;  // standard errors
  double size = 0;
  std::int64_t level = 0;

  void take(double found, double error, std::int64_t k) {
    if (std::abs(found) > errors * error) *this = {std::abs(found) / error, found, k};
  }
};

// What the levels above `level` have added to the answer. Of several components the table knows the size only.
double added_beyond(const Statistics& s, std::int64_t level) {
  double added = 0;
  for (const LevelRow& row : s.levels) {
    if (row.is_base || row.level <= level) continue;
    const double expected = row.probability > 0 ? row.probability * static_cast<double>(s.samples) : 0;
    const double share = expected > 0 ? static_cast<double>(row.count) / expected : 1;
    added += share * (s.components.size() == 1 ? row.mean : std::sqrt(row.second_moment));
  }
  return added;
}

// Is no difference more than rounding?
bool all_vanish(const std::vector<LevelRow>& levels) {
  double base = 0;
  for (const LevelRow& row : levels) base = row.is_base ? std::max(base, row.second_moment) : base;
  return std::all_of(levels.begin(), levels.end(), [&](const LevelRow& row) {
    return row.is_base || row.second_moment <= rounding * rounding * base;
  });
}

}  // namespace

bool LeftOut::is_seen(double error) const { return std::abs(size) > room * std::hypot(error, noise); }

LeftOut left_out(const std::vector<double>& batches, std::int64_t draws, double added) {
  const double whole = static_cast<double>(draws) / static_cast<double>(draws - 1);  // B has 1 - 1 / draws of it
  const auto n = static_cast<double>(batches.size());
  double mean = 0;
  for (const double x : batches) mean += whole * x / n;
  double squares = 0;
  for (const double x : batches) squares += (whole * x - mean) * (whole * x - mean);
  const double noise = std::sqrt(squares / (n * (n - 1)));
  if (!std::isfinite(noise)) return {};
  if (!(mean * added > 0)) return {mean, noise};
  return {std::copysign(std::max(std::abs(mean) - std::abs(added), 0.0), mean), noise};
}

std::vector<double> seen_beyond(const Missed& missed, std::int64_t level, std::int64_t draws,
                                const std::vector<Answered>& answer, double& work) {
  std::vector<double> seen(answer.size());
  for (const Batches which : {batches_of_missed, batches_again}) {
    const MissedBatches batches = missed(level, draws, which);
    work += static_cast<double>(which.count * draws) * std::exp2(static_cast<double>(level));
    bool found = false;
    for (std::size_t c = 0; c < answer.size(); ++c) {
      const Answered& a = answer[c];
      const bool is_doubted = c < batches.size() && (which.first == 0 || seen[c] != 0);
      seen[c] = 0;
      if (!is_doubted) continue;
      const double side = a.sign_is_known || batches[c].front() > 0 ? 1 : -1;
      const LeftOut left = left_out(batches[c], draws, side * a.added);
      if (!left.is_seen(a.error)) continue;
      seen[c] = left.size;
      found = true;
    }
    if (!found) break;
  }
  return seen;
}

bool is_linear(const Missed& missed, std::int64_t level, const std::vector<double>& sizes) {
  const MissedBatches batches = missed(level, fewest_draws, batches_of_missed);
  for (std::size_t c = 0; c < sizes.size(); ++c) {
    if (c >= batches.size()) return false;
    for (const double b : batches[c]) {
      if (!(std::abs(b) <= rounding * sizes[c])) return false;
    }
  }
  return true;
}

std::vector<std::int64_t> levels_to_check(std::int64_t base_level, std::int64_t last) {
  std::vector<std::int64_t> levels = {base_level};
  for (const std::int64_t k : {(base_level + last) / 2, last}) {
    if (k > levels.back()) levels.push_back(k);
  }
  return levels;
}

double work_of_missed(std::int64_t level, std::int64_t draws) {
  return static_cast<double>(batches_of_missed.count * draws) * std::exp2(static_cast<double>(level));
}

std::int64_t draws_of_missed(std::int64_t level, double lookups) {
  const double draws = lookups / std::exp2(static_cast<double>(level)) / static_cast<double>(batches_of_missed.count);
  if (!(draws >= static_cast<double>(fewest_draws))) return 0;
  return draws < static_cast<double>(most_draws) ? static_cast<std::int64_t>(draws) : most_draws;
}

std::string resonance_words(std::int64_t level, double size, double errors) {
  return "the points may resonate with the integrand: independent combs put the answer " + format("%.2g", size) +
         " beyond level " + std::to_string(level) + ", " + format("%.3g", errors) +
         " standard errors, and the levels that were drawn do not show it; take function_of_jittered_integral, or a "
         "base level beyond the period";
}

void judge_points(Statistics& s, const Missed& missed) {
  if (s.nonfinite > 0 || s.blocks < 2) return;
  const LevelTable& table = s.state.total().levels;
  const auto rows = table.rows();
  const auto count = [&](std::size_t k) { return k < rows.size() ? rows[k].count : 0; };
  const std::size_t end = std::min<std::size_t>(rows.size(), LevelTable::single_levels);
  std::size_t deepest = static_cast<std::size_t>(table.base_level());
  for (std::size_t k = deepest; k < end; ++k) deepest = count(k) > 0 ? k : deepest;
  // The shallowest level that hardly anything was drawn beyond.
  auto last = static_cast<std::int64_t>(deepest);
  std::int64_t beyond = 0;
  while (last > table.base_level() && beyond + count(static_cast<std::size_t>(last)) <= few_beyond) {
    beyond += count(static_cast<std::size_t>(last--));
  }
  const double work = s.work - s.pilot_work;
  const double budget = std::max(share_of_run * work, std::min(least_lookups, work / 2));
  while (last > table.base_level() && draws_of_missed(last, budget / 3) == 0) --last;
  const std::vector<std::int64_t> levels = levels_to_check(table.base_level(), last);
  const double each = budget / static_cast<double>(levels.size());
  Finding finding;
  double spent = 0;
  if (s.sequence.constant_limit && all_vanish(s.levels)) {
    std::vector<double> sizes;
    for (const ComponentEstimate& e : s.components) sizes.push_back(std::max(std::abs(e.mean), e.standard_error));
    spent += work_of_missed(table.base_level(), fewest_draws);
    if (is_linear(missed, table.base_level(), sizes)) {
      s.sequence.exact_from = s.state.pilot.sequence.exact_from = table.base_level();
    }
  }
  for (const std::int64_t level : levels) {
    std::int64_t draws = draws_of_missed(level, each);
    if (draws == 0 && levels.size() == 1 && work_of_missed(level, fewest_draws) <= work / 2) draws = fewest_draws;
    if (draws == 0) continue;
    const double added = added_beyond(s, level);
    const bool is_number = s.components.size() == 1;  // of arrays the table has the sizes only
    std::vector<Answered> answer;
    for (const ComponentEstimate& e : s.components) {
      answer.push_back({std::max(e.standard_error, rounding * std::abs(e.mean)), added, is_number});
    }
    const std::vector<double> seen = seen_beyond(missed, level, draws, answer, spent);
    for (std::size_t c = 0; c < seen.size(); ++c) finding.take(seen[c], answer[c].error, level);
  }
  s.work += spent;
  s.pilot_work += spent;
  if (finding.errors == 0) return;
  s.warnings.push_back(
      {WarningCode::aliased_differences, resonance_words(finding.level, finding.size, finding.errors) + "."});
}

}  // namespace debias::detail

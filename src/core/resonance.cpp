#include <debias/core/resonance.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <debias/core/result.hpp>

#include "core/text.hpp"

namespace debias::detail {
namespace {

constexpr double share_of_run = 1.0 / 16;  // of its look-ups
constexpr double least_lookups = 4096;     // as long as they are at most half of the run's
constexpr std::int64_t fewest_draws = 8;
constexpr std::int64_t most_draws = 64;
constexpr std::int64_t few_beyond = 8;      // draws of deeper levels, up to which a level is looked at
constexpr double room = 0.75;               // standard errors
constexpr double room_of_comparison = 3.5;  // likewise
constexpr double rounding = 1e-12;

// The largest that was found.
struct Finding {
  double errors = 0;  // standard errors
  double size = 0;
  std::int64_t level = 0;

  void take(double found, double allowed, const ComponentEstimate& e, std::int64_t k) {
    if (!(std::abs(found) > allowed)) return;
    const double z = std::abs(found) / std::max(e.standard_error, rounding * std::abs(e.mean));
    if (!(z > errors)) return;
    *this = {z, found, k};
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

// Draws beyond a level that a run of its length has on the average.
double expected_beyond(const Statistics& s, std::int64_t level) {
  double mass = 0;
  for (std::size_t i = 0; i < s.masses.mass.size(); ++i) {
    if (s.masses.first_level + static_cast<std::int64_t>(i) > level) mass += s.masses.mass[i];
  }
  return mass * static_cast<double>(s.samples);
}

}  // namespace

double agreed(std::vector<double> batches) {
  for (const double x : batches) {
    if (std::isnan(x)) return 0;  // it has no place in an order
  }
  std::sort(batches.begin(), batches.end());
  if (batches.size() < 2) return 0;
  const double low = batches[1];
  const double high = batches[batches.size() - 2];
  if (low < 0 && high < 0) return low;
  if (low > 0 && high > 0) return high;
  return std::abs(low) > std::abs(high) ? std::min(low, 0.0) : std::max(high, 0.0);
}

double left_out(std::vector<double> batches, std::int64_t draws, double added) {
  const double whole = static_cast<double>(draws) / static_cast<double>(draws - 1);  // B has 1 - 1 / draws of it
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  bool above = true;
  bool below = true;
  for (const double x : batches) {
    if (std::isnan(x)) return 0;
    above = above && x > 0;
    below = below && x < 0;
    low = std::min(low, whole * x - added);
    high = std::max(high, whole * x - added);
  }
  const double spread = high - low;
  if (above && low > spread) return low - spread;
  return below && -high > spread ? high + spread : 0;
}

double work_of_missed(std::int64_t level, std::int64_t draws) {
  return static_cast<double>(batches_of_missed * draws) * std::exp2(static_cast<double>(level));
}

std::int64_t draws_of_missed(std::int64_t level, double lookups) {
  const double draws = lookups / std::exp2(static_cast<double>(level)) / static_cast<double>(batches_of_missed);
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
  const double each = budget / 2;
  Finding finding;
  double spent = 0;
  const auto look = [&](std::int64_t level, std::int64_t draws) {
    spent += work_of_missed(level, draws);
    return missed(level, draws);
  };
  // Not the interval: zeros that it doubts would widen it beyond what they hide.
  const std::size_t components = s.components.size();
  std::int64_t draws = draws_of_missed(last, each);
  if (draws == 0 && last == table.base_level() && work_of_missed(last, fewest_draws) <= work / 2) draws = fewest_draws;
  if (draws > 0) {
    const double expected = std::max(static_cast<double>(beyond), expected_beyond(s, last));
    const MissedBatches b = look(last, draws);
    for (std::size_t c = 0; c < b.size() && c < components; ++c) {
      const ComponentEstimate& e = s.components[c];
      const double allowed = (std::sqrt(expected) + room) * e.standard_error;
      finding.take(agreed(b[c]), allowed + rounding * std::abs(e.mean), e, last);
    }
  }
  // The deepest level that is known well enough: what the run has drawn beyond it may be plenty, and miss one level of them.
  std::int64_t sharp = last;
  while (sharp > table.base_level() && draws_of_missed(sharp, each) < sharp_draws) --sharp;
  draws = draws_of_missed(sharp, each);
  if (finding.errors == 0 && draws >= sharp_draws) {
    const MissedBatches b = look(sharp, draws);
    const double added = added_beyond(s, sharp);
    for (std::size_t c = 0; c < b.size() && c < components; ++c) {
      const ComponentEstimate& e = s.components[c];
      const double side = components == 1 || b[c].front() > 0 ? 1 : -1;
      finding.take(left_out(b[c], draws, side * added),
                   room_of_comparison * e.standard_error + rounding * std::abs(e.mean), e, sharp);
    }
  }
  s.work += spent;
  s.pilot_work += spent;
  if (finding.errors == 0) return;
  s.warnings.push_back(
      {WarningCode::aliased_differences, resonance_words(finding.level, finding.size, finding.errors) + "."});
}

}  // namespace debias::detail

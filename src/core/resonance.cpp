#include <debias/core/resonance.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <debias/core/result.hpp>

#include "core/text.hpp"

namespace debias::detail {
namespace {

constexpr double share_of_run = 1.0 / 16;  // of its look-ups
constexpr double least_lookups = 4096;     // as long as they are at most half of the run's
constexpr std::int64_t fewest_draws = 8;
constexpr std::int64_t most_draws = 256;
constexpr std::int64_t most_levels = 3;
constexpr std::int64_t few_beyond = 8;  // draws of deeper levels, from which on a level is looked at
constexpr double room = 2;              // standard errors
constexpr double rounding = 1e-12;

}  // namespace

double agreed(std::span<double> batches) {
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
  std::vector<std::pair<std::size_t, std::int64_t>> levels;  // with the draws beyond them
  std::int64_t beyond = 0;
  for (std::size_t k = deepest;; --k) {
    if (beyond > few_beyond) break;
    levels.emplace_back(k, beyond);
    beyond += count(k);
    if (k == static_cast<std::size_t>(table.base_level())) break;
  }
  const double work = s.work - s.pilot_work;
  double budget = std::max(share_of_run * work, std::min(least_lookups, work / 2));
  double worst = 0;
  double size = 0;
  std::size_t where = 0;
  std::int64_t looked = 0;
  // Not the interval: zeros that it doubts would widen it beyond what they hide.
  std::vector<double> errors;
  for (const ComponentEstimate& c : s.components) errors.push_back(c.standard_error);
  for (std::size_t i = levels.size(); i-- > 0 && looked < most_levels;) {
    const auto [level, deeper] = levels[i];
    const auto k = static_cast<std::int64_t>(level);
    const std::int64_t draws = draws_of_missed(k, budget / static_cast<double>(most_levels));
    if (draws == 0) break;
    ++looked;
    const std::vector<double> b = missed(k, draws);
    for (std::size_t c = 0; c < b.size() && c < errors.size(); ++c) {
      const double allowed =
          (std::sqrt(static_cast<double>(deeper)) + room) * errors[c] + rounding * std::abs(s.components[c].mean);
      if (!(std::abs(b[c]) > allowed)) continue;
      const double z = std::abs(b[c]) / std::max(errors[c], rounding * std::abs(s.components[c].mean));
      if (!(z > worst)) continue;
      worst = z;
      size = b[c];
      where = level;
    }
  }
  if (!(worst > 0)) return;
  s.warnings.push_back(
      {WarningCode::aliased_differences, resonance_words(static_cast<std::int64_t>(where), size, worst) + "."});
}

}  // namespace debias::detail

#include <debias/derivative/bias.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <debias/core/text.hpp>

namespace debias::detail {

DifferencesSeen see_differences(const LevelTable& levels, std::int64_t last_level, const Rates& rates) {
  constexpr double draws_per_kurtosis = 10;
  const double fall = rates.variance_decay / 2;
  DifferencesSeen seen;
  for (std::size_t i = 1; i < levels.rows().size() && i < static_cast<std::size_t>(LevelTable::single_levels); ++i) {
    const LevelSums& row = levels.rows()[i];
    const auto level = static_cast<std::int64_t>(i);
    if (row.count == 0 || level > last_level) continue;
    seen.any = true;
    const auto count = static_cast<double>(row.count);
    const double square = row.square / count;
    seen.finite = seen.finite && std::isfinite(square);
    seen.truncation =
        std::max(seen.truncation, std::sqrt(square) * std::exp2(-fall * static_cast<double>(last_level + 1 - level)));
    const double kurtosis = row.kurtosis();
    if (!(square > 0) || count < draws_per_kurtosis * kurtosis) continue;
    // Of equal differences the kurtosis is a rounding off 1.
    seen.moments.push_back({level, std::log(square), std::max(kurtosis - 1, 0.0) / count});
  }
  return seen;
}

// Do the levels of a run grow from the first to the last one, or stay at the height of the highest one? A level that
// is higher than the last one, beyond doubt, shows that they fall: the first one may be small by accident.
std::string doubt_of_draws(const std::vector<DifferenceMoment>& moments, const Rates& rates) {
  if (moments.size() < 2) return {};
  const DifferenceMoment& first = moments.front();
  const DifferenceMoment& last = moments.back();
  const DifferenceMoment& highest = *std::max_element(
      moments.begin(), moments.end() - 1,
      [](const DifferenceMoment& a, const DifferenceMoment& b) { return a.log_square < b.log_square; });
  const auto rise = [&last](const DifferenceMoment& m) { return last.log_square - m.log_square; };
  const auto error = [&last](const DifferenceMoment& m) { return 2 * std::sqrt(m.variance + last.variance); };
  // An eighth of the declared rate is nothing that a kink explains.
  const double least_fall = std::min(rates.variance_decay, 16.0) / 8 * std::log(2.0);
  const bool grows = rise(first) > error(first) && !(-rise(highest) > error(highest));
  const bool stays = rise(highest) > error(highest) - least_fall * static_cast<double>(last.level - highest.level);
  if (!grows && !stays) return {};
  const DifferenceMoment& from = grows ? first : highest;
  return std::string("the differences ") + (grows ? "grow" : "do not fall") +
         " (E D_k^2 = " + format("%g", std::exp(from.log_square)) + " at level " + std::to_string(from.level) + ", " +
         format("%g", std::exp(last.log_square)) + " at " + std::to_string(last.level) +
         "): f jumps, or has noise of its own, and common random numbers do not help";
}

// How an f without noise falls is seen over the last levels on which it is above rounding.
std::string doubt_of_sizes(const std::vector<double>& sizes, std::int64_t last, const Rates& rates) {
  constexpr double share_of_rate = 0.75;
  if (last < 2) return {};
  const auto largest = [&sizes](std::int64_t from, std::int64_t to) {  // the level of the largest in [from, to]
    const auto begin = sizes.begin() + std::max<std::int64_t>(from, 1);
    return std::max_element(begin, sizes.begin() + to + 1) - sizes.begin();
  };
  const std::int64_t span = std::min<std::int64_t>(last - 1, 3);
  const std::int64_t late = largest(last - (span == 3 ? 1 : 0), last);
  const std::int64_t early = largest(last - span - 2, last - span);
  const double before = sizes[static_cast<std::size_t>(early)];
  const double after = sizes[static_cast<std::size_t>(late)];
  const double needed = share_of_rate * std::min(rates.variance_decay / 2, 16.0) * static_cast<double>(late - early);
  if (after * std::exp2(needed) <= before) return {};
  return std::string("the differences ") + (after > before ? "grow" : "do not fall as declared") +
         " (|D_k| = " + format("%g", before) + " at level " + std::to_string(early) + ", " + format("%g", after) +
         " at " + std::to_string(late) + "): f jumps or bends there, or has a pole";
}

BiasBound bound_of_differences(const DifferencesSeen& seen, const std::string& doubt, std::int64_t last_level,
                               const Rates& rates, double rounding) {
  const double fall = rates.variance_decay / 2;
  const double truncation = seen.any && seen.finite && fall > 0 && doubt.empty()
                                ? 2 * seen.truncation / (1 - std::exp2(-fall))
                                : std::numeric_limits<double>::infinity();
  std::string text =
      "finite differences end at level " + std::to_string(last_level) + "; truncation " + format("%g", truncation);
  if (!doubt.empty()) {
    text += ", since " + doubt;
  } else if (!seen.finite) {
    text += ", since the differences are not finite";
  } else if (!(fall > 0)) {
    text += ", since E D_k^2 does not fall";
  } else {
    text += std::isinf(fall) ? std::string(" if E D_k^2 falls faster than any power")
                             : " if E D_k^2 falls like 2^(-" + format("%g", rates.variance_decay) + " k)";
  }
  text += ", rounding " + format("%g", rounding) + " if f is good to one unit in the last place";
  return {truncation + rounding, text};
}

}  // namespace debias::detail

#include <debias/core/coupling.hpp>

#include <algorithm>
#include <charconv>
#include <optional>
#include <stdexcept>

#include <debias/core/accumulator.hpp>
#include <debias/core/stream.hpp>

#include "core/text.hpp"

namespace debias {

void CouplingSide::merge(const CouplingSide& b) {
  if (b.count == 0) return;
  if (count == 0) {
    *this = b;
    return;
  }
  const auto na = static_cast<double>(count);
  const auto nb = static_cast<double>(b.count);
  const double delta = b.mean - mean;
  const double share = nb / (na + nb);
  m2 += b.m2 + delta * delta * na * share;
  const double reach_a = reach + std::abs(delta) * share;
  const double reach_b = b.reach + std::abs(delta) * (1 - share);
  reach = reach_a < reach_b ? reach_b : reach_a;
  mean += delta * share;
  count += b.count;
}

void CouplingTable::merge(const CouplingTable& other) {
  for (std::size_t v = 0; v < views; ++v) {
    std::vector<CouplingRow>& rows = rows_[v];
    const std::vector<CouplingRow>& others = other.rows_[v];
    if (rows.size() < others.size()) rows.resize(others.size());
    for (std::size_t k = 0; k < others.size(); ++k) {
      rows[k].value.merge(others[k].value);
      rows[k].coarse.merge(others[k].coarse);
      rows[k].difference.merge(others[k].difference);
    }
  }
}

CouplingSums::CouplingSums() : rows_(CouplingTable::views * static_cast<std::size_t>(CouplingTable::levels)) {}

template <std::size_t n>
CouplingSide CouplingSums::Sums<n>::moments(std::size_t i) const {
  if (count == 0) return {};
  const double shift = sum[i] / static_cast<double>(count);
  const double m2 = squares[i] - sum[i] * shift;
  return {count, pivot[i] + shift, m2 < 0 ? 0 : m2, std::sqrt(largest[i]) + std::abs(shift)};
}

void CouplingSums::finish(CouplingTable& table) {
  for (std::size_t v = 0; v < CouplingTable::views; ++v) {
    table.rows_[v].resize(used_[v]);
    for (std::size_t k = 0; k < used_[v]; ++k) {
      Row& row = rows_[v * static_cast<std::size_t>(CouplingTable::levels) + k];
      table.rows_[v][k] = {row.base.moments(0), row.pair.moments(1), row.difference.moments(0)};
      table.rows_[v][k].value.merge(row.pair.moments(0));
      row = {};
    }
    used_[v] = 0;
  }
}

namespace {

constexpr double false_alarm = 1e-6;       // of a run
constexpr std::int64_t fewest_draws = 16;  // of a mean
constexpr double largest_pull = 1;         // of one draw on a mean, in standard errors of the gap
constexpr double negligible = 1e-10;       // gaps that a run will not see, relative to the values
constexpr double least_size = 1e-140;      // of values whose squares keep their digits
constexpr std::int64_t fewest_equal = 64;  // zeros that are no accident
constexpr double slowest_fall = 0.25;      // of Var I_k, in octaves a level: an average of 2^k draws has 1

// Sides that are added up, with their error and what a single draw does to them.
struct Gap {
  double gap = 0;
  double square_error = 0;
  double pull = 0;
  double size = 0;

  void add(const CouplingSide& s, double sign, double reach) {
    const auto n = static_cast<double>(s.count);
    const double variance = s.m2 / (n - 1);
    gap += sign * s.mean;
    square_error += variance / n;
    pull = std::max(pull, std::max(s.reach, reach) / n);
    size += std::abs(s.mean) + std::sqrt(variance);
  }
};

struct Comparison {
  std::int64_t level;
  Gap gap;
};

// The difference of a level that is a number.
CouplingSide side_of(const LevelSums& s) {
  const auto n = static_cast<double>(s.count);
  const double mean = s.difference / n;
  const double m2 = s.square - n * mean * mean;
  return {s.count, mean, m2 < 0 ? 0 : m2, std::sqrt(std::sqrt(s.fourth) / s.unit) + std::abs(mean)};
}

bool enough(const CouplingSide& s) { return s.count >= fewest_draws && std::isfinite(s.m2) && std::isfinite(s.mean); }

void compare(std::span<const CouplingRow> rows, const LevelTable& levels, double rounding,
             std::vector<Comparison>& all) {
  const auto keep = [&](std::size_t level, Gap gap) {
    if (!(gap.size > least_size) || !std::isfinite(gap.gap) || !std::isfinite(gap.square_error)) return;
    const double floor = rounding * gap.size;
    gap.square_error += floor * floor;
    if (!(gap.pull <= largest_pull * std::sqrt(gap.square_error))) return;
    all.push_back({static_cast<std::int64_t>(level), gap});
  };
  std::size_t m = 0;
  while (m < rows.size() && rows[m].value.count == 0) ++m;
  Gap chain;  // E I_m and the differences above it
  bool whole = m < rows.size() && enough(rows[m].value);
  if (whole) chain.add(rows[m].value, -1, m + 1 < rows.size() ? rows[m + 1].coarse.reach : 0);
  for (std::size_t k = m + 1; k < rows.size(); ++k) {
    const CouplingSide& coarse = rows[k].coarse;
    const CouplingSide& below = rows[k - 1].value;
    if (enough(coarse)) {
      if (enough(below)) {
        Gap gap;
        gap.add(coarse, 1, below.reach);
        gap.add(below, -1, coarse.reach);
        keep(k, gap);
      }
      if (whole && k > m + 1) {
        Gap gap = chain;
        gap.add(coarse, 1, below.reach);
        keep(k, gap);
      }
    }
    CouplingSide difference = rows[k].difference;
    if (difference.count == 0 && k < levels.rows().size()) difference = side_of(levels.rows()[k]);
    whole = whole && enough(difference);
    if (whole) chain.add(difference, -1, 0);
  }
}

// Zeros where draws differ, and go on differing as much: one draw stands for all of a level.
bool all_equal(std::span<const CouplingRow> rows, const LevelTable& levels) {
  std::int64_t draws = 0;
  for (const LevelSums& s : levels.rows()) {
    if (s.square != 0 || s.difference != 0) return false;
    draws += s.count;
  }
  if (draws < fewest_equal) return false;
  const auto variance = [](const CouplingSide& s) { return s.m2 / static_cast<double>(s.count - 1); };
  std::optional<std::size_t> first;
  std::optional<std::size_t> last;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (rows[k].value.count < fewest_equal) continue;
    if (!first) first = k;
    if (rows[k].coarse.count > 0) last = k;
  }
  if (!first || !last || *last == *first) return false;
  const double before = variance(rows[*first].value);
  return before > 0 &&
         variance(rows[*last].value) > before * std::exp2(-slowest_fall * static_cast<double>(*last - *first));
}

}  // namespace

Coupling detail::judge_coupling(const CouplingTable& table, const LevelTable& levels, double epsilon) {
  Coupling c;
  const auto drawn = [](const LevelSums& s) { return s.count > 0; };
  if (std::none_of(levels.rows().begin(), levels.rows().end(), drawn)) return c;
  c.state = Coupling::State::no_values;
  std::vector<Comparison> all;
  for (std::size_t v = 0; v < CouplingTable::views; ++v) {
    const std::span<const CouplingRow> rows = table.rows(v);
    const auto coupled = [](const CouplingRow& row) { return row.coarse.count > 0; };
    if (std::any_of(rows.begin(), rows.end(), coupled)) c.state = Coupling::State::too_few;
    compare(rows, levels, std::max(negligible, 16 * epsilon), all);
  }
  c.all_equal = all_equal(table.rows(0), levels);
  if (all.empty()) return c;
  c.state = Coupling::State::right;
  c.first_level = c.last_level = all.front().level;
  const double q = -normal_quantile(false_alarm / (2 * static_cast<double>(all.size())));
  for (const Comparison& one : all) {
    c.first_level = std::min(c.first_level, one.level);
    c.last_level = std::max(c.last_level, one.level);
    const double error = std::sqrt(one.gap.square_error);
    const double z = std::abs(one.gap.gap) / error;
    const double qg = q * one.gap.pull / error;
    const double threshold = q * (1 + qg / 3 + qg * qg / 25);
    if (c.threshold > 0 && !(z * c.threshold > c.z * threshold)) continue;
    c.level = one.level;
    c.z = z;
    c.threshold = threshold;
  }
  if (c.z > c.threshold) c.state = Coupling::State::wrong;
  return c;
}

const char* name_of(Coupling::State state) {
  constexpr std::array names = {"no levels", "not checked", "too few draws", "right", "wrong"};
  return names[static_cast<std::size_t>(state)];
}

namespace {

// Three digits are enough.
std::string three_digits(double x) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), x, std::chars_format::general, 3).ptr;
  return {digits.data(), end};
}

}  // namespace

std::string text_of(const Coupling& c) {
  switch (c.state) {
    case Coupling::State::no_levels:
      return {};
    case Coupling::State::no_values:
      return "not checked (differences come without the values of their levels)";
    case Coupling::State::too_few:
      return "not checked (too few draws of neighbouring levels, or tails that are too heavy)";
    case Coupling::State::right:
      return "no gap beyond chance between coarse partners and the levels below (levels " +
             std::to_string(c.first_level) + " to " + std::to_string(c.last_level) + ")";
    case Coupling::State::wrong:
      break;
  }
  return "WRONG at level " + std::to_string(c.level) + ", see warning";
}

std::optional<Warning> warning_of(const Coupling& c) {
  if (c.state == Coupling::State::wrong) {
    return Warning{
        WarningCode::coupling,
        "wrong coupling: the coarse partner of level " + std::to_string(c.level) +
            " does not have the mean of the level below (" + three_digits(c.z) +
            " standard errors apart, by chance at most " + three_digits(c.threshold) +
            "), so every estimate from this sequence is biased; are fine and coarse exchanged, or do levels not start "
            "at 0?"};
  }
  if (c.all_equal) {
    return Warning{
        WarningCode::zero_differences,
        "all differences are exactly zero, though numbers were drawn and deep levels vary as much as the base: "
        "either "
        "the base is unbiased already, or all draws of a level are one and the same (a stream that was copied)."};
  }
  return std::nullopt;
}

void detail::refuse_work(std::int64_t level, double work) {
  throw std::invalid_argument("work = " + to_text(work) + " at level " + std::to_string(level) +
                              " (must be finite and not negative); count the draws, say");
}

void detail::refuse_level_zero(double value, double difference) {
  throw std::invalid_argument("level 0: value " + to_text(value) + " and difference " + to_text(difference) +
                              " (must be equal, there is no level below); return base(value, work)");
}

}  // namespace debias

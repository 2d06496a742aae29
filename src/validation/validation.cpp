#include "validation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/stream.hpp>
#include <debias/pmf/dyadic.hpp>

#include "core/text.hpp"

namespace debias::validation {
namespace {

constexpr double false_alarm_rate = 1e-6;
constexpr double power_quantile = 2.326;  // 99 %
// Base levels that validation runs, above the lowest of the problem.
constexpr std::int64_t higher_base = 2;

constexpr std::int64_t pilot_draws = 512;
constexpr std::int64_t pilot_levels = 11;
constexpr double draws_per_kurtosis = 10;
constexpr std::int64_t fewest_equal = 64;  // samples, or blocks of them, that say something though they are all equal
constexpr std::int64_t fewest_samples = 1024;  // of problems whose samples are costly

using PilotMoments = std::array<LevelSums, pilot_levels>;

PilotMoments pilot_moments(const Problem& problem, std::uint64_t seed) {
  PilotMoments moments;
  for (std::size_t level = 0; level < moments.size(); ++level) {
    moments[level] = problem.pilot(static_cast<std::int64_t>(level), pilot_draws, seed);
  }
  return moments;
}

// The probability with which a choice weights level m + j of its sequence.
double probability(const Choice& choice, std::int64_t j) {
  switch (choice.method) {
    case Method::single_term:
      return j > 0 ? choice.pmf.mass(j - 1) : 1;
    case Method::single_term_outcome:
      return choice.pmf.mass(j);
    default:
      return choice.pmf.tail(j);
  }
}

bool needs_pmf(const Choice& choice) { return choice.special.empty() && choice.method != Method::truncated; }

bool is_refused(const Problem& problem, const Choice& choice) {
  return needs_pmf(choice) && !pmf_exists(rates_of(problem, choice.method));
}

std::string refusal(const Rates& rates) {
  const std::string base = rates.decay == Decay::geometric ? "2^(" : "k^(";
  const std::string k = rates.decay == Decay::geometric ? " k)" : ")";
  return "no PMF has both finite variance and finite work: E D_k^2 ~ " + base + format("%g", -rates.variance_decay) +
         k + ", work ~ " + base + format("%g", rates.work_growth) + k;
}

bool is_baseline(const Choice& choice) { return choice.special.empty() && choice.method == Method::truncated; }

// What rounding alone may do to a mean whose samples are sums of numbers of this size.
double rounding_bound(double size) { return 16 * std::numeric_limits<double>::epsilon() * size; }

// Says that the samples cannot see the answer, when a kurtosis does.
void check_power(Cell& cell, double kurtosis, const std::string& source, std::int64_t samples) {
  if (!(draws_per_kurtosis * kurtosis > static_cast<double>(samples))) return;
  cell.status = Status::underpowered;
  cell.reason = source;
  if (std::isfinite(kurtosis)) {
    cell.reason += " a kurtosis of " + std::to_string(static_cast<std::int64_t>(kurtosis)) + ", which asks for " +
                   std::to_string(static_cast<std::int64_t>(draws_per_kurtosis * kurtosis)) + " samples";
  }
}

// Kurtosis of the weighted differences, from E D^2 / p and E D^4 / p^3 over the levels that the run will reach;
// 1, the least there is, where they are rounding noise beside the answer.
double predicted_kurtosis(const Problem& problem, const Choice& choice, const PilotMoments& moments,
                          std::int64_t samples) {
  double second = 0;
  double fourth = 0;
  for (std::int64_t level = choice.base_level; level < pilot_levels; ++level) {
    const double p = probability(choice, level - choice.base_level);
    if (p * static_cast<double>(samples) < 1) break;
    const LevelSums& sums = moments[static_cast<std::size_t>(level)];
    const double square = sums.square / pilot_draws;
    second += square / p;
    fourth += sums.kurtosis() * square * square / (p * p * p);
  }
  return std::sqrt(second) > rounding_bound(std::abs(problem.truth)) ? fourth / (second * second) : 1;
}

// All samples are equal: so few that others need not show, or what none of them drew beside the deepest level, or in place of
// it, explains how far they are from the truth.
bool says_nothing(const Cell& cell, const PilotMoments& moments) {
  const Statistics& s = cell.statistics;
  if (s.components.front().standard_error > 0 || s.levels.empty() || std::abs(cell.z) <= 1) return false;
  if (s.blocks < fewest_equal) return true;
  const LevelRow& deepest = s.levels.back();
  const double of_block = static_cast<double>(s.block) * deepest.probability;
  double beyond = 0;
  for (std::int64_t k = deepest.last_level; k < pilot_levels; ++k) {
    beyond += std::sqrt(moments[static_cast<std::size_t>(k)].square / pilot_draws) / std::min(1.0, of_block);
  }
  return std::abs(s.components.front().mean - cell.problem->truth) <= 1.1 * beyond;
}

// In blocks of nets: as many points of a level as its variance asks for, 32 of the base.
Choice in_nets(const Problem& problem, Choice choice) {
  const Rates& rates = problem.rates;
  const double fall = std::min((rates.variance_decay + rates.work_growth) / 2, 8.0);
  std::vector<int> log2_counts;
  for (double m = 5; m >= 0 && log2_counts.size() < 8; m -= fall) log2_counts.push_back(static_cast<int>(m));
  const Dyadic pmf(std::move(log2_counts), dyadic_exponent(rates));
  choice.block = pmf.block();
  choice.pmf = AnyPmf(pmf);
  choice.points = Points::nets;
  return choice;
}

Cell run_cell(const Problem& problem, const Choice& choice, const Plan& plan, const PilotMoments& moments) {
  Cell cell;
  cell.problem = &problem;
  cell.choice = choice;
  if (const Special* special = find_special(problem, choice.special)) {
    check_power(cell, special->kurtosis, special->reason, plan.samples);
  } else if (choice.method != Method::truncated) {
    check_power(cell, predicted_kurtosis(problem, choice, moments, plan.samples), "level moments predict",
                plan.samples);
  }
  cell.statistics = problem.run(choice, plan);
  cell.has_run = true;
  const double error = believed_error(cell.statistics, problem.truth);
  cell.z = (cell.statistics.components.front().mean - problem.truth) / error;
  cell.detectable_bias = error;  // in units of the threshold, which is known once all cells are counted
  if (needs_pmf(choice) && cell.status == Status::refused && says_nothing(cell, moments)) {
    cell.status = Status::underpowered;
    cell.reason = "all " + std::to_string(cell.statistics.blocks) +
                  " samples are equal, and none drew a level beyond " +
                  std::to_string(cell.statistics.levels.back().last_level);
  }
  if (is_baseline(choice)) {
    cell.status = Status::biased;
    cell.reason = "baseline: the estimate of one level, bias and all";
  }
  return cell;
}

}  // namespace

std::string_view name_of(Status status) {
  switch (status) {
    case Status::pass:
      return "pass";
    case Status::fail:
      return "fail";
    case Status::biased:
      return "biased";
    case Status::refused:
      return "refused";
    case Status::underpowered:
      break;
  }
  return "underpowered";
}

std::vector<Choice> choices(const Problem& problem) {
  const std::int64_t m = problem.lowest_base;
  std::vector<Choice> all;
  for (const Method method : problem.methods) {
    Choice choice{.method = method, .base_level = m};
    if (method == Method::truncated) {
      choice.base_level += higher_base;
    } else if (!is_refused(problem, choice)) {
      choice.pmf = default_pmf(problem, method);
    }
    all.push_back(choice);
    if (method == Method::single_term_outcome && !is_refused(problem, choice) &&
        problem.rates.decay == Decay::geometric) {
      all.push_back(in_nets(problem, choice));
    }
    if (method != Method::single_term) continue;
    choice.base_level += higher_base;
    all.push_back(choice);
  }
  for (const Special& s : problem.specials) all.push_back({.base_level = m, .special = s.name});
  return all;
}

double believed_error(const Statistics& statistics, double truth) {
  const ComponentEstimate& estimate = statistics.components.front();
  double size = std::max(std::abs(truth), std::hypot(estimate.mean, std::sqrt(estimate.variance)));
  for (const LevelRow& row : statistics.levels) {
    if (row.is_base) size = std::max(size, std::sqrt(row.second_moment));  // what a difference may cancel
  }
  return std::max(estimate.standard_error, rounding_bound(size));
}

double family_threshold(std::int64_t cells) {
  // Two-sided, Sidak: 1 - (1 - rate)^(1/n); the quantile is taken at the small end, where it is accurate.
  const double each =
      -std::expm1(std::log1p(-false_alarm_rate) / static_cast<double>(std::max<std::int64_t>(cells, 1)));
  return -normal_quantile(each / 2);
}

Report validate(const std::vector<const Problem*>& problems, const Plan& plan,
                const std::function<void(const Cell&, std::int64_t, std::int64_t)>& progress,
                const std::function<void(const Problem&, const Choice&, Plan&)>& prepare) {
  // The family is fixed before the first number is drawn.
  std::int64_t total = 0;
  std::int64_t judged = 0;
  for (const Problem* problem : problems) {
    for (const Choice& choice : choices(*problem)) {
      ++total;
      if (!is_baseline(choice) && !is_refused(*problem, choice)) ++judged;
    }
  }
  Report report;
  report.threshold = family_threshold(judged);
  for (const Problem* problem : problems) {
    PilotMoments moments{};
    if (pmf_exists(problem->rates)) moments = pilot_moments(*problem, plan.seed);
    for (const Choice& choice : choices(*problem)) {
      Cell cell;
      if (is_refused(*problem, choice)) {
        cell.problem = problem;
        cell.choice = choice;
        cell.reason = refusal(rates_of(*problem, choice.method));
      } else {
        Plan of_cell = plan;
        of_cell.samples = std::max(std::min(plan.samples, fewest_samples), plan.samples / problem->sample_cost);
        if (prepare) prepare(*problem, choice, of_cell);
        cell = run_cell(*problem, choice, of_cell, moments);
      }
      cell.detectable_bias *= report.threshold + power_quantile;
      if (cell.status == Status::refused && cell.has_run) {
        const bool ok = std::abs(cell.z) <= report.threshold;  // false for NaN
        cell.status = ok ? Status::pass : Status::fail;
        if (!ok) cell.reason = "|z| above the threshold";
        ++(ok ? report.passed : report.failed);
        if (!(std::abs(cell.z) <= report.max_abs_z)) report.max_abs_z = std::abs(cell.z);
      }
      report.cells.push_back(std::move(cell));
      if (progress) progress(report.cells.back(), static_cast<std::int64_t>(report.cells.size()), total);
    }
  }
  report.smallest_detectable_bias = (report.threshold + power_quantile) / std::sqrt(static_cast<double>(plan.samples));
  return report;
}

}  // namespace debias::validation

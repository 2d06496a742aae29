// From an estimator and a plan to the run: what a goal asks for, and what the levels say afterwards.

#include <debias/core/estimate.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/communicator.hpp"
#include "core/text.hpp"

namespace debias::detail {
namespace {

// Samples, or blocks, that carry the variance.
double hits_of(const Statistics& s) {
  const double excess = s.moments.kurtosis() - 1;
  return excess > 0 ? static_cast<double>(s.blocks) / excess : static_cast<double>(s.blocks);
}

// The blocks that a pilot asks for.
double wanted_blocks(const Goal& goal, const Statistics& pilot, double spent, double bias) {
  if (goal.seconds > 0) {
    return (Goal::aim * goal.seconds - spent) / (pilot.seconds / static_cast<double>(pilot.blocks));
  }
  const auto n = static_cast<double>(pilot.blocks);
  const double doubt = 2 / std::sqrt(std::max(hits_of(pilot), 4.0));  // two errors of the variance
  const double variance = pilot.total_error() * pilot.total_error() * n * (1 + doubt);
  double wish = goal.error > 0 ? goal.error : goal.relative_error * pilot.norm();
  // The stated bias takes its part of the wish, where the aim does not leave it enough; one above the wish takes no samples.
  if (bias > 0.3 * wish && bias < wish) wish = std::sqrt((wish - bias) * (wish + bias));
  const double error = Goal::aim * wish;
  if (variance == 0) return 2;
  const double wanted = variance / (error * error);
  // Few samples state an error that varies more than the aim leaves room for: one in twenty may miss.
  constexpr double one_in_twenty = 1.645;
  const double varies = one_in_twenty / std::sqrt(wanted * std::min(1.0, hits_of(pilot) / n));
  return std::max(wanted, variance / (wish * wish) * (1 + varies));
}

// Throws for plans that no run has, or none of this estimator; on several ranks all of them do where one does, lest the
// others wait for it.
void check_on_all(const Plan& plan, const Drawn& drawn) {
  plan.ranks.communicator().agree("plan", [&] {
    const std::int64_t block = drawn.pieces.block;
    check_plan(plan);
    check_blocks(plan, block);
    if (!drawn.reach) return;
    require_reach(drawn.reach((plan.first + plan.samples) / block - 1), std::max(plan.whole, plan.samples));
  });
}

// The plan with the samples that its goal asks for, and what finding out took added to its pilot.
Plan plan_for_goal(const Plan& plan, const Drawn& drawn, std::int64_t& nonfinite) {
  constexpr double pilot_share = 1.0 / 16;  // of the run
  constexpr std::int64_t most_pilot_blocks = std::int64_t{1} << 22;
  constexpr std::int64_t fewest = 64;  // a standard error of fewer is none
  constexpr double enough_hits = 32;   // of a pilot: it knows the variance to a third
  constexpr double most_blocks = 0x1p46;
  check_goal(plan.goal);
  const Pieces& pieces = drawn.pieces;
  const std::int64_t block = pieces.block;
  Plan pilot = plan;
  // Where `samples` says that the run is short, so is the pilot.
  const std::int64_t expected = plan.earlier ? 1024 * 8 : plan.samples / block;
  std::int64_t pilot_blocks = plan.goal.seconds > 0 ? fewest : std::clamp<std::int64_t>(expected / 8, fewest, 1024);
  pilot.save = {};
  pilot.earlier = {};
  pilot.pilot = {};
  PilotRun spent;
  const auto planned = [&](std::int64_t blocks) {
    Plan result = plan;
    result.samples = blocks * block;
    result.pilot += spent;
    if (plan.earlier) result.samples = std::max(result.samples, plan.samples);  // fixed before those were drawn
    return result;
  };
  double again = 0;  // work of chunks that were cut, and are drawn once more
  const auto extend = [&](const Statistics& s) {
    again += s.work * static_cast<double>(s.samples % pieces.chunk) / static_cast<double>(s.samples);
    pilot.earlier = std::make_shared<RunState>(s.state);
  };
  for (;;) {
    pilot.samples = pilot_blocks * block;
    check_on_all(pilot, drawn);
    // An earlier pilot is the first part of this one; a chunk of it that was cut is drawn from its beginning.
    const std::int64_t held = pilot.earlier ? pilot.earlier->last() / pieces.chunk * pieces.chunk : pilot.first;
    drawn.begin(std::max(pilot.first, held) / block, (pilot.first + pilot.samples) / block, true);
    const Statistics s = run(pilot, {.estimator = "pilot"}, pieces, drawn.body);
    spent.work = s.work + again;
    spent.seconds = s.seconds;
    const double bias = drawn.bias_bound ? drawn.bias_bound(s.state.total().levels).size : 0;
    const double wanted = wanted_blocks(plan.goal, s, spent.seconds, bias);
    nonfinite = s.nonfinite;
    if (s.nonfinite > 0 || std::isnan(wanted)) {  // nothing to aim at: the run will say what is wrong
      return planned(s.blocks);
    }
    if (plan.goal.seconds == 0) {
      // A variance of few hits, a mean that may be 0, or equal values promise nothing: until the pilot costs the run.
      const auto have = static_cast<double>(s.blocks);
      const bool equal = !(s.moments.m2 > 0);
      const bool unknown_mean = plan.goal.relative_error > 0 && !(s.norm() > 3 * s.total_error());
      const bool rare = hits_of(s) < enough_hits && have < wanted;
      const std::int64_t most = equal
                                    ? std::int64_t{1} << 16
                                    : std::clamp(16 * (plan.samples / block), std::int64_t{1} << 16, most_pilot_blocks);
      if ((equal || unknown_mean || rare) && s.blocks < most) {
        pilot_blocks = std::min(most, 2 * s.blocks);
        extend(s);
        continue;
      }
      if (unknown_mean) return planned(s.blocks);  // the result says that its mean is not told from 0
    }
    // The last pilot is the one that counts: the first is too short to know a variance, or the time of a sample.
    const double next = std::min(pilot_share * wanted, static_cast<double>(most_pilot_blocks));
    if (next < 4 * static_cast<double>(pilot_blocks)) {
      const double samples = wanted * static_cast<double>(block);
      const std::string help = plan.goal.seconds > 0 ? "; ask for fewer seconds" : "; ask for a larger error";
      if (!(samples < 0x1p62)) {
        const std::string many = std::isfinite(samples) ? format("%.3g", samples) + " samples" : "endless samples";
        throw std::invalid_argument("Goal: it takes " + many + " (does not fit 64 bits)" + help);
      }
      if (wanted > most_blocks) {
        throw std::invalid_argument("Goal: it takes " + format("%.3g", samples) + " samples (about " +
                                    format("%.2g", wanted * s.seconds / static_cast<double>(s.blocks)) + " seconds)" +
                                    help);
      }
      if (plan.goal.seconds > 0)
        return planned(std::max<std::int64_t>(2, static_cast<std::int64_t>(std::ceil(wanted))));
      // What the pilot of a recipe has cost is worth a run of that length.
      const double as_pilot = plan.pilot.work / std::max(s.work / static_cast<double>(s.blocks), 1e-300);
      const double least = std::min(as_pilot, most_blocks);
      return planned(std::max(fewest, static_cast<std::int64_t>(std::ceil(std::max(wanted, least)))));
    }
    pilot_blocks = static_cast<std::int64_t>(next);
    extend(s);
  }
}

constexpr std::int64_t most_masses = 1024;

// From the base or the level above it on, as far as they matter.
Masses masses_of(const std::vector<LevelRow>& rows, const std::function<double(std::int64_t level)>& probability) {
  constexpr double least = 1e-280;
  std::int64_t base = 0;
  for (const LevelRow& row : rows) {
    if (row.is_base) base = row.level;
  }
  Masses m;
  m.first_level = probability(base) > 0 && probability(base + 1) > 0 ? base : base + 1;
  const std::int64_t end = base + most_masses;
  while (m.first_level < end && !(probability(m.first_level) > 0)) ++m.first_level;
  for (std::int64_t k = m.first_level; k < end; ++k) {
    const double p = probability(k);
    if (!(p > least)) break;
    m.mass.push_back(p);
  }
  return m;
}

// A PMF that ends leaves out what comes behind it, unless that is zero: as stated, or as the last differences are.
void bound_end_of_pmf(Statistics& s, const std::function<double(std::int64_t level)>& probability) {
  constexpr double underflow = 1e-100;
  const Masses& m = s.masses;
  const std::int64_t last = m.first_level + std::ssize(m.mass) - 1;
  if (m.empty() || m.mass.back() < underflow || probability(last + 1) != 0) return;
  if (s.sequence.exact_from.value_or(last + 1) <= last) return;
  for (std::int64_t k = last + 2; k < last + most_masses; ++k) {
    if (probability(k) != 0) return;  // a hole, where a difference may be zero
  }
  const LevelRow* deepest = nullptr;
  for (const LevelRow& row : s.levels) {
    if (!row.is_base) deepest = &row;
  }
  if (deepest == nullptr || !(deepest->second_moment > 0)) return;
  s.bias_bound = {std::numeric_limits<double>::infinity(),
                  "the PMF ends at level " + std::to_string(last) +
                      " and the differences do not; state exact_from where they are zero beyond some level"};
}

// Says so where the standard error is below the rounding of the values themselves.
void warn_of_single_precision(Statistics& s, double epsilon) {
  if (s.nonfinite > 0 || !(s.total_error() < epsilon * s.norm())) return;
  s.warnings.push_back({WarningCode::single_precision,
                        "the standard error is below the rounding of single-precision values, which may have moved "
                        "the mean by more; compute the values in double."});
}

}  // namespace

// A count of n draws is further than t from n p with a probability of at most 2 exp(-t^2 / (2 n p (1 - p) + 2 t / 3)), that of
// strata or nets even less [Bernstein]; here t = b + sqrt(b^2 + 2 b 3 n p (1 - p)), b = log(2 / that) / 3.
void judge_counts(Statistics& s) {
  constexpr double false_alarm = 1e-9;  // of all levels together
  if (s.nonfinite > 0) return;
  const auto n = static_cast<double>(s.samples);
  const std::int64_t end = std::min(s.masses.first_level + std::ssize(s.masses.mass), LevelTable::single_levels);
  const double b = std::log(2 * static_cast<double>(LevelTable::single_levels) / false_alarm) / 3;
  for (std::int64_t k = s.masses.first_level; k < end; ++k) {
    const double p = s.masses.mass[static_cast<std::size_t>(k - s.masses.first_level)];
    double count = 0;
    bool is_base = false;
    for (const LevelRow& row : s.levels) {
      if (row.level != k) continue;
      count += static_cast<double>(row.count);
      is_base = is_base || row.is_base;
    }
    if (is_base) continue;  // of which every sample may have one
    const double off = std::abs(count - n * p);
    if (!(off > b + std::sqrt(b * b + 6 * b * n * p * std::max(0.0, 1 - p)))) continue;
    s.warnings.push_back({WarningCode::wrong_masses,
                          "level " + std::to_string(k) + " was drawn " + format("%.0f", count) +
                              " times, where its probability " + format("%.3g", p) + " means " + format("%.3g", n * p) +
                              ": `sample` of the PMF does not fit its `mass` and `tail`, so the mean is biased; "
                              "sample(u) is the largest j with u <= tail(j), and mass(j) = tail(j) - tail(j + 1)."});
    return;
  }
}

Statistics with_rounding(Statistics s, double epsilon) {
  const Accumulator sums = s.state.total();
  s.coupling = judge_coupling(sums.coupling, sums.levels, epsilon);
  const std::optional<Warning> warning = warning_of(s.coupling);
  const bool is_known = warning && warning->code == WarningCode::coupling && s.has_wrong_mean();
  // A sequence that ends and says how far from its limit may be drawn at its end alone.
  const bool ends = warning && warning->code == WarningCode::zero_differences && s.bias_bound.size > 0;
  if (warning && !is_known && !ends) s.warnings.insert(s.warnings.begin(), *warning);
  if (epsilon > std::numeric_limits<double>::epsilon()) warn_of_single_precision(s, epsilon);
  return s;
}

Statistics drive(Drawn& drawn, const Plan& plan) {
  const std::int64_t block = drawn.pieces.block;
  Plan fixed = in_blocks(plan, block);
  std::int64_t nonfinite = 0;  // samples of the pilot for a goal
  if (plan.goal.asked()) {
    drawn.pilot = true;
    fixed = plan_for_goal(fixed, drawn, nonfinite);
    drawn.pilot = false;
  }
  // A pilot has been told more, by its caller.
  if (drawn.facts && fixed.pilot.levels.empty()) fixed.pilot.sequence = *drawn.facts;
  check_on_all(fixed, drawn);
  // What an earlier run without holes holds does not come again, but for a chunk that was cut.
  const bool in_order = !fixed.earlier || (fixed.earlier->contiguous() && fixed.earlier->first() <= fixed.first);
  const std::int64_t chunk = drawn.pieces.chunk;
  const std::int64_t held = fixed.earlier && in_order ? fixed.earlier->last() / chunk * chunk : fixed.first;
  drawn.begin(std::max(fixed.first, held) / block, (fixed.first + fixed.samples) / block, in_order);
  Statistics s = run(fixed, drawn.identity, drawn.pieces, drawn.body);
  if (nonfinite > 0 && s.nonfinite == 0) {  // as many samples again have shown none: no number is an answer
    throw std::invalid_argument("Goal: " + counted(nonfinite, "sample") + " of its pilot" + are(nonfinite) +
                                " not finite, none of the " + std::to_string(s.samples) +
                                " of the run is; ask for many `samples` in place of a goal, which name one to replay");
  }
  s.goal = plan.goal;
  if (drawn.bias_bound) s.bias_bound = drawn.bias_bound(s.state.total().levels);
  if (drawn.probability) {
    for (LevelRow& row : s.levels) {
      if (!row.is_base && row.level == row.last_level) row.probability = drawn.probability(row.level);
    }
    s.masses = masses_of(s.levels, drawn.probability);
    bound_end_of_pmf(s, drawn.probability);
    judge_counts(s);
  }
  s = with_rounding(std::move(s), drawn.epsilon);
  if (drawn.missed) judge_points(s, drawn.missed);
  return s;
}

Plan plan_from(const RunState& state, Plan plan) {
  if (state.last() > 0) {
    if (!state.seed) throw std::invalid_argument("extend: samples of no known seed; set `seed` of their state");
    plan.seed = *state.seed;
    plan.first = state.first();
    if (plan.goal.asked()) plan.samples = state.last() - state.first();  // at least
  }
  plan.earlier = std::make_shared<RunState>(state);
  return plan;
}

}  // namespace debias::detail

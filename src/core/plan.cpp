#include <debias/core/plan.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/text.hpp"

namespace debias {

PilotRun::PilotRun() = default;
PilotRun::PilotRun(double pilot_work, double pilot_seconds, std::vector<LevelFacts> seen, const SequenceFacts& stated)
    : work(pilot_work), seconds(pilot_seconds), levels(std::move(seen)), sequence(stated) {}
PilotRun::PilotRun(const PilotRun& other) = default;
PilotRun::PilotRun(PilotRun&& other) noexcept = default;
PilotRun& PilotRun::operator=(const PilotRun& other) = default;
PilotRun& PilotRun::operator=(PilotRun&& other) noexcept = default;
PilotRun::~PilotRun() = default;

PilotRun& PilotRun::operator+=(const PilotRun& other) {
  work += other.work;
  seconds += other.seconds;
  // Sums of another rank or shard may know nothing of the sequence.
  const bool states_nothing =
      !sequence.declared && !sequence.exact_from && !sequence.constant_limit && !sequence.meeting_times;
  if (levels.empty() && (states_nothing || !other.levels.empty())) sequence = other.sequence;
  if (levels.empty()) levels = other.levels;
  return *this;
}

}  // namespace debias

namespace debias::detail {

void check_plan(const Plan& plan) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument("Plan: " + what); };
  if (plan.samples < 1) {
    refuse("samples = " + std::to_string(plan.samples) + " (must be at least 1); 1'000'000 is a good start");
  }
  if (plan.first < 0) refuse("first = " + std::to_string(plan.first) + " (an index is not negative)");
  if (plan.first > std::numeric_limits<std::int64_t>::max() - plan.samples) {
    refuse("first + samples does not fit 64 bits; another seed gives as many fresh samples");
  }
  if (plan.threads < 0) {
    refuse("threads = " + std::to_string(plan.threads) + " (must not be negative); 0 takes all cores");
  }
}

std::int64_t whole_blocks(std::int64_t samples, std::int64_t block) {
  if (samples < 1 || samples > std::numeric_limits<std::int64_t>::max() - block) return samples;
  return (samples + block - 1) / block * block;
}

Plan in_blocks(Plan plan, std::int64_t block) {
  plan.samples = whole_blocks(plan.samples, block);
  plan.whole = whole_blocks(plan.whole, block);
  return plan;
}

void check_blocks(const Plan& plan, std::int64_t block) {
  if (plan.first % block != 0) {
    const std::int64_t begin = plan.first / block * block;
    throw std::invalid_argument("Plan: first = " + std::to_string(plan.first) + " (lies inside a block of " +
                                std::to_string(block) + " samples, which are drawn together); take " +
                                std::to_string(begin) + " or another multiple of " + std::to_string(block));
  }
  if (plan.samples % block != 0) {
    throw std::invalid_argument("Plan: samples = " + std::to_string(plan.samples) + " (whole blocks of " +
                                std::to_string(block) + " do not fit 64 bits); ask for fewer");
  }
}

void check_goal(const Goal& goal) {
  int wishes = 0;
  for (const auto& [name, value] :
       {std::pair("error", goal.error), {"relative_error", goal.relative_error}, {"seconds", goal.seconds}}) {
    if (value == 0) continue;
    ++wishes;
    if (value > 0 && std::isfinite(value)) continue;
    throw std::invalid_argument("Goal: " + std::string(name) + " = " + format("%f", value) +
                                " (must be positive and finite); a hundredth of the value is a good start");
  }
  if (wishes > 1) throw std::invalid_argument("Goal: more than one wish (each alone fixes the samples); keep one");
}

}  // namespace debias::detail

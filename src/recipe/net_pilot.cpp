#include "recipe/net_pilot.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/communicator.hpp"
#include "core/text.hpp"
#include "recipe/choice.hpp"

namespace debias {
namespace {

constexpr int fewest_octaves = 3;           // of a net that tells how a variance falls
constexpr std::int64_t fewest_levels = 3;   // a base and two differences
constexpr std::int64_t most_levels = 16;    // that are measured
constexpr double most_rarer = 4;            // the kurtosis of a level beyond over that above it
constexpr double enough_hits = 16;          // of a level whose second moment is its own, and not the posterior's
constexpr double most_not_shown = 0.25;     // of the variance of a block
constexpr double contradicts = 4;           // of a second moment that enough hits know to a quarter
constexpr double enough_hits_of_base = 32;  // else the base is a rare value
constexpr double block_work = 1000;         // the least of a block, in draws of the base
constexpr double doubts = 1;                // standard errors of a lambda, where nets are compared with plain numbers
constexpr double aim = 0.85;                // of a goal: the error of 32 blocks is known to an eighth
constexpr double most_blocks = 0x1p20;      // of a run: more tell nothing that longer ones do not
constexpr double hopeless = 4;              // of the work of plain numbers
constexpr double most_members_of_block = 0x1p31;
constexpr double most_exponent_beyond = 3;  // of the tail's, over that of the work, where differences end
constexpr double established = 4;           // errors of a decay that no rates are declared for
constexpr double blocks_per_kurtosis = 4;   // then they know the variance to a half
constexpr double told_from_zero = 3;        // standard errors
constexpr double rounding = 0x1p-96;        // of a second moment: so little variance is none
constexpr double goal_pilot = 17.0 / 16;    // of a run of plain numbers: its own pilot for the goal

double rounded_exponent(double theta) { return std::ceil(1000 * theta - 1e-6) / 1000; }

// How the levels go on where nobody has looked: more slowly than they are likely to, since a tail that falls faster than
// they do has infinite variance.
struct Beyond {
  double decay = 0;  // of E D_k^2, in octaves a level
  double theta = 0;  // exponent of the tail
};

// Nothing where no Dyadic PMF fits.
std::optional<Beyond> beyond_of(const Advice& plain, std::string& why) {
  const Evidence& e = plain.survey.evidence;
  const std::optional<Rates>& declared = plain.facts.declared;
  if (e.polynomial) {
    why = "the differences fall like a power of the level, and blocks of nets need a power of 2";
    return {};
  }
  const bool ends = e.end == End::stated || e.end == End::zeros || e.end == End::rounding;
  const bool declares = declared && declared->decay == Decay::geometric;
  const bool has_rates = declares && !e.contradiction;
  double work = e.exponential_work ? std::max(0.0, e.work.value) : 0;
  if (declares && declared->work_growth > work) work = declared->work_growth;
  if (e.courses.empty() && !ends && !has_rates) {
    why = "too few levels show how they fall";
    return {};
  }
  Rates rates{ends ? Rates::faster_than_any : has_rates ? declared->variance_decay : 0, work};
  if (!e.courses.empty()) {
    // Levels may fall faster at first than in the end; what is declared says so, or the doubt of what they show.
    if (!has_rates && !(e.decay.value > established * e.decay.error)) {
      why = "the levels do not show yet how they go on";
      return {};
    }
    rates.variance_decay =
        has_rates ? std::min(e.decay.value, declared->variance_decay) : e.decay.value - e.decay.error;
  }
  if (!pmf_exists(rates)) {
    why = "the levels do not show a decay that leaves room for a tail";
    return {};
  }
  const double theta = std::min(dyadic_exponent(rates), work + most_exponent_beyond);
  return Beyond{rates.variance_decay, rounded_exponent(right_for_declared(theta, plain, rates, dyadic_exponent))};
}

}  // namespace

/// The levels of a block from a base on, and what is known of their mean.
struct NetPilot::Levels {
  std::vector<NetLevel> levels;
  std::vector<bool> shown;   ///< by nets; else of the posterior's size
  double mean = 0;           ///< norm of the sum
  double mean_variance = 0;  ///< of it

  /// Variance of a block from levels that nets did not show.
  [[nodiscard]] double not_shown(const NetBlock& b) const {
    double sum = 0;
    for (std::size_t k = 0; k < b.log2_counts.size(); ++k)
      sum += shown[k] ? 0 : levels[k].variance_of(b.log2_counts[k]);
    return sum;
  }
};

double NetPilot::least_work(std::int64_t base_level) const {
  double work = 0;
  for (std::int64_t i = 0; i < fewest_levels; ++i) {
    const auto each = runs_.work(base_level + i, plan_);
    work = std::max(work, i == 0 ? each.first : each.second);
  }
  return static_cast<double>(fewest_levels) * static_cast<double>(nets << fewest_octaves) * work;
}

const NetMoments* NetPilot::measured(std::int64_t level, bool as_base, double work) {
  const auto each = runs_.work(level, plan_);
  const double points = work / (static_cast<double>(nets) * (as_base ? each.first : each.second));
  const int octaves = std::min(NetMoments::most_octaves, static_cast<int>(std::floor(std::log2(points))));
  if (octaves < fewest_octaves) return nullptr;
  const auto [at, is_new] = known_.try_emplace({level, as_base});
  if (is_new || static_cast<int>(at->second.variance.size()) <= octaves) {
    Plan part = plan_;
    part.samples = nets;
    at->second = runs_.nets(level, as_base, octaves, part);
    work_ += at->second.work;
    seconds_ += at->second.seconds;
  }
  last_level_ = std::max(last_level_, level);
  return &at->second;
}

std::optional<NetPilot::Levels> NetPilot::levels_of(std::int64_t base_level, double work, const Survey& survey,
                                                    const LevelModel& model, double decay) {
  const std::int64_t deepest = std::min(runs_.deepest_level, base_level + most_levels - 1);
  const auto work_of = [&](std::int64_t level) {
    const auto each = runs_.work(level, plan_);
    return level == base_level ? each.first : each.second;
  };
  // As many levels as get a net each of its least size.
  std::int64_t count = 0;
  double most = 0;
  while (base_level + count <= deepest) {
    // A level that the pilot's draws did not reach may be one that the sequence refuses.
    if (count >= fewest_levels && base_level + count > survey.rows.back().level) break;
    const double next = std::max(most, work_of(base_level + count));
    if (work / static_cast<double>(count + 1) < static_cast<double>(nets << fewest_octaves) * next) break;
    most = next;
    ++count;
  }
  if (count < fewest_levels) {
    why_ = "the run is too short for nets to be measured";
    return {};
  }
  Levels found;
  std::vector<double> mean;
  double rarer = 1;        // the kurtosis of a level over that of the level above it
  double last_second = 0;  // of the last level that nets showed
  double last_posterior = 0;
  for (auto k = static_cast<std::size_t>(base_level); k < model.size(); ++k) {
    const auto level = static_cast<std::int64_t>(k);
    const bool as_base = level == base_level;
    const double believed = model.variance[k] + model.mean_square[k];
    if (level - base_level >= count) {  // like the last one, at the posterior's size
      NetLevel deeper = found.levels.back();
      const double least_fall = decay * static_cast<double>(level - (base_level + count - 1));
      const double fall = std::max(model.posterior[k].log2_second - last_posterior, -least_fall);
      const double size = last_second > 0 && std::isfinite(fall) ? last_second * std::exp2(fall) : believed;
      const double scale = deeper.second_moment > 0 ? size / deeper.second_moment : 0;
      for (double& v : deeper.variance) v *= scale;
      deeper.second_moment = size;
      deeper.work = model.work[k];
      deeper.kurtosis *= rarer;
      found.levels.push_back(std::move(deeper));
      found.shown.push_back(true);  // not by itself, but the level that it goes on from is
      continue;
    }
    const NetMoments* m = measured(level, as_base, work / static_cast<double>(count));
    if (m == nullptr || !std::isfinite(m->second_moment) || !std::isfinite(m->variance.front())) {
      why_ = "level " + std::to_string(level) + " has shown no variance that is a finite number";
      return {};
    }
    if (as_base && m->variance.front() > 0 && m->hits < enough_hits_of_base) {
      why_ = "few draws of the base level carry its variance, and nets have not shown it yet";
      return {};
    }
    NetLevel next{m->variance, m->second_moment, work_of(level), m->kurtosis(), runs_.plain_inside};
    const bool shown = as_base || !(believed > (m->hits < enough_hits ? 1 : contradicts) * next.second_moment);
    if (!shown) {
      // Rare: what they add up to is not seen in any net, or only rounding is.
      const double scale = next.second_moment > 0 ? believed / next.second_moment : 0;
      for (double& v : next.variance) v *= scale;
      if (scale == 0) {
        for (std::size_t j = 0; j < next.variance.size(); ++j) {
          next.variance[j] = believed * std::exp2(-static_cast<double>(j));
        }
      }
      next.second_moment = believed;
      next.kurtosis = std::max(next.kurtosis, rarer * found.levels.back().kurtosis);
    }
    if (!as_base) {
      last_second = next.second_moment;
      last_posterior = model.posterior[k].log2_second;
      // Rare differences grow rarer.
      if (level > base_level + 1) {
        const double each =
            std::pow(next.kurtosis / found.levels[1].kurtosis, 1 / static_cast<double>(level - base_level - 1));
        rarer = std::clamp(each, 1.0, most_rarer);
      }
    }
    mean.resize(std::max(mean.size(), m->mean.size()));
    for (std::size_t c = 0; c < m->mean.size(); ++c) mean[c] += m->mean[c];
    found.mean_variance += m->variance.back() / static_cast<double>(nets);
    found.levels.push_back(std::move(next));
    found.shown.push_back(shown);
  }
  const bool is_random = std::any_of(found.levels.begin(), found.levels.begin() + count, [](const NetLevel& level) {
    return level.variance.front() > rounding * level.second_moment;
  });
  if (!is_random && !options_.points) {
    why_ = "the levels are not random: only the level drawn is, and a net does not even that out";
    return {};
  }
  for (const double x : mean) found.mean = std::hypot(found.mean, x);
  return found;
}

std::optional<NetPilot::Found> NetPilot::from(std::int64_t base_level, double work, const Plan& plan,
                                              const Advice& plain, const LevelModel& model, double seconds_left) {
  why_.clear();
  const std::optional<Beyond> beyond = beyond_of(plain, why_);
  if (!beyond) return {};
  const std::optional<Levels> levels = levels_of(base_level, work, plain.survey, model, beyond->decay);
  if (!levels) return {};
  const Goal& goal = plan.goal;
  double target = 0;     // variance of the mean
  double most_work = 0;  // of the run
  double members = 0;    // of the run
  if (goal.seconds > 0) {
    most_work = work_ / std::max(seconds_, 1e-9) * std::max(0.0, seconds_left);
  } else if (goal.asked()) {
    double error = goal.error;
    if (goal.relative_error > 0) {
      const double sure = levels->mean - std::sqrt(levels->mean_variance);
      if (!(levels->mean > told_from_zero * std::sqrt(levels->mean_variance))) {
        why_ = "the mean is not told from 0 yet";
        return {};
      }
      error = goal.relative_error * sure;
    }
    target = std::pow(aim * error, 2);
  } else {
    members = static_cast<double>(plan.samples);
  }
  const double plain_work = plain.predicted.work * static_cast<double>(plain.members) * (goal.asked() ? goal_pilot : 1);
  // Where nets are asked for, 32 have to do.
  const auto fewest_of = [&](const NetBlock& b) {
    return options_.points ? fewest_blocks : std::max(fewest_blocks, std::ceil(blocks_per_kurtosis * b.kurtosis));
  };
  const auto blocks_of = [&](const NetBlock& b) {
    if (target > 0) return std::max(fewest_of(b), std::ceil(b.variance / target));
    if (most_work > 0) return std::max(fewest_of(b), std::floor(most_work / b.work));
    return std::max(fewest_of(b), std::ceil(members / b.members()));
  };
  const auto fits = [&](const NetBlock& b) {
    if (target > 0) return true;
    return most_work > 0 ? fewest_of(b) * b.work <= most_work : fewest_of(b) * b.members() <= members;
  };
  const std::vector<NetBlock> all = net_blocks(levels->levels, beyond->theta, [&](const NetBlock& b) {
    if (b.members() > most_members_of_block) return true;
    if (target > 0) {
      const bool met = b.variance <= fewest_of(b) * target && b.work >= block_work * unit_;
      return met || (!options_.points && fewest_blocks * b.work > hopeless * plain_work);
    }
    return !fits(b);
  });
  std::optional<Found> best;
  for (const NetBlock& b : all) {
    // Where nets are asked for, a short run has small blocks, and a block of any kind is better than none.
    const bool is_first = &b == &all.front();
    const bool large = b.work >= block_work * unit_ || options_.points;
    if (!options_.points && levels->not_shown(b) > most_not_shown * b.variance) {
      why_ = "the differences are rare: nets did not show their variance";
      continue;
    }
    if (!large || !(fits(b) || (is_first && options_.points)) || !std::isfinite(b.variance)) continue;
    Found next{base_level, b, beyond->theta, blocks_of(b), 0, 0};
    next.run_work = next.blocks * b.work;
    if (next.blocks > most_blocks) continue;
    next.share = target > 0 ? next.run_work / plain_work : b.variance * b.work / plain.predicted.product();
    // Beside plain numbers a gain counts as far as it was seen: the best of many blocks is also the luckiest.
    double believed = b.variance;
    for (std::size_t k = 0; k < b.log2_counts.size(); ++k) {
      const NetLevel& level = levels->levels[k];
      believed += level.variance_of(b.log2_counts[k], doubts) - level.variance_of(b.log2_counts[k]);
    }
    if (b.variance > 0) next.share *= believed / b.variance;
    if (std::isnan(next.share)) next.share = 1;
    if (!best || (target > 0 ? next.run_work < best->run_work : true)) best = std::move(next);
  }
  if (!best && why_.empty()) why_ = "the run is too short for 32 blocks of nets";
  return best;
}

std::optional<NetPilot::Found> NetPilot::choose(double work, const Plan& plan, const Advice& plain,
                                                const LevelModel& model, double seconds_left) {
  constexpr double better = 0.9;    // a deeper base has to bring a tenth: by less two of them differ by noise
  constexpr double most_base = 64;  // of the work of the lowest
  const std::int64_t lowest = std::max(options_.lowest_base, plain.survey.evidence.lowest_base);
  const std::int64_t first = options_.base_level.value_or(settled_.value_or(lowest));
  std::optional<Found> best = from(first, work, plan, plain, model, seconds_left);
  // Bases are compared once: each costs a measurement of its own.
  if (!best || options_.base_level || settled_) return best;
  for (std::int64_t m = first + 1; m + 2 <= plain.survey.rows.back().level; ++m) {
    if (runs_.work(m, plan_).first > most_base * unit_) break;
    std::string why = why_;
    const std::optional<Found> next = from(m, work, plan, plain, model, seconds_left);
    why_ = std::move(why);
    if (!next || !(next->share < better * best->share)) break;
    best = next;
  }
  settled_ = best->base_level;
  return best;
}

}  // namespace debias

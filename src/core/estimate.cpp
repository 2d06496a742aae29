#include <debias/core/estimate.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

namespace debias {
namespace {

constexpr double save_interval = 1;  // seconds

void check(const Plan& plan) {
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

// The chunks of the samples that are missing, handed out in order to whoever asks.
class Chunks {
 public:
  Chunks(std::vector<RunState::Range> gaps, std::int64_t size) : gaps_(std::move(gaps)), size_(size) {
    for (const auto& [first, last] : gaps_) {
      starts_.push_back(count_);
      count_ += (last - 1) / size - first / size + 1;
    }
  }

  [[nodiscard]] std::int64_t count() const { return count_; }

  // The samples of the next chunk; empty when there is none.
  RunState::Range take() {
    const std::int64_t number = next_.fetch_add(1);
    if (number >= count_) return {0, 0};
    const auto gap = static_cast<std::size_t>(std::upper_bound(starts_.begin(), starts_.end(), number) -
                                              starts_.begin() - 1);
    const auto [first, last] = gaps_[gap];
    const std::int64_t chunk = first / size_ + (number - starts_[gap]);
    const std::int64_t end = chunk == (last - 1) / size_ ? last : (chunk + 1) * size_;
    return {std::max(first, chunk * size_), end};
  }

 private:
  std::vector<RunState::Range> gaps_;
  std::vector<std::int64_t> starts_;  // the number of the first chunk of each gap
  std::int64_t count_ = 0;
  std::int64_t size_;
  std::atomic<std::int64_t> next_ = 0;
};

// Means, errors, rows and warnings from the sums of a run.
Statistics finish(std::string estimator, std::uint64_t seed, RunState state) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const Accumulator sums = state.total();
  Statistics s;
  s.estimator = std::move(estimator);
  s.seed = seed;
  s.first = state.first();
  s.samples = state.last() - state.first();
  s.moments = sums.moments;
  s.work = sums.work;
  s.seconds = state.seconds;
  s.nonfinite = state.extremes.nonfinite();
  s.first_nonfinite = state.extremes.first_nonfinite();
  s.largest = state.extremes.largest();
  s.upper_tail = state.extremes.upper_tail();
  s.lower_tail = state.extremes.lower_tail();

  const auto n = static_cast<double>(s.samples);
  const auto add_component = [&](double mean, double m2) {
    const double variance = s.samples < 2 ? nan : m2 / (n - 1);
    s.components.push_back({s.nonfinite > 0 ? nan : mean, variance, std::sqrt(variance / n)});
  };
  if (sums.components.entries().empty()) {
    add_component(sums.moments.mean, sums.moments.m2);
  } else {
    for (const ComponentMoments::Entry& e : sums.components.entries()) add_component(e.mean, e.m2);
  }

  const auto add_row = [&](std::pair<std::int64_t, std::int64_t> levels, bool is_base, const LevelSums& l) {
    if (l.count == 0) return;
    const auto count = static_cast<double>(l.count);
    s.levels.push_back({levels.first, levels.second, is_base, l.count, l.difference / count, l.square / count,
                        l.fourth / count, l.work / count, 0.0});
  };
  add_row({sums.levels.base_level(), sums.levels.base_level()}, true, sums.levels.base());
  for (std::size_t i = 0; i < sums.levels.rows().size(); ++i) {
    add_row(LevelTable::levels_of_row(i), false, sums.levels.rows()[i]);
  }
  s.state = std::move(state);
  return s;
}

std::string percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

void add_warnings(Statistics& s) {
  const std::string seed = std::to_string(s.seed);
  if (s.nonfinite > 0) {
    s.warnings.push_back(std::to_string(s.nonfinite) + " of " + std::to_string(s.samples) +
                         " samples are not finite, so the mean is not a number; replay the first: seed " +
                         seed + ", sample " + std::to_string(s.first_nonfinite) + ".");
    return;
  }
  if (s.samples < 2) {
    s.warnings.emplace_back("one sample has no standard error; run at least two.");
    return;
  }
  const auto has_mean = [](const ComponentEstimate& c) { return std::isfinite(c.mean); };
  if (!std::all_of(s.components.begin(), s.components.end(), has_mean)) {
    s.warnings.emplace_back("the sum of these samples overflows, so the mean is not a number; scale the values.");
    return;
  }
  if (!std::isfinite(s.total_error())) {
    s.warnings.emplace_back("squares of these samples overflow, so there is no standard error; scale the values.");
    return;
  }
  const double highest = s.upper_tail.front();
  const double lowest = s.lower_tail.front();
  if (highest == lowest && (s.components.size() == 1 || s.total_error() == 0)) {
    s.warnings.push_back("all " + std::to_string(s.samples) +
                         " samples are equal, so the standard error says nothing: a value that comes up less than "
                         "three times in as many would not have been seen.");
    return;
  }
  constexpr double least_square = 1e-290;  // below, squares lose their digits
  if ((highest - lowest) * (highest - lowest) < least_square) {
    s.warnings.emplace_back("squares of the deviations underflow, so the standard error is too small; scale the values.");
    return;
  }
  if (!(s.moments.m2 > 0)) return;
  const double distance = s.largest.front().value - s.moments.mean;
  const double share = distance * distance / s.moments.m2;
  // Relative error of the standard error: half that of the variance, sqrt((kurtosis - 1) / n).
  const double doubt = 0.5 * std::sqrt((s.moments.kurtosis() - 1) / static_cast<double>(s.samples));
  if (s.samples >= 100 && share > 0.1) {
    s.warnings.push_back(
        "one sample carries " + percent(share) +
        " of the variance (threshold 10 %), so the error bar may be far too small; replay it: seed " + seed +
        ", sample " + std::to_string(s.largest.front().index) + ", level " +
        std::to_string(s.largest.front().level) + ".");
  } else if (doubt > 0.1) {
    s.warnings.push_back("the standard error is itself uncertain by " + percent(doubt) +
                         " (threshold 10 %), more often too small than too large; run more samples.");
  }
}

}  // namespace

namespace detail {

void rethrow_with_sample(std::uint64_t seed, std::int64_t index) {
  const auto report = [&](const std::string& what) {
    std::throw_with_nested(SampleError("sample " + std::to_string(index) + " of seed " +
                                           std::to_string(seed) + " threw: " + what +
                                           "; replay it alone with trace(estimator, " + std::to_string(seed) +
                                           ", " + std::to_string(index) + ")",
                                       seed, index));
  };
  try {
    throw;
  } catch (const std::exception& e) {
    report(e.what());
  } catch (...) {
    report("something that is not a std::exception");
  }
  std::terminate();  // not reached: report always throws
}

Statistics run(const Plan& plan, std::string estimator, std::int64_t chunk, const ChunkBody& body) {
  check(plan);
  const auto start = std::chrono::steady_clock::now();
  const std::int64_t end = plan.first + plan.samples;
  RunState state(chunk);
  if (plan.earlier) {
    state.merge(*plan.earlier);
    if (state.last() > end || (state.last() > 0 && state.first() < plan.first)) {
      throw std::invalid_argument("Plan: samples [" + std::to_string(plan.first) + ", " + std::to_string(end) +
                                  ") (an earlier run holds others, of [" + std::to_string(state.first()) + ", " +
                                  std::to_string(state.last()) + ")); ask for at least those");
    }
  }
  const double earlier_seconds = state.seconds;
  const std::int64_t known = state.reopen(end);  // the extremes hold the samples of a cut chunk before it
  const std::vector<RunState::Range> gaps = state.missing({plan.first, end});
  std::int64_t accounted = state.total().moments.count;
  for (const auto& [first, last] : gaps) accounted += last - first;
  if (accounted != plan.samples) {
    throw std::invalid_argument("Plan: the earlier run holds a part of a chunk of " + std::to_string(chunk) +
                                " samples, and others behind it (a chunk is drawn as a whole); leave out the part");
  }
  Chunks chunks(gaps, chunk);
  std::atomic<std::int64_t> done = 0;
  const auto seconds_now = [&] {
    return earlier_seconds + std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::atomic<bool> stop = false;
  std::mutex mutex;  // guards state and failure
  const std::function<bool(std::int64_t)> no_progress;
  std::exception_ptr failure;
  std::int64_t failed_index = std::numeric_limits<std::int64_t>::max();

  // A save may not cost more than a hundredth of the run.
  double next_save = earlier_seconds + save_interval;
  const auto save = [&] {
    const double began = seconds_now();
    RunState finished(chunk);
    {
      const std::lock_guard lock(mutex);
      state.seconds = began;
      finished = state;
    }
    plan.save(finished, plan);
    const double ended = seconds_now();
    next_save = ended + std::max(save_interval, 100 * (ended - began));
  };

  // Chunks are taken in order and a taken chunk always ends, so the smallest failing index is always found.
  const auto work = [&](bool is_caller) {
    const auto& progress = is_caller ? plan.progress : no_progress;
    Recorder recorder;
    while (!stop.load(std::memory_order_relaxed)) {
      const auto [first, last] = chunks.take();
      if (first >= last) break;
      recorder.begin_chunk(first, first / chunk == known / chunk ? known : 0);
      try {
        body(first, last, recorder);
        const Accumulator& sums = recorder.end_chunk();
        const std::lock_guard lock(mutex);
        state.add_chunk(first, last, sums);
        recorder.extremes().hand_over(state.extremes);
      } catch (...) {
        stop = true;
        const std::lock_guard lock(mutex);
        if (recorder.next_index() < failed_index) {
          failed_index = recorder.next_index();
          failure = std::current_exception();
        }
        break;
      }
      const std::int64_t finished = done += last - first;
      bool go_on = true;
      try {
        if (is_caller && plan.save && seconds_now() >= next_save) save();
        if (progress) go_on = progress(finished);
      } catch (...) {
        stop = true;  // else the caller would wait for the rest of the run
        throw;
      }
      if (!go_on) {
        stop = true;
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::make_exception_ptr(Interrupted("estimate: interrupted by the caller"));
      }
    }
  };

  const unsigned wanted =
      plan.threads > 0 ? static_cast<unsigned>(plan.threads) : std::thread::hardware_concurrency();
  const auto threads = std::clamp<std::int64_t>(wanted, 1, std::clamp<std::int64_t>(chunks.count(), 1, 1024));
  {
    std::vector<std::jthread> helpers;
    for (std::int64_t i = 1; i < threads; ++i) helpers.emplace_back([&work] { work(false); });
    work(true);
  }
  if (plan.save) save();
  if (failure) {
    try {
      std::rethrow_exception(failure);
    } catch (const Interrupted&) {
      throw;
    } catch (...) {
      rethrow_with_sample(plan.seed, failed_index);
    }
  }
  state.seconds = seconds_now();
  Statistics statistics = finish(std::move(estimator), plan.seed, std::move(state));
  add_warnings(statistics);
  return statistics;
}

void check_goal(const Goal& goal) {
  int wishes = 0;
  for (const auto& [name, value] :
       {std::pair("error", goal.error), {"relative_error", goal.relative_error}, {"seconds", goal.seconds}}) {
    if (value == 0) continue;
    ++wishes;
    if (value > 0 && std::isfinite(value)) continue;
    throw std::invalid_argument("Goal: " + std::string(name) + " = " + std::to_string(value) +
                                " (must be positive and finite)");
  }
  if (wishes > 1)
    throw std::invalid_argument("Goal: more than one wish (each alone fixes the samples); keep one");
}

namespace {

// The samples that a pilot asks for.
double wanted_samples(const Goal& goal, const Statistics& pilot, double spent) {
  if (goal.seconds > 0) {
    return (Goal::aim * goal.seconds - spent) / (pilot.seconds / static_cast<double>(pilot.samples));
  }
  const auto n = static_cast<double>(pilot.samples);
  const double doubt = std::sqrt(std::max(pilot.moments.kurtosis() - 1, 0.0) / n);  // of the variance
  const double variance = pilot.total_error() * pilot.total_error() * n * (1 + doubt);
  const double error = Goal::aim * (goal.error > 0 ? goal.error : goal.relative_error * pilot.size());
  if (variance == 0) return 2;
  return variance / (error * error);
}

}  // namespace

void warn_of_single_precision(Statistics& s, double epsilon) {
  if (s.nonfinite > 0 || !(s.total_error() < epsilon * s.size())) return;
  s.warnings.emplace_back("the standard error is below the rounding of single-precision values, which may have moved "
                          "the mean by more; compute the values in double.");
}

Plan plan_for_goal(const Plan& plan, std::int64_t chunk, const ChunkBody& body, double& seconds) {
  constexpr double pilot_share = 1.0 / 16;  // of the run
  constexpr std::int64_t most_pilot_samples = std::int64_t{1} << 22;
  constexpr std::int64_t fewest = 64;  // a standard error of fewer is none
  check_goal(plan.goal);
  Plan pilot = plan;
  // Where `samples` says that the run is short, so is the pilot.
  const std::int64_t expected = plan.earlier ? 1024 * 64 : plan.samples;
  pilot.samples = plan.goal.seconds > 0 ? fewest : std::clamp<std::int64_t>(expected / 64, fewest, 1024);
  pilot.save = {};
  pilot.earlier = {};
  const auto planned = [&](std::int64_t samples) {
    Plan result = plan;
    result.samples = samples;
    if (plan.earlier) result.samples = std::max(samples, plan.samples);  // fixed before those were drawn
    return result;
  };
  for (;;) {
    const Statistics s = run(pilot, "pilot", chunk, body);
    seconds += s.seconds;
    const double wanted = wanted_samples(plan.goal, s, seconds);
    if (s.nonfinite > 0 || std::isnan(wanted)) {  // nothing to aim at: the run will say what is wrong
      return planned(s.samples);
    }
    // The last pilot is the one that counts: the first is too short to know a variance, or the time of a sample.
    const double next = std::min(pilot_share * wanted, static_cast<double>(most_pilot_samples));
    if (next < 4 * static_cast<double>(pilot.samples)) {
      if (!(wanted < 0x1p62)) {
        throw std::invalid_argument("Goal: it takes " + std::to_string(wanted) +
                                    " samples (does not fit 64 bits)");
      }
      return planned(std::max(plan.goal.seconds > 0 ? 2 : fewest, static_cast<std::int64_t>(std::ceil(wanted))));
    }
    pilot.samples = static_cast<std::int64_t>(next);
  }
}

Statistics merge(const Statistics& a, const Statistics& b) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument("merge: " + what); };
  if (a.estimator != b.estimator) {
    refuse("the results are of different estimators (" + a.estimator + " and " + b.estimator + ")");
  }
  if (a.seed != b.seed) {
    refuse("the results have seeds " + std::to_string(a.seed) + " and " + std::to_string(b.seed) +
           " (one run has one seed); average their means weighted by samples instead");
  }
  RunState state = a.state;
  state.merge(b.state);
  if (!state.contiguous()) {
    refuse("the ranges [" + std::to_string(a.first) + ", " + std::to_string(a.first + a.samples) + ") and [" +
           std::to_string(b.first) + ", " + std::to_string(b.first + b.samples) +
           ") do not meet at a multiple of " + std::to_string(state.chunk()) + "; choose `first` and `samples` so");
  }
  Statistics statistics = finish(a.estimator, a.seed, std::move(state));
  statistics.bias_bound = a.bias_bound.size > b.bias_bound.size ? a.bias_bound : b.bias_bound;
  for (LevelRow& row : statistics.levels) {
    for (const Statistics* part : {&a, &b}) {
      for (const LevelRow& known : part->levels) {
        if (known.level == row.level && known.is_base == row.is_base) row.probability = known.probability;
      }
    }
  }
  add_warnings(statistics);
  return statistics;
}

}  // namespace detail
}  // namespace debias

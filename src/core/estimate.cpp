#include <debias/core/estimate.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <limits>
#include <new>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "core/communicator.hpp"
#include "core/text.hpp"

namespace debias {
namespace {

constexpr double save_interval = 1;  // seconds

// What all ranks of a run must have in common.
std::string description(const Plan& plan, const Identity& identity, const detail::Pieces& pieces) {
  std::string text = identity.estimator + identity.name;
  for (const std::int64_t x : {static_cast<std::int64_t>(plan.seed), plan.first, plan.samples, pieces.chunk,
                               pieces.block, static_cast<std::int64_t>(plan.earlier ? 1 : 0)}) {
    text += ' ' + std::to_string(x);
  }
  return text;
}

// Means, errors, rows and warnings from the sums of a run.
Statistics finish(std::uint64_t seed, RunState state) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const Accumulator sums = state.total();
  Statistics s;
  s.estimator = state.identity.estimator;
  s.name = state.identity.name;
  s.seed = seed;
  s.first = state.first();
  s.samples = state.last() - state.first();
  s.block = state.block();
  s.blocks = s.samples / s.block;
  s.moments = sums.moments;
  s.work = sums.work + state.pilot.work;
  s.seconds = state.seconds + state.pilot.seconds;
  s.pilot_work = state.pilot.work;
  s.pilot_seconds = state.pilot.seconds;
  s.pilot_levels = state.pilot.levels;
  s.sequence = state.pilot.sequence;
  s.nonfinite = state.extremes.nonfinite();
  s.first_nonfinite = state.extremes.first_nonfinite();
  s.largest = state.extremes.largest();
  s.upper_tail = state.extremes.upper_tail();
  s.lower_tail = state.extremes.lower_tail();

  const auto n = static_cast<double>(s.blocks);
  const auto add_component = [&](double mean, double m2) {
    const double variance = s.blocks < 2 ? nan : m2 / (n - 1);
    s.components.push_back(
        {s.nonfinite > 0 ? nan : mean, variance * static_cast<double>(s.block), std::sqrt(variance / n)});
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
                        l.kurtosis(), l.work / count, 0.0});
  };
  add_row({sums.levels.base_level(), sums.levels.base_level()}, true, sums.levels.base());
  for (std::size_t i = 0; i < sums.levels.rows().size(); ++i) {
    add_row(LevelTable::levels_of_row(i), false, sums.levels.rows()[i]);
  }
  s.state = std::move(state);
  return s;
}

// "131072 samples", "2048 blocks of 64 samples"
std::string count_text(const Statistics& s) {
  if (s.block == 1) return counted(s.samples, "sample");
  return counted(s.blocks, "block") + " of " + std::to_string(s.block) + " samples";
}

// What one of its values comes from.
std::string one_text(const Statistics& s) {
  return s.block == 1 ? "one sample" : "one block of " + std::to_string(s.block) + " samples";
}

std::string percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

void add_warnings(Statistics& s) {
  const std::string seed = std::to_string(s.seed);
  const auto warn = [&s](WarningCode code, std::string text) { s.warnings.push_back({code, std::move(text)}); };
  if (s.nonfinite > 0) {
    warn(WarningCode::nonfinite_samples, std::to_string(s.nonfinite) + " of " + count_text(s) + are(s.nonfinite) +
                                             " not finite, so the mean is not a number; replay the first: seed " +
                                             seed + ", sample " + std::to_string(s.first_nonfinite) + ".");
    return;
  }
  if (s.blocks < 2) {
    warn(WarningCode::one_sample, one_text(s) + " has no standard error; run at least two.");
    return;
  }
  const auto has_mean = [](const ComponentEstimate& c) { return std::isfinite(c.mean); };
  if (!std::all_of(s.components.begin(), s.components.end(), has_mean)) {
    warn(WarningCode::mean_overflow,
         "the sum of these samples overflows, so the mean is not a number; scale the values.");
    return;
  }
  if (!std::isfinite(s.total_error())) {
    warn(WarningCode::square_overflow,
         "squares of these samples overflow, so there is no standard error; scale the values.");
    return;
  }
  const double highest = s.upper_tail.front();
  const double lowest = s.lower_tail.front();
  if (highest == lowest && (s.components.size() == 1 || s.total_error() == 0)) {
    warn(WarningCode::equal_samples,
         "all " + count_text(s) +
             " are equal, so the standard error says nothing: a value that comes up less than "
             "three times in as many would not have been seen.");
    return;
  }
  constexpr double least_square = 1e-290;  // below, squares lose their digits
  if ((highest - lowest) * (highest - lowest) < least_square) {
    warn(WarningCode::square_underflow,
         "squares of the deviations underflow, so the standard error may be too small; scale the values.");
    return;
  }
  if (!(s.moments.m2 > 0)) return;
  const double distance = s.largest.front().value - s.moments.mean;
  const double share = distance * distance / s.moments.m2;
  // Relative error of the standard error: half that of the variance, sqrt((kurtosis - 1) / n).
  const double doubt = 0.5 * std::sqrt((s.moments.kurtosis() - 1) / static_cast<double>(s.blocks));
  if (s.blocks >= 100 && share > 0.1) {
    warn(WarningCode::dominant_sample,
         one_text(s) + " carries " + percent(share) +
             " of the variance (threshold 10 %), so the error bar may be far too small; replay it: seed " + seed +
             ", sample " + std::to_string(s.largest.front().index) + ", level " +
             std::to_string(s.largest.front().level) + ".");
  } else if (doubt > 0.1) {
    warn(WarningCode::uncertain_error, "the standard error is itself uncertain by " + percent(doubt) +
                                           " (threshold 10 %), more often too small than too large; run more samples.");
  }
}

}  // namespace

namespace detail {

void rethrow_with_sample(std::uint64_t seed, std::int64_t index) {
  const auto report = [&](const std::string& what) {
    std::throw_with_nested(SampleError("sample " + std::to_string(index) + " of seed " + std::to_string(seed) +
                                           " threw: " + what + "; replay it alone with trace(estimator, " +
                                           std::to_string(seed) + ", " + std::to_string(index) + ")",
                                       seed, index));
  };
  try {
    throw;
  } catch (const std::length_error& e) {
    report(std::string(e.what()) +
           " (a sequence that says how deep it can be drawn, by with_deepest_level(sequence, level) or a member "
           "deepest_level(), has such runs refused before they start)");
  } catch (const std::exception& e) {
    report(e.what());
  } catch (...) {
    report("something that is not a std::exception");
  }
  std::terminate();  // not reached: report always throws
}

Statistics run(const Plan& plan, const Identity& identity, const Pieces& pieces, const ChunkBody& body) {
  const auto start = std::chrono::steady_clock::now();
  Communicator& ranks = plan.ranks.communicator();
  const std::int64_t chunk = pieces.chunk;
  const std::int64_t block = pieces.block;
  ChunkQueue queue(chunk, block);
  queue.state.identity = identity;
  queue.state.seed = plan.seed;
  std::int64_t known = 0;  // the extremes hold the samples of a cut chunk before it
  std::int64_t chunks = 0;
  std::vector<RunState::Range> missing;
  const auto begin = [&] {
    check_plan(plan);
    const std::int64_t end = plan.first + plan.samples;
    RunState& state = queue.state;
    if (plan.earlier) {
      state.merge(*plan.earlier);
      if (state.last() > end || (state.last() > 0 && state.first() < plan.first)) {
        throw std::invalid_argument("Plan: samples [" + std::to_string(plan.first) + ", " + std::to_string(end) +
                                    ") (an earlier run holds others, of [" + std::to_string(state.first()) + ", " +
                                    std::to_string(state.last()) + ")); ask for at least those");
      }
    }
    known = state.reopen(end);
    missing = state.missing({plan.first, end});
    std::int64_t accounted = state.total().moments.count * block;
    for (const auto& [first, last] : missing) {
      accounted += last - first;
      chunks += (last - 1) / chunk - first / chunk + 1;
    }
    if (accounted != plan.samples) {
      throw std::invalid_argument("Plan: the earlier run holds a part of a chunk of " + std::to_string(chunk) +
                                  " samples, and others behind it (a chunk is drawn as a whole); leave out the part");
    }
  };
  ranks.agree(description(plan, identity, pieces), begin);
  const double earlier_seconds = queue.state.seconds;
  queue.state.pilot += plan.pilot;
  if (!ranks.leads()) {
    queue.state = RunState(chunk, block);
    queue.state.identity = identity;
    queue.state.seed = plan.seed;
  }
  const auto seconds_now = [&] {
    return earlier_seconds + std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };

  // A save may not cost more than a hundredth of the run.
  double next_save = earlier_seconds + save_interval;
  const auto save = [&] {
    RunState finished = queue.finished();
    // Extremes that hold the samples of a cut chunk without its sums would count them twice.
    if (known > 0 && !finished.missing({std::max(plan.first, known / chunk * chunk), known}).empty()) return;
    finished.seconds = seconds_now();
    plan.save(finished, plan);
    const double ended = seconds_now();
    next_save = ended + std::max(save_interval, 100 * (ended - finished.seconds));
  };
  const auto tell = [&](std::int64_t drawn) {
    if (plan.save && seconds_now() >= next_save) save();
    if (!plan.progress || plan.progress(drawn)) return;
    if (plan.save) save();  // at once: a rank that has died says nothing any more, and all wait for it
    throw Interrupted("estimate: interrupted by the caller");
  };

  // Threads can leave too little memory for one another. One that has none gives its chunk back and ends; `alone`, behind
  // the others, it is a failure like any other.
  std::atomic<bool> gave_up = false;
  const auto draw_chunks = [&](bool tells, bool alone) {
    Recorder recorder;
    for (;;) {
      const auto [first, last] = queue.take();
      if (first >= last) break;
      recorder.begin_chunk(first, first / chunk == known / chunk ? known : 0, CouplingTable::looks_at(first / chunk),
                           block);
      try {
        body(first, last, recorder);
        const Accumulator& sums = recorder.end_chunk();
        try {
          queue.add({first, last}, sums, recorder.extremes());
        } catch (const std::bad_alloc&) {  // half of it may be there
          queue.interrupt(std::current_exception());
          break;
        }
      } catch (const std::bad_alloc&) {
        if (alone) {
          queue.fail(recorder.next_index(), std::current_exception());
        } else {
          queue.give_back({first, last});
          gave_up = true;
        }
        break;
      } catch (...) {
        queue.fail(recorder.next_index(), std::current_exception());
        break;
      }
      try {
        if (tells) tell(queue.look().drawn);
      } catch (...) {
        queue.interrupt(std::current_exception());
      }
    }
  };
  const auto draw = [&](bool tells, bool alone) {
    try {
      draw_chunks(tells, alone);
    } catch (const std::bad_alloc&) {  // none for its sums
      gave_up = true;
      if (alone) queue.interrupt(std::current_exception());
    }
    queue.end_thread();
  };

  const auto threads = std::clamp<std::int64_t>(plan.threads > 0 ? plan.threads : ranks.threads(), 1,
                                                std::clamp<std::int64_t>(chunks, 1, 1024));
  const bool retries = ranks.caller_draws() && threads > 1;  // what other threads gave back, behind them
  const auto draw_here = [&] {
    queue.begin_thread();
    draw(plan.save || plan.progress, !retries);
  };
  const Communicator::Caller caller{static_cast<bool>(plan.save), tell, draw_here};
  std::int64_t drawing = ranks.caller_draws() ? 1 : 0;
  {
    std::vector<std::jthread> helpers;
    for (; drawing < threads; ++drawing) {
      bool begun = false;
      try {
        queue.begin_thread();
        begun = true;
        helpers.emplace_back([&draw, retries] { draw(false, !retries); });
      } catch (...) {  // the machine has no more threads: those that are there do it all
        if (begun) queue.end_thread();
        if (drawing == 0) {
          queue.interrupt(std::make_exception_ptr(std::invalid_argument(
              "a rank could not start the thread that draws (a limit such as ulimit, or the machine, grants no more); "
              "start fewer ranks")));
        }
        break;
      }
    }
    ranks.serve(queue, missing, caller);
  }
  if (gave_up && retries) {
    queue.begin_thread();
    draw(plan.save || plan.progress, true);
  }
  ranks.end(queue, [&] {
    if (plan.save) save();
    queue.state.seconds = seconds_now();
  });
  bool short_of_memory = false;
  if (queue.failure) {
    try {
      std::rethrow_exception(queue.failure);
    } catch (const Interrupted&) {
      throw;
    } catch (const std::bad_alloc&) {
      if (queue.failed_index != ChunkQueue::no_index) rethrow_with_sample(plan.seed, queue.failed_index);
      if (!retries) throw;
      short_of_memory = true;
    } catch (...) {
      if (queue.failed_index == ChunkQueue::no_index) throw;
      rethrow_with_sample(plan.seed, queue.failed_index);
    }
  }
  if (short_of_memory) {  // the threads took it from one another: alone, one may have enough, for the same bits
    queue.state = RunState(chunk, block);
    Plan alone = plan;
    alone.threads = 1;
    Statistics statistics = run(alone, identity, pieces, body);
    statistics.fewer_threads = 1;
    statistics.warnings.push_back(fewer_threads_warning(1));
    return statistics;
  }
  queue.state.identity = identity;  // with its type, also where the sums came from another rank
  Statistics statistics = finish(plan.seed, std::move(queue.state));
  if (statistics.moments.count * block != plan.samples) {
    throw std::logic_error("estimate: " + std::to_string(statistics.moments.count * block) + " of " +
                           std::to_string(plan.samples) +
                           " samples are in the sums (a defect of debias); please report it");
  }
  add_warnings(statistics);
  if (drawing < threads) {
    statistics.fewer_threads = static_cast<int>(drawing);
    statistics.warnings.push_back(fewer_threads_warning(statistics.fewer_threads));
  }
  return statistics;
}

Warning fewer_threads_warning(int threads) {
  return {
      WarningCode::threads,
      "only " + std::to_string(threads) + (threads == 1 ? " thread" : " threads") +
          " could be had (of what a machine or a limit such as ulimit grants); the numbers are the same, the time is "
          "longer."};
}

std::vector<Warning> lasting(const std::vector<Warning>& warnings) {
  std::vector<Warning> kept;
  for (const Warning& w : warnings) {
    const bool of_levels = w.code >= WarningCode::coupling && w.code <= WarningCode::deepest_level;
    if (of_levels && w.code != WarningCode::zero_differences) kept.push_back(w);
  }
  return kept;
}

Statistics merge(const Statistics& a, const Statistics& b) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument("merge: " + what); };
  a.state.identity.demand_same(b.state.identity, "merge");
  if (a.seed != b.seed) {
    refuse("the results have seeds " + std::to_string(a.seed) + " and " + std::to_string(b.seed) +
           " (one run has one seed); average their means weighted by samples instead");
  }
  RunState state = a.state;
  state.merge(b.state);
  if (!state.contiguous()) {
    refuse("the ranges [" + std::to_string(a.first) + ", " + std::to_string(a.first + a.samples) + ") and [" +
           std::to_string(b.first) + ", " + std::to_string(b.first + b.samples) + ") do not meet at a multiple of " +
           std::to_string(state.chunk()) + "; choose `first` and `samples` so");
  }
  Statistics statistics = finish(a.seed, std::move(state));
  statistics.bias_bound = a.bias_bound.size > b.bias_bound.size ? a.bias_bound : b.bias_bound;
  for (LevelRow& row : statistics.levels) {
    for (const Statistics* part : {&a, &b}) {
      for (const LevelRow& known : part->levels) {
        if (known.level == row.level && known.is_base == row.is_base) row.probability = known.probability;
      }
    }
  }
  statistics.masses = a.masses.empty() ? b.masses : a.masses;
  judge_counts(statistics);
  add_warnings(statistics);
  // What was found with points that no state keeps and by pilots, and what that took.
  for (const Statistics* part : {&a, &b}) {
    const double extra = part->pilot_work - part->state.pilot.work;
    statistics.work += extra;
    statistics.pilot_work += extra;
  }
  for (const Statistics* part : {&a, &b}) add_new(statistics.warnings, lasting(part->warnings));
  return statistics;
}

}  // namespace detail
}  // namespace debias

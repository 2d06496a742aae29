#pragma once

// A run as one process sees it: chunks to draw, and the sums of those that are drawn. The threads of the process share it.
//
// Which thread or rank drew a chunk cannot matter: sums travel as the nodes of RunState's fixed tree. Chunks
// are handed out in the order of their samples, and one that begins before the first failure known is always
// drawn, so the smallest failing index is always found.

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/run_state.hpp>

#include "chunks.hpp"

namespace debias::detail {

/// Members may be called from any thread; `state`, `failure` and `failed_index` are free where no thread
/// draws.
class ChunkQueue {
 public:
  using Range = RunState::Range;
  static constexpr std::int64_t no_index = std::numeric_limits<std::int64_t>::max();

  explicit ChunkQueue(std::int64_t chunk, std::int64_t block = 1) : state(chunk, block), samples_(chunk) {}

  /// Samples to draw, behind all that were given before.
  void give(const Range& samples);
  /// A chunk that was taken and not drawn, once a thread. Allocates nothing: it is memory that has run out.
  void give_back(const Range& samples) noexcept;
  /// Nothing more will come.
  void close();
  /// The samples of the next chunk, waiting for more if need be; none at the end.
  Range take();
  /// What came of a chunk.
  void add(const Range& samples, const Accumulator& sums, Extremes& extremes);
  /// A sample threw.
  void fail(std::int64_t index, std::exception_ptr why);
  /// Ends the run for another reason: a chunk in hand is the last one.
  void interrupt(std::exception_ptr why);
  /// Chunks that begin here or later are not wanted any more.
  void stop_at(std::int64_t index);
  /// A copy of the sums so far.
  [[nodiscard]] RunState finished() const;
  /// The sums that came since the last call, for another rank, which adds them to its own.
  [[nodiscard]] RunState take_finished();
  void merge(const RunState& sums);

  /// How many threads draw; one that ends says so. Sets aside what the thread needs to give a chunk back.
  void begin_thread();
  void end_thread();
  struct Look {
    std::int64_t drawn = 0;         ///< samples
    std::int64_t limit = no_index;  ///< chunks that begin here or later are not wanted
    int threads = 0;                ///< that draw
    bool hungry = false;            ///< one of them waits for a chunk
  };
  [[nodiscard]] Look look() const;
  /// Until a thread waits for a chunk or ends, or the time is over.
  void wait(std::chrono::microseconds time);

  RunState state;
  std::exception_ptr failure;
  std::int64_t failed_index = no_index;  ///< of the sample that threw `failure`, if one did

 private:
  mutable std::mutex mutex_;
  std::condition_variable more_;  // for threads that draw
  std::condition_variable news_;  // for the one that serves them
  Chunks samples_;
  std::vector<Range> returned_;  // chunks, with room for one of each thread
  std::size_t begun_ = 0;        // threads
  bool closed_ = false;
  bool news_pending_ = false;
  int waiting_ = 0;
  Look look_;
};

}  // namespace debias::detail

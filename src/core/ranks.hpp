#pragma once

// A run as one process sees it.
//
//   ChunkQueue   chunks to draw, and the sums of those that are drawn: what the threads of the process share
//   Ranks        the processes that share the samples of a run; src/mpi has those of an MPI communicator
//
// Which thread or rank drew a chunk cannot matter: sums travel as the nodes of RunState's fixed tree. Chunks
// are handed out in the order of their samples, and one that begins before the first failure known is always
// drawn, so the smallest failing index is always found.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/result.hpp>

#include "bytes.hpp"

namespace debias::detail {

/// Members may be called from any thread; `state`, `failure` and `failed_index` are free where no thread
/// draws.
class ChunkQueue {
 public:
  using Range = RunState::Range;
  static constexpr std::int64_t no_index = std::numeric_limits<std::int64_t>::max();

  explicit ChunkQueue(std::int64_t chunk) : state(chunk) {}

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
  std::deque<Range> samples_;
  std::vector<Range> returned_;  // chunks, with room for one of each thread
  std::size_t begun_ = 0;        // threads
  bool closed_ = false;
  bool news_pending_ = false;
  int waiting_ = 0;
  Look look_;
};

/// All ranks make the same calls in the same order, each on the thread that called `estimate`.
class Ranks {
 public:
  virtual ~Ranks() = default;
  /// True on the rank that has the last word: it saves, reports progress, and prints.
  [[nodiscard]] virtual bool leads() const = 0;
  /// What `threads = 0` means.
  [[nodiscard]] virtual int threads() const = 0;
  /// Runs `begin`. Where it throws on any rank, or not all ranks have the same text, all of them throw.
  virtual void agree(const std::string& text, const std::function<void()>& begin) = 0;
  /// What `make` returns on the leading rank, on all of them; they all throw where it does.
  virtual Bytes share(const std::function<Bytes()>& make) = 0;
  /// The last call, after whatever failure of its own: returns when all ranks have made it. Those that have
  /// not yet throw the failure from what else they call.
  virtual void leave(std::exception_ptr failure) = 0;
  /// Feeds the threads of `queue` until all ranks have drawn `samples` or stopped. On the leading rank, whose
  /// `samples` count, `tell` is called with the number that all ranks have drawn, and ends the run by what it
  /// throws; sums that it wants to save (`saves`) come to it all the time.
  virtual void serve(ChunkQueue& queue, const std::vector<ChunkQueue::Range>& samples, bool saves,
                     const std::function<void(std::int64_t drawn)>& tell) = 0;
  /// Gives all ranks the sums of all, or the failure with the smallest index. `seal` runs on the leading
  /// rank in between, when it has them all.
  virtual void end(ChunkQueue& queue, const std::function<void()>& seal) = 0;
};

/// What `make` returns on the leading rank, on all of them: a number that each would find another one for.
template <class T>
T share(Ranks* ranks, const std::function<T()>& make) {
  if (ranks == nullptr) return make();
  const Bytes bytes = ranks->share([&] {
    const T x = make();
    ByteWriter w;
    w.number(x);
    return std::move(w.bytes);
  });
  T x{};
  ByteReader(bytes).number(x);
  return x;
}

}  // namespace debias::detail

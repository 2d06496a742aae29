#pragma once

// What the processes that share a run say to each other. One process alone says it to itself (src/core/ranks.cpp); src/mpi has
// those of an MPI communicator.

#include <cstdint>
#include <exception>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/ranks.hpp>

#include "bytes.hpp"
#include "chunk_queue.hpp"

namespace debias::detail {

/// All ranks make the same calls in the same order, each on the thread that called `estimate`.
class Communicator {
 public:
  virtual ~Communicator() = default;
  [[nodiscard]] virtual int size() const = 0;
  /// True on the rank that has the last word: it saves, reports progress, and prints.
  [[nodiscard]] virtual bool leads() const = 0;
  /// What `threads = 0` means.
  [[nodiscard]] virtual int threads() const = 0;
  /// True where the calling thread draws like the others; one that listens to other ranks does nothing else, so that
  /// neither waits for a long sample of the other.
  [[nodiscard]] virtual bool caller_draws() const = 0;
  /// Runs `begin`. Where it throws on any rank, or not all ranks have the same text, all of them throw.
  virtual void agree(const std::string& text, const std::function<void()>& begin) = 0;
  /// What `make` returns on the leading rank, on all of them; they all throw where it does.
  virtual Bytes share(const std::function<Bytes()>& make) = 0;
  /// The last call, after whatever failure of its own: returns when all ranks have made it. Those that have
  /// not yet throw the failure from what else they call.
  virtual void leave(std::exception_ptr failure) = 0;
  /// What the calling thread has for the others.
  struct Caller {
    bool saves = false;                            ///< sums that are to be saved come to the leading rank all the time
    std::function<void(std::int64_t drawn)> tell;  ///< how many all ranks have drawn; ends the run by what it throws
    std::function<void()> draw;                    ///< until the queue has no more
  };
  /// Feeds the threads of `queue` until all ranks have drawn `samples`, those of the leading rank, or stopped.
  virtual void serve(ChunkQueue& queue, const std::vector<ChunkQueue::Range>& samples, const Caller& caller) = 0;
  /// Gives all ranks the sums of all, or the failure with the smallest index. `seal` runs on the leading
  /// rank in between, when it has them all.
  virtual void end(ChunkQueue& queue, const std::function<void()>& seal) = 0;
};

/// What `make` returns on the leading rank, on all of them: a number that each would find another one for.
template <class T>
T share(const Ranks& ranks, const std::function<T()>& make) {
  const Bytes bytes = ranks.communicator().share([&] {
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

#pragma once

// Pieces of work on threads; which thread does a piece cannot matter, since each writes its own results.

#include <algorithm>
#include <atomic>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace debias::render {

/// body(0) ... body(pieces - 1), in about this order, on `threads` threads (0: all cores); the caller works too.
/// `more` is asked, by the caller's thread only, before each of its pieces: false leaves out what has not begun.
/// Rethrows the first exception. Returns how many threads there were where the machine had fewer, else 0.
inline int in_parallel(int pieces, int threads, const std::function<void(int)>& body,
                       const std::function<bool(int finished)>& more) {
  std::atomic<int> next = 0;
  std::atomic<int> finished = 0;
  std::atomic<bool> stop = false;
  std::exception_ptr failure;
  std::mutex mutex;
  const auto work = [&](bool caller) {
    try {
      while (!stop) {
        if (caller && !more(finished)) stop = true;
        const int piece = stop ? pieces : next++;
        if (piece >= pieces) return;
        body(piece);
        ++finished;
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      stop = true;
    }
  };
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int wanted = std::max(1, std::min(threads == 0 ? cores : threads, pieces));
  int working = 1;
  {
    std::vector<std::jthread> others;
    try {
      for (; working < wanted; ++working) others.emplace_back(work, false);
    } catch (const std::exception&) {  // no more threads to be had: those that are there do it all
    }
    work(true);
  }
  if (failure) std::rethrow_exception(failure);
  return working < wanted ? working : 0;
}

}  // namespace debias::render

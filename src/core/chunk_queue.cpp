#include "core/chunk_queue.hpp"

#include <algorithm>
#include <utility>

namespace debias::detail {

void ChunkQueue::give(const Range& samples) {
  const std::lock_guard lock(mutex_);
  samples_.give(samples);
  more_.notify_all();
}

void ChunkQueue::give_back(const Range& samples) noexcept {
  const std::lock_guard lock(mutex_);
  returned_.push_back(samples);
  more_.notify_all();
}

void ChunkQueue::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  more_.notify_all();
}

ChunkQueue::Range ChunkQueue::take() {
  std::unique_lock lock(mutex_);
  if (!returned_.empty() && returned_.back().first < look_.limit) {
    const Range chunk = returned_.back();
    returned_.pop_back();
    return chunk;
  }
  if (samples_.empty() && !closed_) {
    ++waiting_;
    news_pending_ = true;
    news_.notify_one();
    more_.wait(lock, [this] { return closed_ || !samples_.empty(); });
    --waiting_;
  }
  if (samples_.empty() || samples_.next() >= look_.limit) return {0, 0};
  return samples_.take();
}

void ChunkQueue::add(const Range& samples, const Accumulator& sums, Extremes& extremes) {
  const std::lock_guard lock(mutex_);
  state.add_chunk(samples.first, samples.second, sums);
  extremes.hand_over(state.extremes);
  look_.drawn += samples.second - samples.first;
}

void ChunkQueue::fail(std::int64_t index, std::exception_ptr why) {
  const std::lock_guard lock(mutex_);
  look_.limit = std::min(look_.limit, index);
  if (index >= failed_index) return;
  failed_index = index;
  failure = std::move(why);
}

void ChunkQueue::interrupt(std::exception_ptr why) {
  const std::lock_guard lock(mutex_);
  look_.limit = 0;
  if (!failure) failure = std::move(why);
}

void ChunkQueue::stop_at(std::int64_t index) {
  const std::lock_guard lock(mutex_);
  look_.limit = std::min(look_.limit, index);
}

RunState ChunkQueue::finished() const {
  const std::lock_guard lock(mutex_);
  return state;
}

RunState ChunkQueue::take_finished() {
  const std::lock_guard lock(mutex_);
  RunState empty(state.chunk(), state.block());
  empty.identity = state.identity;
  empty.seed = state.seed;
  return std::exchange(state, std::move(empty));
}

void ChunkQueue::merge(const RunState& sums) {
  const std::lock_guard lock(mutex_);
  state.merge(sums);
}

void ChunkQueue::begin_thread() {
  const std::lock_guard lock(mutex_);
  returned_.reserve(begun_ + 1);
  ++begun_;
  ++look_.threads;
}

void ChunkQueue::end_thread() {
  const std::lock_guard lock(mutex_);
  --look_.threads;
  news_pending_ = true;
  news_.notify_one();
}

ChunkQueue::Look ChunkQueue::look() const {
  const std::lock_guard lock(mutex_);
  Look now = look_;
  now.hungry = waiting_ > 0 && samples_.empty() && !closed_;
  return now;
}

void ChunkQueue::wait(std::chrono::microseconds time) {
  std::unique_lock lock(mutex_);
  news_.wait_for(lock, time, [this] { return news_pending_; });
  news_pending_ = false;
}

}  // namespace debias::detail

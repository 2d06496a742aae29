#pragma once

// A run whose samples are drawn twice: first for the questions that they ask, which are then answered all at once, and again,
// in the same order, to be recorded. On one thread.
//
//   collection.collect_queries(draws) calls draws() for its questions, and has them answered; then the draws that count read them

#include <algorithm>
#include <bit>
#include <cstdint>
#include <functional>

#include <debias/core/estimate.hpp>

namespace debias::python {

/// Draws while the flag says that only questions are asked.
inline void ask_by(bool& collecting, const std::function<void()>& draws) {
  collecting = true;
  try {
    draws();
  } catch (...) {
    collecting = false;
    throw;
  }
  collecting = false;
}

template <class Collection>
class Collecting {
 public:
  /// `block` samples come from each stream.
  explicit Collecting(Collection& collection, std::int64_t block = 1)
      : collection_(&collection),
        ahead_(std::max<std::int64_t>(
            1, static_cast<std::int64_t>(std::bit_floor(static_cast<std::uint64_t>(ahead_of(collection) / block))))) {}

  void begin(std::int64_t first, std::int64_t last, bool in_order) {
    in_order_ = in_order;
    collected_ = first;
    end_ = last;
  }
  template <class Draw>
  void chunk(std::int64_t first, std::int64_t last, const Draw& draw, Recorder& recorder) {
    if (!in_order_ || first >= collected_) {  // some whole chunks at once, where all will come
      collected_ = in_order_ ? std::min((first / ahead_ + 1) * ahead_, end_) : last;
      collect_queries(first, collected_, draw);
    }
    for (std::int64_t i = first; i < last; ++i) recorder.add(draw(i, recorder));
  }
  template <class F>
  auto aside(const F& f) {
    collection_->collect_queries([&] { f(); });
    return f();
  }

 private:
  static constexpr std::int64_t most_ahead = 1 << 16;  // samples

  // Fewer where the collection says so, of samples that take long.
  static std::int64_t ahead_of(const Collection& collection) {
    if constexpr (requires { collection.ahead(); }) return std::min(most_ahead, collection.ahead());
    return most_ahead;
  }

  template <class Draw>
  void collect_queries(std::int64_t first, std::int64_t last, const Draw& draw) {
    collection_->collect_queries([&] {
      NullRecord record;
      for (std::int64_t i = first; i < last; ++i) draw(i, record);
    });
  }

  Collection* collection_;
  std::int64_t ahead_;  // streams: whole chunks
  bool in_order_ = false;
  std::int64_t collected_ = 0;
  std::int64_t end_ = 0;
};

/// `estimate` so; nothing is asked again for the mean in the type of the value.
template <Estimator E, class Collection>
Statistics estimate_collected(Collection& collection, const E& estimator, Plan plan) {
  plan.threads = 1;
  Collecting<Collection> way(collection, debias::detail::pieces_of(estimator).block);
  return debias::detail::statistics_by(way, estimator, plan);
}

}  // namespace debias::python

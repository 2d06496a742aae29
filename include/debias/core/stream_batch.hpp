#pragma once

// The streams of several members of one sample that draw in step: what the batch hook of a sequence draws from.
//
//   number t of member b  =  number t of the stream of member b alone; rows of numbers lie member by member
//
// A batch may be stratified: the first uniform of member b of n is then (b + u_b) / n instead of u_b. Each member
// alone has another law then, but the mean over all n has the expectation of n independent draws, and a variance
// that is smaller, far smaller where a draw depends smoothly on its first uniform. [McKay, Beckman, Conover 1979]

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>

#include <debias/core/stream.hpp>

namespace debias {

class StreamBatch {
 public:
  /// The most members of a batch, and of the rows of numbers that a hook need keep.
  static constexpr std::size_t capacity = 64;

  /// The streams parent.split(first), parent.split(first + 1), ... of `size` members, each split once more: from
  /// `branch`. `rank` of the first of them among `strata` members; strata = 1 is no stratification.
  StreamBatch(const Stream& parent, std::uint64_t first, std::size_t size, std::uint64_t branch, std::int64_t rank = 0,
              std::int64_t strata = 1)
      : index_(parent.index_), size_(size), rank_(rank), strata_(strata) {
    assert(size >= 1 && size <= capacity);
    for (std::size_t b = 0; b < size; ++b) {
      keys_[b] = Stream::mix(Stream::mix(parent.key_, first + b), branch);
    }
  }

  [[nodiscard]] std::size_t size() const { return size_; }

  /// The next out.size() / size() numbers of every member: out[t * size() + b].
  void uniforms(std::span<double> out);
  /// The same through normal_quantile.
  void normals(std::span<double> out) {
    uniforms(out);
    normal_quantiles(out);
  }

  /// The stream of member b alone, where the batch stands. Not for a stratified batch that has not drawn yet.
  [[nodiscard]] Stream stream(std::size_t b) const {
    Stream rng(keys_[b], index_);
    rng.seek(position_);
    return rng;
  }

 private:
  alignas(64) std::array<std::uint64_t, capacity> keys_;  // only the first size_ are set
  std::uint64_t index_;
  std::uint64_t position_ = 0;
  std::size_t size_;
  std::int64_t rank_;
  std::int64_t strata_;
};

}  // namespace debias

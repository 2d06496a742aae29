#pragma once

// What a run has so far: the sums over its finished chunks, in a form that goes on.
//
//   nodes of a binary tree over chunks of samples, by absolute index: O(log N) of them for N samples in a row
//
//   Notation: a block is the samples that an estimator draws from one stream, 1 for most; its moments are those of the means
//   of blocks. Indices, ranges and chunks count samples.
//
// States of neighbouring, or any disjoint, samples merge in any order into the bits that one run would have given. A state
// is what Plan::save hands out, Plan::earlier takes up, and core/checkpoint.hpp keeps on disk.
// Fails where two hold the same sample, or are of two estimators or seeds: merge throws, for it would be a wrong result.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <typeinfo>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/plan.hpp>

namespace debias {

/// Whose sums they are. Within a process an estimator is known by its type, everywhere by what it calls itself and by the
/// name that `named` gave it. Equal types over different data cannot be told apart: give them names.
struct Identity {
  std::string estimator = {};            ///< its description; empty where nothing is known
  std::string name = {};                 ///< empty where it was given none
  const std::type_info* type = nullptr;  ///< never in a file, nor sent to another rank

  [[nodiscard]] bool known() const { return !estimator.empty(); }
  /// Throws std::invalid_argument, with `who` in front, where `other` is known to be another estimator.
  void demand_same(const Identity& other, const std::string& who) const;
};

/// The sums of a run as the open nodes of a binary tree over its chunks of samples (absolute index): what two
/// results need in order to merge into the bits that one run would have given.
class RunState {
 public:
  /// Throws std::invalid_argument unless `chunk` is a power of two of blocks.
  explicit RunState(std::int64_t chunk, std::int64_t block = 1);
  RunState() : RunState(default_chunk) {}

  /// Samples of a chunk.
  [[nodiscard]] std::int64_t chunk() const { return chunk_; }
  /// Samples of a block.
  [[nodiscard]] std::int64_t block() const { return block_; }
  /// Adds the sums over samples [first, last) of one chunk, or of a part of it.
  void add_chunk(std::int64_t first, std::int64_t last, const Accumulator& sums);
  /// Adds another state. Throws std::invalid_argument where both hold the same samples, or are of two estimators or seeds.
  void merge(const RunState& other);

  [[nodiscard]] std::int64_t first() const;
  [[nodiscard]] std::int64_t last() const;
  /// True when [first, last) has no hole and no cut inside a chunk.
  [[nodiscard]] bool contiguous() const;
  [[nodiscard]] Accumulator total() const;
  using Range = std::pair<std::int64_t, std::int64_t>;
  /// The samples [first, second) that it does not hold, of `range`, a cut chunk counted as not held.
  [[nodiscard]] std::vector<Range> missing(Range range) const;
  /// Takes out the sums of the last chunk where it is cut before `end`, so that it can be drawn again; returns its end. The
  /// extremes keep its samples.
  std::int64_t reopen(std::int64_t end);

  Identity identity;
  std::optional<std::uint64_t> seed;  ///< of the samples; none where they are of no one run
  Extremes extremes;
  double seconds = 0;  ///< of the runs that these sums are from, without their pilots
  PilotRun pilot;      ///< of these runs

 private:
  friend struct detail::Codec;
  struct Node {
    std::int64_t last = 0;
    std::int64_t chunks = 0;  // a power of two; 0 for a chunk that is not complete
    Accumulator sums;
  };
  void insert(std::int64_t first, Node node);

  std::int64_t chunk_;
  std::int64_t block_;
  std::map<std::int64_t, Node> nodes_;  // by first sample
};

}  // namespace debias

#pragma once

// A run on disk: what it is of, as text, and the sums of its finished chunks, again and again as they grow.
//
//   file    "DEBIASCP", format, byte order, stream layout (u32 each), text (u64 size, bytes), CRC-32 of all that
//   record  "RECD" (u32), u64 size, the sums, CRC-32 of all that; the last whole record holds all before it
//
// Numbers are little endian, doubles their 64 bits. What follows the last whole record was being written when the power
// went, and is of no use. A file that grows beyond `most_records` is written anew under another name and put in its
// place, so that at any moment one whole file has the name.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <debias/core/result.hpp>

namespace debias {

/// What the file says.
struct Checkpoint {
  std::string text;
  std::optional<RunState> state;  ///< none, where the run was killed before the first record
  std::size_t dropped = 0;        ///< bytes at the end that are no whole record
};

/// Any bytes at all: throws std::invalid_argument where they do not begin with a whole header of this format and stream
/// layout, and allocates no more than a small multiple of their number.
Checkpoint parse_checkpoint(std::span<const std::byte> bytes);
/// Throws std::system_error where the file cannot be read, std::invalid_argument as parse_checkpoint.
Checkpoint read_checkpoint(const std::string& path);

/// Writes the records of one run. All members throw std::system_error where the disk refuses.
class CheckpointWriter {
 public:
  /// Puts a file with the text, and the sums if there are any, at `path` at once: a path that cannot be written is
  /// found out before the hours of a run.
  CheckpointWriter(std::string path, std::string text, const RunState* state = nullptr);
  /// On disk when it returns.
  void save(const RunState& state);

  static constexpr int most_records = 32;

 private:
  void write_whole(const RunState* state);

  std::string path_;
  std::string text_;
  int records_ = 0;
};

}  // namespace debias

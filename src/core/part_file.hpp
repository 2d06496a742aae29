#pragma once

// What has been finished, on disk: a text that says of what, and parts that each have a name, again and again as they grow.
// A part is the sums of a run, or of an image.
//
//   file    "DEBIASCP", format, byte order, stream layout (u32 each), text (u64 size, bytes), CRC-32 of all that
//   record  "RECD" (u32), u64 size, name (u64 size, bytes), contents, CRC-32 of all that
//
// Of the records of a name the last whole one counts. What follows the last whole record was being written when the power
// went, and is of no use. A file that has grown to four times what counts is written anew under another name and put in
// its place, so that at any moment one whole file has the name.

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "bytes.hpp"

namespace debias {

using Parts = std::map<std::string, Bytes>;

/// What the file says.
struct PartFile {
  std::string text;
  Parts parts;
  std::size_t dropped = 0;  ///< bytes at the end that are no whole record
};

/// Any bytes at all: throws std::invalid_argument where they do not begin with a whole header of this format and stream
/// layout, and allocates no more than a small multiple of their number.
PartFile parse_parts(std::span<const std::byte> bytes);
/// Throws std::system_error where the file cannot be read, std::invalid_argument as parse_parts.
PartFile read_parts(const std::string& path);
/// The bytes of a file that holds these.
Bytes encode(const std::string& text, const Parts& parts);

namespace detail {
class File;
}

/// Writes the records of one file. All members throw std::system_error where the disk refuses.
class PartWriter {
 public:
  /// Puts a file with the text and the parts at `path` at once: a path that cannot be written is found out before
  /// the hours of a run.
  PartWriter(std::string path, std::string text, Parts parts = {});
  ~PartWriter();
  PartWriter(const PartWriter&) = delete;
  PartWriter& operator=(const PartWriter&) = delete;
  /// Parts that are new, or have grown: on disk when it returns. Throws std::system_error where another run has put a file
  /// of its own at the path.
  void save(const Parts& parts);
  /// The same file with another text, and with these parts alone.
  void restart(std::string text, Parts parts);

  static constexpr std::size_t most_waste = 1
                                            << 20;  // bytes of records that no longer count, beside four times the rest

 private:
  void write_whole();
  bool is_there() const;

  std::string path_;
  std::string text_;
  Parts parts_;
  std::size_t size_ = 0;
  std::size_t least_size_ = 0;
  std::unique_ptr<detail::File> own_;  ///< the file, held open: another one at the path is told by it
};

}  // namespace debias

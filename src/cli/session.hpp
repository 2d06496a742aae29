#pragma once

// What a command has finished, on disk: the words of the command line and the parts that it consists of (the run of
// `run`, the cells of `validate`, the points of `tradeoff`, the images of `render`). A part that is held is taken up where
// it was left; whatever lies between the parts (pilots, surveys) is drawn again, to the same bits.

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include <debias/core/result.hpp>

#include "../core/checkpoint.hpp"
#include "arguments.hpp"

namespace debias::cli {

/// The words of a command that decide its numbers, as text; seeds are numbers by now. Throws std::invalid_argument for a
/// line break.
std::string text_of(const std::string& command, const Arguments& arguments);

/// A file as it was read.
struct Loaded {
  std::string command;
  Arguments arguments;
  Parts parts;
};
/// Throws FileError; says where the tail is torn. The leading one of `ranks` reads for all.
Loaded load(const std::string& path, debias::detail::Ranks* ranks = nullptr);

class Session {
 public:
  /// Nothing is kept where there is no --checkpoint. A file that exists is taken up where `resume` asks for it, and
  /// refused else. Throws FileError.
  Session(const std::string& command, const Arguments& arguments);

  /// Null where nothing is held.
  [[nodiscard]] const Bytes* held(const std::string& part) const;
  /// True when a second has gone by since the last write, and a hundred times what that took.
  [[nodiscard]] bool due() const;
  /// Written with the next flush, which it does itself when it is due.
  void keep(const std::string& part, Bytes contents);
  /// Throws FileError where the disk refuses.
  void flush();
  /// Takes up the samples of a part, and keeps those to come.
  void attach(Plan& plan, const std::string& part);
  /// What `draw` returns; an interrupt suspends on its way.
  template <class Draw>
  auto guard(const Draw& draw) {
    try {
      return draw();
    } catch (const Interrupted&) {
      suspend();
      throw;
    }
  }
  /// Writes what there is, and how to go on: for a command that is interrupted.
  void suspend();

 private:
  using Clock = std::chrono::steady_clock;
  std::string path_;
  Parts held_;
  Parts fresh_;
  std::optional<CheckpointWriter> writer_;
  Clock::time_point due_;
};

}  // namespace debias::cli

#pragma once

// What a command has finished, on disk: its words, and its parts (the run of `run`, the cells of `validate`, the points of
// `tradeoff`, the images of `render`).

#include <chrono>
#include <optional>
#include <string>

#include "commands/store.hpp"
#include "core/part_file.hpp"
#include "execute.hpp"

namespace debias::cli {

/// The words as the text of a file, and where their report goes in which form. Throws std::invalid_argument for a line
/// break.
std::string text_of(const Saved& saved, const Delivery& delivery = {});

/// A file as it was read.
struct Loaded {
  Saved saved;
  Delivery delivery;  ///< output, plot, csv, full and json
  Parts parts;
};
/// Throws FileError; says where the tail is torn. The leading one of `ranks` reads for all.
Loaded load(const std::string& path, const Ranks& ranks = {});

bool is_regular_file(const std::string& path);

class Session final : public commands::Store {
 public:
  /// Nothing is kept where there is no --checkpoint. A file that exists is taken up where `resume` asks for it, and
  /// refused else. Throws FileError.
  Session(const Saved& saved, const Delivery& delivery);

  [[nodiscard]] const Bytes* held(const std::string& part) const override;
  /// True when a second has gone by since the last write, and a hundred times what that took.
  [[nodiscard]] bool due() const override;
  /// Written with the next flush, which it does itself when it is due.
  void keep(const std::string& part, Bytes contents) override;
  /// Throws FileError where the disk refuses.
  void flush();
  /// A caller of a command that keeps its parts here, if anything is kept.
  commands::Caller caller(commands::Watch watch) { return {std::move(watch), writer_ ? this : nullptr}; }
  /// What `draw` returns; an interrupt suspends on its way.
  template <class Draw>
  auto guard(const Draw& draw) {
    try {
      return draw();
    } catch (const Interrupted&) {
      suspend();
      throw;
    } catch (const commands::BadPart& e) {
      throw FileError("'" + path_ + "': " + e.what());
    }
  }
  /// Writes what there is, and how to go on: for a command that is interrupted.
  void suspend();

 private:
  using Clock = std::chrono::steady_clock;
  std::string path_;
  Parts held_;
  Parts fresh_;
  std::optional<PartWriter> writer_;
  Clock::time_point due_;
};

}  // namespace debias::cli

#pragma once

// Where words go: results to a checked stream, progress and complaints to standard error; and the exit codes.

#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace debias::cli {

enum ExitCode : int {
  done = 0,
  internal_error = 1,
  bad_usage = 2,
  goal_missed = 3,
  validation_failed = 4,
  file_error = 5,
  nonfinite_samples = 6,
  interrupted_by_signal = 130,
};

/// A file that cannot be opened, a full disk, a reader that has gone.
struct FileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Standard output, or a file.
class Output {
 public:
  /// Opens the file at once, before the hours of a run, and empties it when there is a result: of a run that ends
  /// without one, however it ends, the file is as it was, or not there. An empty path is standard output. Throws
  /// FileError, which names the `option` that the file came by.
  explicit Output(const std::string& path = "", std::string option = "-o");

  std::ostream& stream() { return text_; }
  /// Writes what the stream has collected. Throws FileError unless all of it arrives; of a file, what was written
  /// before is kept, and no part of this.
  void flush();
  [[nodiscard]] bool is_file() const { return !path_.empty(); }

 private:
  std::string path_;
  std::string option_;
  std::ofstream file_;
  bool is_new_ = false;
  bool emptied_ = false;
  std::uintmax_t written_ = 0;
  std::ostringstream text_;  // only texts
};

/// Throws std::invalid_argument where the result would take the place of a file that it is made from.
void keep_apart(const std::string& output, const std::string& file, const std::string& option = "-o");

/// Where the picture of a result goes, if one is wanted: opened before the run, written after it.
class Picture {
 public:
  /// Of Delivery::plot, beside the file of the result. An empty path wants none.
  Picture(const std::string& path, const std::string& output);
  explicit operator bool() const { return file_.has_value(); }
  void write(const std::string& svg);

 private:
  std::optional<Output> file_;
};

/// A line on standard error that is overwritten, at most ten times a second, and only on a terminal.
class Progress {
 public:
  explicit Progress(bool quiet);
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() { erase(); }

  /// True when it is time for another line.
  bool due();
  void show(const std::string& text);
  void erase();
  /// Since the start.
  [[nodiscard]] double seconds() const;

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_ = start_;
  bool terminal_;
};

/// "62 %, 12 s left".
std::string share_of(double done, double total, double seconds);
/// A Watch (commands/request.hpp) that shows each step, and ends where a signal came: samples that are drawn, or the
/// share of what there is to do.
std::function<bool(std::string_view what, double done, double total)> watch_samples(Progress& progress);
std::function<bool(std::string_view what, double done, double total)> watch_share(Progress& progress);

/// A standard stream that is closed fails from here on where it is used; else the next file that is opened would get
/// its number, and what is meant for the stream.
void keep_standard_streams();

/// From here on SIGINT and SIGTERM set a flag and end the program within a second, a second one ends it at
/// once; a closed pipe, or a file that may not grow, is an error of the write.
void watch_signals();
bool interrupted();
/// The message that goes with it, and the exit code.
int say_interrupted();

/// From here on this process writes nothing, anywhere: another one speaks for it.
void be_silent();

/// `debias: message` on standard error, as one line whatever the message holds.
void complain(std::string_view message);

}  // namespace debias::cli

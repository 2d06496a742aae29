#include "output.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <system_error>
#include <utility>

#include "commands/text.hpp"

namespace debias::cli {
namespace {

volatile std::sig_atomic_t signalled = 0;
volatile std::sig_atomic_t line_visible = 0;

bool silent = false;

constexpr std::string_view erase_line = "\r\033[K";
constexpr std::string_view farewell =
    "debias: interrupted; no result, since a run that the clock ended would be biased\n";

void write_stderr(std::string_view text) { [[maybe_unused]] const auto n = write(2, text.data(), text.size()); }

volatile std::sig_atomic_t farewell_said = 0;

void say_farewell() {
  if (!silent && farewell_said == 0) write_stderr(farewell);
  farewell_said = 1;
}

// Deep in a level of 2^60 draws nobody looks at the flag, so an alarm ends what has not ended in a second.
extern "C" void on_signal(int) {
  signalled = 1;
  alarm(1);
}
extern "C" void on_alarm(int) {
  if (line_visible != 0) write_stderr(erase_line);
  say_farewell();
  _exit(interrupted_by_signal);
}

std::string reason() { return errno != 0 ? std::strerror(errno) : "cannot be written"; }

// Of a link the file.
void remove_file(const std::string& path) {
  std::error_code ignored;
  std::filesystem::remove(std::filesystem::canonical(path, ignored), ignored);
}

}  // namespace

Output::Output(const std::string& path, std::string option) : path_(silent ? "" : path), option_(std::move(option)) {
  if (path_.empty()) return;
  std::error_code ignored;
  is_new_ = !std::filesystem::exists(path, ignored);
  errno = 0;
  file_.open(path, std::ios::binary | std::ios::app);
  if (!file_) throw FileError(option_ + " '" + path + "': " + reason());
  if (is_new_) remove_file(path);  // at once: a run that is killed cannot do it later
}

void Output::flush() {
  if (silent) return;
  std::ostream& target = is_file() ? file_ : std::cout;
  errno = 0;
  // A pipe that is opened anew has lost its reader.
  std::error_code unknown;
  const bool is_pipe = is_file() && std::filesystem::is_fifo(path_, unknown);
  if (is_file() && !std::exchange(emptied_, true) && !is_pipe) {
    file_.close();
    file_.open(path_, std::ios::binary | std::ios::trunc);
  }
  const std::string text = text_.str();
  if (!(target << text << std::flush)) {
    const std::string why = reason();
    std::error_code ignored;
    if (is_file() && is_new_ && written_ == 0) {
      remove_file(path_);
    } else if (is_file() && std::filesystem::is_regular_file(path_, ignored)) {
      std::filesystem::resize_file(path_, written_, ignored);
    }
    throw FileError((is_file() ? option_ + " '" + path_ + "'" : "standard output") + ": " + why);
  }
  written_ += text.size();
  text_.str("");
}

void keep_apart(const std::string& output, const std::string& file, const std::string& option) {
  if (output.empty() || file.empty()) return;
  std::error_code ignored;
  const auto whole = [&ignored](const std::string& path) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(path, ignored), ignored);
  };
  if (whole(output) != whole(file) && !std::filesystem::equivalent(output, file, ignored)) return;
  throw std::invalid_argument(option + " '" + output + "', '" + file +
                              "' (one file for two things); choose another name");
}

Picture::Picture(const std::string& path, const std::string& output) {
  if (path.empty()) return;
  if (!path.ends_with(".svg"))
    throw std::invalid_argument("--plot '" + path + "' (is written as SVG); write --plot picture.svg");
  keep_apart(path, output, "--plot");
  file_.emplace(path, "--plot");
}

void Picture::write(const std::string& svg) {
  file_->stream() << svg;
  file_->flush();
}

Progress::Progress(bool quiet) : terminal_(!quiet && !silent && isatty(STDERR_FILENO) != 0) {}

bool Progress::due() {
  if (!terminal_ || Clock::now() < next_) return false;
  next_ = Clock::now() + std::chrono::milliseconds(100);
  return true;
}

void Progress::show(const std::string& text) {
  std::cerr << erase_line << text << std::flush;
  line_visible = 1;
}

void Progress::erase() {
  if (line_visible != 0) std::cerr << erase_line << std::flush;
  line_visible = 0;
}

double Progress::seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

std::string share_of(double done, double total, double seconds) {
  const double left = seconds * (total - done) / done;
  return commands::rounded(std::floor(100 * done / total)) + " %, " + commands::rounded(std::ceil(left), 6) + " s left";
}

std::function<bool(std::string_view, double, double)> watch_samples(Progress& progress) {
  return [&progress](std::string_view what, double done, double total) {
    if (progress.due()) {
      progress.show(std::string(what) + ", " + commands::rounded(done) +
                    (total > 0
                         ? " of " + commands::rounded(total) + " samples, " + share_of(done, total, progress.seconds())
                         : " draws"));
    }
    return !interrupted();
  };
}

std::function<bool(std::string_view, double, double)> watch_share(Progress& progress) {
  return [&progress](std::string_view what, double done, double total) {
    if (progress.due()) {
      progress.show(std::string(what) + (done > 0 ? ", " + share_of(done, total, progress.seconds()) : ""));
    }
    return !interrupted();
  };
}

void keep_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) < 0) open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  }
}

void watch_signals() {
  struct sigaction action = {};
  action.sa_handler = on_signal;
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGALRM, on_alarm);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

bool interrupted() { return signalled != 0; }

int say_interrupted() {
  say_farewell();
  return interrupted_by_signal;
}

void be_silent() { silent = true; }

void complain(std::string_view message) {
  if (silent) return;
  std::string line = "debias: " + std::string(message);
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = ' ';
  }
  std::cerr << line + "\n" << std::flush;
}

}  // namespace debias::cli

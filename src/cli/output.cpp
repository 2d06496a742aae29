#include "output.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <system_error>
#include <utility>

#include <debias/core/stream.hpp>

#include "../core/text.hpp"

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

}  // namespace

Output::Output(const std::string& path) : path_(silent ? "" : path) {
  if (path_.empty()) return;
  errno = 0;
  file_.open(path, std::ios::binary | std::ios::app);
  if (!file_) throw FileError("-o '" + path + "': " + reason());
}

void Output::flush() {
  if (silent) return;
  std::ostream& target = is_file() ? file_ : std::cout;
  errno = 0;
  if (is_file() && !std::exchange(emptied_, true)) {
    file_.close();
    file_.open(path_, std::ios::binary | std::ios::trunc);
  }
  const std::string text = text_.str();
  if (!(target << text << std::flush)) {
    const std::string why = reason();
    std::error_code ignored;
    if (is_file() && std::filesystem::is_regular_file(path_, ignored)) {
      std::filesystem::resize_file(path_, written_, ignored);
    }
    throw FileError((is_file() ? "-o '" + path_ + "'" : "standard output") + ": " + why);
  }
  written_ += text.size();
  text_.str("");
}

void keep_apart(const std::string& output, const std::string& file) {
  std::error_code ignored;
  if (output.empty() || (output != file && !std::filesystem::equivalent(output, file, ignored))) return;
  throw std::invalid_argument("-o '" + output + "', '" + file + "' (one file for two things); choose another name");
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
  return rounded(std::floor(100 * done / total)) + " %, " + rounded(std::ceil(left), 6) + " s left";
}

std::function<bool(std::string_view, double, double)> watch_on(Progress& progress) {
  return [&progress](std::string_view what, double done, double total) {
    if (progress.due()) {
      progress.show(
          std::string(what) + ", " + rounded(done) +
          (total > 0 ? " of " + rounded(total) + " samples, " + share_of(done, total, progress.seconds()) : " draws"));
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

std::string version_text() {
  std::string text = "debias " DEBIAS_VERSION "\nstream layout " + std::to_string(Stream::layout_version);
#ifdef __clang__
  text += "\ncompiler " __VERSION__;
#else
  text += "\ncompiler g++ " __VERSION__;
#endif
#ifdef __OPTIMIZE__
  text += ", optimised";
#else
  text += ", not optimised";
#endif
#ifndef NDEBUG
  text += ", assertions on";
#endif
  return text;
}

std::string rounded(double x, int digits) { return format({std::chars_format::general, digits}, x); }

void print_row(std::ostream& out, const Row& row, const std::vector<std::size_t>& widths) {
  std::string line;
  for (std::size_t i = 0; i < row.size(); ++i) {
    line += row[i];
    const std::size_t width = i < widths.size() ? widths[i] : 0;
    line.append(row[i].size() < width ? width - row[i].size() : 0, ' ');
    line += "  ";
  }
  line.erase(line.find_last_not_of(' ') + 1);
  out << line << '\n';
}

void print_table(std::ostream& out, const std::vector<Row>& rows) {
  std::vector<std::size_t> widths;
  for (const Row& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  for (const Row& row : rows) print_row(out, row, widths);
}

void print_line(std::ostream& out, const std::string& name, const std::string& text) {
  print_row(out, {name, text}, {12});
}

}  // namespace debias::cli

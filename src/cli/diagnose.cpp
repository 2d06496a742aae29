// diagnose: a file of anyone's numbers, and what settles a doubt of it.

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>

#include "core/text.hpp"
#include "execute.hpp"

namespace debias::cli {
namespace {

using commands::Diagnosis;

/// Bytes of a file or of standard input.
class Source {
 public:
  explicit Source(const std::string& path) : name_(path == "-" ? "standard input" : "'" + path + "'") {
    if (path == "-") return;
    file_ = open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file_ < 0 && interrupted()) throw Interrupted("diagnose: interrupted");  // a pipe that nobody writes
    if (file_ < 0) fail();
  }
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  ~Source() {
    if (file_ != STDIN_FILENO) close(file_);
  }

  /// Fills as much of `bytes` as there is; 0 at the end.
  std::size_t read(std::span<char> bytes) {
    std::size_t filled = 0;
    while (filled < bytes.size()) {
      if (interrupted()) throw Interrupted("diagnose: interrupted");
      const ssize_t n = ::read(file_, bytes.data() + filled, bytes.size() - filled);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) fail();
      if (n == 0) break;
      filled += static_cast<std::size_t>(n);
    }
    return filled;
  }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  [[noreturn]] void fail() const { throw FileError(name_ + ": " + std::strerror(errno)); }

  std::string name_;
  int file_ = STDIN_FILENO;
};

// What is in doubt of the reading, and the words that settle it.
std::string advice_on(numbers::Cause cause) {
  using numbers::Cause;
  switch (cause) {
    case Cause::request:
      return "leave it out, or write --format text";
    case Cause::which_column:
      return "write --column with a name or a number; where commas are decimal marks, --decimal ,";
    case Cause::no_column:
      return "write --column with a name of the header or a number from 1; --header makes the first row one";
    case Cause::array_column:
      return "write --column with a number from 1";
    case Cause::doubled_name:
      return "write --column with a number from 1";
    case Cause::ragged:
      return "mend that row, or name the separator by --separator, and decimal commas by --decimal ,";
    case Cause::decimal_comma:
      return "write --decimal , if it is the decimal mark";
    case Cause::decimal_point:
      return "leave --decimal out, or mend that row";
    case Cause::thousands:
      return "write the numbers without them";
    case Cause::encoding:
      return "convert it: iconv -f UTF-16 -t UTF-8 (or UTF-32)";
    case Cause::packed:
      return "unpack it first, such as by gunzip -c FILE | debias diagnose -, or of an archive the one file";
    case Cause::other_format:
      return "export the numbers as CSV, or as .npy";
    case Cause::npy:
      return "leave --format out, or write --format npy";
    case Cause::complex:
      return "save the real part, the imaginary part or the modulus";
    case Cause::unsupported:
      return "save one column of real numbers, such as numpy.save(FILE, x.ravel().astype(float))";
    case Cause::corrupt:
      return "write it again";
    case Cause::left_out:
      return "mend it, or leave --strict out";
    case Cause::header:
      return "write --header or --no-header";
    case Cause::byte_order:
      return "write --format f64be or f32be for big-endian numbers";
    case Cause::rounded:
      return "save differences from a common offset if the last digits matter";
  }
  return "";
}

bool is_of_the_request(numbers::Cause cause) {
  using numbers::Cause;
  return cause == Cause::request || cause == Cause::which_column || cause == Cause::no_column ||
         cause == Cause::array_column || cause == Cause::doubled_name;
}

Diagnosis diagnosed(Source& source, const numbers::Request& reading) {
  try {
    return commands::diagnose({[&source](std::span<char> bytes) { return source.read(bytes); }, reading});
  } catch (const numbers::Error& e) {
    const std::string what = source.name() + ": " + e.what() + "; " + advice_on(e.cause());
    if (is_of_the_request(e.cause())) throw std::invalid_argument(what);
    throw FileError(what);
  }
}

std::string first_bad_row(const Diagnosis& d) {
  const numbers::BadRow& bad = d.read.first_bad_rows.front();
  return d.unit + " " + std::to_string(bad.row) + ": " + bad.reason;
}

}  // namespace

int execute(const Diagnose& request, const Delivery& delivery) {
  keep_apart(delivery.output, request.file);
  Source source(request.file);
  Output out(delivery.output);
  Diagnosis d = diagnosed(source, request.reading);
  d.file = request.file == "-" ? source.name() : request.file;
  std::vector<Warning> doubts;
  for (const numbers::Doubt& doubt : d.read.doubts) {
    doubts.push_back({WarningCode::reading, doubt.text + "; " + advice_on(doubt.cause) + "."});
  }
  d.warnings.insert(d.warnings.begin(), doubts.begin(), doubts.end());
  const std::string bad_rows = counted(d.read.bad_rows, "bad row");
  if (d.moments.count == 0) {
    std::string why = source.name() + ": no value";
    if (d.read.bad_rows > 0) why += ", " + bad_rows + "; " + first_bad_row(d);
    throw FileError(why);
  }
  deliver(d, delivery, out);
  if (d.read.bad_rows > 0)
    complain(source.name() + ": " + bad_rows + (d.read.bad_rows == 1 ? ", " : ", the first is ") + first_bad_row(d));
  if (d.nonfinite > 0) {
    complain(source.name() + ": " + counted(d.nonfinite, "value") + are(d.nonfinite) + " not finite, the first is " +
             d.unit + " " + std::to_string(d.first_nonfinite));
    return nonfinite_samples;
  }
  return d.read.bad_rows > 0 ? file_error : done;
}

}  // namespace debias::cli

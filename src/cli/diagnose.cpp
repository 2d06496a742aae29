// debias diagnose: mean, error, tails and verdict of anyone's numbers, in one pass and bounded memory.

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <ostream>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/diagnostics.hpp>

#include "commands/diagnose.hpp"
#include "core/text.hpp"
#include "execute.hpp"

namespace debias::cli {
namespace {

using commands::BadRow;
using commands::Diagnosis;
using commands::Sums;

constexpr std::size_t buffer_size = std::size_t{1} << 20;  // also the longest row

/// Bytes of a file or of standard input.
class Source {
 public:
  explicit Source(const std::string& path) : name_(path == "-" ? "standard input" : "'" + path + "'") {
    if (path == "-") return;
    file_ = open(path.c_str(), O_RDONLY | O_CLOEXEC);
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

void add_bad_row(Diagnosis& d, std::int64_t row, const std::string& reason) {
  constexpr std::size_t named = 5;
  ++d.bad_rows;
  if (d.first_bad_rows.size() < named) d.first_bad_rows.push_back({row, reason});
}

std::string_view trimmed(std::string_view text) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  if (text.size() > 1 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

/// Takes the text up to the next comma that is not between quotes; false when there is none left.
bool take_field(std::string_view& rest, std::string_view& field) {
  if (rest.data() == nullptr) return false;
  bool quoted = false;
  std::size_t end = 0;
  while (end < rest.size() && (quoted || rest[end] != ',')) quoted = quoted != (rest[end++] == '"');
  field = trimmed(rest.substr(0, end));
  rest = end < rest.size() ? rest.substr(end + 1) : std::string_view();
  return true;
}

std::string_view field_of(std::string_view line, std::size_t column) {
  std::string_view field;
  for (std::size_t i = 0; i <= column; ++i) {
    if (!take_field(line, field)) return {};
  }
  return field;
}

/// nan, inf and infinity, as programs write them.
double not_finite(std::string_view text) {
  std::string word;
  for (const char c : text.substr(0, 10)) word += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  const bool negative = word.starts_with('-');
  if (negative || word.starts_with('+')) word.erase(0, 1);
  if (word == "nan") return std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  return word == "inf" || word == "infinity" ? (negative ? -infinity : infinity) : 0;
}

/// Rows of text, one number each or a column of a table.
class Table {
 public:
  Table(const Diagnose& request, Diagnosis& diagnosis) : column_(request.column), d_(diagnosis) {}

  void add_row(std::string_view line) {
    ++row_;
    if (trimmed(line).empty()) {  // a fault only if something follows
      if (blanks_++ == 0) first_blank_ = row_;
      return;
    }
    add_blanks();
    if (!started_ && start(line)) return;
    add_value(single_ ? trimmed(line) : field_of(line, index_));
  }
  void add_long_row() {
    ++row_;
    add_blanks();
    add_bad_row(d_, row_, "longer than " + std::to_string(buffer_size) + " bytes");
  }
  Sums& sums() { return sums_; }

 private:
  void add_blanks() {
    for (; blanks_ > 0; --blanks_) add_bad_row(d_, first_blank_++, "empty");
  }

  // The first row: is it a header, and which column is meant? True when it has been dealt with.
  bool start(std::string_view line) {
    started_ = true;
    if (line.starts_with("\xef\xbb\xbf")) line.remove_prefix(3);
    std::vector<std::string> names;
    std::string_view rest = line;
    for (std::string_view field; take_field(rest, field);) names.emplace_back(field.substr(0, 40));
    single_ = names.size() == 1;
    if (column_.empty() && !single_) {
      throw std::invalid_argument("--column (" + std::to_string(names.size()) +
                                  " columns); write --column with one of: " + listed(names));
    }
    const bool has_header = std::all_of(names.begin(), names.end(), [](const std::string& name) {
      return not_finite(name) == 0 && name.find_first_of("+-.0123456789") != 0;
    });
    if (!column_.empty()) index_ = find_column(names, has_header);
    if (has_header) {
      d_.column = names[index_];
    } else {
      add_value(field_of(line, index_));
    }
    return true;
  }

  std::size_t find_column(const std::vector<std::string>& names, bool has_header) const {
    const auto name = std::find(names.begin(), names.end(), column_);
    if (has_header && name != names.end()) return static_cast<std::size_t>(name - names.begin());
    if (column_.find_first_not_of("0123456789") == column_.npos) {
      return static_cast<std::size_t>(parse_count(column_, "--column", 1, names.size()) - 1);
    }
    const std::vector<std::string_view> views(names.begin(), names.end());
    throw std::invalid_argument("--column = '" + column_ + "' (" +
                                (has_header ? "no such column" : "the first row is no header") + "); write " +
                                (has_header ? "one of: " + listed(names) : "a number from 1") +
                                (has_header ? suggestion(column_, views) : ""));
  }

  static std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), 10); ++i) text += (i > 0 ? ", " : "") + names[i];
    return names.size() > 10 ? text + ", ..." : text;
  }

  void add_value(std::string_view field) {
    double x = 0;
    try {
      x = parse_double(field, "");
    } catch (const std::invalid_argument& e) {
      x = not_finite(field);
      if (x == 0) return add_bad_row(d_, row_, reason(field, e.what()));
    }
    sums_.add(x, row_);
  }

  static std::string reason(std::string_view field, std::string_view what) {
    if (field.empty()) return "empty";
    const std::size_t open = what.rfind(" (");
    const std::size_t close = what.rfind("); ");
    const std::string why(what.substr(open + 2, close - open - 2));
    std::string shown(field.substr(0, 40));
    for (char& c : shown) c = static_cast<unsigned char>(c) < ' ' || c == '\x7f' ? '?' : c;
    return "'" + shown + (field.size() > 40 ? "...': not a number" : "': " + why);
  }

  std::string column_;
  Diagnosis& d_;
  Sums sums_;
  std::int64_t row_ = 0;
  std::int64_t blanks_ = 0;  // rows in a row
  std::int64_t first_blank_ = 0;
  bool started_ = false;
  bool single_ = true;
  std::size_t index_ = 0;
};

Diagnosis read_text(Source& source, const Diagnose& request) {
  Diagnosis d;
  Table table(request, d);
  std::vector<char> buffer(buffer_size);
  std::size_t kept = 0;
  bool skipping = false;  // the rest of a row that did not fit
  while (true) {
    const std::size_t n = source.read(std::span(buffer).subspan(kept));
    std::string_view text(buffer.data(), kept + n);
    const bool at_end = kept + n < buffer.size();
    while (!text.empty()) {
      const std::size_t end = text.find('\n');
      if (end == text.npos && !at_end) break;
      if (!std::exchange(skipping, false)) table.add_row(text.substr(0, end));
      text.remove_prefix(end == text.npos ? text.size() : end + 1);
    }
    if (at_end) break;
    if (text.size() == buffer.size()) {
      if (!std::exchange(skipping, true)) table.add_long_row();
      text = {};
    } else if (skipping) {
      text = {};
    }
    kept = text.size();
    std::copy(text.begin(), text.end(), buffer.begin());  // forwards: they may overlap
  }
  table.sums().finish(d);
  return d;
}

bool is_ordinary(double x) { return x == 0 || (std::abs(x) > 1e-60 && std::abs(x) < 1e60); }

Diagnosis read_doubles(Source& source) {
  Diagnosis d;
  Sums sums;
  std::int64_t odd = 0;
  std::int64_t odd_if_swapped = 0;
  std::vector<char> buffer(buffer_size);
  std::int64_t row = 0;
  while (true) {
    const std::size_t n = source.read(buffer);
    for (std::size_t i = 0; i + 8 <= n; i += 8) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, buffer.data() + i, 8);
      if constexpr (std::endian::native == std::endian::big) bits = __builtin_bswap64(bits);
      sums.add(std::bit_cast<double>(bits), ++row);
      odd += !is_ordinary(std::bit_cast<double>(bits));
      odd_if_swapped += !is_ordinary(std::bit_cast<double>(__builtin_bswap64(bits)));
    }
    if (n == buffer.size()) continue;
    if (n % 8 != 0) {
      add_bad_row(d, row + 1, std::to_string(n % 8) + " bytes at the end are no double");
    }
    break;
  }
  sums.finish(d);
  if (2 * odd > row && 2 * odd_if_swapped < row) {
    d.warnings.push_back(std::to_string(odd) + " values lie beyond 1e-60 ... 1e60, and " +
                         std::to_string(odd_if_swapped) +
                         " would in the other byte order: the file may be big-endian.");
  }
  return d;
}

}  // namespace

int execute(const Diagnose& request, const Delivery& delivery) {
  keep_apart(delivery.output, request.file);
  Source source(request.file);
  Output out(delivery.output);
  Diagnosis d = request.doubles ? read_doubles(source) : read_text(source, request);
  d.file = request.file == "-" ? source.name() : request.file;
  if (request.doubles) d.unit = "value";
  if (d.moments.count == 0) {
    std::string why = source.name() + ": no value";
    if (d.bad_rows > 0) {
      why += ", " + std::to_string(d.bad_rows) + " bad rows; " + d.unit + " " +
             std::to_string(d.first_bad_rows.front().row) + ": " + d.first_bad_rows.front().reason;
    }
    throw FileError(why);
  }
  conclude(d);
  deliver(d, delivery, out);
  if (d.bad_rows > 0) {
    complain(source.name() + ": " + std::to_string(d.bad_rows) + " bad rows, the first is " + d.unit + " " +
             std::to_string(d.first_bad_rows.front().row) + ": " + d.first_bad_rows.front().reason);
  }
  if (d.nonfinite > 0) {
    complain(source.name() + ": " + std::to_string(d.nonfinite) + " values are not finite, the first is " + d.unit +
             " " + std::to_string(d.first_nonfinite));
    return nonfinite_samples;
  }
  return d.bad_rows > 0 ? file_error : done;
}

}  // namespace debias::cli

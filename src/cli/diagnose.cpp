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

#include "../core/text.hpp"
#include "commands.hpp"
#include "diagnose.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

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
  Table(const Arguments& arguments, Diagnosis& diagnosis) : column_(arguments.column), d_(diagnosis) {}

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

Diagnosis read_text(Source& source, const Arguments& arguments) {
  Diagnosis d;
  Table table(arguments, d);
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

std::string figure(double x, int digits = 3) { return std::isfinite(x) ? rounded(x, digits) : "-"; }

std::string text_of(const TailIndex& tail) {
  if (tail.state == TailState::too_few) return "no shape: too few values beyond the most common ones";
  if (tail.state == TailState::bounded) return "bounded: the outermost value is too common for a tail";
  return "k = " + figure(tail.k) + " +- " + figure(tail.error, 2) + " (" + std::to_string(tail.values) + " values; " +
         (tail.ties ? "with ties as they are " + figure(tail.plain) + ", " : "") + "Hill " + figure(tail.hill) +
         ", moment " + figure(tail.moment) + ", Pickands " + figure(tail.pickands) + ")";
}

// Neighbours that resemble each other make the means of blocks scatter more than single values say.
void judge_blocks(Diagnosis& d) {
  constexpr double limit = 1.5;
  constexpr std::size_t fewest_blocks = 32;
  if (d.block_means.size() < 2) return;
  d.block_interval = batch_interval(d.block_means);
  if (d.block_means.size() < fewest_blocks || d.block_length < 2) return;
  const double ratio = (d.block_interval.high - d.block_interval.low) / (d.interval.high - d.interval.low);
  if (ratio < limit) return;
  d.warnings.push_back("the interval by blocks is " + rounded(ratio, 2) + " times as wide (threshold " +
                       rounded(limit) +
                       "): values depend on their neighbours, so the standard error is too small; take the blocks.");
}

}  // namespace

double square_share(const Diagnosis& d, double value) {
  return (value - d.moments.mean) * (value - d.moments.mean) / d.moments.m2;
}

namespace {

void print_values(std::ostream& out, const Diagnosis& d) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Moments& m = d.moments;
  print_line(out, "file", d.file + (d.column.empty() ? "" : ", column " + d.column));
  print_line(out, "values", std::to_string(m.count));
  const auto at = [&d](std::int64_t row) { return d.unit + " " + std::to_string(row); };
  if (d.bad_rows > 0) print_line(out, "bad rows", std::to_string(d.bad_rows) + ", left out of everything below");
  for (const BadRow& bad : d.first_bad_rows) print_line(out, "", at(bad.row) + ": " + bad.reason);
  if (d.nonfinite > 0) {
    print_line(out, "mean",
               "not a number: " + std::to_string(d.nonfinite) + " values are not finite, the first in " +
                   at(d.first_nonfinite));
    return;
  }
  const RunVerdict& v = d.verdict;
  const double error = m.standard_error();
  const char* doubt = v.interval_reliable() ? "" : " (unreliable, see verdict)";
  print_line(out, "mean",
             std::isfinite(error) && error > 0
                 ? with_error(m.mean, error) + "   95 % interval [" + rounded(d.interval.low, 8) + ", " +
                       rounded(d.interval.high, 8) + "]" + doubt
                 : to_text(m.mean));
  if (m.count < 2) {
    print_line(out, "warning", "one value has no standard error.");
    return;
  }
  if (!(m.m2 > 0)) {
    print_line(out, "verdict", "all values are equal: there is no variance to judge.");
    return;
  }
  if (!std::isfinite(m.m2)) {
    print_line(out, "warning", "squares of these values overflow, so there is no standard error; scale them.");
    return;
  }
  print_line(out, "in blocks",
             "95 % interval [" + rounded(d.block_interval.low, 8) + ", " + rounded(d.block_interval.high, 8) + "] by " +
                 std::to_string(d.block_means.size()) + " means of " + std::to_string(d.block_length) +
                 " neighbours, t quantiles");
  if (d.robust.groups > 0) {
    print_line(out, "robust",
               rounded(d.robust.value, 8) + " (median of " + std::to_string(d.robust.groups) +
                   " means: BIASED for skewed values, never to be averaged)");
  }
  print_line(out, "kurtosis", figure(m.kurtosis(), 4));
  print_line(out, "upper tail", text_of(v.upper));
  print_line(out, "lower tail", text_of(v.lower));
  const char* name = "largest";
  for (const LargeSample& l : d.largest) {
    print_line(out, name,
               rounded(l.value, 8) + " in " + at(l.index) + ", " + rounded(100 * square_share(d, l.value), 2) +
                   " % of the squares about the mean");
    name = "";
    if (&l - d.largest.data() == 2) break;
  }
  print_line(out, "running", "values, mean, standard error:");
  std::vector<Row> rows;
  for (const Moments& r : d.running) {
    if (r.count < 16 && r.count < m.count) continue;
    const double e = r.count > 1 ? r.standard_error() : nan;
    rows.push_back({std::string(12, ' '), std::to_string(r.count), rounded(r.mean, 8), figure(e, 3)});
  }
  print_table(out, rows);
  name = "verdict";
  for (const std::string& sentence : v.sentences()) {
    print_line(out, name, sentence);
    name = "";
  }
}

}  // namespace

void print(std::ostream& out, const Diagnosis& d) {
  print_values(out, d);
  for (const std::string& warning : d.warnings) print_line(out, "warning", warning);
}

void conclude(Diagnosis& d) {
  if (d.nonfinite > 0 || d.moments.count < 2) return;
  d.interval = interval_of(d.moments);
  d.verdict = judge(d.moments, d.upper_tail, d.lower_tail);
  if (d.moments.m2 > 0) judge_blocks(d);
  const auto values = std::span<const double>(d.block_means);
  if (values.size() >= 24) d.robust = median_of_means(values);
}

int diagnose(const Arguments& arguments) {
  const bool is_text = arguments.format == "text";
  if (!is_text && arguments.format != "f64") {
    constexpr std::array<std::string_view, 2> formats = {"text", "f64"};
    throw std::invalid_argument("--format = '" + arguments.format + "' (must be text or f64)" +
                                suggestion(arguments.format, formats));
  }
  if (!is_text && !arguments.column.empty()) {
    throw std::invalid_argument("--column (a file of doubles has none); leave it out, or --format text");
  }
  keep_apart(arguments.output, arguments.file);
  Source source(arguments.file);
  Output out(arguments.output);
  Diagnosis d = is_text ? read_text(source, arguments) : read_doubles(source);
  d.file = arguments.file == "-" ? source.name() : arguments.file;
  if (!is_text) d.unit = "value";
  if (d.moments.count == 0) {
    std::string why = source.name() + ": no value";
    if (d.bad_rows > 0) {
      why += ", " + std::to_string(d.bad_rows) + " bad rows; " + d.unit + " " +
             std::to_string(d.first_bad_rows.front().row) + ": " + d.first_bad_rows.front().reason;
    }
    throw FileError(why);
  }
  conclude(d);
  if (arguments.json) {
    out.stream() << diagnose_json(d) << '\n';
  } else {
    print(out.stream(), d);
  }
  out.flush();
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

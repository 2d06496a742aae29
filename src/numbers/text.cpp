// Rows of text. What the first rows are is planned once, from the first of them that the buffer holds: separator,
// header, column. After that each row is a number, a bad row, or a reason to refuse the file.

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <system_error>
#include <utility>

#include "numbers/input.hpp"

namespace debias::numbers {
namespace {

constexpr std::size_t rows_ahead = 100;

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view without_quotes(std::string_view text) {
  text = trimmed(text);
  if (text.size() > 1 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

std::string lower(std::string_view text) {
  std::string word;
  for (const char c : text) word += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return word;
}

// ---- one field

enum class Kind { number, missing, word, comma, point, thousands };

struct Parsed {
  Kind kind = Kind::word;
  double x = 0;
  std::string reason;  // of what is no number
};

/// How programs write a value that is missing.
bool is_missing(std::string_view field) {
  if (field.empty()) return true;
  if (field.size() > 9) return false;
  if (field.find_first_not_of("-") == field.npos || field.find_first_not_of("*") == field.npos) return true;
  const std::string word = lower(field);
  for (const char* name : {"na", "n/a", "#n/a", "#na", "<na>", "nil", "null", "none", ".", "?", "missing", "#null!",
                           "#div/0!", "#value!", "#ref!", "#name?", "#num!", "\\n"}) {
    if (word == name) return true;
  }
  return false;
}

/// nan, inf and infinity, as programs write them; 0 is none of these.
double not_finite(std::string_view field) {
  if (field.size() > 12) return 0;
  std::string word = lower(field);
  const bool negative = word.starts_with('-');
  if (negative || word.starts_with('+')) word.erase(0, 1);
  if (word.starts_with("nan") && (word.size() == 3 || (word[3] == '(' && word.back() == ')'))) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  if (word == "1.#ind" || word == "1.#qnan" || word == "1.#snan") return std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  return word == "inf" || word == "infinity" || word == "1.#inf" ? (negative ? -infinity : infinity) : 0;
}

/// Digits, points, commas, a sign and an exponent, and a comma among them.
bool has_comma_among_digits(std::string_view field) {
  if (!field.empty() && (field[0] == '+' || field[0] == '-')) field.remove_prefix(1);
  const std::size_t comma = field.find(',');
  const std::size_t end = field.find_first_not_of("0123456789.,");
  if (comma == field.npos || (end != field.npos && comma > end)) return false;
  if (end != field.npos && field[end] != 'e' && field[end] != 'E') return false;
  return field.find_first_of("0123456789") != field.npos;
}

Parsed refused(Kind kind, std::string_view field, const std::string& why) {
  return {kind, 0, field.empty() ? why : quoted(field) + ": " + why};
}

Parsed why_not(std::string_view field, std::string_view number, const char* end, std::errc error) {
  if (error == std::errc::result_out_of_range) return refused(Kind::word, field, "beyond the range of a double");
  if (field.size() > 40 || error != std::errc{}) return refused(Kind::word, field, "not a number");
  const std::string_view left = number.substr(static_cast<std::size_t>(end - number.data()));
  const bool hexadecimal = left.starts_with('x') || left.starts_with('X');
  return refused(Kind::word, field, hexadecimal ? "hexadecimal" : quoted(left) + " follows the number");
}

/// The whole field as a number. `comma_is_free`: no separator explains a comma in it.
Parsed parse(std::string_view field, char decimal, bool comma_is_free) {
  std::string_view number = field;
  if (number.size() > 1 && number[0] == '+' && (is_digit(number[1]) || number[1] == '.' || number[1] == ',')) {
    number.remove_prefix(1);  // what %+e writes
  }
  std::string changed;
  if (decimal == ',') {
    if (has_comma_among_digits(number)) {
      const std::size_t comma = number.find(',');
      if (number.find(',', comma + 1) != number.npos || number.find('.') != number.npos) {
        return refused(Kind::thousands, field, "separators of thousands");
      }
      changed = number;
      changed[comma] = '.';
      number = changed;
    } else if (number.find('.') != number.npos && number.find_first_not_of("0123456789.+-eE") == number.npos) {
      return refused(Kind::point, field, "a decimal point, where the decimal mark is a comma");
    }
  }
  double x = 0;
  const char* last = number.data() + number.size();
  auto [end, error] = std::from_chars(number.data(), last, x);
  if (error == std::errc{} && end == last && !std::isnan(x) && !std::isinf(x)) return {Kind::number, x, ""};
  if (const double special = not_finite(field); special != 0) return {Kind::number, special, ""};
  if (is_missing(field)) return refused(Kind::missing, field, field.empty() ? "empty" : "a missing value");
  // Fortran writes double precision with a D
  if (error == std::errc{} && last - end >= 2 && (*end == 'd' || *end == 'D') &&
      std::string_view(end + 1, last).find_first_not_of("+-0123456789") == std::string_view::npos) {
    std::string spelled(number);
    spelled[static_cast<std::size_t>(end - number.data())] = 'e';
    const char* spelled_last = spelled.data() + spelled.size();
    const auto read = std::from_chars(spelled.data(), spelled_last, x);
    if (read.ec == std::errc::result_out_of_range) error = read.ec;
    if (read.ec == std::errc{} && read.ptr == spelled_last) return {Kind::number, x, ""};
  }
  if (decimal == '.' && comma_is_free && has_comma_among_digits(field)) {
    const std::size_t comma = field.find(',');
    const bool several = field.find(',', comma + 1) != field.npos || field.find('.') != field.npos;
    return several ? refused(Kind::thousands, field, "separators of thousands")
                   : refused(Kind::comma, field, "a comma within a number");
  }
  return why_not(field, number, end, error);
}

/// A word that begins as a number does is a number gone wrong sooner than a name.
bool begins_like_number(std::string_view field) {
  if (!field.empty() && (field[0] == '+' || field[0] == '-')) return true;
  return !field.empty() && (is_digit(field[0]) || field[0] == '.');
}

bool is_plain_integer(std::string_view field) {
  return !field.empty() && field.find_first_not_of("0123456789") == field.npos &&
         (field.size() == 1 || field[0] != '0');
}

// ---- one row

/// A row that begins with #, unless that is how a spreadsheet writes an error.
bool is_comment(std::string_view row) {
  row = trimmed(row);
  if (!row.starts_with('#')) return false;
  const std::size_t end = row.find_first_of(",; \t");
  return !is_missing(row.substr(0, end));
}

/// The row without what follows a # that stands after a blank, outside quotes.
std::string_view without_comment(std::string_view row) {
  bool open = false;
  for (std::size_t i = 0; i < row.size(); ++i) {
    open = open != (row[i] == '"');
    if (row[i] != '#' || open || i == 0 || !is_blank(row[i - 1])) continue;
    if (!is_missing(trimmed(row.substr(i, row.find_first_of(",; \t", i) - i)))) return row.substr(0, i);
  }
  return row;
}

/// The fields of a row, by number.
class Fields {
 public:
  explicit Fields(char separator) : separator_(separator) {}

  /// Their number; `field` becomes the one of that index, as it stands.
  std::size_t split(std::string_view row, std::size_t index, std::string_view& field) const {
    std::size_t count = 0;
    each(row, [&](std::string_view f) {
      if (count++ == index) field = f;
    });
    return count;
  }
  [[nodiscard]] std::vector<std::string_view> all(std::string_view row) const {
    std::vector<std::string_view> fields;
    each(row, [&](std::string_view f) { fields.push_back(f); });
    return fields;
  }

 private:
  template <class Take>
  void each(std::string_view row, const Take& take) const {
    if (separator_ == 0) return take(row);
    if (separator_ == ' ') return each_word(row, take);
    if (row.find('"') == row.npos) {
      std::size_t begin = 0;
      for (std::size_t end = row.find(separator_); end != row.npos; end = row.find(separator_, begin)) {
        take(row.substr(begin, end - begin));
        begin = end + 1;
      }
      return take(row.substr(begin));
    }
    bool open = false;
    std::size_t begin = 0;
    for (std::size_t i = 0; i < row.size(); ++i) {
      open = open != (row[i] == '"');
      if (open || row[i] != separator_) continue;
      take(row.substr(begin, i - begin));
      begin = i + 1;
    }
    take(row.substr(begin));
  }
  template <class Take>
  static void each_word(std::string_view row, const Take& take) {
    std::size_t i = 0;
    while (true) {
      while (i < row.size() && is_blank(row[i])) ++i;
      if (i == row.size()) return;
      const std::size_t begin = i;
      bool open = false;
      for (; i < row.size() && (open || !is_blank(row[i])); ++i) open = open != (row[i] == '"');
      take(row.substr(begin, i - begin));
    }
  }

  char separator_;
};

// ---- lines

/// Lines end with \n, \r\n or \r.
class Lines {
 public:
  Lines(std::string_view window, bool at_end)
      : text_(window), at_end_(at_end), has_return_(std::memchr(window.data(), '\r', window.size()) != nullptr) {}

  /// False where the rest is no whole line.
  bool next(std::string_view& line) {
    if (position_ == text_.size()) return false;
    if (newline_ < position_ || newline_ == unknown) newline_ = std::min(text_.find('\n', position_), text_.size());
    std::size_t end = newline_;
    std::size_t after = std::min(end + 1, text_.size());
    if (has_return_) {
      const void* found = std::memchr(text_.data() + position_, '\r', end - position_);
      if (found != nullptr) {
        end = static_cast<std::size_t>(static_cast<const char*>(found) - text_.data());
        std::size_t last = end + 1;
        while (last < text_.size() && text_[last] == '\r') ++last;
        if (last == text_.size() && !at_end_) return false;
        after = last < text_.size() && text_[last] == '\n' ? last + 1 : end + 1;
      } else if (end == text_.size() && !at_end_) {
        return false;
      }
    } else if (end == text_.size() && !at_end_) {
      return false;
    }
    line = text_.substr(position_, end - position_);
    position_ = after;
    return true;
  }
  [[nodiscard]] std::size_t position() const { return position_; }

 private:
  static constexpr std::size_t unknown = std::string_view::npos;
  std::string_view text_;
  bool at_end_;
  bool has_return_;
  std::size_t position_ = 0;
  std::size_t newline_ = unknown;
};

// ---- the file

class Table {
 public:
  Table(const Request& request, Report& report, const Take& take)
      : request_(request), report_(report), sink_(take, request, report) {}

  void read(Input& input) {
    if (input.window().starts_with("\xef\xbb\xbf")) input.consume(3);
    std::string_view line;
    bool skipping = false;  // the rest of a row that did not fit
    while (true) {
      if (skipping) {
        Lines rest(input.window(), input.at_end());
        skipping = !rest.next(line);
        input.consume(skipping ? input.window().size() : rest.position());
      }
      if (!skipping) {
        if (!planned_) plan(input);
        Lines lines(input.window(), input.at_end());
        while (lines.next(line)) add_row(line);
        input.consume(lines.position());
      }
      if (input.at_end()) break;
      if (input.full()) {
        add_long_row();
        skipping = true;
        input.consume(input.window().size());
      }
      input.fill();
    }
    sink_.flush();
    report_.format = Format::text;
  }

 private:
  void add_row(std::string_view line) {
    ++row_;
    if (simple_ && !header_follows_) {
      double x = 0;
      const char* last = line.data() + line.size();
      const auto [end, error] = std::from_chars(line.data(), last, x);
      if (end == last && error == std::errc{} && std::abs(x) <= std::numeric_limits<double>::max()) {
        if (blanks_ > 0) add_blanks();
        sink_.add(x, row_);
        return;
      }
    }
    if (plain_fields_ && !header_follows_ && add_field(line)) return;
    add_other_row(line);
  }

  /// A row as most are: the fields that are expected, no quotes, no comment, and a number in its column.
  bool add_field(std::string_view line) {
    const char* begin = line.data();
    const char* const last = begin + line.size();
    const char* end = last;
    std::size_t count = 0;
    const std::size_t wanted = report_.column_number - 1;
    for (const char* at = begin; at != last; ++at) {
      if (!special_[static_cast<unsigned char>(*at)]) continue;
      if (*at != report_.separator) return false;
      if (count == wanted) end = at;
      if (++count == wanted) begin = at + 1;
    }
    if (count + 1 != expected_) return false;
    while (begin != end && is_blank(*begin)) ++begin;
    while (begin != end && is_blank(end[-1])) --end;
    double x = 0;
    const auto [stop, error] = std::from_chars(begin, end, x);
    if (stop != end || error != std::errc{} || !(std::abs(x) <= std::numeric_limits<double>::max())) return false;
    if (blanks_ > 0) add_blanks();
    sink_.add(x, row_);
    return true;
  }

  void add_other_row(std::string_view line) {
    if (trimmed(line).empty()) {  // a fault only if something follows
      if (blanks_++ == 0) first_blank_ = row_;
      return;
    }
    if (is_comment(line)) {
      ++report_.comments;
      return;
    }
    add_blanks();
    if (std::exchange(header_follows_, false)) return;
    if (std::memchr(line.data(), '\0', line.size()) != nullptr) {
      return sink_.leave_out(row_, quoted(line) + ": a byte that is zero");
    }
    const std::string_view row = without_comment(line);
    std::string_view field = row;
    if (report_.separator != 0) {
      std::size_t count = fields_.split(row, report_.column_number - 1, field);
      if ((count != expected_ || ends_empty_) && !may_have(count, row)) refuse_ragged(count, row);
    }
    field = without_quotes(field);
    const Parsed parsed = parse(field, request_.decimal, true);
    switch (parsed.kind) {
      case Kind::number:
        return sink_.add(parsed.x, row_);
      case Kind::comma:
        refuse(Cause::decimal_comma, parsed.reason);
      case Kind::point:
        refuse(Cause::decimal_point, parsed.reason);
      case Kind::thousands:
        refuse(Cause::thousands, parsed.reason);
      case Kind::missing:
      case Kind::word:
        sink_.leave_out(row_, parsed.reason);
    }
  }

  [[noreturn]] void refuse(Cause cause, const std::string& what) const {
    throw Error(cause, "row " + std::to_string(row_) + ": " + what);
  }

  /// One field more or less than the first row has, and nothing in it: a separator at the end of the row.
  bool may_have(std::size_t count, std::string_view row) const {
    const std::size_t real = expected_ - (ends_empty_ ? 1 : 0);
    if (report_.separator == ' ') return false;
    if (count == real) return true;
    return count == real + 1 && row.substr(row.rfind(report_.separator) + 1).find_first_not_of(" \t\r") == row.npos;
  }
  [[noreturn]] void refuse_ragged(std::size_t count, std::string_view row) const {
    refuse(Cause::ragged, quoted(trimmed(row)) + " has " + std::to_string(count) + (count == 1 ? " field" : " fields") +
                              ", the first row has " + std::to_string(expected_ - (ends_empty_ ? 1 : 0)) + ": " +
                              quoted(report_.first_row, 80));
  }

  void add_long_row() {
    ++row_;
    add_blanks();
    header_follows_ = false;
    sink_.leave_out(row_, "longer than " + std::to_string(buffer_size) + " bytes");
  }

  void add_blanks() {
    for (; blanks_ > 0; --blanks_) sink_.leave_out(first_blank_++, "empty");
  }

  // ---- the plan

  void plan(const Input& input) {
    Lines lines(input.window(), input.at_end());
    std::string_view line;
    std::vector<std::string_view> rows;
    std::int64_t number = row_;
    std::int64_t first = 0;
    while (rows.size() <= rows_ahead && lines.next(line)) {
      ++number;
      if (trimmed(line).empty() || is_comment(line)) continue;
      if (rows.empty()) first = number;
      rows.push_back(without_comment(line));
    }
    if (rows.empty()) return;
    planned_ = true;
    report_.first_row = std::string(trimmed(rows.front()).substr(0, 200));
    report_.separator_guessed = request_.separator == 0;
    report_.separator = request_.separator != 0 ? request_.separator : guess_separator(rows);
    fields_ = Fields(report_.separator);
    std::vector<std::string_view> cells = fields_.all(rows.front());
    expected_ = cells.size();
    for (std::string_view& c : cells) c = without_quotes(c);
    ends_empty_ = cells.size() > 1 && cells.back().empty() && report_.separator != ' ';
    if (ends_empty_) cells.pop_back();
    report_.columns = cells.size();
    std::vector<std::string> names;
    for (const std::string_view c : cells) names.emplace_back(c.substr(0, 40));
    decide_header(rows, cells, names, first);
    report_.header_guessed = request_.header == Header::guess;
    header_follows_ = report_.header;
    if (report_.header) report_.column = names[report_.column_number - 1];
    simple_ = report_.separator == 0 && request_.decimal == '.';
    plain_fields_ = report_.separator != 0 && report_.separator != ' ' && request_.decimal == '.' && !ends_empty_;
    for (const char c : {report_.separator, '"', '#', '\0'}) special_[static_cast<unsigned char>(c)] = true;
  }

  /// Tabs, semicolons and commas where the first row has one; blanks where the rows agree on them.
  char guess_separator(const std::vector<std::string_view>& rows) const {
    char present = 0;
    for (const char c : {'\t', ';', ','}) {
      if (c == request_.decimal) continue;
      const std::size_t count = Fields(c).all(trimmed_for(c, rows.front())).size();
      if (count == 1) continue;
      if (present == 0) present = c;
      bool agree = true;
      for (const std::string_view r : rows) agree = agree && Fields(c).all(trimmed_for(c, r)).size() == count;
      if (agree && c == ',' && has_decimal_commas(rows, ';')) return ';';
      if (agree && c == ',' && has_decimal_commas(rows, ' ')) return ' ';
      if (agree) return c;
    }
    if (present != 0) return present;
    const std::vector<std::string_view> words = Fields(' ').all(rows.front());
    if (words.size() < 2) return 0;
    bool numbers = true;
    for (const std::string_view w : words) numbers = numbers && is_value(without_quotes(w));
    // words above single numbers are one name; else a row of another length is refused when it comes
    for (std::size_t i = 1; i < rows.size() && !numbers; ++i) {
      if (Fields(' ').all(rows[i]).size() == 1) return 0;
    }
    return rows.size() > 1 || numbers ? ' ' : char{0};
  }
  /// Rows such as "1 0,5": no row has numbers between commas, and all have them between those separators.
  bool has_decimal_commas(const std::vector<std::string_view>& rows, char separator) const {
    for (std::size_t i = rows.size() > 1 ? 1 : 0; i < rows.size(); ++i) {
      const auto by_commas = Fields(',').all(rows[i]);
      const auto fields = Fields(separator).all(rows[i]);
      const auto value = [this](std::string_view f) { return is_value(without_quotes(f)); };
      const auto numeric = [this](std::string_view f) { return is_numeric(without_quotes(f)); };
      if (std::all_of(by_commas.begin(), by_commas.end(), value)) return false;
      if (fields.size() < 2 || !std::all_of(fields.begin(), fields.end(), numeric)) return false;
    }
    return true;
  }
  static std::string_view trimmed_for(char separator, std::string_view row) {
    return separator == '\t' ? row : trimmed(row);
  }

  bool is_value(std::string_view cell) const { return parse(cell, request_.decimal, false).kind == Kind::number; }
  /// As `is_value`, or one whose comma is refused later: no name of a column either way.
  bool is_numeric(std::string_view cell) const {
    const Kind kind = parse(cell, request_.decimal, true).kind;
    return kind != Kind::word && kind != Kind::missing;
  }
  bool is_name(std::string_view cell, bool single) const {
    return parse(cell, request_.decimal, true).kind == Kind::word && !(single && begins_like_number(cell));
  }

  void decide_header(const std::vector<std::string_view>& rows, const std::vector<std::string_view>& cells,
                     const std::vector<std::string>& names, std::int64_t number) {
    const bool asked = request_.header == Header::yes;
    std::size_t supported = 0;  // columns with a word above numbers
    bool all_words = true;
    bool any_word = false;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      const bool name = is_name(cells[c], cells.size() == 1);
      any_word = any_word || name;
      all_words = all_words && (name || cells[c].empty());
      if (name && cells.size() > 1 && numbers_below(rows, c)) ++supported;
    }
    const bool looks_like_one = any_word && (all_words || supported > 0);
    report_.header = asked || (request_.header == Header::guess && looks_like_one);
    const bool may_be = report_.header || request_.header == Header::guess;
    if (cells.size() == 1 && request_.column.empty()) {
      report_.column_number = 1;
    } else {
      report_.column_number = choose(names, may_be) + 1;
    }
    const std::string_view cell = cells[report_.column_number - 1];
    if (request_.header != Header::guess) return;
    const std::string shown =
        "row " + std::to_string(number) + ", " + quoted(report_.first_row, 60) + ", was taken as ";
    if (report_.header && !all_words && !is_name(cell, false)) {
      sink_.doubt(Cause::header,
                  shown + "a header, since it has words above numbers; " + quoted(cell) + " is not counted");
    } else if (!report_.header && is_value(cell) && looks_like_header(rows, cells)) {
      sink_.doubt(Cause::header,
                  shown + "values, though it looks like a header: " + quoted(cell) + " is unlike the rows below it");
    }
  }

  std::size_t choose(const std::vector<std::string>& names, bool may_be_header) const {
    if (!report_.header && may_be_header && !request_.column.empty() &&
        request_.column.find_first_not_of("0123456789") != request_.column.npos) {
      throw Error(Cause::no_column, "column " + quoted(request_.column) + " (the first row, " +
                                        quoted(report_.first_row, 60) + ", is no header)");
    }
    return find_column(request_.column, names, report_.header);
  }

  /// Every row below has a number there, or nothing.
  bool numbers_below(const std::vector<std::string_view>& rows, std::size_t column) const {
    bool some = false;
    for (std::size_t i = 1; i < rows.size(); ++i) {
      std::string_view field;
      fields_.split(rows[i], column, field);
      field = without_quotes(field);
      if (is_missing(field)) continue;
      if (!is_numeric(field)) return false;
      some = true;
    }
    return some;
  }

  /// Numbers as data frames write them where there are no names (0, 1, 2, ...), or a year above fractions.
  bool looks_like_header(const std::vector<std::string_view>& rows, const std::vector<std::string_view>& cells) const {
    const std::string_view cell = cells[report_.column_number - 1];
    if (cells.size() > 1) {
      const std::size_t unnamed = cells.front().empty() ? 1 : 0;
      bool counting = cells.size() - unnamed > 1;
      for (const std::size_t start : {0, 1}) {
        counting = cells.size() - unnamed > 1;
        for (std::size_t c = unnamed; c < cells.size(); ++c) {
          counting = counting && cells[c] == std::to_string(c - unnamed + start);
        }
        if (counting) return true;
      }
    }
    const double x = parse(cell, request_.decimal, true).x;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    std::size_t count = 0;
    bool fractions = true;
    for (std::size_t i = 1; i < rows.size(); ++i) {
      std::string_view field;
      fields_.split(rows[i], report_.column_number - 1, field);
      field = without_quotes(field);
      const Parsed p = parse(field, request_.decimal, true);
      if (p.kind != Kind::number || !std::isfinite(p.x)) continue;
      ++count;
      low = std::min(low, p.x);
      high = std::max(high, p.x);
      fractions = fractions && field.find_first_of(".,eEdD") != field.npos;
    }
    const bool integer = is_plain_integer(cell);
    if (count < 2 || !std::isfinite(x)) return false;
    if (integer && fractions) return true;
    const double distance = x < low ? low - x : x - high;
    return count >= 3 && distance > (integer ? 1 : 10) * (high - low);
  }

  const Request& request_;
  Report& report_;
  Sink sink_;
  Fields fields_{0};
  std::int64_t row_ = 0;
  std::int64_t blanks_ = 0;  // rows in a row
  std::int64_t first_blank_ = 0;
  std::size_t expected_ = 1;  // fields
  bool ends_empty_ = false;   // the last of them, in the first row
  bool planned_ = false;
  bool simple_ = false;              // a number a row, as from_chars reads it
  bool plain_fields_ = false;        // a row has `expected_` fields between single characters
  std::array<bool, 256> special_{};  // characters that end a plain field, or are in none
  bool header_follows_ = false;
};

}  // namespace

std::size_t find_column(const std::string& column, const std::vector<std::string>& names, bool named) {
  if (column.empty()) {
    if (names.size() == 1) return 0;
    throw Error(Cause::which_column, std::to_string(names.size()) + " columns (" + listed(names) + ")");
  }
  const auto name = std::find(names.begin(), names.end(), column);
  if (named && name != names.end()) {
    const auto index = static_cast<std::size_t>(name - names.begin());
    const auto again = std::find(name + 1, names.end(), column);
    if (again == names.end()) return index;
    throw Error(Cause::doubled_name, "columns " + std::to_string(index + 1) + " and " +
                                         std::to_string(again - names.begin() + 1) + " are both named " +
                                         quoted(column) + " (" + listed(names) + ")");
  }
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(column.data(), column.data() + column.size(), number);
  const bool is_number = error == std::errc{} && end == column.data() + column.size();
  if (is_number && number >= 1 && number <= names.size()) return number - 1;
  throw Error(Cause::no_column, "column " + quoted(column) + " (" +
                                    (is_number ? "a number from 1 to " + std::to_string(names.size())
                                               : std::string(named ? "no such name" : "the first row is no header")) +
                                    (named ? ": " + listed(names) : "") + ")");
}

void read_text(Input& input, const Request& request, Report& report, const Take& take) {
  Table(request, report, take).read(input);
}

}  // namespace debias::numbers

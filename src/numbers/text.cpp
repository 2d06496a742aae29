// Rows of text. What the first rows are is planned once, from the first of them that the buffer holds: separator,
// header, column. After that each row is a number, a bad row, or a reason to refuse the file.

#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <system_error>
#include <utility>

#include "numbers/field.hpp"
#include "numbers/input.hpp"
#include "numbers/lines.hpp"

namespace debias::numbers {
namespace {

constexpr std::size_t rows_ahead = 100;

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
      return sink_.leave_out(row_, excerpt(line) + ": a byte that is zero");
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
    refuse(Cause::ragged, excerpt(trimmed(row)) + " has " + std::to_string(count) +
                              (count == 1 ? " field" : " fields") + ", the first row has " +
                              std::to_string(expected_ - (ends_empty_ ? 1 : 0)) + ": " +
                              excerpt(report_.first_row, 80));
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
        "row " + std::to_string(number) + ", " + excerpt(report_.first_row, 60) + ", was taken as ";
    if (report_.header && !all_words && !is_name(cell, false)) {
      sink_.doubt(Cause::header,
                  shown + "a header, since it has words above numbers; " + excerpt(cell) + " is not counted");
    } else if (!report_.header && is_value(cell) && looks_like_header(rows, cells)) {
      sink_.doubt(Cause::header,
                  shown + "values, though it looks like a header: " + excerpt(cell) + " is unlike the rows below it");
    }
  }

  std::size_t choose(const std::vector<std::string>& names, bool may_be_header) const {
    if (!report_.header && may_be_header && !request_.column.empty() &&
        request_.column.find_first_not_of("0123456789") != request_.column.npos) {
      throw Error(Cause::no_column, "column " + excerpt(request_.column) + " (the first row, " +
                                        excerpt(report_.first_row, 60) + ", is no header)");
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
                                         excerpt(column) + " (" + listed(names) + ")");
  }
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(column.data(), column.data() + column.size(), number);
  const bool is_number = error == std::errc{} && end == column.data() + column.size();
  if (is_number && number >= 1 && number <= names.size()) return number - 1;
  throw Error(Cause::no_column, "column " + excerpt(column) + " (" +
                                    (is_number ? "a number from 1 to " + std::to_string(names.size())
                                               : std::string(named ? "no such name" : "the first row is no header")) +
                                    (named ? ": " + listed(names) : "") + ")");
}

void read_text(Input& input, const Request& request, Report& report, const Take& take) {
  Table(request, report, take).read(input);
}

}  // namespace debias::numbers

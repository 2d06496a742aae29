#include "numbers/field.hpp"

#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <system_error>

#include "numbers/input.hpp"

namespace debias::numbers {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string lower(std::string_view text) {
  std::string word;
  for (const char c : text) word += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return word;
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
  return {kind, 0, field.empty() ? why : excerpt(field) + ": " + why};
}

Parsed why_not(std::string_view field, std::string_view number, const char* end, std::errc error) {
  if (error == std::errc::result_out_of_range) return refused(Kind::word, field, "beyond the range of a double");
  if (field.size() > 40 || error != std::errc{}) return refused(Kind::word, field, "not a number");
  const std::string_view left = number.substr(static_cast<std::size_t>(end - number.data()));
  const bool hexadecimal = left.starts_with('x') || left.starts_with('X');
  return refused(Kind::word, field, hexadecimal ? "hexadecimal" : excerpt(left) + " follows the number");
}

}  // namespace

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

bool begins_like_number(std::string_view field) {
  if (!field.empty() && (field[0] == '+' || field[0] == '-')) return true;
  return !field.empty() && (is_digit(field[0]) || field[0] == '.');
}

bool is_plain_integer(std::string_view field) {
  return !field.empty() && field.find_first_not_of("0123456789") == field.npos &&
         (field.size() == 1 || field[0] != '0');
}

}  // namespace debias::numbers

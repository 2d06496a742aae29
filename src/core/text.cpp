#include <debias/core/text.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "core/text.hpp"

namespace debias {
namespace {

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

/// Insertions, deletions and replacements that turn a into b.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t k = 0; k < b.size(); ++k) {
      const std::size_t replaced = diagonal + (lower(a[i]) == lower(b[k]) ? 0 : 1);
      diagonal = row[k + 1];
      row[k + 1] = std::min({replaced, row[k] + 1, diagonal + 1});
    }
  }
  return row.back();
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// The digits at the start of `text`, without the single _ or ' between them; leaves what follows.
std::string take_digits(std::string_view& text) {
  std::string digits;
  while (!text.empty() && is_digit(text[0])) {
    digits += text[0];
    text.remove_prefix(1);
    if (text.size() > 1 && (text[0] == '_' || text[0] == '\'') && is_digit(text[1])) text.remove_prefix(1);
  }
  return digits;
}

/// A text read as a count: its value, or what is wrong with it.
struct Count {
  std::uint64_t value = 0;
  std::string wrong;
};

Count read_count(std::string_view text) {
  if (text.empty()) return {0, "empty"};
  if (text.size() > 1 && is_digit(text[1])) {
    if (text[0] == '-') return {0, "must not be negative"};
    if (text[0] == '+') return {0, "a sign"};
  }
  std::string_view rest = text;
  std::string digits = take_digits(rest);
  if (digits.empty()) return {0, "not a number"};
  if (digits.size() > 1 && digits[0] == '0') return {0, "a leading zero"};
  int exponent = 0;
  if (rest.size() > 1 && rest[0] == '.' && is_digit(rest[1])) {
    rest.remove_prefix(1);
    const std::string fraction = take_digits(rest);
    digits += fraction;
    exponent -= static_cast<int>(fraction.size());
  }
  if (!rest.empty() && (rest[0] == 'e' || rest[0] == 'E')) {
    const bool negative = rest.substr(1, 1) == "-";
    std::string_view after = rest.substr(negative || rest.substr(1, 1) == "+" ? 2 : 1);
    const std::string shift = take_digits(after);
    if (!shift.empty()) {
      const int power = shift.size() < 5 ? std::stoi(shift) : 9999;
      exponent += negative ? -power : power;
      rest = after;
    }
  }
  if (!rest.empty()) return {0, "'" + std::string(rest) + "' follows the number"};

  for (; exponent < 0 && digits.size() > 1 && digits.back() == '0'; ++exponent) digits.pop_back();
  if (digits.find_first_not_of('0') == digits.npos) return {};
  if (exponent < 0) return {0, "not a whole number"};
  constexpr std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
  if (exponent > std::numeric_limits<std::uint64_t>::digits10) return {0, "beyond 64 bits"};
  digits.append(static_cast<std::size_t>(exponent), '0');
  std::uint64_t value = 0;
  for (const char c : digits) {
    const auto digit = static_cast<std::uint64_t>(c - '0');
    if (value > (most - digit) / 10) return {0, "beyond 64 bits"};
    value = 10 * value + digit;
  }
  return {value, ""};
}

/// What may have been meant: the text without thousands commas, sign and leading zeros, as far as it reads.
std::string near_miss(std::string_view text) {
  std::string candidate;
  for (const char c : text) {
    const bool skip = c == ',' || c == ' ' || (candidate.empty() && (c == '-' || c == '+' || c == '0'));
    if (!skip) candidate += c;
    if (candidate.size() == 32) break;  // no count that anybody means is longer
  }
  while (!candidate.empty() && !read_count(candidate).wrong.empty()) candidate.pop_back();
  return candidate;
}

}  // namespace

double parse_double(std::string_view text, std::string_view what) {
  const auto refuse = [&](std::string_view why) {
    throw std::invalid_argument(std::string(what) + " = '" + std::string(text) + "' (" + std::string(why) +
                                "); write a decimal number such as 0.5 or 1e-3");
  };
  double x = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (error == std::errc::result_out_of_range) refuse("beyond the range of a double");
  if (error != std::errc{}) refuse("not a number");
  if (end != text.data() + text.size()) {
    refuse("'" + std::string(end, text.data() + text.size()) + "' follows the number");
  }
  if (!std::isfinite(x)) refuse("must be finite");
  return x;
}

std::uint64_t parse_count(std::string_view text, std::string_view what, std::uint64_t low, std::uint64_t high) {
  Count count = read_count(text);
  if (count.wrong.empty() && low <= count.value && count.value <= high) return count.value;
  const std::string range = std::to_string(low) + " ... " + std::to_string(high);
  std::string meant = near_miss(text);
  if (count.wrong.empty()) {
    count.wrong = "must lie in " + range;
    meant = std::to_string(count.value < low ? low : high);
  } else if (count.wrong == "beyond 64 bits") {
    count.wrong = "must lie in " + range;
    meant = std::to_string(high);
  }
  throw std::invalid_argument(
      std::string(what) + " = '" + std::string(text) + "' (" + count.wrong + "); " +
      (meant.empty() ? "write a whole number such as 1000, 1e6 or 1_000_000" : "did you mean '" + meant + "'?"));
}

namespace {

/// NaN and infinity in words; nothing for any other number.
std::string_view in_words(double x) {
  if (std::isnan(x)) return "unknown";
  if (std::isinf(x)) return x > 0 ? "infinity" : "minus infinity";
  return "";
}

}  // namespace

std::string detail::format(NumberPattern pattern, double x) {
  if (const std::string_view words = in_words(x); !words.empty()) return std::string(words);
  std::array<char, 512> digits{};  // %.99f of the largest double has 309 + 1 + 99 of them, and a sign
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), x, pattern.kind, pattern.precision).ptr;
  return {digits.data(), end};
}

double parse_positive(std::string_view text, std::string_view what) {
  const double x = parse_double(text, what);
  if (x >= std::numeric_limits<double>::min()) return x;
  throw std::invalid_argument(std::string(what) + " = '" + std::string(text) + "' (must be positive" +
                              (x > 0 ? ", and a double of full precision" : "") + ")");
}

double parse_seconds(std::string_view text, std::string_view what) {
  const bool unit = !text.empty() && text.back() == 's';
  return parse_positive(unit ? text.substr(0, text.size() - 1) : text, what);
}

double parse_share(std::string_view text, std::string_view what) {
  const double x = parse_double(text, what);
  if (x > 0 && x < 1) return x;
  const double meant = x >= 1 && x < 100 ? x / 100 : 0.95;
  throw std::invalid_argument(std::string(what) + " = '" + std::string(text) +
                              "' (must lie in (0, 1)); did you mean '" + to_text(meant) + "'?");
}

std::string right(const std::string& text, std::size_t width) {
  return std::string(width > text.size() ? width - text.size() : 0, ' ') + text;
}

std::string counted(std::int64_t n, std::string_view noun) {
  return std::to_string(n) + " " + std::string(noun) + (n == 1 ? "" : "s");
}

std::string are(std::int64_t n) { return n == 1 ? " is" : " are"; }

std::string to_text(double x) {
  if (const std::string_view words = in_words(x); !words.empty()) return std::string(words);
  std::array<char, 32> digits{};  // the longest double, -2.2250738585072014e-308, has 24
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), x).ptr;
  return {digits.data(), end};
}

std::string nearest_name(std::string_view text, std::span<const std::string_view> names) {
  std::string_view nearest;
  std::size_t best = 4;  // more than three edits are no typing error
  for (const std::string_view name : names) {
    // No fewer edits than the lengths differ by: a text of any length is done with at once.
    if (std::max(text.size(), name.size()) - std::min(text.size(), name.size()) >= best) continue;
    const std::size_t distance = edit_distance(text, name);
    if (distance < best && 2 * distance <= std::max(text.size(), name.size())) {
      best = distance;
      nearest = name;
    }
  }
  return std::string(nearest);
}

std::string suggestion(std::string_view text, std::span<const std::string_view> names) {
  const std::string name = nearest_name(text, names);
  return name.empty() ? "" : "; did you mean '" + name + "'?";
}

}  // namespace debias

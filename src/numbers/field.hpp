#pragma once

// One field of a text: a number as programs write them, a missing value, a word, or what is not to be guessed.

#include <string>
#include <string_view>

namespace debias::numbers {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

inline std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

inline std::string_view without_quotes(std::string_view text) {
  text = trimmed(text);
  if (text.size() > 1 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

enum class Kind { number, missing, word, comma, point, thousands };

struct Parsed {
  Kind kind = Kind::word;
  double x = 0;
  std::string reason;  // of what is no number
};

/// How programs write a value that is missing.
bool is_missing(std::string_view field);
/// The whole field as a number. `comma_is_free`: no separator explains a comma in it.
Parsed parse(std::string_view field, char decimal, bool comma_is_free);
/// A word that begins as a number does is a number gone wrong sooner than a name.
bool begins_like_number(std::string_view field);
bool is_plain_integer(std::string_view field);

}  // namespace debias::numbers

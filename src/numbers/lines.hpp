#pragma once

// The lines of a text, and the fields of a row.

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string_view>
#include <vector>

#include "numbers/field.hpp"

namespace debias::numbers {

/// A row that begins with #, unless that is how a spreadsheet writes an error.
inline bool is_comment(std::string_view row) {
  row = trimmed(row);
  if (!row.starts_with('#')) return false;
  const std::size_t end = row.find_first_of(",; \t");
  return !is_missing(row.substr(0, end));
}

/// The row without what follows a # that stands after a blank, outside quotes.
inline std::string_view without_comment(std::string_view row) {
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

}  // namespace debias::numbers

#pragma once

// A window on the bytes of a file, and where the readers put their numbers.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "numbers/numbers.hpp"

namespace debias::numbers {

/// The next bytes that were not consumed, as many as the buffer holds.
class Input {
 public:
  explicit Input(const Bytes& read) : read_(read), buffer_(std::make_unique_for_overwrite<char[]>(buffer_size)) {
    fill();
  }

  [[nodiscard]] std::string_view window() const { return {buffer_.get() + begin_, end_ - begin_}; }
  void consume(std::size_t bytes) { begin_ += bytes; }
  /// Reads on behind what is left of the window.
  void fill() {
    std::copy(buffer_.get() + begin_, buffer_.get() + end_, buffer_.get());  // forwards: they may overlap
    end_ -= begin_;
    begin_ = 0;
    const std::size_t room = buffer_size - end_;
    const std::size_t n = room == 0 ? 0 : read_(std::span(buffer_.get() + end_, room));
    end_ += n;
    at_end_ = n < room;
  }
  /// Nothing follows the window.
  [[nodiscard]] bool at_end() const { return at_end_; }
  [[nodiscard]] bool full() const { return begin_ == 0 && end_ == buffer_size; }

 private:
  const Bytes& read_;
  std::unique_ptr<char[]> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool at_end_ = false;
};

/// Hands values on in blocks of consecutive rows; the rest is the report's.
class Sink {
 public:
  Sink(const Take& take, const Request& request, Report& report) : take_(take), request_(request), report_(report) {}

  void add(double x, std::int64_t row) {
    if (filled_ == block_.size() || row != first_row_ + static_cast<std::int64_t>(filled_)) flush();
    if (filled_ == 0) first_row_ = row;
    block_[filled_++] = x;
  }
  void flush() {
    if (filled_ == 0) return;
    report_.values += static_cast<std::int64_t>(filled_);
    take_(std::span<const double>(block_).first(filled_), first_row_);
    filled_ = 0;
  }
  void leave_out(std::int64_t row, const std::string& reason) {
    constexpr std::size_t named = 5;
    if (request_.strict) throw Error(Cause::left_out, "row " + std::to_string(row) + ": " + reason);
    ++report_.bad_rows;
    if (report_.first_bad_rows.size() < named) report_.first_bad_rows.push_back({row, reason});
  }
  void doubt(Cause cause, const std::string& text) {
    if (request_.strict) throw Error(cause, text);
    report_.doubts.push_back({cause, text});
  }

 private:
  const Take& take_;
  const Request& request_;
  Report& report_;
  std::array<double, 256> block_;
  std::size_t filled_ = 0;
  std::int64_t first_row_ = 0;
};

/// A few bytes as people can read them: 'abc...'.
std::string excerpt(std::string_view text, std::size_t limit = 40);
/// The first few names.
std::string listed(const std::vector<std::string>& names);
/// Which of the columns is meant, from 0. `named`: the names are names, not values of a first row.
std::size_t find_column(const std::string& column, const std::vector<std::string>& names, bool named);

void read_text(Input& input, const Request& request, Report& report, const Take& take);
void read_npy(Input& input, const Request& request, Report& report, const Take& take);
void read_raw(Input& input, const Request& request, Report& report, const Take& take);

}  // namespace debias::numbers

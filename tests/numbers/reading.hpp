#pragma once

// What the tests of the readers share: a file in memory, read, and the bytes of some formats.

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "catch_shim.hpp"
#include "numbers/numbers.hpp"

namespace numbers_test {

using namespace debias::numbers;
using namespace std::string_literals;
using Values = std::vector<double>;

struct Read {
  Values values;
  std::vector<std::int64_t> rows;
  Report report;
  std::optional<Cause> refused;
  std::string why;
};

/// `pieces`: the source hands out so many bytes at most, which it may do at the end only; here all of them.
inline Read read_bytes(std::string_view file, const Request& request = {}) {
  Read r;
  std::size_t position = 0;
  const auto bytes = [&](std::span<char> out) {
    const std::size_t n = std::min(out.size(), file.size() - position);
    std::copy_n(file.data() + position, n, out.data());
    position += n;
    return n;
  };
  const auto take = [&r](std::span<const double> values, std::int64_t row) {
    for (const double x : values) {
      r.values.push_back(x);
      r.rows.push_back(row++);
    }
  };
  try {
    r.report = read(bytes, request, take);
  } catch (const Error& e) {
    r.refused = e.cause();
    r.why = e.what();
  }
  return r;
}

inline Values values_of(std::string_view file, const Request& request = {}) {
  const Read r = read_bytes(file, request);
  INFO(r.why);
  CHECK(!r.refused.has_value());
  return r.values;
}

inline Request column(std::string name) {
  Request r;
  r.column = std::move(name);
  return r;
}
inline Request decimal_commas(std::string name = "") {
  Request r;
  r.decimal = ',';
  r.column = std::move(name);
  return r;
}
inline Request header(Header h) {
  Request r;
  r.header = h;
  return r;
}
inline Request raw(Format format, ByteOrder order = ByteOrder::little) {
  Request r;
  r.format = format;
  r.order = order;
  return r;
}

inline bool doubts(const Read& r, Cause cause) {
  return std::any_of(r.report.doubts.begin(), r.report.doubts.end(), [=](const Doubt& d) { return d.cause == cause; });
}

inline std::string counted(int first, int last) {
  std::string text;
  for (int i = first; i <= last; ++i) text += std::to_string(i) + "\n";
  return text;
}

/// The bytes of a .npy file.
inline std::string npy(const std::string& dict, const std::string& data, int version = 1) {
  std::string head = dict + "\n";
  std::string file = "\x93NUMPY"s + static_cast<char>(version) + '\0';
  const int bytes = version == 1 ? 2 : 4;
  for (int i = 0; i < bytes; ++i) file += static_cast<char>((head.size() >> (8 * i)) & 255);
  return file + head + data;
}
inline std::string dict(const std::string& type, const std::string& shape, bool fortran = false) {
  return "{'descr': " + type + ", 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape + ", }";
}
template <class T>
std::string bytes_of(const std::vector<T>& values, bool big = false) {
  std::string bytes;
  for (const T& x : values) {
    char b[sizeof(T)];
    std::memcpy(b, &x, sizeof x);
    if (big != (std::endian::native == std::endian::big)) std::reverse(b, b + sizeof x);
    bytes.append(b, sizeof x);
  }
  return bytes;
}

}  // namespace numbers_test

// The readers of anyone's numbers on any bytes: refused by a cause, or read; a number a row at most, and rows
// ascend. The first byte chooses the request; where it asks for .npy the rest follows its
// magic, with a length of the header that is right.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include "numbers/numbers.hpp"

namespace {

using namespace debias::numbers;

void demand(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const unsigned choice = data[0];
  std::string file(reinterpret_cast<const char*>(data) + 1, size - 1);
  Request request;
  if ((choice & 1U) != 0) {  // a header up to the last brace
    const std::size_t length = file.find_last_of('}') + 1;
    std::string npy("\x93NUMPY\1\0", 8);
    npy += static_cast<char>(length & 255U);
    npy += static_cast<char>(length >> 8);
    file = npy + file;
  } else {
    if ((choice & 8U) != 0) request.decimal = ',';
    if ((choice & 16U) != 0) request.header = (choice & 32U) != 0 ? Header::yes : Header::no;
    if ((choice & 128U) != 0) request.separator = (choice & 32U) != 0 ? ';' : ' ';
  }
  if ((choice & 2U) != 0) request.column = (choice & 4U) != 0 ? "2" : "x";
  request.strict = (choice & 64U) != 0;

  std::size_t position = 0;
  const auto bytes = [&](std::span<char> out) {
    const std::size_t n = std::min(out.size(), file.size() - position);
    std::copy_n(file.data() + position, n, out.data());
    position += n;
    return n;
  };
  std::int64_t last = 0;
  std::int64_t count = 0;
  const auto take = [&](std::span<const double> values, std::int64_t row) {
    demand(!values.empty() && row > last);
    last = row + static_cast<std::int64_t>(values.size()) - 1;
    count += static_cast<std::int64_t>(values.size());
  };
  try {
    const Report r = read(bytes, request, take);
    demand(r.values == count && count <= static_cast<std::int64_t>(file.size()));
    demand(r.first_bad_rows.size() == static_cast<std::size_t>(std::min<std::int64_t>(r.bad_rows, 5)));
    demand(!request.strict || (r.bad_rows == 0 && r.doubts.empty()));
    demand(r.column_number >= 1 && (r.columns == 0 || r.column_number <= r.columns));
  } catch (const Error& e) {
    demand(*e.what() != '\0');
  }
  return 0;
}

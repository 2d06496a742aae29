#include <bit>
#include <cmath>
#include <cstring>

#include "numbers/input.hpp"

namespace debias::numbers {
namespace {

bool is_ordinary(double x) { return x == 0 || (std::abs(x) > 1e-60 && std::abs(x) < 1e60); }
bool is_ordinary(float x) { return x == 0 || (std::abs(x) > 1e-15F && std::abs(x) < 1e15F); }

inline std::uint32_t swapped(std::uint32_t x) { return __builtin_bswap32(x); }
inline std::uint64_t swapped(std::uint64_t x) { return __builtin_bswap64(x); }

template <class Float, class Bits>
void read_all(Input& input, bool swap, Report& report, Sink& sink, const char* range) {
  std::int64_t row = 0;
  std::int64_t odd = 0;
  std::int64_t odd_if_swapped = 0;
  while (true) {
    const std::string_view bytes = input.window();
    const std::size_t whole = bytes.size() / sizeof(Bits) * sizeof(Bits);
    for (std::size_t i = 0; i < whole; i += sizeof(Bits)) {
      Bits bits = 0;
      std::memcpy(&bits, bytes.data() + i, sizeof bits);
      const Bits other = swapped(bits);
      if (swap) bits = other;
      const auto x = std::bit_cast<Float>(bits);
      sink.add(static_cast<double>(x), ++row);
      odd += !is_ordinary(x);
      odd_if_swapped += !is_ordinary(std::bit_cast<Float>(swap ? swapped(other) : other));
    }
    input.consume(whole);
    if (input.at_end()) break;
    input.fill();
  }
  if (const std::size_t rest = input.window().size(); rest > 0) {
    sink.leave_out(row + 1, std::to_string(rest) +
                                (rest == 1 ? " byte at the end is no " : " bytes at the end are no ") +
                                (sizeof(Bits) == 8 ? "double" : "32-bit float"));
  }
  sink.flush();
  if (2 * odd > row && 2 * odd_if_swapped < row) {
    const bool big = report.order == ByteOrder::big;
    sink.doubt(Cause::byte_order, std::to_string(odd) + (odd == 1 ? " value lies beyond " : " values lie beyond ") +
                                      range + ", and " + std::to_string(odd_if_swapped) +
                                      " would in the other byte order: the file may be " +
                                      (big ? "little-endian" : "big-endian"));
  }
}

}  // namespace

void read_raw(Input& input, const Request& request, Report& report, const Take& take) {
  Sink sink(take, request, report);
  report.order = request.order;
  const bool swap = (request.order == ByteOrder::big) != (std::endian::native == std::endian::big);
  if (request.format == Format::f32) {
    read_all<float, std::uint32_t>(input, swap, report, sink, "1e-15 ... 1e15");
  } else {
    read_all<double, std::uint64_t>(input, swap, report, sink, "1e-60 ... 1e60");
  }
}

}  // namespace debias::numbers

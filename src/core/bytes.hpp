#pragma once

// Numbers and texts as bytes of one order (little endian; a double is its 64 bits, a text its length and characters).
// Writer and reader have the same members, so that one function describes a layout for both ways.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace debias {

using Bytes = std::vector<std::byte>;

std::uint32_t crc32(std::span<const std::byte> bytes);

class ByteWriter {
 public:
  static constexpr bool reads = false;
  template <class T>
  void number(const T& x) {
    static_assert(std::is_arithmetic_v<T>);
    if constexpr (std::is_same_v<T, double>) {
      number(std::bit_cast<std::uint64_t>(x));
    } else {
      for (std::size_t i = 0; i < sizeof(T); ++i) {
        bytes.push_back(static_cast<std::byte>(static_cast<std::uint64_t>(x) >> (8 * i) & 0xff));
      }
    }
  }
  void text(const std::string& text) {
    number(static_cast<std::uint64_t>(text.size()));
    for (const char c : text) bytes.push_back(static_cast<std::byte>(c));
  }

  Bytes bytes;
};

/// Throws std::invalid_argument where the bytes end too early.
class ByteReader {
 public:
  static constexpr bool reads = true;
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  template <class T>
  void number(T& x) {
    static_assert(std::is_arithmetic_v<T>);
    if constexpr (std::is_same_v<T, double>) {
      std::uint64_t bits = 0;
      number(bits);
      x = std::bit_cast<double>(bits);
    } else {
      const auto raw = take(sizeof(T));
      std::uint64_t bits = 0;
      for (std::size_t i = 0; i < sizeof(T); ++i) bits |= std::to_integer<std::uint64_t>(raw[i]) << (8 * i);
      x = static_cast<T>(bits);
    }
  }
  void text(std::string& text) {
    std::uint64_t size = 0;
    number(size);
    text.clear();
    for (const std::byte c : take(size)) text += static_cast<char>(c);
  }
  std::span<const std::byte> take(std::uint64_t n) {
    if (n > left()) throw std::invalid_argument("it ends too early");
    const auto taken = bytes_.subspan(position_, static_cast<std::size_t>(n));
    position_ += taken.size();
    return taken;
  }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] std::size_t position() const { return position_; }

 private:
  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
};

}  // namespace debias

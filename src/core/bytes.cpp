#include "core/bytes.hpp"

#include <boost/crc.hpp>

namespace debias {

std::uint32_t crc32(std::span<const std::byte> bytes) {
  boost::crc_32_type sum;
  sum.process_bytes(bytes.data(), bytes.size());
  return sum.checksum();
}

}  // namespace debias

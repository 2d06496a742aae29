#include "core/sobol.hpp"

#include <boost/random/sobol.hpp>

namespace debias::detail {
namespace {

std::uint32_t reverse(std::uint32_t x) {
  std::uint32_t r = 0;
  for (int i = 0; i < 32; ++i, x >>= 1) r = (r << 1) | (x & 1);
  return r;
}

SobolTable make_table() {
  // The engine counts in Gray code and leaves out point 0: after seed(n) comes the point of the bits of (n + 1) xor (n + 1)/2.
  SobolTable table;
  boost::random::sobol_engine<std::uint32_t, 32> engine(net_dimensions);
  for (unsigned b = 0; b < 32; ++b) {
    engine.seed(static_cast<std::uint32_t>((std::uint64_t{2} << b) - 2));  // of bit b alone
    for (std::uint32_t& v : table.of_bit[b]) v = reverse(static_cast<std::uint32_t>(engine()));
  }
  return table;
}

}  // namespace

const SobolTable& sobol_table() {
  static const SobolTable table = make_table();
  return table;
}

}  // namespace debias::detail

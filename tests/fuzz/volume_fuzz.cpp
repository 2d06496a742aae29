// A volume of any numbers and dimensions, and rays through it: refused, or a transmittance in [0, 1].

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <utility>
#include <vector>

#include "render/cloud.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace debias::render;
  if (size < 4) return 0;
  const std::array<int, 3> dimensions = {data[0], data[1], data[2]};
  const double density = 0.1 * (1 + data[3]);
  std::vector<float> grid((size - 4) / sizeof(float));
  if (!grid.empty()) std::memcpy(grid.data(), data + 4, grid.size() * sizeof(float));
  try {
    const Cloud cloud(std::move(grid), dimensions, density);
    for (const int x : {0, 1, 3}) {
      const Pixel pixel = look(cloud, x, 2, 4, 4);
      const double extinction = cloud({0.3 * x - 0.9, 0.5, -0.99});
      if (!(extinction >= 0)) std::abort();
      const double t = exact_transmittance(pixel.path);
      if (!(t >= 0 && t <= 1)) std::abort();
    }
  } catch (const std::invalid_argument&) {
  }
  return 0;
}

#include "image.hpp"

#include <png.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace debias::render {
namespace {

std::uint8_t to_srgb(double linear) {
  const double x = std::clamp(linear, 0.0, 1.0);
  const double curve = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * curve));
}

}  // namespace

std::string to_pfm(const Image& image) {
  static_assert(std::endian::native == std::endian::little);
  std::string bytes = std::string(image.channels == 3 ? "PF" : "Pf") + "\n" + std::to_string(image.width) + " " +
                      std::to_string(image.height) + "\n-1.0\n";
  const auto row = static_cast<std::size_t>(image.width * image.channels);
  for (int y = image.height - 1; y >= 0; --y) {
    bytes.append(reinterpret_cast<const char*>(&image.values[image.at(0, y)]), row * sizeof(float));
  }
  return bytes;
}

std::string to_png(const Image& image, double exposure) {
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * image.values.size());
  for (std::size_t i = 0; i < image.values.size(); i += static_cast<std::size_t>(image.channels)) {
    const bool number = std::isfinite(image.values[i]);
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = image.values[i + (image.channels == 3 ? c : 0)];
      rgb.push_back(number ? to_srgb(exposure * value) : c == 1 ? 0 : 255);
    }
  }
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, rgb.data(), 0, nullptr) == 0) {
    throw std::runtime_error(std::string("png: ") + png.message);
  }
  bytes.resize(size);
  return bytes;
}

}  // namespace debias::render

#pragma once

// Linear images, their files, and the one way to show them: exposure and the sRGB curve.

#include <cstddef>
#include <string>
#include <vector>

namespace debias::render {

/// Rows from the top, `channels` (1 or 3) numbers a pixel.
struct Image {
  Image(int w, int h, int c = 1)
      : width(w), height(h), channels(c), values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h * c)) {}
  [[nodiscard]] std::size_t at(int x, int y, int channel = 0) const {
    return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) *
               static_cast<std::size_t>(channels) +
           static_cast<std::size_t>(channel);
  }

  int width;
  int height;
  int channels;
  std::vector<float> values;
};

/// The bytes of a PFM file: the numbers themselves.
std::string to_pfm(const Image& image);
/// The bytes of a PNG file. Where a pixel is not a number it is magenta, never hidden.
std::string to_png(const Image& image, double exposure);

}  // namespace debias::render

#pragma once

// Images of a cloud: one transmittance estimate for each sample of each pixel.

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "cloud.hpp"
#include "image.hpp"
#include "saving.hpp"

namespace debias::render {

/// Of the samples of a pixel.
struct PixelSums {
  double sum = 0;
  double square = 0;
  double lookups = 0;
  std::int64_t samples = 0;
};

struct TransmittanceMethod {
  std::string_view name;
  std::string_view description;
  bool biased;
  /// Adds the samples [first, last) of a pixel, sample s from Stream(seed, pixel + pixels * s).
  void (*add)(const Ray<Path>& ray, std::uint64_t seed, std::uint64_t pixel, std::uint64_t pixels, std::int64_t first,
              std::int64_t last, PixelSums& sums);
};
std::span<const TransmittanceMethod> transmittance_methods();

struct RenderPlan {
  int width = 512;
  int height = 512;
  std::int64_t samples = 16;  ///< of each pixel
  std::uint64_t seed = 1;
  int threads = 0;
  /// Called now and then with the share that is done; false stops.
  std::function<bool(double)> progress;
  Saving saving;
};

/// Sums of each pixel, row by row. The same bits for any number of threads.
struct Rendering {
  std::vector<PixelSums> pixels;
  double seconds = 0;
  bool complete = true;
  int fewer_threads = 0;  ///< that worked, where as many as asked for could not be had; else 0
  [[nodiscard]] double lookups() const;
};
Rendering render(const Cloud& cloud, const TransmittanceMethod& method, const RenderPlan& plan);

/// The samples a pixel that take about so many seconds: measured by a pilot, whose samples are not used.
std::int64_t samples_for(double seconds, const Cloud& cloud, const TransmittanceMethod& method, RenderPlan plan);

/// The transmittance of each pixel: the mean of a rendering (NaN where there is no sample yet), or the quadrature.
Image transmittance_of(const Rendering& rendering, const RenderPlan& plan);
Image exact_image(const Cloud& cloud, const RenderPlan& plan);
/// What the camera sees without the cloud, and with it.
Image background_of(const Cloud& cloud, const RenderPlan& plan);
Image composed(const Image& background, const Image& transmittance);

}  // namespace debias::render

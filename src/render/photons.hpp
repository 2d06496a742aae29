#pragma once

// Irradiance of a floor under a glass sphere and a small lamp: the caustic, from photons.

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image.hpp"
#include "saving.hpp"

namespace debias::render {

struct PhotonMethod {
  std::string_view name;
  std::string_view description;
  bool biased;
  bool infinite_mean;  ///< E|Z| is infinite: refused without the flag
  bool median;         ///< show the median of the means of groups
};
std::span<const PhotonMethod> photon_methods();
/// Whether variance and work are finite, in words; empty for biased methods.
std::string verdict_of(const PhotonMethod& method);

struct PhotonPlan {
  int width = 512;
  int height = 512;
  double photons = 1 << 24;  ///< expected, of all passes; the passes are fixed before the first one
  bool sphere = true;        ///< else the lamp alone, of which the irradiance is known
  std::uint64_t seed = 1;
  int threads = 0;
  /// Called now and then with the share that is done; false stops.
  std::function<bool(double)> progress;
  Saving saving;
};

struct PhotonRendering {
  Image image{1, 1};
  std::int64_t passes = 0;
  double photons = 0;
  double seconds = 0;
  bool complete = true;
  int fewer_threads = 0;  ///< that worked, where as many as asked for could not be had; else 0
};
/// The mean irradiance of each pixel; the same bits for any number of threads.
PhotonRendering render(const PhotonMethod& method, const PhotonPlan& plan);

/// Without the sphere the solid angle of each pixel; with it a midpoint rule over all directions of the lamp, every
/// ray followed with its weight through reflection and refraction.
Image exact_irradiance(const PhotonPlan& plan);

}  // namespace debias::render

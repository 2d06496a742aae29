#pragma once

// Images that show bias, noise and heavy tails: of one estimator, or of all beside the reference.

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include "fields.hpp"
#include "render/photons.hpp"
#include "render/transmittance.hpp"
#include "store.hpp"

namespace debias::commands {

/// What both scenes have.
struct PictureRequest {
  int width = 512;
  int height = 512;
  std::uint64_t seed = 1;
  int threads = 0;
  bool compare = false;  ///< all estimators and the reference

  static constexpr int most_pixels_a_side = 1 << 14;
};

struct TransmittanceRequest : PictureRequest {
  const render::Cloud* cloud = nullptr;
  const render::TransmittanceMethod* method = nullptr;  ///< null: telescoping_2, or all to compare
  std::int64_t samples = 64;                            ///< of a pixel
  double equal_time = 0;  ///< seconds: as many samples as take it; 0: `samples`, or 4 s to compare
};

struct PhotonRequest : PictureRequest {
  const render::PhotonMethod* method = nullptr;  ///< null: balanced, or all to compare
  double photons = 4e6;                          ///< expected, of the whole image
  bool sphere = true;                            ///< else the lamp alone
  bool allow_infinite_mean = false;
};

/// By its name. Throw BadRequest, with the nearest one.
const render::TransmittanceMethod& transmittance_method(const std::string& name);
const render::PhotonMethod& photon_method(const std::string& name);

/// One image.
struct Picture {
  std::string name;
  std::string description;
  bool biased = false;
  std::int64_t samples = 0;  ///< of a pixel, or passes
  double work = 0;           ///< look-ups, or photons
  double seconds = 0;
  double mean = 0;   ///< over the image
  double error = 0;  ///< root mean square against the reference, relative to its mean; NaN without one
  std::string verdict;
};

/// An error against the photons that it took.
struct CurvePoint {
  std::string name;
  double photons = 0;
  std::int64_t passes = 0;
  double error = 0;
};

struct PicturesReport {
  std::string scene;
  std::string work_unit;
  int width = 0;
  int height = 0;
  std::uint64_t seed = 0;
  int fewer_threads = 0;  ///< that drew, where as many as asked for could not be had; else 0
  bool complete = true;   ///< false: it was ended, and the last image is what there is
  std::vector<Picture> pictures;
  std::vector<CurvePoint> curves;  ///< to compare photons
};

/// Sees each image as it is finished: "reference" and "background" of a comparison, and those of the estimators; a single
/// one of the cloud is composed with its background. A part is kept of each.
using ShowImage = std::function<void(const std::string& name, const render::Image& image)>;
PicturesReport render(const TransmittanceRequest& request, const Caller& caller = {}, const ShowImage& show = {});
PicturesReport render(const PhotonRequest& request, const Caller& caller = {}, const ShowImage& show = {});

void print(std::ostream& out, const PicturesReport& report);
/// Comma-separated values, a line for each point.
void print_curves(std::ostream& out, const PicturesReport& report);
Fields fields(const PicturesReport& report);

/// A number that an earlier run has found out, or this one.
std::uint64_t kept_number(Store* store, const std::string& part, const std::function<std::uint64_t()>& find_out);

}  // namespace debias::commands

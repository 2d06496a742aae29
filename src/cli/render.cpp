// render: images into files as they are finished, a volume out of one.

#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/estimate.hpp>

#include "core/bytes.hpp"
#include "core/text.hpp"
#include "execute.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

// One image file and, beside a PNG, the linear image; or a folder of linear images. Opened before the run.
class Target {
 public:
  Target(const std::string& path, double exposure, bool folder) : path_(path), exposure_(exposure) {
    if (folder) {
      std::error_code error;
      std::filesystem::create_directories(path_, error);
      if (error || !std::filesystem::is_directory(path_)) throw FileError("-o '" + path_ + "': no folder can be made");
      index_.emplace(path_ + "/index.json");
    } else if (path_.size() > 4 && path_.ends_with(".png")) {
      png_.emplace(path_);
      pfm_.emplace(path_.substr(0, path_.size() - 4) + ".pfm");
    } else if (path_.size() > 4 && path_.ends_with(".pfm")) {
      pfm_.emplace(path_);
    } else {
      throw std::invalid_argument("-o '" + path_ + "' (must end in .png or .pfm); a .png brings its .pfm");
    }
  }
  // In a folder by its name.
  void write(const std::string& name, const render::Image& image) {
    if (index_) return write_file(name + ".pfm", to_pfm(image));
    if (png_) put(*png_, to_png(image, exposure_));
    put(*pfm_, to_pfm(image));
  }
  // What a folder says of its images.
  void write(const commands::PicturesReport& report) {
    if (!index_) return;
    if (!report.curves.empty()) {
      std::ostringstream curves;  // only texts
      print_curves(curves, report);
      write_file("curves.csv", curves.str());
    }
    put(*index_, commands::to_json(report) + "\n");
  }

 private:
  static void put(Output& file, const std::string& bytes) {
    file.stream() << bytes;
    file.flush();
  }
  void write_file(const std::string& name, const std::string& bytes) const {
    Output file(path_ + "/" + name);
    put(file, bytes);
  }
  std::string path_;
  double exposure_ = 1;
  std::optional<Output> png_;
  std::optional<Output> pfm_;
  std::optional<Output> index_;
};

// The cloud, and a checksum of its volume.
std::pair<render::Cloud, std::uint64_t> read_cloud(const RenderTransmittance& r, const std::string& output) {
  if (r.volume.empty()) return {render::Cloud(r.density), 0};
  const std::array<int, 3>& size = *r.dims;
  keep_apart(output, r.volume);
  std::error_code error;
  if (std::filesystem::exists(r.volume, error) && !std::filesystem::is_regular_file(r.volume, error)) {
    throw FileError("--volume '" + r.volume + "': is no regular file");  // a pipe would be waited for
  }
  std::ifstream file(r.volume, std::ios::binary);
  const std::uintmax_t wanted = sizeof(float) * static_cast<std::uintmax_t>(size[0]) *
                                static_cast<std::uintmax_t>(size[1]) * static_cast<std::uintmax_t>(size[2]);
  const std::uintmax_t bytes = std::filesystem::file_size(r.volume, error);
  if (!file || error) throw FileError("--volume '" + r.volume + "': cannot be read");
  if (bytes != wanted) {
    throw std::invalid_argument("--volume '" + r.volume + "': " + std::to_string(bytes) + " bytes (--dims " +
                                std::to_string(size[0]) + "x" + std::to_string(size[1]) + "x" +
                                std::to_string(size[2]) + " of 32-bit floats are " + std::to_string(wanted) +
                                "); give the right dimensions");
  }
  std::vector<float> grid(bytes / sizeof(float));
  if (!file.read(reinterpret_cast<char*>(grid.data()), static_cast<std::streamsize>(bytes))) {
    throw FileError("--volume '" + r.volume + "': cannot be read");
  }
  const std::uint64_t sum = crc32(std::as_bytes(std::span(grid)));
  return {render::Cloud(std::move(grid), size, r.density), sum};
}

void check_exposure(double exposure, bool folder, const Delivery& delivery) {
  const bool has_png = !folder && delivery.output.ends_with(".png");
  if (has_png || exposure == RenderPhotons{}.exposure || delivery.held) return;
  throw std::invalid_argument("--exposure = '" + to_text(exposure) +
                              "' (it is of a PNG, and linear images are written); leave it out, or write -o FILE.png");
}

template <class R>
int draw(const R& request, double exposure, Session& session, const Delivery& delivery) {
  Target target(delivery.output, exposure, request.compare);
  std::optional<Progress> progress;
  std::string drawn;
  const auto watch = [&](std::string_view what, double share, double) {
    if (what != drawn) {  // the clock of an image begins with it
      drawn = what;
      progress.emplace(delivery.quiet);
    }
    return watch_share(*progress)(what, share, 1);
  };
  const auto show = [&target](const std::string& name, const render::Image& image) { target.write(name, image); };
  const commands::PicturesReport report =
      session.guard([&] { return commands::render(request, session.caller(watch), show); });
  progress.reset();
  report.complete ? session.flush() : session.suspend();
  target.write(report);
  if (report.fewer_threads > 0 && !delivery.quiet) {
    complain("warning: " + debias::detail::fewer_threads_warning(report.fewer_threads).text);
  }
  Output out;
  deliver(report, delivery, out);
  if (report.complete) return done;
  complain("interrupted; what there is of the image is written");
  return interrupted_by_signal;
}

}  // namespace

int execute(const RenderTransmittance& r, const Delivery& delivery) {
  if (r.request.samples != commands::TransmittanceRequest{}.samples &&
      (r.request.equal_time > 0 || r.request.compare)) {
    throw std::invalid_argument("--spp = '" + std::to_string(r.request.samples) + "' (" +
                                (r.request.equal_time > 0 ? "--equal-time" : "--compare") +
                                " takes as many as the time allows); leave one out");
  }
  check_exposure(r.exposure, r.request.compare, delivery);
  const auto read = read_cloud(r, delivery.output);
  commands::TransmittanceRequest request = r.request;
  request.cloud = &read.first;
  Session session(saved(r), delivery);
  commands::Store* store = session.caller({}).store;
  const auto sum = [&read] { return read.second; };
  if (!r.volume.empty() && commands::kept_number(store, "volume", sum) != read.second) {
    throw FileError("--volume '" + r.volume + "': not the values that the image was begun with");
  }
  return draw(request, r.exposure, session, delivery);
}

int execute(const RenderPhotons& r, const Delivery& delivery) {
  check_exposure(r.exposure, r.request.compare, delivery);
  Session session(saved(r), delivery);
  return draw(r.request, r.exposure, session, delivery);
}

}  // namespace debias::cli

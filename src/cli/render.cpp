#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "../core/text.hpp"
#include "../render/image.hpp"
#include "../render/named.hpp"
#include "../render/photons.hpp"
#include "../render/transmittance.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

constexpr std::uint64_t most_pixels_a_side = 1 << 14;

// "512x256" as that many numbers.
template <std::size_t n>
std::array<int, n> read_dimensions(const std::string& text, const std::string& name) {
  std::array<int, n> size{};
  std::size_t begin = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t end = i + 1 < n ? text.find('x', begin) : text.size();
    if (end == std::string::npos) {
      throw std::invalid_argument(name + " = '" + text + "' (not " + std::to_string(n) + " numbers); write " +
                                  (n == 2 ? "512x512" : "64x64x64"));
    }
    size[i] = static_cast<int>(parse_count(text.substr(begin, end - begin), name, 1, most_pixels_a_side));
    begin = end + 1;
  }
  return size;
}

bool ends_in(const std::string& text, const std::string& end) {
  return text.size() > end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// One image file and, beside a PNG, the linear image; or a folder of linear images. Opened before the run.
class Target {
 public:
  Target(const Arguments& arguments, bool folder) : path_(arguments.output) {
    exposure_ = read_positive(arguments.exposure, "--exposure");
    if (folder) {
      std::error_code error;
      std::filesystem::create_directories(path_, error);
      if (error || !std::filesystem::is_directory(path_)) throw FileError("-o '" + path_ + "': no folder can be made");
      index_.emplace(path_ + "/index.json");
    } else if (ends_in(path_, ".png")) {
      png_.emplace(path_);
      pfm_.emplace(path_.substr(0, path_.size() - 4) + ".pfm");
    } else if (ends_in(path_, ".pfm")) {
      pfm_.emplace(path_);
    } else {
      throw std::invalid_argument("-o '" + path_ + "' (must end in .png or .pfm); a .png brings its .pfm");
    }
  }
  void write(const render::Image& image) {
    if (png_) put(*png_, to_png(image, exposure_));
    put(*pfm_, to_pfm(image));
  }
  void write(const std::string& name, const render::Image& image) const {
    Output file(path_ + "/" + name + ".pfm");
    put(file, to_pfm(image));
  }
  void write_text(const std::string& name, const std::string& text) const {
    Output file(path_ + "/" + name);
    put(file, text);
  }
  void write(const Pictures& pictures) { put(*index_, render_json(pictures) + "\n"); }

 private:
  static void put(Output& file, const std::string& bytes) {
    file.stream() << bytes;
    file.flush();
  }
  std::string path_;
  double exposure_ = 1;
  std::optional<Output> png_;
  std::optional<Output> pfm_;
  std::optional<Output> index_;
};

// Root mean square of the differences over the mean of the reference.
double relative_error(const render::Image& image, const render::Image& reference) {
  double square = 0;
  double total = 0;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const double d = static_cast<double>(image.values[i]) - static_cast<double>(reference.values[i]);
    square += d * d;
    total += static_cast<double>(reference.values[i]);
  }
  return std::sqrt(square * static_cast<double>(image.values.size())) / total;
}

double mean_of(const render::Image& image) {
  double total = 0;
  for (const float v : image.values) total += static_cast<double>(v);
  return total / static_cast<double>(image.values.size());
}

int report(const Arguments& arguments, const Pictures& all, int fewer_threads) {
  if (fewer_threads > 0 && !arguments.quiet) complain("warning: " + debias::detail::fewer_threads_text(fewer_threads));
  Output out;
  if (arguments.json) {
    out.stream() << render_json(all) << '\n';
  } else {
    print_line(out.stream(), "scene",
               all.scene + ", " + std::to_string(all.width) + "x" + std::to_string(all.height) + ", seed " +
                   std::to_string(all.seed));
    std::vector<Row> rows = {{"estimator", "", "samples", all.work_unit, "per second", "seconds", "mean", "error"}};
    for (const Picture& p : all.pictures) {
      rows.push_back({p.name, p.biased ? "biased" : "", std::to_string(p.samples), rounded(p.work),
                      p.seconds > 0 ? rounded(p.work / p.seconds) : "", rounded(p.seconds), rounded(p.mean, 6),
                      std::isnan(p.error) ? "" : rounded(p.error)});
    }
    print_table(out.stream(), rows);
    for (const Picture& p : all.pictures) {
      if (!p.verdict.empty()) print_line(out.stream(), p.name, p.verdict);
    }
  }
  out.flush();
  if (all.complete) return done;
  complain("interrupted; what there is of the image is written");
  return interrupted_by_signal;
}

// Of either scene.
template <class Plan>
void read_common(const Arguments& arguments, Plan& plan) {
  const auto size = read_dimensions<2>(arguments.size, "--size");
  plan.width = size[0];
  plan.height = size[1];
  plan.seed = read_seed_or_random(arguments.seed);
  plan.threads = read_threads(arguments.threads);
}

// All, or the one of --estimator.
template <class Method>
std::vector<const Method*> chosen(const Arguments& arguments, std::span<const Method> all, const char* standard) {
  if (!arguments.compare) {
    return {&render::named(all, arguments.estimator.empty() ? std::string(standard) : arguments.estimator)};
  }
  if (!arguments.estimator.empty()) {
    throw std::invalid_argument("--estimator = '" + arguments.estimator + "' (--compare takes all); leave one out");
  }
  std::vector<const Method*> methods;
  for (const Method& m : all) methods.push_back(&m);
  return methods;
}

// Under the name of a part; a part that is held is taken up.
render::Saving saving_in(Session& session, const std::string& part) {
  render::Saving saving;
  if (const Bytes* contents = session.held(part)) saving.earlier = *contents;
  saving.save = [&session, part](const std::function<Bytes()>& sums, bool last) {
    if (last || session.due()) session.keep(part, sums());
  };
  return saving;
}

// A number that an earlier run has found out, or this one.
std::uint64_t kept_number(Session& session, const std::string& part, const std::function<std::uint64_t()>& find_out) {
  std::uint64_t number = 0;
  if (const Bytes* contents = session.held(part)) {
    ByteReader(*contents).number(number);
    return number;
  }
  number = find_out();
  ByteWriter w;
  w.number(number);
  session.keep(part, std::move(w.bytes));
  return number;
}

void suspend_or_flush(Session& session) { interrupted() ? session.suspend() : session.flush(); }

// The cloud, and a checksum of its volume.
std::pair<render::Cloud, std::uint64_t> read_cloud(const Arguments& arguments) {
  const double density = read_positive(arguments.density, "--density");
  if (arguments.volume.empty()) {
    if (arguments.dimensions.empty()) return {render::Cloud(density), 0};
    throw std::invalid_argument("--dims = '" + arguments.dimensions + "' (of no volume); add --volume FILE");
  }
  if (arguments.dimensions.empty()) {
    throw std::invalid_argument("--volume '" + arguments.volume + "' (has no dimensions); add --dims 64x64x64");
  }
  const std::array<int, 3> size = read_dimensions<3>(arguments.dimensions, "--dims");
  keep_apart(arguments.output, arguments.volume);
  std::error_code error;
  if (std::filesystem::exists(arguments.volume, error) && !std::filesystem::is_regular_file(arguments.volume, error)) {
    throw FileError("--volume '" + arguments.volume + "': is no regular file");  // a pipe would be waited for
  }
  std::ifstream file(arguments.volume, std::ios::binary);
  const std::uintmax_t wanted = sizeof(float) * static_cast<std::uintmax_t>(size[0]) *
                                static_cast<std::uintmax_t>(size[1]) * static_cast<std::uintmax_t>(size[2]);
  const std::uintmax_t bytes = std::filesystem::file_size(arguments.volume, error);
  if (!file || error) throw FileError("--volume '" + arguments.volume + "': cannot be read");
  if (bytes != wanted) {
    throw std::invalid_argument("--volume '" + arguments.volume + "': " + std::to_string(bytes) + " bytes (--dims " +
                                arguments.dimensions + " of 32-bit floats are " + std::to_string(wanted) +
                                "); give the right dimensions");
  }
  std::vector<float> grid(bytes / sizeof(float));
  if (!file.read(reinterpret_cast<char*>(grid.data()), static_cast<std::streamsize>(bytes)))
    throw FileError("--volume '" + arguments.volume + "': cannot be read");
  const std::uint64_t sum = crc32(std::as_bytes(std::span(grid)));
  return {render::Cloud(std::move(grid), size, density), sum};
}

}  // namespace

int render_transmittance(const Arguments& arguments) {
  const auto read = read_cloud(arguments);
  const render::Cloud& cloud = read.first;
  render::RenderPlan plan;
  read_common(arguments, plan);
  plan.samples = static_cast<std::int64_t>(parse_count(arguments.spp, "--spp", 1, 1'000'000'000));
  double equal_time = arguments.equal_time == "none" ? 0 : read_seconds(arguments.equal_time, "--equal-time");
  if (arguments.compare && equal_time == 0) equal_time = 4;
  const auto methods = chosen(arguments, render::transmittance_methods(), "telescoping_2");
  Arguments words = arguments;
  words.seed = std::to_string(plan.seed);
  Session session("render transmittance", words);
  if (!arguments.volume.empty() && kept_number(session, "volume", [&] { return read.second; }) != read.second) {
    throw FileError("--volume '" + arguments.volume + "': not the values that the image was begun with");
  }
  Target target(arguments, arguments.compare);

  Pictures all{"transmittance", "lookups", plan.width, plan.height, plan.seed, true, {}};
  std::optional<Progress> progress;
  std::string name = "reference";
  plan.progress = [&](double share) {
    if (progress->due() && share > 0) progress->show(name + ": " + share_of(share, 1, progress->seconds()));
    return !interrupted();
  };
  std::optional<render::Image> reference;
  if (arguments.compare) {
    progress.emplace(arguments.quiet);
    reference = render::exact_image(cloud, plan);
    target.write("background", background_of(cloud, plan));
    if (!interrupted()) target.write(name, *reference);
  }
  int fewer_threads = 0;
  for (const render::TransmittanceMethod* method : methods) {
    if (interrupted()) break;
    name = method->name;
    progress.emplace(arguments.quiet);
    if (equal_time > 0) {
      plan.samples = static_cast<std::int64_t>(kept_number(session, "samples " + name, [&] {
        return static_cast<std::uint64_t>(samples_for(equal_time, cloud, *method, plan));
      }));
    }
    plan.saving = saving_in(session, name);
    progress.emplace(arguments.quiet);
    const render::Rendering r = render::render(cloud, *method, plan);
    if (r.fewer_threads > 0) fewer_threads = r.fewer_threads;
    const render::Image image = transmittance_of(r, plan);
    arguments.compare ? target.write(name, image) : target.write(composed(background_of(cloud, plan), image));
    all.pictures.push_back(
        {name, std::string(method->description), method->biased, plan.samples, r.lookups(), r.seconds, mean_of(image),
         reference ? relative_error(image, *reference) : std::numeric_limits<double>::quiet_NaN(), ""});
  }
  progress.reset();
  suspend_or_flush(session);
  all.complete = !interrupted();
  if (arguments.compare) target.write(all);
  return report(arguments, all, fewer_threads);
}

int render_photons(const Arguments& arguments) {
  render::PhotonPlan plan;
  read_common(arguments, plan);
  plan.photons = static_cast<double>(parse_count(arguments.photons, "--photons", 1, std::uint64_t{1} << 50));
  static constexpr std::array<std::string_view, 2> scenes = {"sphere", "direct"};
  if (arguments.scene != scenes[0] && arguments.scene != scenes[1]) {
    const std::string meant = suggestion(arguments.scene, scenes);
    throw std::invalid_argument("--scene = '" + arguments.scene + "' (no scene)" +
                                (meant.empty() ? "; write sphere or direct" : meant));
  }
  plan.sphere = arguments.scene == scenes[0];
  auto methods = chosen(arguments, render::photon_methods(), "balanced");
  if (!arguments.allow_infinite_mean) {
    if (!arguments.compare && methods[0]->infinite_mean) {
      throw std::invalid_argument("--estimator = '" + arguments.estimator +
                                  "' (E|Z| is infinite: its mean does not converge); take balanced, or add "
                                  "--allow-infinite-mean to see what happens");
    }
    std::erase_if(methods, [](const render::PhotonMethod* m) { return m->infinite_mean; });
  }
  Arguments words = arguments;
  words.seed = std::to_string(plan.seed);
  Session session("render photons", words);
  Target target(arguments, arguments.compare);

  Pictures all{"photons, " + arguments.scene, "photons", plan.width, plan.height, plan.seed, true, {}};
  std::optional<Progress> progress(arguments.quiet);
  std::string name = "reference";
  plan.progress = [&](double share) {
    if (progress->due() && share > 0) progress->show(name + ": " + share_of(share, 1, progress->seconds()));
    return !interrupted();
  };
  std::optional<render::Image> reference;
  if (arguments.compare) reference = render::exact_irradiance(plan);
  std::string curves = "estimator,photons,passes,error\n";
  if (reference && !interrupted()) target.write(name, *reference);
  int fewer_threads = 0;
  for (const render::PhotonMethod* method : methods) {
    if (interrupted()) break;
    name = method->name;
    progress.emplace(arguments.quiet);
    // An error against work: of 1/64, 1/16, 1/4 of the photons, and of all.
    for (double share = arguments.compare ? 1.0 / 64 : 1; share <= 1 && !interrupted(); share *= 4) {
      render::PhotonPlan part = plan;
      part.photons = std::ceil(share * plan.photons);
      part.saving = saving_in(session, name + " " + to_text(part.photons));
      const render::PhotonRendering r = render::render(*method, part);
      if (r.fewer_threads > 0) fewer_threads = r.fewer_threads;
      const double error = reference ? relative_error(r.image, *reference) : std::numeric_limits<double>::quiet_NaN();
      if (r.complete) {
        curves += name + "," + to_text(r.photons) + "," + std::to_string(r.passes) + "," + to_text(error) + "\n";
      }
      if (share < 1) continue;
      arguments.compare ? target.write(name, r.image) : target.write(r.image);
      all.pictures.push_back({name, std::string(method->description), method->biased, r.passes, r.photons, r.seconds,
                              mean_of(r.image), error, verdict_of(*method)});
    }
  }
  progress.reset();
  suspend_or_flush(session);
  all.complete = !interrupted();
  if (arguments.compare) {
    target.write_text("curves.csv", curves);
    target.write(all);
  }
  return report(arguments, all, fewer_threads);
}

}  // namespace debias::cli

#include "render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <ostream>
#include <span>
#include <string_view>

#include "core/text.hpp"
#include "text.hpp"

namespace debias::commands {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class Method>
const Method& named(std::span<const Method> methods, const std::string& name) {
  std::vector<std::string_view> names;
  std::string all;
  for (const Method& m : methods) {
    if (m.name == name) return m;
    names.push_back(m.name);
    all += (all.empty() ? "" : ", ") + std::string(m.name);
  }
  const std::string meant = suggestion(name, names);
  throw BadRequest({Field{"estimator"},
                    " = '" + name + "' (no estimator of this scene)" + (meant.empty() ? "; there are " + all : meant)});
}

// All, or the one that is asked for.
template <class Request, class Method>
std::vector<const Method*> methods_of(const Request& request, std::span<const Method> all, const Method& standard) {
  if (!request.compare) return {request.method != nullptr ? request.method : &standard};
  if (request.method != nullptr) {
    throw BadRequest({Field{"estimator"}, " = '" + std::string(request.method->name) + "' (", Field{"compare"},
                      " takes all); leave one out"});
  }
  std::vector<const Method*> methods;
  for (const Method& m : all) methods.push_back(&m);
  return methods;
}

// Root mean square of the differences over the mean of the reference; NaN without one.
double relative_error(const render::Image& image, const std::optional<render::Image>& reference) {
  if (!reference) return nan;
  double square = 0;
  double total = 0;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const double d = static_cast<double>(image.values[i]) - static_cast<double>(reference->values[i]);
    square += d * d;
    total += static_cast<double>(reference->values[i]);
  }
  return std::sqrt(square * static_cast<double>(image.values.size())) / total;
}

double mean_of(const render::Image& image) {
  double total = 0;
  for (const float v : image.values) total += static_cast<double>(v);
  return total / static_cast<double>(image.values.size());
}

// Under the name of a part; a part that is held is taken up.
render::Saving saving_in(Store* store, const std::string& part) {
  render::Saving saving;
  if (store == nullptr) return saving;
  if (const Bytes* contents = store->held(part)) saving.earlier = *contents;
  saving.save = [store, part](const std::function<Bytes()>& sums, bool last) {
    if (last || store->due()) store->keep(part, sums());
  };
  return saving;
}

// Says which image is being made, and remembers that it is to end.
class Watched {
 public:
  explicit Watched(const Caller& caller) : caller_(caller) {}
  bool goes_on(double share = 0) {
    if (!caller_.goes_on(name, share, 1)) stopped_ = true;
    return !stopped_;
  }
  std::string name = "reference";

 private:
  const Caller& caller_;
  bool stopped_ = false;
};

template <class RenderPlan>
void take_common(const PictureRequest& request, Watched& watched, RenderPlan& plan) {
  plan.width = request.width;
  plan.height = request.height;
  plan.seed = request.seed;
  plan.threads = request.threads;
  plan.progress = [&watched](double share) { return watched.goes_on(share); };
}

PicturesReport report_of(const PictureRequest& request, std::string scene, std::string work_unit) {
  PicturesReport report;
  report.scene = std::move(scene);
  report.work_unit = std::move(work_unit);
  report.width = request.width;
  report.height = request.height;
  report.seed = request.seed;
  return report;
}

}  // namespace

const render::TransmittanceMethod& transmittance_method(const std::string& name) {
  return named(render::transmittance_methods(), name);
}
const render::PhotonMethod& photon_method(const std::string& name) { return named(render::photon_methods(), name); }

std::uint64_t kept_number(Store* store, const std::string& part, const std::function<std::uint64_t()>& find_out) {
  std::uint64_t number = 0;
  const Bytes* contents = store != nullptr ? store->held(part) : nullptr;
  if (contents != nullptr) {
    ByteReader(*contents).number(number);
    return number;
  }
  number = find_out();
  if (store == nullptr) return number;
  ByteWriter w;
  w.number(number);
  store->keep(part, std::move(w.bytes));
  return number;
}

PicturesReport render(const TransmittanceRequest& request, const Caller& caller, const ShowImage& show) {
  const render::Cloud& cloud = *request.cloud;
  const auto methods = methods_of(request, render::transmittance_methods(), transmittance_method("telescoping_2"));
  Watched watched(caller);
  render::RenderPlan plan;
  take_common(request, watched, plan);
  plan.samples = request.samples;
  const double equal_time = request.compare && request.equal_time == 0 ? 4 : request.equal_time;

  PicturesReport all = report_of(request, "transmittance", "lookups");
  std::optional<render::Image> reference;
  if (request.compare) {
    reference = render::exact_image(cloud, plan);
    if (show) show("background", background_of(cloud, plan));
    if (show && watched.goes_on()) show(watched.name, *reference);
  }
  for (const render::TransmittanceMethod* method : methods) {
    watched.name = method->name;
    if (!watched.goes_on()) break;
    if (equal_time > 0) {
      plan.samples = static_cast<std::int64_t>(kept_number(caller.store, "samples " + watched.name, [&] {
        return static_cast<std::uint64_t>(samples_for(equal_time, cloud, *method, plan));
      }));
    }
    plan.saving = saving_in(caller.store, watched.name);
    const render::Rendering r = render::render(cloud, *method, plan);
    if (r.fewer_threads > 0) all.fewer_threads = r.fewer_threads;
    const render::Image image = transmittance_of(r, plan);
    if (show) show(watched.name, request.compare ? image : composed(background_of(cloud, plan), image));
    all.pictures.push_back({watched.name, std::string(method->description), method->biased, plan.samples, r.lookups(),
                            r.seconds, mean_of(image), relative_error(image, reference), ""});
  }
  all.complete = watched.goes_on(1);
  return all;
}

PicturesReport render(const PhotonRequest& request, const Caller& caller, const ShowImage& show) {
  auto methods = methods_of(request, render::photon_methods(), photon_method("balanced"));
  if (!request.allow_infinite_mean) {
    if (!request.compare && methods[0]->infinite_mean) {
      throw BadRequest({Field{"estimator"},
                        " = '" + std::string(methods[0]->name) +
                            "' (E|Z| is infinite: its mean does not converge); take balanced, or add ",
                        Field{"allow_infinite_mean"}, " to see what happens"});
    }
    std::erase_if(methods, [](const render::PhotonMethod* m) { return m->infinite_mean; });
  }
  Watched watched(caller);
  render::PhotonPlan plan;
  take_common(request, watched, plan);
  plan.photons = request.photons;
  plan.sphere = request.sphere;

  PicturesReport all = report_of(request, request.sphere ? "photons, sphere" : "photons, direct", "photons");
  std::optional<render::Image> reference;
  if (request.compare) reference = render::exact_irradiance(plan);
  if (show && reference && watched.goes_on()) show(watched.name, *reference);
  for (const render::PhotonMethod* method : methods) {
    watched.name = method->name;
    // An error against work: of 1/64, 1/16, 1/4 of the photons, and of all.
    for (double share = request.compare ? 1.0 / 64 : 1; share <= 1 && watched.goes_on(); share *= 4) {
      render::PhotonPlan part = plan;
      part.photons = std::ceil(share * plan.photons);
      part.saving = saving_in(caller.store, watched.name + " " + to_text(part.photons));
      const render::PhotonRendering r = render::render(*method, part);
      if (r.fewer_threads > 0) all.fewer_threads = r.fewer_threads;
      const double error = relative_error(r.image, reference);
      if (r.complete && request.compare) all.curves.push_back({watched.name, r.photons, r.passes, error});
      if (share < 1) continue;
      if (show) show(watched.name, r.image);
      all.pictures.push_back({watched.name, std::string(method->description), method->biased, r.passes, r.photons,
                              r.seconds, mean_of(r.image), error, verdict_of(*method)});
    }
  }
  all.complete = watched.goes_on(1);
  return all;
}

void print(std::ostream& out, const PicturesReport& all) {
  print_line(out, "scene",
             all.scene + ", " + std::to_string(all.width) + "x" + std::to_string(all.height) + ", seed " +
                 std::to_string(all.seed));
  std::vector<Row> rows = {{"estimator", "", "samples", all.work_unit, "per second", "seconds", "mean", "error"}};
  for (const Picture& p : all.pictures) {
    rows.push_back({p.name, p.biased ? "biased" : "", std::to_string(p.samples), rounded(p.work),
                    p.seconds > 0 ? rounded(p.work / p.seconds) : "", rounded(p.seconds), rounded(p.mean, 6),
                    std::isnan(p.error) ? "" : rounded(p.error)});
  }
  print_table(out, rows);
  for (const Picture& p : all.pictures) {
    if (!p.verdict.empty()) print_line(out, p.name, p.verdict);
  }
}

void print_curves(std::ostream& out, const PicturesReport& all) {
  out << "estimator,photons,passes,error\n";
  for (const CurvePoint& c : all.curves) {
    out << c.name << ',' << to_text(c.photons) << ',' << std::to_string(c.passes) << ',' << to_text(c.error) << '\n';
  }
}

Fields fields(const PicturesReport& all) {
  Fields f = {{"scene", all.scene},
              {"width", all.width},
              {"height", all.height},
              {"seed", all.seed},
              {"complete", all.complete},
              {"pictures", list_of(all.pictures, [&all](const Picture& p) {
                 return Fields{{"name", p.name},       {"description", p.description}, {"biased", p.biased},
                               {"samples", p.samples}, {all.work_unit, p.work},        {"mean", p.mean},
                               {"error", p.error},     {"verdict", p.verdict},         {"seconds", p.seconds}};
               })}};
  append(f, versions());
  return f;
}

}  // namespace debias::commands

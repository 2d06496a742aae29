#include "photons.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <debias/diagnostics.hpp>
#include <debias/photon.hpp>

#include "cloud.hpp"
#include "parallel.hpp"

namespace debias::render {
namespace {

// The floor is the plane z = 0; the image is its window [-1.5, 1.5]^2 seen from above.
constexpr double half_window = 1.5;
constexpr double first_radius = 0.06;
constexpr double margin = half_window + first_radius;  // photons that a pixel at the edge can see
constexpr double intensity = 10 / (4 * std::numbers::pi);
const Vec lamp{1.3, -1, 2};
const Vec centre{0.3, -0.2, 0.52};
constexpr double radius = 0.5;
constexpr double glass = 1.5;
constexpr int groups = 16;  // of passes, each with sums of its own

constexpr PhotonMethod all_photon_methods[] = {
    {"disc", "one radius for ever", true, false, false},
    {"progressive", "radius^2 ~ i^(-1/3) in pass i", true, false, false},
    {"balanced", "unbiased, radius^2 / 2 and photons x 8 a level", false, false, false},
    {"geometric", "unbiased, radius^2 / 2 and photons x 2.8 a level, r = 0.65 as published", false, false, false},
    {"alpha", "unbiased in a formal sense only, radius^2 ~ j^(-1/3), photons ~ j^(1/3) at level j", false, true, false},
    {"median_of_means", "balanced, pixel by pixel the median of 16 means: biased", true, false, true},
};

constexpr double photons_in_pass = 2048;  // of biased passes
constexpr double photons_in_base = 64;    // of unbiased ones
const GeometricRadii balanced{first_radius, photons_in_base};
const GeometricRadii geometric{first_radius, photons_in_base, 2, 2.8};
const AlphaRadii alpha{first_radius, photons_in_base};
const Geometric published(0.65);

// What a pass draws: how many photons, and under which kernels.
struct Pass {
  std::int64_t photons = 0;
  std::int64_t base_photons = 0;  // the first ones, under the base kernel as well
  std::int64_t level = 0;
  double base2 = 0;
  double fine2 = 0;
  double coarse2 = 0;
  double weight = 0;  // of the difference; 0 without one
};

template <class Schedule, class P>
Pass unbiased_pass(const Schedule& schedule, const P& pmf, double u) {
  const std::int64_t j = pmf.sample(u);
  return {schedule.photons_at(j + 1),
          schedule.photons_at(0),
          j + 1,
          schedule.radius2(0),
          schedule.radius2(j + 1),
          schedule.radius2(j),
          inverse_weight(pmf.mass(j), j + 1)};
}

Pass pass_of(const PhotonMethod& method, const Stream& rng) {
  const auto n = static_cast<std::int64_t>(photons_in_pass);
  if (method.name == "disc") return {n, n, 0, first_radius * first_radius, 0, 0, 0};
  if (method.name == "progressive") {
    return {n, n, 0, ProgressiveRadii{first_radius, photons_in_pass}.radius2(rng.index()), 0, 0, 0};
  }
  const double u = split(rng, Branch::pmf).uniform();
  if (method.name == "geometric") return unbiased_pass(geometric, published, u);
  if (method.name == "alpha") return unbiased_pass(alpha, alpha.pmf(), u);
  return unbiased_pass(balanced, balanced.pmf(), u);
}

// Expected photons of a pass; of alpha, whose sum converges only on paper, over the levels that `total` can pay for.
double expected_photons(const PhotonMethod& method, double total) {
  const auto of = [](const GeometricRadii& schedule, const Geometric& pmf) {
    return schedule.photons * schedule.growth * pmf.mass(0) / (1 - schedule.growth * pmf.tail(1));
  };
  if (method.name == "disc" || method.name == "progressive") return photons_in_pass;
  if (method.name == "geometric") return of(geometric, published);
  if (method.name == "alpha") return photons_in_base * (1 + std::log(std::max(1.0, total / photons_in_base)));
  return of(balanced, balanced.pmf());
}

// ---- light

Vec reflected(const Vec& d, const Vec& normal) { return d - 2 * dot(d, normal) * normal; }

// The distance to the sphere from outside; infinity for a miss.
double to_sphere(const Vec& from, const Vec& d) {
  const Vec o = from - centre;
  const double b = dot(o, d);
  const double discriminant = b * b - dot(o, o) + radius * radius;
  if (!(discriminant > 0) || b > 0) return std::numeric_limits<double>::infinity();
  return -b - std::sqrt(discriminant);
}

// Reflectance of unpolarised light; the same from inside, under the refracted angle.
double fresnel(double cosine, double cosine_inside) {
  const double s = (cosine - glass * cosine_inside) / (cosine + glass * cosine_inside);
  const double p = (glass * cosine - cosine_inside) / (glass * cosine + cosine_inside);
  return 0.5 * (s * s + p * p);
}

// Calls land(x, y, power) for the light aimed at (x, y) of the floor. At each surface decide(reflectance, weight) gives
// the weights that are reflected and that pass: a photon takes one way, a quadrature both.
template <class Decide, class Land>
void follow(double x, double y, bool sphere, const Decide& decide, const Land& land) {
  const Vec aim{x - lamp.x, y - lamp.y, -lamp.z};
  const double distance = std::sqrt(dot(aim, aim));
  const double power = intensity * lamp.z / (distance * distance * distance);  // per area of the floor
  const Vec d = 1 / distance * aim;
  const double t = sphere ? to_sphere(lamp, d) : std::numeric_limits<double>::infinity();
  if (!(t < distance)) return land(x, y, power);

  const auto on_floor = [&](const Vec& from, const Vec& direction, double weight) {
    if (!(weight > 0) || !(direction.z < 0)) return;
    const double s = -from.z / direction.z;
    land(from.x + s * direction.x, from.y + s * direction.y, power * weight);
  };
  Vec p = lamp + t * d;
  Vec normal = 1 / radius * (p - centre);
  const double cosine = -dot(d, normal);
  const double cosine_inside = std::sqrt(1 - (1 - cosine * cosine) / (glass * glass));
  const double reflectance = fresnel(cosine, cosine_inside);
  auto [back, on] = decide(reflectance, 1.0);
  on_floor(p, reflected(d, normal), back);
  Vec inside = 1 / glass * d + (cosine / glass - cosine_inside) * normal;
  for (double weight = on; weight > 1e-6;) {  // photons have weight 1: their way ends by chance alone
    p = p + 2 * radius * cosine_inside * inside;
    normal = normalized(p - centre);  // grazing light goes round thousands of times: rounding must not add up
    p = centre + radius * normal;
    const auto [stay, leave] = decide(reflectance, weight);
    on_floor(p, glass * inside + (cosine - glass * cosine_inside) * normal, leave);
    inside = normalized(reflected(inside, normal));
    weight = stay;
  }
}

// ---- gathering: the points of the pixels are a grid, on which each photon finds those within its radius

class Points {
 public:
  Points(const PhotonPlan& plan, double offset_x, double offset_y)
      : width_(plan.width),
        height_(plan.height),
        step_x_(2 * half_window / plan.width),
        step_y_(2 * half_window / plan.height),
        from_x_(-half_window + step_x_ * offset_x),
        from_y_(half_window - step_y_ * offset_y) {}

  void add(double x, double y, const RadialKernel& kernel, double r, double weight, std::vector<double>& sums) const {
    const int first_x = std::max(0, whole(std::ceil((x - r - from_x_) / step_x_)));
    const int last_x = std::min(width_ - 1, whole(std::floor((x + r - from_x_) / step_x_)));
    const int first_y = std::max(0, whole(std::ceil((from_y_ - y - r) / step_y_)));
    const int last_y = std::min(height_ - 1, whole(std::floor((from_y_ - y + r) / step_y_)));
    for (int j = first_y; j <= last_y; ++j) {
      const double dy = from_y_ - step_y_ * j - y;
      double* row = &sums[static_cast<std::size_t>(j) * static_cast<std::size_t>(width_)];
      for (int i = first_x; i <= last_x; ++i) {
        const double dx = from_x_ + step_x_ * i - x;
        row[i] += weight * kernel(dx * dx + dy * dy);
      }
    }
  }

 private:
  static int whole(double x) { return static_cast<int>(std::clamp(x, -1e9, 1e9)); }

  int width_;
  int height_;
  double step_x_;
  double step_y_;
  double from_x_;
  double from_y_;
};

void add_pass(const PhotonMethod& method, const PhotonPlan& plan, const Stream& rng, const Pass& pass,
              std::vector<double>& sums) {
  const Kernel kernel = method.name == "disc" ? Kernel::disc : Kernel::epanechnikov;
  Stream photons = split_level(rng, pass.level);
  // One offset for all pixels: the mean over it is the mean over each pixel.
  const double offset_x = photons.uniform();
  const double offset_y = photons.uniform();
  const Points points(plan, offset_x, offset_y);
  const RadialKernel base(kernel, pass.base2);
  const RadialKernel fine(kernel, pass.weight > 0 ? pass.fine2 : 1);
  const RadialKernel coarse(kernel, pass.weight > 0 ? pass.coarse2 : 1);
  const double area = 4 * margin * margin;
  const auto decide = [&photons](double reflectance, double weight) {
    return photons.uniform() < reflectance ? std::pair(weight, 0.0) : std::pair(0.0, weight);
  };
  for (std::int64_t i = 0; i < pass.photons; ++i) {
    const double x = margin * (2 * photons.uniform() - 1);
    const double y = margin * (2 * photons.uniform() - 1);
    follow(x, y, plan.sphere, decide, [&](double fx, double fy, double power) {
      const double w = power * area;
      if (i < pass.base_photons) {
        points.add(fx, fy, base, std::sqrt(pass.base2), w / static_cast<double>(pass.base_photons), sums);
      }
      if (pass.weight == 0) return;
      const double weight = w * pass.weight / static_cast<double>(pass.photons);
      points.add(fx, fy, fine, std::sqrt(pass.fine2), weight, sums);
      points.add(fx, fy, coarse, std::sqrt(pass.coarse2), -weight, sums);
    });
  }
}

// A share of the passes, with sums of its own.
struct Group {
  std::vector<double> sums;
  std::int64_t passes = 0;
  double photons = 0;
};

}  // namespace

std::span<const PhotonMethod> photon_methods() { return all_photon_methods; }

std::string verdict_of(const PhotonMethod& method) {
  if (method.name == "balanced") return judge(balanced.rates(), balanced.pmf().tail_exponent()).sentence;
  if (method.name == "geometric") return judge(geometric.rates(), published.tail_exponent()).sentence;
  if (method.name == "alpha") return judge(alpha.rates(), alpha.pmf().tail_exponent()).sentence;
  return "";
}

PhotonRendering render(const PhotonMethod& method, const PhotonPlan& plan) {
  PhotonRendering r;
  r.image = Image(plan.width, plan.height);
  const auto start = std::chrono::steady_clock::now();
  const double passes = std::ceil(plan.photons / expected_photons(method, plan.photons));
  const auto in_group = std::max<std::int64_t>(1, static_cast<std::int64_t>(passes) / groups);
  // Slices over all groups, so that what an interrupt leaves is an image.
  const auto slices = static_cast<int>(std::clamp(plan.photons / 0x1p18, 1.0, 0x1p30));
  std::vector<Group> all(groups);
  for (Group& g : all) g.sums.resize(r.image.values.size());
  const auto layout = [&](auto& io, std::vector<Group>& state) {
    io.number(r.seconds);
    for (Group& g : state) {
      io.number(g.passes);
      io.number(g.photons);
      for (double& x : g.sums) io.number(x);
    }
  };
  plan.saving.take_up(all, layout);
  for (const Group& g : all) {
    if (g.passes < 0 || g.passes > in_group)
      throw std::invalid_argument("no checkpoint: the sums are of another image");
  }
  const double earlier_seconds = r.seconds;
  const auto seconds_now = [&] {
    return earlier_seconds + std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  for (int slice = 0; slice < slices && r.complete; ++slice) {
    const auto body = [&](int g) {
      Group& group = all[static_cast<std::size_t>(g)];
      const std::int64_t last = in_group * (slice + 1) / slices;
      for (; group.passes < last; ++group.passes) {
        const Stream rng(plan.seed, static_cast<std::uint64_t>(group.passes * groups + g));
        const Pass pass = pass_of(method, rng);
        add_pass(method, plan, rng, pass, group.sums);
        group.photons += static_cast<double>(pass.photons);
      }
    };
    const int fewer = in_parallel(groups, plan.threads, body, [&](int finished) {
      const double share = (slice + static_cast<double>(finished) / groups) / slices;
      if (plan.progress && !plan.progress(share)) r.complete = false;
      return r.complete;
    });
    if (fewer > 0) r.fewer_threads = fewer;
    r.seconds = seconds_now();
    plan.saving.keep(all, layout, slice == slices - 1 || !r.complete);
  }
  for (const Group& g : all) {
    r.passes += g.passes;
    r.photons += g.photons;
  }
  for (std::size_t i = 0; i < r.image.values.size(); ++i) {
    double total = 0;
    std::array<double, groups> means{};
    for (std::size_t g = 0; g < groups; ++g) {
      total += all[g].sums[i];
      means[g] = all[g].sums[i] / static_cast<double>(all[g].passes);
    }
    if (method.median) {
      std::sort(means.begin(), means.end());
      r.image.values[i] = static_cast<float>(0.5 * (means[groups / 2 - 1] + means[groups / 2]));
    } else {
      r.image.values[i] = static_cast<float>(total / static_cast<double>(r.passes));
    }
  }
  r.seconds = seconds_now();
  return r;
}

Image exact_irradiance(const PhotonPlan& plan) {
  const double step_x = 2 * half_window / plan.width;
  const double step_y = 2 * half_window / plan.height;
  const auto solid_angle = [](double x, double y) {  // of the rectangle from the lamp's foot to there
    x -= lamp.x;
    y -= lamp.y;
    return std::atan(x * y / (lamp.z * std::sqrt(x * x + y * y + lamp.z * lamp.z)));
  };
  std::vector<std::vector<double>> parts(groups, std::vector<double>(Image(plan.width, plan.height).values.size()));
  const auto body = [&](int g) {
    std::vector<double>& sums = parts[static_cast<std::size_t>(g)];
    for (int j = g; j < plan.height; j += groups) {
      for (int i = 0; i < plan.width; ++i) {
        const double x = -half_window + step_x * i;
        const double y = half_window - step_y * (j + 1);
        // How far from the sphere's centre the ray to the middle passes, and how far the others of the pixel.
        const Vec ray = normalized({x + step_x / 2 - lamp.x, y + step_y / 2 - lamp.y, -lamp.z});
        const Vec o = centre - lamp;
        const double passes_at = std::sqrt(std::max(0.0, dot(o, o) - dot(o, ray) * dot(o, ray)));
        if (!plan.sphere || passes_at > radius + step_x + step_y) {
          const double omega = (solid_angle(x + step_x, y + step_y) - solid_angle(x, y + step_y)) -
                               (solid_angle(x + step_x, y) - solid_angle(x, y));
          sums[static_cast<std::size_t>(j * plan.width + i)] += intensity * omega / (step_x * step_y);
          continue;
        }
        const int side = std::clamp(12288 / std::max(plan.width, plan.height), 8, 64);  // rays a pixel, each way
        const double share = 1.0 / side / side;
        const auto both = [](double reflectance, double weight) {
          return std::pair(reflectance * weight, (1 - reflectance) * weight);
        };
        for (int k = 0; k < side * side; ++k) {
          const double rx = x + step_x * (k % side + 0.5) / side;
          const double ry = y + step_y * (k / side + 0.5) / side;
          follow(rx, ry, true, both, [&](double fx, double fy, double power) {
            const double column = std::floor((fx + half_window) / step_x);
            const double row = std::floor((half_window - fy) / step_y);
            if (!(column >= 0 && row >= 0 && column < plan.width && row < plan.height)) return;
            sums[static_cast<std::size_t>(static_cast<int>(row) * plan.width + static_cast<int>(column))] +=
                power * share;
          });
        }
      }
    }
  };
  in_parallel(groups, plan.threads, body,
              [&](int finished) { return !plan.progress || plan.progress(static_cast<double>(finished) / groups); });
  Image image(plan.width, plan.height);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    double total = 0;
    for (const std::vector<double>& part : parts) total += part[i];
    image.values[i] = static_cast<float>(total);
  }
  return image;
}

}  // namespace debias::render

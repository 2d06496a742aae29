#include "transmittance.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <debias/core/estimator.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/truncated.hpp>

#include "parallel.hpp"

namespace debias::render {
namespace {

// Of the work of a walk or a series, the first unit is no look-up.
template <auto make, int no_lookups = 0>
void add_samples(const Ray<Path>& ray, std::uint64_t seed, std::uint64_t pixel, std::uint64_t pixels,
                 std::int64_t first, std::int64_t last, PixelSums& sums) {
  const auto estimator = make(ray);
  NullRecord record;
  for (std::int64_t s = first; s < last; ++s) {
    Stream rng(seed, pixel + pixels * static_cast<std::uint64_t>(s));
    const Sample<double> sample = draw_sample(estimator, rng, record);
    sums.sum += sample.value;
    sums.square += sample.value * sample.value;
    sums.lookups += sample.work - no_lookups;
  }
  sums.samples += last - first;
}

template <int level>
auto marching(const Ray<Path>& ray) {
  return truncated(telescoping(ray), level);
}
template <int level>
auto jittered(const Ray<Path>& ray) {
  return truncated(jittered_telescoping(ray), level);
}
auto cumulative(const Ray<Path>& ray) {
  return roulette(transmittance_series(ray), RunningWeight(std::exp(-ray.majorant * ray.length)));
}
auto cmf(const Ray<Path>& ray) {
  const double depth = ray.majorant * ray.length;
  return roulette(transmittance_series(ray), IndexRoulette(depth), {.base_level = poisson_quantile(depth, 0.99)});
}
template <int level>
auto telescope(const Ray<Path>& ray) {
  return single_term(telescoping(ray), {.base_level = level});
}
// About a mean of four fixed look-ups, which any number may take the place of.
auto residual(const Ray<Path>& ray) {
  double control = 0;
  for (const double share : {0.125, 0.375, 0.625, 0.875}) control += ray.extinction(share * ray.length) / 4;
  return residual_ratio_tracking(ray, control);
}

constexpr TransmittanceMethod all_transmittance_methods[] = {
    {"ray_marching", "g of 4 equidistant points with a random offset", true, add_samples<marching<2>>},
    {"jittered_ray_marching", "g of 4 jittered points", true, add_samples<jittered<2>>},
    {"delta_tracking", "1 without a real collision, else 0", false, add_samples<delta_tracking<Path>, 1>},
    {"ratio_tracking", "weights of null collisions", false,
     add_samples<static_cast<RatioTracking<Path> (*)(Ray<Path>)>(ratio_tracking<Path>), 1>},
    {"residual_ratio_tracking", "ratio tracking of the difference from a control", false, add_samples<residual, 1>},
    {"next_flight", "ratio tracking with the flight to the end at each collision", false,
     add_samples<next_flight<Path>, 1>},
    {"p_series_cumulative", "power series, roulette on the running weight", false, add_samples<cumulative, 1>},
    {"p_series_cmf", "power series, terms to the 99 % quantile, then roulette", false, add_samples<cmf, 1>},
    {"u_statistics", "pivoted power series of combs", false,
     add_samples<static_cast<decltype(u_statistics(std::declval<const Ray<Path>&>())) (*)(const Ray<Path>&)>(
         u_statistics<Path>)>},
    {"telescoping", "telescoping ray marching from 1 point", false, add_samples<telescope<0>>},
    {"telescoping_2", "telescoping ray marching from combs of 4 points", false, add_samples<telescope<2>>},
    {"telescoping_4", "telescoping ray marching from combs of 16 points", false, add_samples<telescope<4>>},
};

constexpr auto layout = [](auto& io, Rendering& r) {
  io.number(r.seconds);
  for (PixelSums& p : r.pixels) {
    io.number(p.sum);
    io.number(p.square);
    io.number(p.lookups);
    io.number(p.samples);
  }
};

}  // namespace

std::span<const TransmittanceMethod> transmittance_methods() { return all_transmittance_methods; }

double Rendering::lookups() const {
  double total = 0;
  for (const PixelSums& p : pixels) total += p.lookups;
  return total;
}

Rendering render(const Cloud& cloud, const TransmittanceMethod& method, const RenderPlan& plan) {
  // Passes over the whole image, so that what an interrupt leaves is an image.
  constexpr std::int64_t in_pass = 16;
  const auto passes = static_cast<int>((plan.samples + in_pass - 1) / in_pass);
  const auto pixels = static_cast<std::size_t>(plan.width) * static_cast<std::size_t>(plan.height);
  Rendering rendering;
  rendering.pixels.resize(pixels);
  plan.saving.take_up(rendering, layout);
  for (const PixelSums& p : rendering.pixels) {
    if (p.samples < 0 || p.samples > plan.samples || (p.samples % in_pass != 0 && p.samples != plan.samples)) {
      throw std::invalid_argument("no checkpoint: the sums are of another image");
    }
  }
  const double earlier_seconds = rendering.seconds;
  const auto start = std::chrono::steady_clock::now();
  for (int pass = 0; pass < passes && rendering.complete; ++pass) {
    const auto row = [&](int y) {
      for (int x = 0; x < plan.width; ++x) {
        const auto pixel =
            static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(plan.width) + static_cast<std::uint64_t>(x);
        PixelSums& sums = rendering.pixels[pixel];
        const std::int64_t last = std::min(plan.samples, in_pass * (pass + 1));
        if (sums.samples >= last) continue;  // of an earlier run
        const Path path = look(cloud, x, y, plan.width, plan.height).path;
        if (path.length() == 0) {  // past the box
          const auto n = static_cast<double>(last - sums.samples);
          sums = {sums.sum + n, sums.square + n, sums.lookups, last};
          continue;
        }
        const Ray ray(path, RayBounds{path.length(), cloud.majorant(), 0});
        method.add(ray, plan.seed, pixel, pixels, in_pass * pass, last, sums);
      }
    };
    const int fewer = in_parallel(plan.height, plan.threads, row, [&](int finished) {
      const double share = (pass + static_cast<double>(finished) / plan.height) / passes;
      if (plan.progress && !plan.progress(share)) rendering.complete = false;
      return rendering.complete;
    });
    if (fewer > 0) rendering.fewer_threads = fewer;
    rendering.seconds =
        earlier_seconds + std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    plan.saving.keep(rendering, layout, pass == passes - 1 || !rendering.complete);
  }
  return rendering;
}

std::int64_t samples_for(double seconds, const Cloud& cloud, const TransmittanceMethod& method, RenderPlan plan) {
  const double pixels = static_cast<double>(plan.width) * plan.height;
  plan.width = std::max(1, plan.width / 4);
  plan.height = std::max(1, plan.height / 4);
  plan.seed = ~plan.seed;
  plan.progress = nullptr;
  plan.saving = {};
  const double share = plan.width * plan.height / pixels;
  for (plan.samples = 16;; plan.samples *= 4) {
    const double needed = render(cloud, method, plan).seconds;
    if (needed < 0.03 * seconds && plan.samples < 1'000'000) continue;
    return std::max<std::int64_t>(
        1, static_cast<std::int64_t>(std::min(static_cast<double>(plan.samples) * share * seconds / needed, 1e9)));
  }
}

Image transmittance_of(const Rendering& rendering, const RenderPlan& plan) {
  Image image(plan.width, plan.height);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const PixelSums& p = rendering.pixels[i];
    image.values[i] = p.samples == 0 ? std::numeric_limits<float>::quiet_NaN()
                                     : static_cast<float>(p.sum / static_cast<double>(p.samples));
  }
  return image;
}

Image exact_image(const Cloud& cloud, const RenderPlan& plan) {
  Image image(plan.width, plan.height);
  const auto row = [&](int y) {
    for (int x = 0; x < plan.width; ++x) {
      const Path path = look(cloud, x, y, plan.width, plan.height).path;
      image.values[image.at(x, y)] = static_cast<float>(exact_transmittance(path));
    }
  };
  in_parallel(plan.height, plan.threads, row, [&](int finished) {
    return !plan.progress || plan.progress(static_cast<double>(finished) / plan.height);
  });
  return image;
}

Image background_of(const Cloud& cloud, const RenderPlan& plan) {
  Image image(plan.width, plan.height, 3);
  for (int y = 0; y < plan.height; ++y) {
    for (int x = 0; x < plan.width; ++x) {
      const Pixel pixel = look(cloud, x, y, plan.width, plan.height);
      for (int c = 0; c < 3; ++c) image.values[image.at(x, y, c)] = pixel.background[static_cast<std::size_t>(c)];
    }
  }
  return image;
}

Image composed(const Image& background, const Image& transmittance) {
  Image image = background;
  for (std::size_t i = 0; i < image.values.size(); ++i) image.values[i] *= transmittance.values[i / 3];
  return image;
}

}  // namespace debias::render

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "catch_shim.hpp"
#include "commands/render.hpp"
#include "render/image.hpp"

#include "render/photons.hpp"

using namespace debias::render;

namespace {

const PhotonMethod& method_named(const char* name) { return debias::commands::photon_method(name); }

PhotonPlan plan_of(int size, double photons, bool sphere, std::uint64_t seed = 1) {
  PhotonPlan plan;
  plan.width = size;
  plan.height = size;
  plan.photons = photons;
  plan.sphere = sphere;
  plan.seed = seed;
  return plan;
}

double mean_of(const Image& image) {
  double total = 0;
  for (const float v : image.values) total += static_cast<double>(v);
  return total / static_cast<double>(image.values.size());
}

double relative_error(const Image& image, const Image& exact) {
  double square = 0;
  for (std::size_t i = 0; i < exact.values.size(); ++i) {
    square += std::pow(static_cast<double>(image.values[i]) - static_cast<double>(exact.values[i]), 2);
  }
  return std::sqrt(square / static_cast<double>(exact.values.size())) / mean_of(exact);
}

}  // namespace

TEST_CASE("the irradiance of the lamp alone is that of its cosine and distance", "[render][exact]") {
  const Image image = exact_irradiance(plan_of(300, 1, false));
  for (const int i : {0, 57, 150, 299}) {
    const double x = -1.5 + 0.01 * (i + 0.5);  // on the diagonal from the lower left corner
    const double d2 = (x - 1.3) * (x - 1.3) + (x + 1) * (x + 1) + 4;
    const double irradiance = 10 / (4 * std::numbers::pi) * 2 / std::pow(d2, 1.5);
    CHECK(image.values[image.at(i, 299 - i)] == Approx(irradiance).epsilon(1e-4));
  }
}

TEST_CASE("photons on the floor of the lamp alone come to its irradiance, pixel by pixel", "[render][statistical]") {
  const Image exact = exact_irradiance(plan_of(32, 1, false));
  for (const char* name : {"disc", "progressive", "balanced", "median_of_means"}) {
    CAPTURE(name);
    const auto error = [&](double photons) {
      return relative_error(render(method_named(name), plan_of(32, photons, false)).image, exact);
    };
    const double few = error(1e6);
    const double many = error(1.6e7);
    CHECK(many < 0.55 * few);  // 16 times the photons: 16^(-1/3) = 0.4, and 0.25 for disc
    CHECK(many < 0.2);
  }
}

TEST_CASE("the light on the floor is that of the quadrature, with the sphere and without",
          "[render][statistical][stat]") {
  // A kernel moves light, and takes none away except over the edge of the window.
  for (const bool sphere : {false, true}) {
    const double truth = mean_of(exact_irradiance(plan_of(128, 1, sphere)));
    for (const char* name : {"disc", "progressive", "balanced"}) {
      double sum = 0;
      double square = 0;
      constexpr int repeats = 16;
      for (std::uint64_t seed = 1; seed <= repeats; ++seed) {
        const double mean = mean_of(render(method_named(name), plan_of(128, 1e5, sphere, seed)).image);
        sum += mean / repeats;
        square += mean * mean / repeats;
      }
      const double error = std::sqrt((square - sum * sum) / (repeats - 1));
      CAPTURE(name, sphere, sum, truth, error);
      CHECK(std::abs(sum - truth) < 4.5 * error);
      CHECK(error < 0.01 * truth);
      CHECK(std::abs(sum - 1.06 * truth) > 4.5 * error);
    }
  }
}

TEST_CASE("photons give the same bits for any number of threads, and keep what an interrupt leaves",
          "[render][exact]") {
  for (const PhotonMethod& method : photon_methods()) {
    PhotonPlan plan = plan_of(24, 1e5, true, 3);
    plan.threads = 1;
    const std::vector<float> one = render(method, plan).image.values;
    for (const int threads : {2, 3, 7}) {
      plan.threads = threads;
      CHECK(render(method, plan).image.values == one);
    }
  }
  PhotonPlan plan = plan_of(24, 4e6, false);
  plan.progress = [](double share) { return share < 0.5; };
  const PhotonRendering part = render(method_named("disc"), plan);
  CHECK_FALSE(part.complete);
  CHECK(part.passes > 0);
  CHECK(part.photons < 3e6);
  plan.progress = nullptr;
  CHECK(relative_error(part.image, exact_irradiance(plan)) < 0.1);
}

TEST_CASE("every unbiased method of photons carries its verdict", "[render][exact]") {
  for (const PhotonMethod& method : photon_methods()) {
    CAPTURE(method.name);
    CHECK(method.biased == verdict_of(method).empty());
    if (!method.biased) CHECK_THAT(verdict_of(method), Catch::Contains("variance INFINITE"));
  }
  CHECK_THROWS_WITH(method_named("balancd"), Catch::Contains("did you mean 'balanced'"));
}

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include <boost/math/distributions/normal.hpp>

#include "catch_shim.hpp"
#include "commands/render.hpp"
#include "render/cloud.hpp"
#include "render/image.hpp"

#include "render/transmittance.hpp"

using namespace debias;
using namespace debias::render;

namespace {

const TransmittanceMethod& method_named(const char* name) { return debias::commands::transmittance_method(name); }

constexpr double density = 3;

RenderPlan plan_of(int size, std::int64_t samples, std::uint64_t seed) {
  RenderPlan plan;
  plan.width = size;
  plan.height = size;
  plan.samples = samples;
  plan.seed = seed;
  return plan;
}

struct Pixels {
  std::int64_t tested = 0;
  std::int64_t accepted = 0;
  bool finite = true;
  [[nodiscard]] bool pass() const {
    return finite && static_cast<double>(accepted) >= 0.9975 * static_cast<double>(tested);
  }
};

// Each pixel that the cloud dims against quadrature, with the variance of a run from another seed, at a
// false-alarm rate of 0.01 for the whole image. Of delta tracking, which is 0 or 1, those where 1024 samples
// hold fewer than 25 of either are underpowered: no normal law yet.
Pixels z_test(const TransmittanceMethod& method, const Cloud& cloud) {
  const RenderPlan plan = plan_of(52, 1024, 1);
  const Rendering r = render::render(cloud, method, plan);
  const Rendering other = render::render(cloud, method, plan_of(52, 1024, 2));
  std::vector<double> z;
  Pixels pixels;
  for (int y = 0; y < plan.height; ++y) {
    for (int x = 0; x < plan.width; ++x) {
      const double truth = exact_transmittance(look(cloud, x, y, plan.width, plan.height).path);
      if (!(truth < 1 - 1e-6)) continue;
      if (method.name == "delta_tracking" && 1024 * std::fmin(truth, 1 - truth) < 25) continue;
      const auto i = static_cast<std::size_t>(y * plan.width + x);
      const auto n = static_cast<double>(other.pixels[i].samples);
      const double mean = other.pixels[i].sum / n;
      const double variance = (other.pixels[i].square / n - mean * mean) * n / (n - 1);
      const double error = std::fmax(std::sqrt(std::fmax(variance, 0) / 1024), 1e-8);  // of the quadrature
      z.push_back((r.pixels[i].sum / 1024 - truth) / error);
      pixels.finite = pixels.finite && std::isfinite(z.back());
    }
  }
  pixels.tested = static_cast<std::int64_t>(z.size());
  const double each = -std::expm1(std::log1p(-0.01) / static_cast<double>(z.size()));
  const double limit = boost::math::quantile(complement(boost::math::normal(), each / 2));
  for (const double one : z) pixels.accepted += std::abs(one) <= limit ? 1 : 0;
  return pixels;
}

// In three parts, so that none takes long.
void check_methods(std::size_t part) {
  const Cloud cloud(density);
  for (std::size_t i = part; i < transmittance_methods().size(); i += 3) {
    const TransmittanceMethod& method = transmittance_methods()[i];
    const Pixels pixels = z_test(method, cloud);
    CAPTURE(method.name, pixels.tested, pixels.accepted);
    CHECK(pixels.tested > 500);
    CHECK(pixels.finite);
    CHECK(pixels.pass() == !method.biased);
  }
}

}  // namespace

TEST_CASE("each pixel agrees with quadrature for every unbiased estimator, and not for ray marching",
          "[render][statistical][stat]") {
  check_methods(0);
}
TEST_CASE("each pixel agrees with quadrature, second part", "[render][statistical][stat]") { check_methods(1); }
TEST_CASE("each pixel agrees with quadrature, third part", "[render][statistical][stat]") { check_methods(2); }

TEST_CASE("an image has the same bits for any number of threads, and the samples of a longer run", "[render][exact]") {
  const Cloud cloud(density);
  const TransmittanceMethod& method = method_named("telescoping");
  RenderPlan plan = plan_of(24, 40, 7);
  plan.threads = 1;
  const std::vector<float> one = transmittance_of(render::render(cloud, method, plan), plan).values;
  for (const int threads : {2, 3, 7}) {
    plan.threads = threads;
    CHECK(transmittance_of(render::render(cloud, method, plan), plan).values == one);
  }
  plan.seed = 8;
  CHECK(transmittance_of(render::render(cloud, method, plan), plan).values != one);
}

TEST_CASE("a rendering that is stopped keeps the samples that are complete", "[render][exact]") {
  const Cloud cloud(density);
  RenderPlan plan = plan_of(16, 64, 1);
  plan.threads = 1;
  const TransmittanceMethod& method = method_named("ratio_tracking");
  plan.progress = [](double share) { return share < 0.4; };
  const Rendering part = render::render(cloud, method, plan);
  CHECK_FALSE(part.complete);
  plan.progress = nullptr;
  plan.samples = 16;
  const Rendering first = render::render(cloud, method, plan);
  CHECK(part.pixels.front().samples == 32);
  CHECK(part.pixels.back().samples == 16);
  CHECK(part.pixels.back().sum == first.pixels.back().sum);
  plan.progress = [](double) { return false; };
  const Image nothing = transmittance_of(render::render(cloud, method, plan), plan);
  CHECK(std::isnan(nothing.values.front()));
}

TEST_CASE("a grid is interpolated between the middles of its voxels, and bounded by its largest number",
          "[render][exact]") {
  const Cloud cloud({1, 3, 1, 3, 1, 3, 1, 3}, {2, 2, 2}, 2);
  CHECK(cloud.majorant() == 6);
  CHECK(cloud({-0.5, 0.3, 0.1}) == Approx(2));
  CHECK(cloud({0.5, 0.3, 0.1}) == Approx(6));
  CHECK(cloud({0, -0.9, 0.9}) == Approx(4));
  CHECK(cloud({1, 1, 1}) == Approx(6));
  CHECK(Cloud({5}, {1, 1, 1}, 1)({0.2, 0, 0}) == Approx(5));
  CHECK_THROWS_WITH(Cloud({1, 2}, {2, 2, 2}, 1), Catch::Contains("2x2x2"));
  CHECK_THROWS_WITH(Cloud({-1}, {1, 1, 1}, 1), Catch::Contains("number 0"));
  CHECK_THROWS_AS(Cloud({std::numeric_limits<float>::quiet_NaN()}, {1, 1, 1}, 1), std::invalid_argument);
  CHECK_THROWS_WITH(Cloud({0}, {1, 1, 1}, 1), Catch::Contains("nothing to see"));

  const Cloud fractal(density);  // its bound holds, and it is gone at the faces of the box
  Stream rng(1, 0);
  for (int i = 0; i < 100'000; ++i) {
    Vec p;
    for (double* c : {&p.x, &p.y, &p.z}) *c = 2 * rng.uniform() - 1;
    const double mu = fractal(p);
    if (!(mu >= 0 && mu <= fractal.majorant())) FAIL("density " << mu);
  }
}

TEST_CASE("quadrature of a path is that of its segments", "[render][exact]") {
  const Cloud cloud(std::vector<float>(8, 1.0F), {2, 2, 2}, 0.5);  // constant
  for (const int x : {20, 32, 40}) {
    const Path path = look(cloud, x, 30, 64, 64).path;
    CHECK(exact_transmittance(path) == Approx(std::exp(-0.5 * path.length())));
  }
  CHECK(look(cloud, 0, 0, 64, 64).path.length() == 0);
}

TEST_CASE("images as files: linear numbers from the bottom, bytes of an sRGB curve, no NaN hidden", "[render][exact]") {
  Image image(2, 1);
  image.values = {0.5F, std::numeric_limits<float>::quiet_NaN()};
  const std::string pfm = to_pfm(image);
  CHECK(pfm.rfind("Pf\n2 1\n-1.0\n", 0) == 0);
  CHECK(pfm.size() == 12 + 8);
  CHECK(to_png(image, 1).substr(1, 3) == "PNG");
  Image rows(1, 2);
  rows.values = {1, 2};
  CHECK(to_pfm(rows).substr(12) == to_pfm(Image(rows)).substr(12));
  const float bottom = 2;
  CHECK(to_pfm(rows).substr(12, 4) == std::string(reinterpret_cast<const char*>(&bottom), 4));
}

TEST_CASE("an estimator of transmittance by a wrong name is refused with the nearest", "[render][exact]") {
  CHECK_THROWS_WITH(method_named("ratio_trackin"), Catch::Contains("did you mean 'ratio_tracking'"));
}

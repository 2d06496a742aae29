#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/diagnostics.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/photon.hpp>

using namespace debias;

namespace {

constexpr double flux = 10;

// A point light, uniform over the hemisphere, at height 1 above a plane; the point lies at a distance from its foot.
struct Hemisphere {
  double from_foot;
  Photon operator()(Stream& rng) const {
    const double cosine = rng.uniform();
    const double at = std::sqrt(1 - cosine * cosine) / cosine;
    const double angle = 2 * std::numbers::pi * rng.uniform();
    return {at * at + from_foot * from_foot - 2 * at * from_foot * std::cos(angle), flux};
  }
  [[nodiscard]] double irradiance() const {
    return flux / (2 * std::numbers::pi) * std::pow(1 + from_foot * from_foot, -1.5);
  }
};

// E of the disc estimate at the foot.
double disc_mean(double radius2) { return flux * (1 - 1 / std::sqrt(1 + radius2)) / (std::numbers::pi * radius2); }

constexpr double points[] = {0, 0.5, 1};

template <class E>
double z(const E& estimator, double truth, std::int64_t samples) {
  const auto r = estimate(estimator, {.samples = samples, .seed = 5});
  return (r.mean - truth) / r.standard_error;
}

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

// Least squares of log2 y against the index of y.
double slope(const std::vector<double>& y) {
  double top = 0;
  double bottom = 0;
  const double middle = static_cast<double>(y.size() - 1) / 2;
  for (std::size_t i = 0; i < y.size(); ++i) {
    const double d = static_cast<double>(i) - middle;
    top += d * std::log2(y[i]);
    bottom += d * d;
  }
  return top / bottom;
}

}  // namespace

TEST_CASE("kernels integrate to 1 and end at the radius", "[photon][exact]") {
  for (const Kernel kernel : {Kernel::disc, Kernel::cone, Kernel::epanechnikov}) {
    constexpr double radius2 = 0.7;
    constexpr int n = 100'000;
    double sum = 0;  // over d^2, of area pi per unit
    for (int i = 0; i < n; ++i) sum += RadialKernel(kernel, radius2)(radius2 * (i + 0.5) / n);
    CHECK(sum * std::numbers::pi * radius2 / n == Approx(1).epsilon(1e-6));
    CHECK(RadialKernel(kernel, radius2)(radius2 * (1 + 1e-15)) == 0);
  }
}

TEST_CASE("levels have the means of their discs, and differences those of two", "[photon][statistical]") {
  const GeometricRadii radii{1, 4, 2, 4};
  const auto levels = photon_levels(Hemisphere{0}, radii, {Kernel::disc});
  for (std::int64_t k = 0; k <= 3; ++k) {
    CAPTURE(k);
    const double fine = disc_mean(radii.radius2(k));
    const double coarse = disc_mean(2 * radii.radius2(k));
    CHECK(std::abs(z([&](Stream& rng) { return levels(k, rng).value; }, fine, 20'000)) < 5.1);
    if (k == 0) continue;
    CHECK(std::abs(z([&](Stream& rng) { return levels(k, rng).difference; }, fine - coarse, 20'000)) < 5.1);
    const auto shared = [&](Stream& rng) { return levels.shared(k, 0, rng).base; };
    CHECK(std::abs(z(shared, disc_mean(1), 20'000)) < 5.1);
  }
}

TEST_CASE("a PMF of finite variance makes photon levels unbiased at three points, for all kernels",
          "[photon][statistical][stat]") {
  // Its work has no mean: a few hundred samples are what one can pay for.
  const Geometric pmf = Geometric::with_exponent(1.5);
  for (const double at : points) {
    const Hemisphere light{at};
    for (const Kernel kernel : {Kernel::disc, Kernel::cone, Kernel::epanechnikov}) {
      CAPTURE(at, static_cast<int>(kernel));
      const auto levels = photon_levels(light, GeometricRadii{1, 4}, {kernel});
      CHECK(std::abs(z(single_term(levels, pmf), light.irradiance(), 400)) < 5.1);
    }
    // The same test finds the bias of the base.
    const auto base = [levels = photon_levels(light, GeometricRadii{1, 4})](Stream& rng) {
      return levels(0, rng).value;
    };
    CHECK(std::abs(z(base, light.irradiance(), 400'000)) > 5.1);
  }
}

TEST_CASE("the mean square error of progressive photons falls like N^(-2/3)", "[photon][statistical][stat]") {
  for (const double at : points) {
    const Hemisphere light{at};
    const auto progressive = progressive_photons(light, {.radius = 0.8, .photons = 16});
    std::vector<double> errors;
    constexpr int repeats = 200;
    for (std::int64_t n = 64; n <= 4096; n *= 2) {
      double square = 0;
      for (std::uint64_t seed = 1; seed <= repeats; ++seed) {
        const double e = estimate(progressive, {.samples = n, .seed = seed}).mean - light.irradiance();
        square += e * e / repeats;
      }
      errors.push_back(square);
    }
    CAPTURE(at, errors);
    CHECK(slope(errors) == Approx(-2.0 / 3).margin(0.1));
  }
}

TEST_CASE("the error of balanced unbiased photons falls like work^(-1/3)", "[photon][statistical][stat]") {
  for (const double at : points) {
    const Hemisphere light{at};
    const GeometricRadii radii{0.8, 1};
    const auto unbiased = single_term(photon_levels(light, radii), radii.pmf());
    std::vector<double> errors;
    for (std::int64_t n = 64; n <= 2048; n *= 2) {
      std::vector<double> distances;
      for (std::uint64_t seed = 1; seed <= 200; ++seed) {
        distances.push_back(std::abs(estimate(unbiased, {.samples = n, .seed = seed}).mean - light.irradiance()));
      }
      errors.push_back(median(distances));
    }
    CAPTURE(at, errors);
    CHECK(slope(errors) == Approx(-1.0 / 3).margin(0.1));
  }
}

TEST_CASE("no schedule has finite variance and finite work, and the verdict says so", "[photon][exact]") {
  for (const double shrink : {1.5, 2.0, 4.0}) {
    for (const double growth : {1.2, 2.8, 8.0, 64.0})
      CHECK_FALSE(pmf_exists(GeometricRadii{1, 1, shrink, growth}.rates()));
  }
  const GeometricRadii balanced{1, 1};
  const DeclaredFiniteness v = judge(balanced.rates(), balanced.pmf().tail_exponent());
  CHECK_FALSE(v.finite_variance);
  CHECK(v.finite_work);
  CHECK(v.highest_moment() == Approx(3.25 / 2.25));
  CHECK(v.highest_moment() < 1.5);

  for (const double c : {0.0, 0.4, 0.6, 1.0, 1.2}) CHECK_FALSE(pmf_exists(AlphaRadii{1, 1, 2.0 / 3, c}.rates()));
  const AlphaRadii published{1, 1};
  const DeclaredFiniteness alpha = judge(published.rates(), published.pmf().tail_exponent());
  CHECK_FALSE(alpha.finite_variance);
  CHECK(alpha.finite_work);
  CHECK(alpha.highest_moment() == Approx(1).margin(1e-3));
  const AlphaRadii other_side{1, 1, 2.0 / 3, 0.499};
  const DeclaredFiniteness v2 = judge(other_side.rates(), other_side.pmf().tail_exponent());
  CHECK(v2.finite_variance);
  CHECK_FALSE(v2.finite_work);
}

TEST_CASE("a schedule without E|Z| is refused without the flag", "[photon][exact]") {
  const Hemisphere light{0};
  CHECK_THROWS_WITH(photon_levels(light, AlphaRadii{}), Catch::Contains("allow_infinite_mean"));
  CHECK_THROWS_WITH(photon_levels(light, GeometricRadii{1, 1, 2, 2}), Catch::Contains("growth = shrink^3"));
  CHECK_NOTHROW(photon_levels(light, AlphaRadii{}, {.allow_infinite_mean = true}));
  CHECK_NOTHROW(photon_levels(light, AlphaRadii{.c = 0.5}));
  CHECK_NOTHROW(photon_levels(light, GeometricRadii{}));
  CHECK_THROWS_WITH(single_term(photon_levels(light, GeometricRadii{})), Catch::Contains("no PMF"));
}

TEST_CASE("the PMF of the alpha schedule keeps the mean of a weighted difference constant", "[photon][exact]") {
  const AlphaRadii radii{0.125, 1};
  const RadiusPmf pmf = radii.pmf();
  for (const std::int64_t k : {1, 7, 100}) {
    CHECK((radii.radius2(k - 1) - radii.radius2(k)) / pmf.mass(k - 1) == Approx(0.125 * 0.125));
  }
}

TEST_CASE("impossible schedules are refused, in words", "[photon][exact]") {
  const Hemisphere light{0};
  CHECK_THROWS_WITH(photon_levels(light, GeometricRadii{0, 1}), Catch::Contains("radius = 0"));
  CHECK_THROWS_WITH(photon_levels(light, GeometricRadii{1, 0}), Catch::Contains("photons = 0"));
  CHECK_THROWS_WITH(photon_levels(light, GeometricRadii{1, 1, 1, 8}), Catch::Contains("shrink = 1"));
  CHECK_THROWS_WITH(photon_levels(light, AlphaRadii{1, 1, 1}), Catch::Contains("alpha = 1"));
  CHECK_THROWS_WITH(progressive_photons(light, {.alpha = 0}), Catch::Contains("alpha = 0"));
  CHECK_THROWS_AS(GeometricRadii{}.photons_at(40), std::length_error);
}

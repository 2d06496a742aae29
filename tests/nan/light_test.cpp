// NaN and infinity from media and photon sources.

#include <cmath>

#include "faults.hpp"

#include <debias/functions.hpp>
#include <debias/photon.hpp>
#include <debias/transmittance.hpp>

using namespace debias;
using namespace debias::faults;

TEST_CASE("no estimator of transmittance hides a NaN or an infinite extinction", "[nan][exact]") {
  using Infinity::has_a_limit;
  const Ray ray([](double t) { return bad(1 + 0.5 * std::sin(3 * t)); }, RayBounds{2, 1.6, 0.4});
  check("delta_tracking", "extinction", delta_tracking(ray));
  check("ratio_tracking", "extinction", ratio_tracking(ray));
  check("residual_ratio_tracking", "extinction", residual_ratio_tracking(ray));
  check("residual_ratio_tracking", "extinction", residual_ratio_tracking(ray, 1));
  check("residual_ratio_tracking", "extinction between equal bounds",
        residual_ratio_tracking(Ray([](double) { return bad(1); }, RayBounds{2, 1, 1})));
  check("next_flight", "extinction", next_flight(ray));
  check("denser", "extinction", ratio_tracking(denser(ray, 2)));
  check("optical_depth", "extinction", optical_depth(ray));
  check_terms("transmittance_series", "extinction", transmittance_series(ray));
  check_terms("transmittance_series", "extinction", transmittance_series(ray, functions::Davis{0.5}));
  check("u_statistics", "extinction", u_statistics(ray));
  check("u_statistics", "extinction", u_statistics(ray, functions::Davis{0.5}, 4, Geometric(0.5)));
  check_sequence("telescoping", "extinction", telescoping(ray), has_a_limit);
  check_sequence("telescoping", "extinction", telescoping(ray, functions::Log{}));
  check_sequence("jittered_telescoping", "extinction", jittered_telescoping(ray), has_a_limit);
  check_sequence("jittered_telescoping", "extinction", jittered_telescoping(ray, functions::Log{}));
  check("davis_mixture", "the extinction of what make returns",
        davis_mixture(0.5, [ray](double m) { return next_flight(denser(ray, m)); }));
}

TEST_CASE("no density of photons hides a NaN or an infinite power", "[nan][exact]") {
  using Infinity::has_a_limit;
  const auto power = [](Stream& rng) { return Photon{2 * rng.uniform(), bad(1)}; };
  const auto distance = [](Stream& rng) { return Photon{bad(2 * rng.uniform()), 1}; };
  for (const Kernel kernel : {Kernel::disc, Kernel::cone, Kernel::epanechnikov}) {
    const GeometricRadii radii{.radius = 1, .photons = 2};
    check_sequence("photon_levels", "power", photon_levels(power, radii, {.kernel = kernel}));
    check_sequence("photon_levels", "distance2", photon_levels(distance, radii, {.kernel = kernel}), has_a_limit);
    check("progressive_photons", "power", progressive_photons(power, {.photons = 4, .kernel = kernel}));
    check("progressive_photons", "distance2", progressive_photons(distance, {.photons = 4, .kernel = kernel}),
          has_a_limit);
    CHECK_THROWS_AS(RadialKernel(kernel, 1)(poisons[0]), std::domain_error);
    CHECK_THROWS_AS(RadialKernel(kernel, 1)(-0.5), std::domain_error);
    CHECK(RadialKernel(kernel, 1)(poisons[1]) == 0);
  }
  const AlphaRadii alpha{.photons = 3};
  check_sequence("photon_levels", "power", photon_levels(power, alpha, {.allow_infinite_mean = true}));
}

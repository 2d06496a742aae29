#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include <boost/math/quadrature/gauss_kronrod.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/transmittance.hpp>

using namespace debias;
using laws::estimator_laws;
using laws::Failures;

namespace {

// A bent medium that is not periodic, and one with a kink at the edge of a cloud.
struct Bent {
  static constexpr RayBounds bounds{2, 1.5, 0.05};
  double operator()(double t) const { return 0.8 + 0.5 * std::sin(3 * t) + 0.1 * t; }
};
struct Kinked {
  static constexpr double kink = 0.4;
  static constexpr RayBounds bounds{1.5, 2.4, 0.2};
  double operator()(double t) const { return 0.2 + 2 * std::fmax(0, t - kink); }
};

template <class F>
Ray<F> ray_through(F mu) {
  return Ray(mu, F::bounds);
}

template <class F>
double depth(const F& mu) {
  using Quadrature = boost::math::quadrature::gauss_kronrod<double, 31>;
  return Quadrature::integrate(mu, 0, Kinked::kink, 10, 1e-13) +
         Quadrature::integrate(mu, Kinked::kink, F::bounds.length, 10, 1e-13);
}

template <class F>
auto p_series_cumulative(const Ray<F>& ray) {
  return roulette(transmittance_series(ray), RunningWeight(std::exp(-ray.majorant * ray.length)));
}
template <class F>
auto p_series_cmf(const Ray<F>& ray) {
  const double residual = std::fmax((ray.majorant - ray.minorant) * ray.length, 1e-3);
  return roulette(transmittance_series(ray), IndexRoulette(residual), {.base_level = poisson_quantile(residual, 0.99)});
}

// use(name, make) for every unbiased estimator of exp(-tau): make(ray) is the estimator.
template <class Use>
void each_exponential(const Use& use) {
  use("delta_tracking", [](const auto& ray) { return delta_tracking(ray); });
  use("ratio_tracking", [](const auto& ray) { return ratio_tracking(ray); });
  use("residual_ratio_tracking", [](const auto& ray) { return residual_ratio_tracking(ray); });
  use("residual_ratio_tracking about the middle",
      [](const auto& ray) { return residual_ratio_tracking(ray, (ray.majorant + ray.minorant) / 2); });
  use("next_flight", [](const auto& ray) { return next_flight(ray); });
  use("p_series_cumulative", [](const auto& ray) { return p_series_cumulative(ray); });
  use("p_series_cmf", [](const auto& ray) { return p_series_cmf(ray); });
  use("u_statistics", [](const auto& ray) { return u_statistics(ray); });
  for (const std::int64_t m : {0, 1, 3}) {
    use("telescoping from base level " + std::to_string(m),
        [m](const auto& ray) { return single_term(telescoping(ray), {.base_level = m}); });
  }
}

// use(name, estimator) for those that know g themselves.
template <class F, class G, class Use>
void each_of(const Ray<F>& ray, const G& g, const Use& use) {
  use("telescoping, 0", single_term(telescoping(ray, g)));
  use("telescoping, 2", single_term(telescoping(ray, g), {.base_level = 2}));
  use("u_statistics", u_statistics(ray, g, 4, Geometric(0.5)));
  use("series", roulette(transmittance_series(ray, g), Geometric(0.15)));
}

template <class E>
double z(const E& estimator, double truth, std::int64_t samples = 1 << 16) {
  const auto r = estimate(estimator, {.samples = samples, .seed = 11});
  return (r.mean - truth) / r.standard_error;
}

template <class F>
void check_exponential(const F& mu) {
  const double truth = std::exp(-depth(mu));
  each_exponential([&](const std::string& name, const auto& make) {
    CAPTURE(name);
    CHECK(estimator_laws(make(ray_through(mu)), truth) == Failures{});
  });
}

template <class F>
void check_mixture(const F& mu) {
  for (const double c : {0.4, 1.3}) {
    const double truth = functions::Davis{c}(depth(mu));
    each_exponential([&](const std::string& name, const auto& make) {
      CAPTURE(name, c);
      const auto mixture = davis_mixture(c, [&, ray = ray_through(mu)](double m) { return make(denser(ray, m)); });
      CHECK(std::abs(z(mixture, truth)) < 4.5);
      if (name == "ratio_tracking") CHECK(std::abs(z(mixture, truth * 1.05)) > 4.5);
    });
  }
}

template <class F>
void check_direct(const F& mu) {
  const double tau = depth(mu);
  const auto check = [&](const auto& g) {
    each_of(ray_through(mu), g, [&](const std::string& name, const auto& estimator) {
      CAPTURE(name, g(tau));
      CHECK(std::abs(z(estimator, g(tau))) < 4.5);
    });
  };
  check(functions::Davis{0.5});
  check(power_law(2));
  CHECK(power_law(2)(tau) == Approx(std::pow(1 + tau / 2, -2)));
  CHECK(std::abs(z(single_term(telescoping(ray_through(mu), functions::Power{-2}), {.base_level = 2}),
                   std::pow(tau, -2))) < 4.5);
}

}  // namespace

TEST_CASE("every estimator of exp(-tau) is unbiased and honest in a bent and in a kinked medium",
          "[transmittance][statistical]") {
  check_exponential(Bent{});
  check_exponential(Kinked{});
}

TEST_CASE("every estimator of exp(-tau) serves the Davis law through its gamma mixture",
          "[transmittance][statistical]") {
  check_mixture(Bent{});
  check_mixture(Kinked{});
}

TEST_CASE("Davis and power laws by their own series and levels", "[transmittance][statistical]") {
  check_direct(Bent{});
  check_direct(Kinked{});
}

TEST_CASE("ray marching is rejected by the same test, with offsets and with jitter", "[transmittance][statistical]") {
  const auto check = [](const auto& mu) {
    const double truth = std::exp(-depth(mu));
    const auto ray = ray_through(mu);
    CHECK(std::abs(z(truncated(telescoping(ray), 0), truth)) > 4.5);
    CHECK(std::abs(z(truncated(jittered_telescoping(ray), 0), truth)) > 4.5);
    CHECK(std::abs(z(truncated(telescoping(ray), 12), truth, 1024)) < 4.5);  // and its bias ends
  };
  check(Bent{});
  check(Kinked{});
}

TEST_CASE("a constant medium leaves no variance to residuals, U-statistics and combs", "[transmittance][exact]") {
  const Ray ray([](double /*t*/) { return 0.7; }, {2, 0.7, 0.7});
  const double truth = std::exp(-1.4);
  for (std::int64_t i = 0; i < 100; ++i) {
    CHECK(trace(residual_ratio_tracking(ray), 1, i).sample.value == Approx(truth).epsilon(1e-14));
    CHECK(trace(u_statistics(ray), 1, i).sample.value == Approx(truth).epsilon(1e-14));
    CHECK(trace(single_term(telescoping(ray)), 1, i).sample.value == Approx(truth).epsilon(1e-14));
    CHECK(trace(p_series_cmf(ray), 1, i).sample.value == Approx(truth).epsilon(1e-14));
  }
}

TEST_CASE("ratio tracking has the variance of its formula, a majorant too low leaves it unbiased",
          "[transmittance][statistical]") {
  const auto variance_is = [](const auto& ray, double second, double fourth, double truth) {
    const auto r = estimate(ratio_tracking(ray), {.samples = 1 << 18, .seed = 3});
    const double a = ray.majorant * ray.length;
    const double square = std::exp(-a + second / a);           // E Z^2
    const double power = std::exp(-a + fourth / (a * a * a));  // E Z^4
    const auto n = static_cast<double>(r.samples);
    const double variance = r.standard_error * r.standard_error * n;
    CHECK(std::abs(variance - (square - truth * truth)) < 4.5 * std::sqrt((power - square * square) / n));
    CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
  };
  // mu = t on [0, 1]: E (a - X)^q = (a^(q+1) - (a - 1)^(q+1)) / (q + 1)
  for (const double a : {1.0, 1.5, 0.8}) {
    CAPTURE(a);
    const auto moment = [a](int q) { return (std::pow(a, q + 1) - std::pow(a - 1, q + 1)) / (q + 1); };
    variance_is(Ray([](double t) { return t; }, {1, a, 0}), moment(2), moment(4), std::exp(-0.5));
  }
}

TEST_CASE("the gamma of a mixture has the moments of its law", "[transmittance][statistical]") {
  for (const double c : {0.3, 1.0, 2.0}) {
    CAPTURE(c);
    for (const double s : {0.5, 2.0}) {  // E exp(-s M) = (1 + c^2 s)^(-1 / c^2)
      const auto transform = [c, s](Stream& rng) { return std::exp(-s * detail::unit_mean_gamma(c, rng)); };
      CHECK(std::abs(z(transform, functions::Davis{c}(s))) < 4.5);
    }
  }
}

TEST_CASE("orders and combs of the published estimators", "[transmittance][exact]") {
  const double depths[] = {1, 2, 4, 8, 16, 30, 100};
  const std::int64_t terms[] = {5, 7, 10, 16, 27, 44, 125};
  // Of the tables in their source, with P(N <= k) >= 0.99 counted as k + 1 terms.
  for (int i = 0; i < 7; ++i) CHECK(poisson_quantile(depths[i], 0.99) + 1 == Approx(terms[i]).margin(1));
  const double mean_order = BhanotKennedy(0.9, 2, 2).mean();
  const double of_combs[] = {1, 2, 4.6, 10, 30, 100};
  const std::int64_t points[] = {4, 5, 9, 15, 33, 89};
  for (int i = 0; i < 6; ++i) CHECK(comb_of_u_statistics(of_combs[i], mean_order) == points[i]);
}

TEST_CASE("impossible rays are refused, in words", "[transmittance][exact]") {
  const auto one = [](double /*t*/) { return 1.0; };
  const auto one_flight = [](Stream& rng) { return rng.uniform(); };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(Ray(one, RayBounds{0, 1, 0}), Catch::Contains("length = 0"));
  CHECK_THROWS_WITH(Ray(one, RayBounds{1, 1, 2}), Catch::Contains("minorant = 2"));
  CHECK_THROWS_AS(Ray(one, RayBounds{nan, 1, 0}), std::invalid_argument);
  CHECK_THROWS_AS(Ray(one, RayBounds{1, nan, 0}), std::invalid_argument);
  const Ray open(one, {});
  CHECK_THROWS_WITH(ratio_tracking(open), Catch::Contains("majorant") && Catch::Contains("telescoping"));
  CHECK_THROWS_WITH(transmittance_series(open), Catch::Contains("majorant"));
  CHECK_THROWS_WITH(u_statistics(open), Catch::Contains("majorant"));
  CHECK_THROWS_WITH(delta_tracking(open), Catch::Contains("majorant"));
  CHECK_THROWS_WITH(residual_ratio_tracking(Ray(one, {1, 2, 0}), nan), Catch::Contains("control"));
  CHECK_THROWS_WITH(davis_mixture(0, [&](double /*m*/) { return one_flight; }), Catch::Contains("c = 0"));
  const auto low = delta_tracking(Ray(one, {100, 0.5, 0}));
  Stream rng(1, 1);
  CHECK_THROWS_AS(low(rng), std::domain_error);
}

// ---- extinctions outside what an estimator assumes

namespace {

/// Vacuum and worse: the optical depth of [0, 1] is 1 - 1/2.
constexpr auto negative_behind = [](double s) { return s < 0.5 ? 2.0 : -1.0; };

template <class E>
std::string refusal_of(const E& e) {
  NullRecord record;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    Stream rng(1, i);
    try {
      (void)draw_sample(e, rng, record);
    } catch (const std::domain_error& error) {
      return error.what();
    }
  }
  return "none";
}

}  // namespace

TEST_CASE("delta tracking refuses an extinction that is no probability, with place and value",
          "[transmittance][exact]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const std::string negative = refusal_of(delta_tracking(Ray(negative_behind, {1, 2, 0})));
  CHECK_THAT(negative, Catch::Contains("extinction = -1 at 0.") && Catch::Contains("[0, majorant = 2]"));
  for (const double wrong : {-1e-300, nan, infinity, -infinity, 2.0000001}) {
    INFO(wrong);
    const auto mu = [wrong](double t) { return t < 0.5 ? 1.0 : wrong; };
    CHECK_THAT(refusal_of(delta_tracking(Ray(mu, {1, 2, 0}))), Catch::Contains("extinction = "));
  }
  CHECK(refusal_of(delta_tracking(Ray([](double) { return 2.0; }, {1, 2, 0}))) == "none");  // the majorant itself
  CHECK(refusal_of(delta_tracking(Ray([](double) { return 0.0; }, {1, 2, 0}))) == "none");
}

TEST_CASE("estimators without probabilities take negative extinctions and are right", "[transmittance][stat]") {
  const double truth = std::exp(-0.5);
  const Ray ray(negative_behind, RayBounds{1, 2, 0});
  const Plan plan{.samples = 1 << 15, .seed = 18};
  const auto right = [&](const auto& estimator) {
    const auto r = estimate(estimator, plan);
    INFO(r.estimator << ": " << r.mean << " +- " << r.standard_error << " for " << truth);
    CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
    CHECK(r.standard_error < 0.02);
    CHECK(std::abs(r.mean - std::exp(-1.0)) >
          4.5 * r.standard_error);  // power: vacuum in the place of what is negative
  };
  right(ratio_tracking(ray));
  right(residual_ratio_tracking(ray, 0.5));
  right(next_flight(ray));
  right(p_series_cumulative(ray));
  right(single_term(telescoping(ray)));
}

TEST_CASE("equal bounds of a medium that is not constant are refused, not believed", "[transmittance][exact]") {
  const auto bent = [](double t) { return 1 + t; };
  CHECK_THAT(refusal_of(residual_ratio_tracking(Ray(bent, {1, 1, 1}))), Catch::Contains("minorant = majorant = 1"));
  CHECK_THAT(refusal_of(residual_ratio_tracking(Ray([](double) { return std::nan(""); }, {1, 1, 1}))),
             Catch::Contains("extinction = "));
  CHECK(refusal_of(residual_ratio_tracking(Ray([](double) { return 1 + 1e-14; }, {1, 1, 1}))) == "none");
}

TEST_CASE("impossible numbers of schedules are refused, and large means have their quantile",
          "[transmittance][exact]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double wrong : {nan, infinity, -1.0, 1e12}) {
    CHECK_THROWS_AS(poisson_quantile(wrong, 0.99), std::invalid_argument);
    CHECK_THROWS_AS(comb_of_u_statistics(wrong, 1), std::invalid_argument);
    CHECK_THROWS_AS(comb_of_u_statistics(1, wrong), std::invalid_argument);
  }
  for (const double wrong : {nan, -0.1, 1.1}) CHECK_THROWS_AS(poisson_quantile(3, wrong), std::invalid_argument);
  // e^-800 underflows: the quantile was 0. By the normal law with its correction 800 + 2.326 sqrt(800) + (2.326^2 - 1) / 6.
  CHECK(poisson_quantile(800, 0.99) == Approx(866.5).margin(1.5));
  CHECK(poisson_quantile(700, 0.99) <= poisson_quantile(700.0001, 0.99));
  const auto one = [](double m) { return delta_tracking(Ray([](double) { return 1.0; }, RayBounds{1, 1 + 0 * m, 0})); };
  for (const double wrong : {nan, infinity, 0.0, -1.0, 1e-200, 1e200}) {
    CHECK_THROWS_AS(davis_mixture(wrong, one), std::invalid_argument);  // of 1e-200 no gamma number was ever accepted
  }
}

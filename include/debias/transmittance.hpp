#pragma once

// Transmittance along a ray: g(tau), tau = integral of the extinction mu over [0, length]; g = exp(-tau) unless said.
//   name                     needs               look-ups                       what breaks it
//   delta_tracking           0 <= mu <= majorant at most tau_m                  other mu: throws; only 0 or 1
//   ratio_tracking           majorant            tau_m                          * variance T^2 (exp(E X^2 / tau_m) - 1)
//   residual_ratio_tracking  both bounds         (majorant - minorant) length   * a control far from mu
//   next_flight              majorant            tau_m                          *
//   p-series, cumulative     majorant            1 to 2 tau_m + 2               * throws for tau_m > 700
//   p-series, CMF            majorant            tau_m + 3 sqrt(tau_m) + 1      * throws for tau_m > 700
//   u_statistics             points of a comb    1.32 combs                     combs that differ by more than 1
//   telescoping, any g       nothing             2^(m + 1) r / (2 r - 1)        combs of 2^m points that differ by more
//   ray marching, any g      nothing             2^level                        everything: biased; also with jitter
// tau_m = majorant length, X = mu(U) length, m = base level. *: with mu < 0 or > majorant unbiased, but far noisier.
// Only a probability needs its bounds: all but delta_tracking take any finite mu. A NaN makes the sample NaN, and so does
// an infinite mu, but for exp(-inf) = 0 of a base that meets it. Bounds that are equal leave nothing to track: then
// residual_ratio_tracking looks the medium up once, and throws where it is not what the bounds say.
// p-series are roulette on transmittance_series, ray marching is `truncated` on telescoping or jittered_telescoping.
// Davis and power laws: telescoping, u_statistics with a Geometric order, or davis_mixture of any row. Sources: Cramer
// 1978 (next flight), Novak et al. 2014 (residual), Georgiev et al. 2019, Kettunen et al. 2021, Misso et al. 2022.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/text.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/taylor.hpp>

namespace debias {

/// What is known of the extinction of a ray besides its values.
struct RayBounds {
  double length = 1;
  double majorant = std::numeric_limits<double>::infinity();
  double minorant = 0;
};

/// The extinction mu(t), in 1 / length, at the distances t in [0, length].
template <class F>
struct Ray : RayBounds {
  F extinction;

  /// Throws std::invalid_argument unless 0 < length < infinity and 0 <= minorant <= majorant.
  Ray(F mu, const RayBounds& bounds) : RayBounds(bounds), extinction(std::move(mu)) {
    if (length > 0 && std::isfinite(length) && minorant >= 0 && minorant <= majorant) return;
    throw std::invalid_argument("ray: length = " + detail::format("%f", length) + ", minorant = " +
                                detail::format("%f", minorant) + ", majorant = " + detail::format("%f", majorant) +
                                " (must be positive and finite, and 0 <= minorant <= majorant)");
  }
};
template <class F>
Ray(F, RayBounds) -> Ray<F>;

/// The extinction times `factor`, and its bounds with it.
template <class F>
auto denser(const Ray<F>& ray, double factor) {
  const auto mu = [f = ray.extinction, factor](double t) { return factor * f(t); };
  return Ray(mu, RayBounds{ray.length, factor * ray.majorant, factor * ray.minorant});
}

/// (1 + tau / alpha)^-alpha, as a Davis law.
inline functions::Davis power_law(double alpha) { return {1 / std::sqrt(alpha)}; }

namespace detail {
inline void require_majorant(const char* estimator, const RayBounds& ray) {
  if (ray.majorant > 0 && std::isfinite(ray.majorant)) return;
  throw std::invalid_argument(std::string(estimator) + ": majorant = " + detail::format("%f", ray.majorant) +
                              " (must be positive and finite); telescoping needs none");
}
/// What delta tracking cannot make a probability of.
[[noreturn]] void refuse_extinction(const RayBounds& ray, double t, double mu);
/// What is not the one value that the bounds of a ray leave.
[[noreturn]] void refuse_constant(const RayBounds& ray, double t, double mu, double control);
}  // namespace detail

// ---- walks: free flights of rate `majorant`; work is 1 + look-ups

/// 1 if no collision is real before the end, else 0.
template <class F>
class DeltaTracking {
 public:
  explicit DeltaTracking(Ray<F> ray) : ray_(std::move(ray)) { detail::require_majorant("delta_tracking", ray_); }
  /// Throws std::domain_error where the extinction is not in [0, majorant]: mu / majorant is a probability.
  Sample<double> operator()(Stream& rng) const {
    double work = 1;
    const double flight = 1 / ray_.majorant;
    for (double t = flight * rng.exponential(); t < ray_.length; t += flight * rng.exponential()) {
      const double mu = ray_.extinction(t);
      ++work;
      if (!(mu >= 0 && mu <= ray_.majorant)) [[unlikely]]
        detail::refuse_extinction(ray_, t, mu);
      if (rng.uniform() * ray_.majorant < mu) return {0, work};
    }
    return {1, work};
  }
  [[nodiscard]] std::string describe() const { return "delta_tracking"; }

 private:
  Ray<F> ray_;
};

/// exp(-c length) prod (1 - (mu(t_i) - c) / rate) over the points of a Poisson process of that rate.
template <class F>
class RatioTracking {
 public:
  RatioTracking(Ray<F> ray, double control, double rate)
      : ray_(std::move(ray)), control_(control), rate_(rate), start_(std::exp(-control * ray_.length)) {}
  Sample<double> operator()(Stream& rng) const {
    Sample<double> sample{start_, 1};
    if (rate_ == 0) [[unlikely]] {
      look_up_once(rng);
      ++sample.work;
      return sample;
    }
    const double flight = 1 / rate_;
    for (double t = flight * rng.exponential(); t < ray_.length; t += flight * rng.exponential()) {
      sample.value *= 1 - (ray_.extinction(t) - control_) / rate_;
      ++sample.work;
      if (sample.value == 0) break;  // nothing can follow
    }
    return sample;
  }
  [[nodiscard]] std::string describe() const {
    return "ratio_tracking, control " + detail::format("%f", control_) + ", rate " + detail::format("%f", rate_);
  }

 private:
  // With equal bounds nothing is tracked: a medium that is not constant would be taken for one.
  void look_up_once(Stream& rng) const {
    const double t = ray_.length * rng.uniform();
    const double mu = ray_.extinction(t);
    if (std::abs(mu - control_) <= 1e-9 * std::abs(control_)) return;  // rounding in mu; a NaN is refused
    detail::refuse_constant(ray_, t, mu, control_);
  }

  Ray<F> ray_;
  double control_;
  double rate_;
  double start_;
};

/// Ratio tracking that adds at each collision what would go on to the end without another one.
template <class F>
class NextFlight {
 public:
  explicit NextFlight(Ray<F> ray) : ray_(std::move(ray)) { detail::require_majorant("next_flight", ray_); }
  Sample<double> operator()(Stream& rng) const {
    double end = std::exp(-ray_.majorant * ray_.length);  // probability of a flight from here to the end
    Sample<double> sample{end, 1};
    const double flight = 1 / ray_.majorant;
    double weight = 1;
    double t = 0;
    while (weight != 0) {
      const double u = rng.uniform();  // e^-(majorant x flight)
      t -= std::log(u) * flight;
      if (t >= ray_.length) break;
      weight *= 1 - ray_.extinction(t) * flight;
      end = end > smallest ? end / u : std::exp(-ray_.majorant * (ray_.length - t));
      sample.value += weight * end;
      ++sample.work;
    }
    return sample;
  }
  [[nodiscard]] std::string describe() const { return "next_flight"; }

 private:
  static constexpr double smallest = 1e-280;  // below, quotients would carry on what has underflowed
  Ray<F> ray_;
};

template <class F>
DeltaTracking<F> delta_tracking(Ray<F> ray) {
  return DeltaTracking<F>(std::move(ray));
}
template <class F>
RatioTracking<F> ratio_tracking(Ray<F> ray) {
  detail::require_majorant("ratio_tracking", ray);
  const double rate = ray.majorant;
  return {std::move(ray), 0, rate};
}
/// Tracks the difference from `control` only. Throws std::invalid_argument for a control that is not finite.
template <class F>
RatioTracking<F> residual_ratio_tracking(Ray<F> ray, double control) {
  detail::require_majorant("residual_ratio_tracking", ray);
  if (!std::isfinite(control)) {
    throw std::invalid_argument("residual_ratio_tracking: control = " + detail::format("%f", control) +
                                " (must be finite, between the bounds of the extinction)");
  }
  const double rate = std::max(ray.majorant - control, control - ray.minorant);
  return {std::move(ray), control, rate};
}
template <class F>
RatioTracking<F> residual_ratio_tracking(Ray<F> ray) {
  const double control = ray.minorant;
  return residual_ratio_tracking(std::move(ray), control);
}
template <class F>
NextFlight<F> next_flight(Ray<F> ray) {
  return NextFlight<F>(std::move(ray));
}

// ---- power series

/// The optical depth from one uniform point: E X = tau.
template <class F>
auto optical_depth(const Ray<F>& ray) {
  return [f = ray.extinction, length = ray.length](Stream& rng) { return length * f(length * rng.uniform()); };
}

/// The terms of the power series of g about the majorant optical depth tau_m, for roulette:
///   cumulative  RunningWeight(exp(-tau_m))
///   CMF         IndexRoulette(tau_m), {.base_level = poisson_quantile(tau_m, 0.99)}
/// With a minorant, (majorant - minorant) length takes the place of tau_m in both numbers of the CMF.
template <class F, Expandable G = functions::ExpMinus>
auto transmittance_series(const Ray<F>& ray, const G& g = {}) {
  detail::require_majorant("transmittance_series", ray);
  return debias::taylor(debias::optical_depth(ray), g, ray.majorant * ray.length);
}

namespace detail {
/// The same where e^-mean underflows; throws std::invalid_argument where the arguments are impossible.
std::int64_t large_poisson_quantile(double mean, double probability);
}  // namespace detail

/// The number of terms that reaches `probability` of a Poisson law of that mean.
/// Throws std::invalid_argument unless the mean lies in [0, 10^4] and the probability in [0, 1].
inline std::int64_t poisson_quantile(double mean, double probability) {
  if (!(mean >= 0 && mean <= 700 && probability >= 0 && probability <= 1)) [[unlikely]]
    return detail::large_poisson_quantile(mean, probability);
  double mass = std::exp(-mean);
  double cdf = mass;
  std::int64_t k = 0;
  while (cdf < probability && mass > 0) {
    mass *= mean / static_cast<double>(++k);
    cdf += mass;
  }
  return k;
}

/// Points of the combs: as many look-ups as a p-series has terms, over the expected draws.
/// Throws std::invalid_argument unless both are at least 0 and below 10^9.
inline std::int64_t comb_of_u_statistics(double majorant_depth, double mean_order) {
  if (!(majorant_depth >= 0 && majorant_depth < 1e9 && mean_order >= 0 && mean_order < 1e9)) {
    throw std::invalid_argument("comb_of_u_statistics: majorant_depth = " + detail::format("%g", majorant_depth) +
                                ", mean_order = " + detail::format("%g", mean_order) + " (must lie in [0, 10^9))");
  }
  const double d = majorant_depth;
  const double terms = std::ceil(std::cbrt((0.015 + d) * (0.65 + d) * (60.3 + d)));
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(terms / (mean_order + 1) + 0.5));
}

/// Symmetric products of combs of `points` about each of them. Where g has a finite radius of convergence
/// (Davis) `order` must be Geometric.
template <class F, Expandable G, Pmf P>
auto u_statistics(const Ray<F>& ray, const G& g, std::int64_t points, P order) {
  return debias::taylor_sum(debias::comb_mean(ray.extinction, points, 0, ray.length), g, drawn_pivot, std::move(order));
}
/// With the order PMF and the combs of its authors, from the majorant.
template <class F>
auto u_statistics(const Ray<F>& ray) {
  detail::require_majorant("u_statistics", ray);
  const BhanotKennedy order(0.9, 2, 2);
  return debias::u_statistics(ray, functions::ExpMinus{}, comb_of_u_statistics(ray.majorant * ray.length, order.mean()),
                              order);
}

// ---- combs

/// The sequence g(comb of 2^k points), for single_term(telescoping(ray), {.base_level = m}).
template <class F, class G = functions::ExpMinus>
auto telescoping(const Ray<F>& ray, const G& g = {}) {
  return debias::function_of_integral(ray.extinction, g, {.from = 0, .to = ray.length});
}

/// The same with jittered points, for media that do not continue periodically.
template <class F, class G = functions::ExpMinus>
auto jittered_telescoping(const Ray<F>& ray, const G& g = {}) {
  return debias::function_of_jittered_integral(ray.extinction, g, {.from = 0, .to = ray.length});
}

// ---- correlated media

namespace detail {
/// Gamma with mean 1 and variance c^2 [Marsaglia & Tsang 2000].
inline double unit_mean_gamma(double c, Stream& rng) {
  const double shape = 1 / (c * c);
  const bool boosted = shape < 1;
  const double d = (boosted ? shape + 1 : shape) - 1.0 / 3;
  for (;;) {
    const double x = rng.normal();
    const double u = rng.uniform();
    const double root = 1 + x / std::sqrt(9 * d);
    const double v = root * root * root;
    if (!(root > 0) || !(std::log(u) < 0.5 * x * x + d * (1 - v + std::log(v)))) continue;
    return c * c * d * v * (boosted ? std::pow(rng.uniform(), 1 / shape) : 1);
  }
}
}  // namespace detail

/// (1 + c^2 tau)^(-1 / c^2) = E exp(-M tau), M gamma with mean 1 and variance c^2: `make(m)` is any unbiased
/// estimator of exp(-m tau), `next_flight(denser(ray, m))`, say. Its variance has to be finite on
/// average over M: ratio tracking has exp(m (E X^2 / tau_m - 2 tau)) there.
template <class Make>
class DavisMixture {
 public:
  /// Throws std::invalid_argument unless c is positive, and c^2 and 1 / c^2 are finite.
  DavisMixture(double c, Make make) : c_(c), make_(std::move(make)) {
    if (c > 0 && std::isfinite(c * c) && std::isfinite(1 / (c * c))) return;
    throw std::invalid_argument(
        "davis_mixture: c = " + detail::format("%f", c) +
        " (must be positive, with a finite c^2 and 1 / c^2; for 0 take the exponential itself)");
  }
  Sample<double> operator()(Stream& rng) const {
    constexpr std::uint64_t density_branch = std::uint64_t{1} << 61;
    Stream density = rng.split(density_branch);
    NullRecord record;
    return debias::draw_sample(make_(detail::unit_mean_gamma(c_, density)), rng, record);
  }
  [[nodiscard]] std::string describe() const { return "davis_mixture, c " + detail::format("%f", c_); }

 private:
  double c_;
  Make make_;
};
template <class Make>
requires Estimator<detail::result_t<Make, double>> DavisMixture<Make> davis_mixture(double c, Make make) {
  return {c, std::move(make)};
}

template <class Make>
requires(!Estimator<detail::result_t<Make, double>>) auto davis_mixture(double /*c*/, const Make& /*make*/) {
  return detail::refuse<detail::mistake_in_estimator<detail::result_t<Make, double>>(),
                        detail::result_t<Make, double>>();
}

}  // namespace debias

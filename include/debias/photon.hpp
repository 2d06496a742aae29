#pragma once

// Irradiance at a point from photons within a radius that shrinks: kernel density estimation without its bias.
//   I_k = 1/n_k sum_i w_i K_k(d_i),  D_k = the same n_k photons under K_k - K_(k-1)      [Misso et al. 2022]
//   K_k: disc 1 / (pi r^2), cone 3 (1 - d/r) / (pi r^2), epanechnikov 2 (1 - d^2/r^2) / (pi r^2);  r = r_k, d < r
//   Notation: n = photons, w = power, d = distance from the point.  E I_k - I ~ r^2, Var D_k ~ 1 / (n r^2), work n.
// No PMF has finite variance and finite work. Let r^2 fall by a and n grow by m a level: E D_k^2 ~ 2^(-beta k) and
// work ~ 2^(gamma k) with beta = min(log2 m - log2 a, 2 log2 a) < log2 m = gamma for every a, m and kernel. With finite
// work (p_k ~ 2^(-theta k), theta > gamma) moments of |Z| end below theta / (theta - beta/2), and errors fall like
// work^-(beta / (2 gamma)): at best (n ~ r^-6, m = a^3, "balanced") 3/2 and work^(-1/3). E|Z| = infinity for m <= a.
// r_j^2 ~ j^(alpha-1), n_j ~ j^(1 - c alpha), p_j = j^(alpha-1) - (j+1)^(alpha-1) ("alpha"): Var D_j ~ j^(-2-alpha+c
// alpha); variance finite iff c < 2 - 1/alpha, work iff c > 1; E|Z| = infinity for c >= 1, the mean does not converge.
// Progressive: sample i has r_i^2 ~ i^(alpha-1), each is biased, the mean square error of their mean is N^(-2/3) at
// alpha = 2/3, where it is best. Sources: Knaus & Zwicker 2011 (progressive); Misso et al. 2022; derived here.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include <debias/core/estimator.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/text.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/radius.hpp>

namespace debias {

/// Where a photon arrived, seen from the point: `power` is what all photons together carry. A photon that arrives
/// nowhere has an infinite distance; powers of either sign are averaged as they are, others are refused.
struct Photon {
  double distance2;
  double power;
};
/// A const callable that emits one photon.
template <class S>
concept PhotonSource = requires(const S& s, Stream& rng) {
  { s(rng) } -> std::same_as<Photon>;
};

enum class Kernel { disc, cone, epanechnikov };

namespace detail {
[[noreturn]] inline void refuse_photon(double distance2, double power) {
  throw std::domain_error("photon: distance2 = " + detail::format("%g", distance2) +
                          ", power = " + detail::format("%g", power) +
                          " (must be at least 0, and finite); an infinite distance is a photon that arrives nowhere");
}
/// A power that is not finite is refused, wherever its photon arrived.
inline void require_power(const Photon& p) {
  if (!std::isfinite(p.power)) [[unlikely]]
    refuse_photon(p.distance2, p.power);
}
}  // namespace detail

/// K(d) of one radius, per area; 0 from the radius on.
class RadialKernel {
 public:
  RadialKernel(Kernel kernel, double radius2)
      : kernel_(kernel), inverse_(1 / radius2), height_(inverse_ / std::numbers::pi) {}
  /// Throws std::domain_error for a squared distance that is negative or no number.
  double operator()(double distance2) const {
    const double share = distance2 * inverse_;
    if (share >= 1) return 0;
    if (!(share >= 0)) [[unlikely]]
      detail::refuse_photon(distance2, 1);
    switch (kernel_) {
      case Kernel::disc:
        return height_;
      case Kernel::cone:
        return 3 * height_ * (1 - std::sqrt(share));
      case Kernel::epanechnikov:
        break;
    }
    return 2 * height_ * (1 - share);
  }

 private:
  Kernel kernel_;
  double inverse_;
  double height_;
};

namespace detail {
inline void require_radius(const char* name, double radius, double photons) {
  if (radius > 0 && std::isfinite(radius) && photons >= 1 && std::isfinite(photons)) return;
  throw std::invalid_argument(std::string(name) + ": radius = " + detail::format("%f", radius) + ", photons = " +
                              detail::format("%f", photons) + " (must be positive and finite, and at least 1)");
}
inline std::int64_t whole_photons(double n) {
  if (n < 0x1p62) return static_cast<std::int64_t>(std::ceil(n));
  throw std::length_error("photon: a level needs " + detail::format("%f", n) +
                          " photons (beyond int64); choose a PMF with a lighter tail");
}
/// The last level whose number of photons, which grows, is one.
template <class Photons>
std::int64_t deepest_of_photons(const Photons& photons) {
  const auto fits = [&](std::int64_t k) { return photons(static_cast<double>(k)) < 0x1p62; };
  std::int64_t low = 0;
  std::int64_t high = deepest_of_all;
  if (fits(high)) return high;
  while (high - low > 1) {
    const std::int64_t middle = low + (high - low) / 2;
    (fits(middle) ? low : high) = middle;
  }
  return low;
}
}  // namespace detail

// ---- schedules: what radius and how many photons a level has

/// r_k^2 = radius^2 a^-k, n_k = photons m^k.
struct GeometricRadii {
  double radius = 1;
  double photons = 1;
  double shrink = 2;  ///< a
  double growth = 8;  ///< m; a^3 is balanced, the best there is

  [[nodiscard]] double radius2(std::int64_t k) const {
    return radius * radius * std::pow(shrink, -static_cast<double>(k));
  }
  [[nodiscard]] std::int64_t photons_at(std::int64_t k) const {
    return detail::whole_photons(photons * std::pow(growth, static_cast<double>(k)));
  }
  /// The last level whose photons fit 64 bits.
  [[nodiscard]] std::int64_t deepest_level() const {
    return detail::deepest_of_photons([this](double k) { return photons * std::pow(growth, k); });
  }
  [[nodiscard]] Rates rates() const {
    const double a = std::log2(shrink);
    return {std::min(std::log2(growth) - a, 2 * a), std::log2(growth)};
  }
  [[nodiscard]] bool finite_mean() const { return growth > shrink; }  ///< of |Z|
  /// The PMF with the least theta that leaves the work a mean, and a tail of it that can be waited for.
  [[nodiscard]] Geometric pmf() const { return Geometric::with_exponent(std::log2(growth) + 0.25); }
  void check() const {
    detail::require_radius("GeometricRadii", radius, photons);
    if (shrink > 1 && growth > 1 && std::isfinite(shrink) && std::isfinite(growth)) return;
    throw std::invalid_argument("GeometricRadii: shrink = " + detail::format("%f", shrink) +
                                ", growth = " + detail::format("%f", growth) + " (must be finite and above 1)");
  }
  [[nodiscard]] std::string describe() const {
    return "r^2 / " + detail::format("%f", shrink) + " and photons x " + detail::format("%f", growth) + " a level";
  }
};

/// r_k^2 = radius^2 (k + 1)^(alpha - 1), n_k = photons (k + 1)^(1 - c alpha).
struct AlphaRadii {
  double radius = 1;
  double photons = 1;
  double alpha = 2.0 / 3;
  double c = 1.0001;

  [[nodiscard]] double radius2(std::int64_t k) const {
    return radius * radius * std::pow(static_cast<double>(k) + 1, alpha - 1);
  }
  [[nodiscard]] std::int64_t photons_at(std::int64_t k) const {
    return detail::whole_photons(photons * std::pow(static_cast<double>(k) + 1, 1 - c * alpha));
  }
  [[nodiscard]] std::int64_t deepest_level() const {
    return detail::deepest_of_photons([this](double k) { return photons * std::pow(k + 1, 1 - c * alpha); });
  }
  [[nodiscard]] Rates rates() const { return {2 + alpha - c * alpha, 1 - c * alpha, Decay::polynomial}; }
  [[nodiscard]] bool finite_mean() const { return c < 1; }
  [[nodiscard]] RadiusPmf pmf() const { return RadiusPmf(alpha); }
  void check() const {
    detail::require_radius("AlphaRadii", radius, photons);
    if (alpha > 0 && alpha < 1 && c >= 0 && c * alpha <= 1) return;
    throw std::invalid_argument("AlphaRadii: alpha = " + detail::format("%f", alpha) +
                                ", c = " + detail::format("%f", c) + " (must lie in (0, 1), and in [0, 1 / alpha])");
  }
  [[nodiscard]] std::string describe() const {
    return "r^2 ~ k^(alpha - 1), photons ~ k^(1 - c alpha), alpha = " + detail::format("%f", alpha) +
           ", c = " + detail::format("%f", c);
  }
};

struct PhotonOptions {
  Kernel kernel = Kernel::cone;
  bool allow_infinite_mean = false;  ///< run a schedule of which E|Z| is infinite all the same
};

/// The sequence I_0, I_1, ... at a point; take the schedule's PMF, `single_term(levels, schedule.pmf())`.
template <PhotonSource S, class Schedule>
class PhotonLevels {
 public:
  using value_type = double;
  Rates rates;

  /// Throws std::invalid_argument for an impossible schedule, and for one without E|Z| unless that is allowed.
  PhotonLevels(S source, const Schedule& schedule, const PhotonOptions& options)
      : source_(std::move(source)), schedule_(schedule), kernel_(options.kernel) {
    schedule.check();
    rates = schedule.rates();
    if (schedule.finite_mean() || options.allow_infinite_mean) return;
    throw std::invalid_argument("photon_levels: " + schedule.describe() +
                                " (E|Z| is infinite, so the mean need not converge); take growth = shrink^3, or set "
                                "allow_infinite_mean to see what happens");
  }

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const SharedDraw<double> d = draw(level, level, rng);
    return {d.base, level == 0 ? d.base : d.difference, d.work};
  }
  [[nodiscard]] std::int64_t deepest_level() const { return schedule_.deepest_level(); }
  /// The base from the photons of the difference, under the kernel of its own radius.
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    return draw(level, base_level, rng);
  }

 private:
  SharedDraw<double> draw(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    const std::int64_t n = schedule_.photons_at(level);
    const double fine2 = schedule_.radius2(level);
    const double coarse2 = level == 0 ? fine2 : schedule_.radius2(level - 1);
    const double base2 = schedule_.radius2(base_level);
    const double largest = std::max(coarse2, base2);
    const RadialKernel fine(kernel_, fine2);
    const RadialKernel coarse(kernel_, coarse2);
    const RadialKernel base(kernel_, base2);
    double values = 0;
    double differences = 0;
    for (std::int64_t i = 0; i < n; ++i) {
      const Photon p = source_(rng);
      detail::require_power(p);
      if (p.distance2 >= largest) continue;  // the kernels refuse a NaN
      values += p.power * base(p.distance2);
      differences += p.power * (fine(p.distance2) - coarse(p.distance2));
    }
    const auto count = static_cast<double>(n);
    return {values / count, differences / count, count};
  }

  S source_;
  Schedule schedule_;
  Kernel kernel_;
};

template <PhotonSource S, class Schedule>
PhotonLevels<S, Schedule> photon_levels(S source, const Schedule& schedule, const PhotonOptions& options = {}) {
  return {std::move(source), schedule, options};
}

struct ProgressiveRadii {
  double radius = 1;
  double photons = 1;  ///< of each sample
  double alpha = 2.0 / 3;
  Kernel kernel = Kernel::cone;

  [[nodiscard]] double radius2(std::uint64_t index) const {
    return radius * radius * std::pow(static_cast<double>(index) + 1, alpha - 1);
  }
};

/// The consistent baseline: each sample is biased by its own radius, and so is each mean.
template <PhotonSource S>
class ProgressivePhotons {
 public:
  ProgressivePhotons(S source, const ProgressiveRadii& radii) : source_(std::move(source)), radii_(radii) {
    detail::require_radius("progressive_photons", radii.radius, radii.photons);
    if (radii.alpha > 0 && radii.alpha <= 1) return;
    throw std::invalid_argument("progressive_photons: alpha = " + detail::format("%f", radii.alpha) +
                                " (must lie in (0, 1]; 2/3 is best, 1 keeps the radius)");
  }
  Sample<double> operator()(Stream& rng) const {
    const RadialKernel kernel(radii_.kernel, radii_.radius2(rng.index()));
    const std::int64_t n = detail::whole_photons(radii_.photons);
    double sum = 0;
    for (std::int64_t i = 0; i < n; ++i) {
      const Photon p = source_(rng);
      detail::require_power(p);
      sum += p.power * kernel(p.distance2);
    }
    const auto count = static_cast<double>(n);
    return {sum / count, count};
  }
  [[nodiscard]] std::string describe() const {
    return "progressive_photons (biased), alpha " + detail::format("%f", radii_.alpha);
  }

 private:
  S source_;
  ProgressiveRadii radii_;
};

template <PhotonSource S>
ProgressivePhotons<S> progressive_photons(S source, const ProgressiveRadii& radii) {
  return {std::move(source), radii};
}

// What is no source.
template <class S, class Schedule>
requires(!PhotonSource<S>) auto photon_levels(const S& /*source*/, const Schedule& /*schedule*/,
                                              const PhotonOptions& /*options*/ = {}) {
  return detail::refuse<detail::first_of(detail::mistake_in_call<S, Stream&>(), detail::Mistake::no_photons), S>();
}
template <class S>
requires(!PhotonSource<S>) auto progressive_photons(const S& /*source*/, const ProgressiveRadii& /*radii*/) {
  return detail::refuse<detail::first_of(detail::mistake_in_call<S, Stream&>(), detail::Mistake::no_photons), S>();
}

}  // namespace debias

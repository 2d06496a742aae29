#pragma once

// The power series of a function of yours, by automatic differentiation: taylor(x, autodiff<32>(g), a).
//
//   c_k = g^(k)(a) / k!, k = 0 ... order, by Boost.Math's forward mode                [Boost.Math, autodiff]
//
// `g` is a generic callable (`[](const auto& x) { return log(x) * x; }`) that finds log and the like by
// argument-dependent lookup. The radius of convergence is estimated by the root test, 1 / |c_k|^(1/k) over
// the upper half of the orders: good enough to refuse a hopeless centre, no proof of a good one.
// Fails beyond `order`: a run that is likely to get there is refused (core/reach.hpp), and one that gets there all the same
// stops (std::length_error), since a cut would be a bias.
// Not part of debias.hpp: it needs Boost.Math and compiles for seconds.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include <boost/math/differentiation/autodiff.hpp>

#include <debias/core/text.hpp>

namespace debias {

/// Coefficients 0 ... order that were computed beforehand.
template <std::size_t order>
class TabulatedSeries {
 public:
  /// c_k s^k with s = the radius where that is finite, else 1.
  TabulatedSeries(const std::array<double, order + 1>& coefficients, double convergence)
      : scale(std::isfinite(convergence) ? convergence : 1), radius(convergence), c_(coefficients) {
    double power = 1;
    for (double& c : c_) {
      c *= power;
      power *= scale;
    }
  }
  [[nodiscard]] static std::int64_t deepest_level() { return static_cast<std::int64_t>(order); }
  /// Throws std::length_error beyond the last order.
  double operator()() {
    if (k_ <= order) return c_[k_++];
    throw std::length_error("autodiff: order " + std::to_string(k_) + " is beyond the " + std::to_string(order) +
                            " that were asked for; ask for more, or take a PMF that falls faster");
  }

  double scale;
  double radius;

 private:
  std::array<double, order + 1> c_;
  std::size_t k_ = 0;
};

/// A function with its series up to an order.
template <std::size_t order, class G>
struct Autodiff {
  static_assert(order >= 2);
  G g;

  double operator()(double m) const { return g(m); }
  [[nodiscard]] static std::int64_t deepest_level() { return static_cast<std::int64_t>(order); }

  /// Throws std::invalid_argument where a coefficient is not finite.
  TabulatedSeries<order> expand(double a) const {
    const auto y = g(boost::math::differentiation::make_fvar<double, order>(a));
    std::array<double, order + 1> c{};
    double root = 0;
    for (std::size_t k = 0; k <= order; ++k) {
      c[k] = static_cast<double>(y.at(k));
      if (!std::isfinite(c[k])) {
        throw std::invalid_argument("autodiff: coefficient " + std::to_string(k) + " at " + detail::format("%f", a) +
                                    " is not finite (the function has no series there)");
      }
      if (2 * k > order) root = std::max(root, std::pow(std::abs(c[k]), 1 / static_cast<double>(k)));
    }
    // An entire function has roots that go to 0; at order k those of exp are about e / k.
    const bool entire = root * static_cast<double>(order) < 8;
    return {c, entire ? std::numeric_limits<double>::infinity() : 1 / root};
  }
};

template <std::size_t order, class G>
Autodiff<order, G> autodiff(G g) {
  return {std::move(g)};
}

}  // namespace debias

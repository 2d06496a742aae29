#pragma once

// Gibbs sampling whose chains meet: one site after the other from its law given the others, both chains at once.
//
//   x_i ~ p(. | x_others),  y_i ~ p(. | y_others),  P(x_i = y_i) = 1 - TV of the two laws: a maximal coupling
//
//   Notation: a law is a NormalLaw, BernoulliLaw or GammaLaw, or a std::variant of them; TV = distance in total variation.
// Normals of one deviation are coupled by reflection, others and gammas by rejection [Thorisson 2000; JOA 2020, section 4.1]:
//   X ~ p; Y = X if U p(X) <= q(X), else Y ~ q until U q(Y) > p(Y)
// which takes two draws on average whatever p and q are; Bernoulli laws by one uniform. A step is one sweep over all sites.
// Parameters that are no numbers, or impossible, throw std::domain_error. Fails, in that chains take long to meet, where sites
// hold one another: all of them have to be equal after one sweep.
// Sources: Jacob, O'Leary, Atchade 2020; Marsaglia & Tsang, ACM TOMS 26 (2000), for gammas.

#include <concepts>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <variant>

#include <debias/chains/kernel.hpp>
#include <debias/core/stream.hpp>

namespace debias {

struct NormalLaw {
  double mean = 0;
  double deviation = 1;

  double draw(Stream& rng) const;
  [[nodiscard]] double log_density(double x) const;
  static std::pair<double, double> couple(const NormalLaw& p, const NormalLaw& q, Stream& rng);
  friend bool operator==(const NormalLaw&, const NormalLaw&) = default;
};

/// 1 with this probability, else 0.
struct BernoulliLaw {
  double probability = 0.5;

  double draw(Stream& rng) const;
  static std::pair<double, double> couple(const BernoulliLaw& p, const BernoulliLaw& q, Stream& rng);
};

/// Of mean shape / rate.
struct GammaLaw {
  double shape = 1;
  double rate = 1;

  double draw(Stream& rng) const;
  [[nodiscard]] double log_density(double x) const;
  static std::pair<double, double> couple(const GammaLaw& p, const GammaLaw& q, Stream& rng);
  friend bool operator==(const GammaLaw&, const GammaLaw&) = default;
};

/// `law.draw(rng)`, and `L::couple(p, q, rng)`: a pair of draws that are equal as often as may be.
template <class L>
concept CoupledLaw = requires(const L& law, Stream& rng) {
  { law.draw(rng) } -> std::convertible_to<double>;
  { L::couple(law, law, rng) } -> std::convertible_to<std::pair<double, double>>;
};

namespace detail {
[[noreturn]] void refuse_laws();

template <class L>
double draw_from(const L& law, Stream& rng) {
  if constexpr (CoupledLaw<L>) {
    return law.draw(rng);
  } else {
    return std::visit([&rng](const auto& one) -> double { return one.draw(rng); }, law);
  }
}
template <class L>
std::pair<double, double> couple(const L& p, const L& q, Stream& rng) {
  if constexpr (CoupledLaw<L>) {
    return L::couple(p, q, rng);
  } else {
    return std::visit(
        [&rng]<class P, class Q>(const P& one, const Q& other) -> std::pair<double, double> {
          if constexpr (std::same_as<P, Q>) {
            return P::couple(one, other, rng);
          } else {
            refuse_laws();
          }
        },
        p, q);
  }
}
}  // namespace detail

/// `conditional(i, x)` is the law of coordinate i given the others of x.
template <class C>
class Gibbs {
 public:
  static constexpr bool checks_points = true;

  explicit Gibbs(C conditional) : conditional_(std::move(conditional)) {}

  template <class P>
  void step(P& x, Stream& rng) const {
    for (std::size_t i = 0; i < detail::coordinate_count(x); ++i) {
      set(x, i, detail::draw_from(conditional_(i, std::as_const(x)), rng));
    }
  }
  template <class P>
  void coupled_step(P& x, P& y, Stream& rng) const {
    for (std::size_t i = 0; i < detail::coordinate_count(x); ++i) {
      const auto drawn = detail::couple(conditional_(i, std::as_const(x)), conditional_(i, std::as_const(y)), rng);
      set(x, i, drawn.first);
      set(y, i, drawn.second);
    }
  }

 private:
  template <class P>
  static void set(P& x, std::size_t i, double value) {
    auto& site = detail::coordinate(x, i);
    site = static_cast<std::remove_reference_t<decltype(site)>>(value);
  }

  C conditional_;
};

/// `gibbs([](std::size_t i, const std::array<double, 2>& x) { return NormalLaw{0.9 * x[1 - i], 0.44}; })`.
template <class C>
Gibbs<C> gibbs(C conditional) {
  return Gibbs<C>(std::move(conditional));
}

}  // namespace debias

#pragma once

// g(E f) of chains that meet: function_of_mean over unbiased draws, which may have either sign.
//
//   x(rng) = H of one pair of chains,  E x = E f;  function_of_mean(draws_of(chain), g) has E I_k -> g(E f)
//
// A draw H may be negative where f is not, and any real number where f is not bounded: its tails are those of the meeting
// time, exponential at best. So g needs a value and moments at every real number. Refused at the door, by what g is at
// +-2^j, j = -2 ... 10, and at 0:
//   no value            log, square root: NaN below 0
//   a pole              1/x: draws, and means of any number of them, lie around 0 with a density: no level has a mean
//   faster than powers  exp(-x), up to +-2^40: a chain may stay where f is large as long as it does not meet: no level
//                       has a mean; where f is bounded a high base level may have one, which no draws can tell
// What is left has a mean where f has moments enough. For exp, take the power series, which asks for products of draws and
// not for exp of one: taylor_sum(draws_of(chain), functions::ExpMinus{}, centre, pmf). Fails where a pole, or what grows too
// fast, lies between the points looked at; a draw of work counts as 1.
// Source: derived here; Jacob & Thiery 2015 for signs.

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <debias/chains/coupled_chain.hpp>
#include <debias/core/estimator.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/function_of_mean.hpp>

namespace debias {

/// A random variable: one estimate by two chains. Draws of one stream are independent.
template <class K, class Start, class F>
class ChainDraws {
 public:
  using value_type = typename CoupledChain<K, Start, F>::value_type;

  explicit ChainDraws(CoupledChain<K, Start, F> chain) : chain_(std::move(chain)) {}
  value_type operator()(Stream& rng) const {
    NullRecord unused;
    return chain_(rng, unused).value;
  }

 private:
  CoupledChain<K, Start, F> chain_;
};

/// The estimator as a random variable.
template <class K, class Start, class F>
ChainDraws<K, Start, F> draws_of(CoupledChain<K, Start, F> chain) {
  return ChainDraws<K, Start, F>(std::move(chain));
}

namespace detail {

/// g at 0, +-1/4, ... +-2^40, by size: `below` and `above` in that order from -1/4 and 1/4 on. NaN: no value.
struct Probe {
  double at_zero = 0;
  std::vector<double> below;
  std::vector<double> above;
};
/// Throws std::invalid_argument where g has no mean over signed draws.
void require_signed(const Probe& probe);

/// The size of a value; NaN where a component is.
template <Value V>
double size_of(const V& v) {
  return debias::has_nan(v) ? std::numeric_limits<double>::quiet_NaN() : std::abs(debias::as_scalar(v));
}

template <class G, Value M>
void probe_signed(const G& g, const M& shape) {
  for (std::size_t c = 0; c < component_count(shape); ++c) {
    M at = debias::zero_like(shape);
    const auto size_at = [&](double x) {
      set_component(at, c, x);
      return detail::size_of(g(at));
    };
    Probe probe;
    probe.at_zero = size_at(0);
    for (int j = -2; j <= 40; ++j) {
      probe.below.push_back(size_at(-std::ldexp(1.0, j)));
      probe.above.push_back(size_at(std::ldexp(1.0, j)));
    }
    require_signed(probe);
  }
}

}  // namespace detail

/// g(E f) of chains, from signed draws. Throws std::invalid_argument where g cannot take them.
template <class K, class Start, class F, class G>
auto function_of_mean(ChainDraws<K, Start, F> draws, G g, const Rates& rates = {2, 1}) {
  Stream rng(0, 0);
  detail::probe_signed(g, draws(rng));
  using P = detail::IndependentPoints<ChainDraws<K, Start, F>>;
  return Doubling<P, G>(P{std::move(draws)}, std::move(g), rates);
}

}  // namespace debias

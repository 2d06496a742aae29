#pragma once

// A PMF of the random level: a probability mass function on j = 0, 1, 2, ...
//
//   mass(j) = P(J = j),  tail(j) = P(J >= j) (tail(0) = 1, computed on its own, never as 1 - cdf),
//   sample(u) = the largest j with u <= tail(j), so that P(sample(U) >= j) = tail(j) for a uniform U.
//
// Single-term estimators weight by 1 / mass, sums by 1 / tail. Deep levels sit at small u, where a tail keeps
// its relative accuracy. `sample` takes a number, not a stream: it can be tested as an inverse, stratified and
// replayed. Every PMF must be positive wherever a difference is not zero; a PMF that ends is a truncation.
// Source: Rhee & Glynn, Oper. Res. 63 (2015), sections 2 and 3.

#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <string>

#include <debias/core/rates.hpp>

namespace debias {

template <class P>
concept Pmf = requires(const P& p, std::int64_t j, double u) {
  { p.mass(j) } -> std::same_as<double>;
  { p.tail(j) } -> std::same_as<double>;
  { p.sample(u) } -> std::same_as<std::int64_t>;
};

/// A PMF that says how its tail falls and what it is called, `geometric:r=0.6`.
template <class P>
concept DescribedPmf = Pmf<P> && requires(const P& p) {
  { p.tail_exponent() } -> std::same_as<TailExponent>;
  { p.spec() } -> std::same_as<std::string>;
};

/// A number that stands for no level.
[[noreturn]] void refuse_uniform(double u);

/// The largest j >= 0 with u <= tail(j), from a guess that is close: sampling a PMF is inverting its tail.
/// Throws std::invalid_argument unless u > 0.
template <class Tail>
requires std::invocable<const Tail&, std::int64_t> std::int64_t invert_tail(const Tail& tail, double u,
                                                                            std::int64_t guess) {
  if (!(u > 0)) [[unlikely]]
    refuse_uniform(u);
  std::int64_t j = guess > 0 ? guess : 0;
  while (j > 0 && u > tail(j)) --j;
  while (u <= tail(j + 1)) ++j;
  return j;
}

/// 1 / probability. Throws std::length_error where the probability has underflowed (a weight of infinity or a clamped one
/// would be a wrong number), or is no number; and std::domain_error where it is above 1, and 1 / p would be too small.
double inverse_weight_error(double probability, std::int64_t level);
inline double inverse_weight(double probability, std::int64_t level) {
  constexpr double one = 1 + 0x1p-20;  // tails are sums, and rounded
  if (probability >= std::numeric_limits<double>::min() && probability <= one) [[likely]]
    return 1.0 / probability;
  return inverse_weight_error(probability, level);
}

}  // namespace debias

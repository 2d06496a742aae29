#pragma once

// The covariance of the components of one estimate: how far the errors of a price and its delta go together.
//
//   2 Cov(a, b) = Var(a + b) - Var a - Var b
//
// `with_covariance(sequence)` gives every value one component more for each pair, 2^-40 (a + b): all statistics of a run are linear in
// values and square in components, so that any estimator has their variance, and in a norm they do not count.
//
//   const auto result = estimate(recipe(with_covariance(greeks)), plan);
//   covariance(result)[0][1]     // of mean.value's components 0 and 1
//
// Fails as the standard errors do, where variances are not finite. Work per sample grows by n (n - 1) / 2 accumulators.

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>

namespace debias {

/// A value and the sums of its pairs.
template <Value V>
struct WithPairs {
  static constexpr double unit = 0x1p-40;
  V value;

  [[nodiscard]] double scalar() const { return as_scalar(value); }
  friend WithPairs operator+(WithPairs a, const WithPairs& b) { return {debias::sum(std::move(a.value), b.value)}; }
  friend WithPairs operator-(WithPairs a, const WithPairs& b) {
    return {debias::difference(std::move(a.value), b.value)};
  }
  friend std::size_t component_count(const WithPairs& v) {
    const std::size_t n = component_count(v.value);
    return n * (n + 1) / 2;
  }
  /// The n components, then pairs (0, 1), (0, 2), (1, 2), (0, 3), ...
  friend double component(const WithPairs& v, std::size_t i) {
    const std::size_t n = component_count(v.value);
    if (i < n) return component(v.value, i);
    std::size_t left = i - n;
    std::size_t second = 1;
    for (; left >= second; ++second) left -= second;
    return unit * (component(v.value, left) + component(v.value, second));
  }
  /// Pairs follow their components.
  friend void set_component(WithPairs& v, std::size_t i, double x) {
    if (i < component_count(v.value)) set_component(v.value, i, x);
  }
};

/// The sequence of a sequence's values with pairs.
template <BiasedSequence S>
class CovarianceOf {
 public:
  using V = WithPairs<sequence_value_t<S>>;

  CovarianceOf(S sequence, const Rates& declared) : rates(declared), sequence_(std::move(sequence)) {}

  Draw<V> operator()(std::int64_t level, Stream& rng) const {
    auto draw = sequence_(level, rng);
    return {{std::move(draw.value)}, {std::move(draw.difference)}, draw.work};
  }
  Term<V> value_at(std::int64_t level, Stream& rng) const {
    auto term = debias::value_of(sequence_, level, rng);
    return {{std::move(term.value)}, term.work};
  }
  [[nodiscard]] std::int64_t deepest_level() const { return deepest_level_of(sequence_); }

  Rates rates;

 private:
  S sequence_;
};
template <BiasedSequence S>
requires DeclaresRates<S> CovarianceOf<S> with_covariance(S sequence) {
  const Rates rates = sequence.rates;
  return {std::move(sequence), rates};
}

/// Of the means of a result of `with_covariance`, row by row.
template <class Result>
std::vector<std::vector<double>> covariance(const Result& result) {
  const std::size_t n = component_count(result.mean.value);
  std::vector<std::vector<double>> c(n, std::vector<double>(n));
  const auto square = [&result](std::size_t i) {
    const double e = result.components[i].standard_error;
    return e * e;
  };
  std::size_t pair = n;
  for (std::size_t b = 0; b < n; ++b) {
    c[b][b] = square(b);
    for (std::size_t a = 0; a < b; ++a) {
      constexpr double unit = decltype(result.mean)::unit;
      c[a][b] = c[b][a] = (square(pair++) / (unit * unit) - square(a) - square(b)) / 2;
    }
  }
  return c;
}

}  // namespace debias

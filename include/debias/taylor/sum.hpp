#pragma once

// g(E X) by its power series, with products of k factors averaged over all draws of a sample.
//
//   Z = sum_(k <= N) c_k A_k / P(N' >= k),  A_k = average of products of k of the n factors (X_i - a)
//     simple: the first k;  cyclic: the n blocks of k neighbours on a ring    [Chopin, Crucinio & Singh 2024]
//     symmetric: all subsets of k (U-statistics), by a recursion in O(n N)         [Kettunen et al. 2021]
//   drawn_pivot: of n + 1 draws each is in turn the centre a for the others        [Kettunen et al. 2021]
//
//   Notation: N = random order, n = max(N, TaylorSumOptions::draws).
// Work and conditions are those of taylor/terms.hpp: averaging quiets the noise, but at k = n there is one
// product only. A drawn pivot is not checked: where the radius of g is finite (Davis, 1/x) the terms fall
// like a power only, and BhanotKennedy or Poisson orders have infinite variance; take Geometric there.
// Over integrals: X = net_mean(f, Cube(d), n) is an independent net for each factor. Its variance V falls faster than 1 / n, so
// one large net and hardly any further factor is best: base_level 1 and Geometric(0.95), (V / R^2 far below .05). Variance x
// look-ups of 1/I and e^-I, f = exp((x_1 + ... + x_d) / sqrt(d)), n = 1024: 7e5, 2e5, 2e4 times less than with independent draws
// for d = 2, 4, 8, and 1.2, 1.6, 1.5 times less than doubling over nets (function_of_integral) with a base of n / 2, which takes 1.2
// to 2.3 times the look-ups a sample. Symmetric averages over 4 nets of n / 4 points (draws = 4) take 7 to 18 times more than
// one of n: no gain. Without a centre known to be good, or with few samples of few points, take doubling.
// O(n N) arithmetic a sample, O(n^2 N) with a drawn pivot: for small orders and draws that cost something.

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/estimator.hpp>
#include <debias/core/pmf.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/text.hpp>
#include <debias/taylor/terms.hpp>

namespace debias {

/// How the product of k factors is averaged over the draws.
enum class Products { simple, cyclic, symmetric };

/// Each draw is in turn the centre for the others. It needs draws that g can be expanded at, with the others
/// within the radius of convergence.
struct DrawnPivot {};
inline constexpr DrawnPivot drawn_pivot{};

struct TaylorSumOptions {
  Products products = Products::symmetric;
  std::int64_t base_level = 0;  ///< terms up to this one are always there, with weight 1
  std::int64_t draws = 0;       ///< at least so many factors in each average, whatever the order
};

namespace detail {

/// Numbers of one sample: on the stack, on the heap beyond 256.
class Scratch {
 public:
  explicit Scratch(std::size_t n) : size_(n) {
    if (n > stack_.size()) heap_.resize(n);
  }
  std::span<double> numbers() { return {heap_.empty() ? stack_.data() : heap_.data(), size_}; }

 private:
  std::size_t size_;
  std::array<double, 256> stack_;  // not zeroed
  std::vector<double> heap_;
};

/// averages[k] = average over the factors f of products of k of them, for all k < averages.size() <= f.size() + 1.
/// `spare`, of the size of f, is overwritten.
inline void average_products(Products products, std::span<const double> f, std::span<double> averages,
                             std::span<double> spare) {
  const std::size_t n = f.size();
  const std::size_t order = averages.size() - 1;
  averages[0] = 1;
  switch (products) {
    case Products::simple:
      for (std::size_t k = 1; k <= order; ++k) averages[k] = averages[k - 1] * f[k - 1];
      return;
    case Products::cyclic:
      for (std::size_t i = 0; i < n; ++i) spare[i] = 1;
      for (std::size_t k = 1; k <= order; ++k) {
        double total = 0;
        for (std::size_t i = 0; i < n; ++i) {
          const std::size_t next = i + k - 1;
          spare[i] *= f[next < n ? next : next - n];
          total += spare[i];
        }
        averages[k] = total / static_cast<double>(n);
      }
      return;
    case Products::symmetric:
      // m_k(n) = (1 - k / n) m_k(n - 1) + (k / n) m_(k-1)(n - 1) f_n: the subsets without and with factor n
      for (std::size_t k = 1; k <= order; ++k) averages[k] = 0;
      for (std::size_t i = 1; i <= n; ++i) {
        const double share = 1 / static_cast<double>(i);
        for (std::size_t k = std::min(i, order); k > 0; --k) {
          averages[k] += static_cast<double>(k) * share * (averages[k - 1] * f[i - 1] - averages[k]);
        }
      }
  }
}

}  // namespace detail

/// The estimator Z of the head of this file; Pivot is a double or DrawnPivot.
template <RandomVariable X, Expandable G, class Pivot, Pmf P>
class TaylorSum {
 public:
  using value_type = mean_t<draw_t<X>>;
  static_assert(detail::Separable<value_type>, "X must be real, or an array of fixed size");

  /// Throws std::invalid_argument for a negative base level, draws that the products do not use, or where g has
  /// no series at the pivot.
  TaylorSum(X x, G g, Pivot pivot, P pmf, const TaylorSumOptions& options)
      : x_(std::move(x)), g_(std::move(g)), pivot_(pivot), pmf_(std::move(pmf)), options_(options) {
    if (options.base_level < 0) {
      throw std::invalid_argument("taylor_sum: base_level = " + std::to_string(options.base_level) +
                                  " (levels start at 0)");
    }
    if (options.draws < 0 || (options.draws > 0 && options.products == Products::simple)) {
      throw std::invalid_argument("taylor_sum: draws = " + std::to_string(options.draws) +
                                  " (must be at least 0, and 0 for simple products, which use as many as the "
                                  "order); cyclic and symmetric ones average over all");
    }
    if constexpr (!drawn) g_.expand(pivot_);
  }

  template <Record R>
  Sample<value_type> operator()(Stream& rng, R& record) const {
    Stream pmf_stream = split(rng, Branch::pmf);
    Stream path = split_level(rng, 0);
    const std::int64_t order = options_.base_level + pmf_.sample(pmf_stream.uniform());
    if (draws_at(order) == 0) return constant_term(path, record);
    const auto n = static_cast<std::size_t>(draws_at(order));
    const auto count = static_cast<std::size_t>(order) + 1;  // of terms
    const std::size_t draws = n + (drawn ? 1 : 0);
    const std::size_t parts = component_count(value_type{});
    detail::Scratch scratch((draws + count) * parts + 2 * n + count);
    std::span<double> rest = scratch.numbers();
    const auto take = [&rest](std::size_t some) {
      const std::span<double> taken = rest.first(some);
      rest = rest.subspan(some);
      return taken;
    };
    const std::span<double> x = take(draws * parts);
    const std::span<double> terms = take(count * parts);
    const Buffers buffers{take(n), take(count), take(n)};

    for (std::size_t i = 0; i < draws; ++i) {
      const value_type v(x_(path));
      for (std::size_t c = 0; c < parts; ++c) x[c * draws + i] = component(v, c);
    }
    for (double& t : terms) t = 0;
    for (std::size_t c = 0; c < parts; ++c) {
      const std::span<const double> of_part = x.subspan(c * draws, draws);
      const std::span<double> terms_of_part = terms.subspan(c * count, count);
      if constexpr (drawn) {
        for (std::size_t p = 0; p < draws; ++p) add_terms(of_part, of_part[p], p, buffers, terms_of_part);
        for (double& t : terms_of_part) t /= static_cast<double>(draws);
      } else {
        add_terms(of_part, pivot_, draws, buffers, terms_of_part);
      }
    }
    return weighted(terms, order, record);
  }

  /// What the term of a level is divided by.
  [[nodiscard]] double probability(std::int64_t level) const { return pmf_.tail(level - options_.base_level); }
  [[nodiscard]] Reach reach(std::int64_t /*last*/) const {
    return detail::reach_of(g_, pmf_, options_.base_level, options_.base_level);
  }
  [[nodiscard]] const P& pmf() const { return pmf_; }

  [[nodiscard]] std::string describe() const {
    static constexpr const char* names[] = {"simple", "cyclic", "symmetric"};
    std::string text = std::string("taylor_sum, ") + names[static_cast<int>(options_.products)] + " products, ";
    if constexpr (drawn) {
      text += "drawn pivot, ";
    } else {
      text += "centre " + detail::format("%f", pivot_) + ", ";
    }
    if constexpr (DescribedPmf<P>) {
      text += pmf_.spec();
    } else {
      text += "user-defined PMF";
    }
    text += ", base level " + std::to_string(options_.base_level);
    return options_.draws == 0 ? text : text + ", draws " + std::to_string(options_.draws);
  }

 private:
  static constexpr bool drawn = std::same_as<Pivot, DrawnPivot>;

  struct Buffers {
    std::span<double> factors;
    std::span<double> averages;
    std::span<double> spare;
  };

  /// Factors in a sample of that order. About a given centre the term of order 0 needs none.
  [[nodiscard]] std::int64_t draws_at(std::int64_t order) const {
    return order == 0 && !drawn ? 0 : std::max(order, options_.draws);
  }

  /// The sample of order 0, which has no products: with a drawn pivot g of a single draw.
  template <Record R>
  Sample<value_type> constant_term(Stream& path, R& record) const {
    value_type value{};
    double work = 1;
    if constexpr (drawn) {
      value = value_type(x_(path));
      work = detail::work_of(x_);
      for (std::size_t c = 0; c < component_count(value); ++c) {
        set_component(value, c, g_.expand(component(value, c))());
      }
    } else {
      value = detail::constant<value_type>(g_.expand(pivot_)());
    }
    record.base(0, debias::as_scalar(value), work);
    return {std::move(value), work, 0};
  }

  /// Adds c_k A_k of the draws other than number `left_out` to terms[k].
  void add_terms(std::span<const double> x, double centre, std::size_t left_out, const Buffers& buffers,
                 std::span<double> terms) const {
    auto series = g_.expand(centre);
    const double inverse_scale = detail::inverse_of_scale(series.scale, centre);
    std::size_t n = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (i != left_out) buffers.factors[n++] = (x[i] - centre) * inverse_scale;
    }
    detail::average_products(options_.products, buffers.factors, buffers.averages, buffers.spare);
    for (std::size_t k = 0; k < terms.size(); ++k) terms[k] += series() * buffers.averages[k];
  }

  template <Record R>
  Sample<value_type> weighted(std::span<const double> terms, std::int64_t order, R& record) const {
    const std::size_t stride = static_cast<std::size_t>(order) + 1;
    const double work_per_draw = detail::work_of(x_);
    const auto term = [&](std::int64_t k) {
      value_type v{};
      for (std::size_t c = 0; c < component_count(v); ++c) {
        set_component(v, c, terms[c * stride + static_cast<std::size_t>(k)]);
      }
      return v;
    };
    const double base_work =
        (drawn ? work_per_draw : 1) + static_cast<double>(draws_at(options_.base_level)) * work_per_draw;
    Sample<value_type> sample{term(0), base_work, order};
    for (std::int64_t k = 1; k <= options_.base_level; ++k)
      sample.value = debias::sum(std::move(sample.value), term(k));
    record.base(options_.base_level, debias::as_scalar(sample.value), base_work);
    for (std::int64_t k = options_.base_level + 1; k <= order; ++k) {
      value_type v = term(k);
      const double work = static_cast<double>(draws_at(k) - draws_at(k - 1)) * work_per_draw;
      record.difference(k, debias::as_scalar(v), work);
      sample.value =
          debias::sum(std::move(sample.value), debias::scaled(std::move(v), inverse_weight(probability(k), k)));
      sample.work += work;
    }
    return sample;
  }

  X x_;
  G g_;
  Pivot pivot_;
  P pmf_;
  TaylorSumOptions options_;
};

/// g(E X) by averages of products about a point; `pmf` is that of the order above the base level.
template <RandomVariable X, Expandable G, Pmf P>
TaylorSum<X, G, double, P> taylor_sum(X x, G g, double at, P pmf, const TaylorSumOptions& options = {}) {
  return {std::move(x), std::move(g), at, std::move(pmf), options};
}
/// Throws std::invalid_argument where the terms do not fall, or the PMF has infinite variance or work.
template <RandomVariable X, Expandable G, Pmf P>
TaylorSum<X, G, double, P> taylor_sum(X x, G g, const Centre& centre, P pmf, const TaylorSumOptions& options = {}) {
  detail::require_mean_square(centre);
  const double b = detail::decay(g, centre);
  detail::require_decay(b);
  if constexpr (DescribedPmf<P>) detail::require_survival(b, pmf.tail_exponent());
  return {std::move(x), std::move(g), centre.at, std::move(pmf), options};
}
template <RandomVariable X, Expandable G, Pmf P>
TaylorSum<X, G, DrawnPivot, P> taylor_sum(X x, G g, DrawnPivot pivot, P pmf, const TaylorSumOptions& options = {}) {
  return {std::move(x), std::move(g), pivot, std::move(pmf), options};
}

template <class X, class G, class At, class P>
requires(!(RandomVariable<X> && Expandable<G> && Pmf<P>)) auto taylor_sum(const X& /*x*/, const G& /*g*/,
                                                                          const At& /*at*/, const P& /*pmf*/,
                                                                          const TaylorSumOptions& /*options*/ = {}) {
  if constexpr (RandomVariable<X> && Expandable<G>) {
    return detail::refuse<detail::mistake_in_pmf<P>(), P>();
  } else {
    return detail::refuse<detail::mistake_in_taylor<X, G>(), X, G>();
  }
}

}  // namespace debias

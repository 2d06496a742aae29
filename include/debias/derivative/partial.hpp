#pragma once

// Gradients and Jacobians: the finite differences of derivative.hpp along every axis.
//
//   J_k = column by column (f(x + h_k e_i) - f(x)) / h_k, or the central form, all columns from the same random numbers
//
// Notation: e_i = axis i, h_k = step of level k. Each axis has its own last level, where rounding takes over.
// Assumes and fails as derivative.hpp does, on any one axis; the work is that of all axes.
// Source: Glasserman, Monte Carlo Methods in Financial Engineering, 2003, section 7.1.

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/bias.hpp>
#include <debias/core/refusals.hpp>
#include <debias/core/sequence.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/value.hpp>
#include <debias/derivative/finite_difference.hpp>

namespace debias {

namespace detail {

/// f along one axis.
template <class F, class A>
struct AlongAxis {
  F f;
  A at;
  std::size_t axis;

  auto operator()(double x) const requires std::invocable<const F&, const A&> { return f(moved(x)); }
  auto operator()(double x, Stream& rng) const requires std::invocable<const F&, const A&, Stream&> {
    return f(moved(x), rng);
  }

 private:
  A moved(double x) const {
    A point = at;
    set_component(point, axis, x);
    return point;
  }
};

}  // namespace detail

/// All partial derivatives of f at a point, each with its own last level, from the same random numbers:
/// column i of J is the derivative along axis i. The work counts all evaluations.
template <class F, ArrayValue A, ArrayValue J>
class PartialDerivatives {
 public:
  using value_type = J;
  using Partial = FiniteDifference<detail::AlongAxis<F, A>>;

  PartialDerivatives(const F& f, const A& at, J shape, const DifferenceOptions& options, const Rates& declared)
      : rates(declared), shape_(debias::zero_like(std::move(shape))) {
    for (std::size_t i = 0; i < component_count(at); ++i) {
      partials_.emplace_back(detail::AlongAxis<F, A>{f, at, i}, component(at, i), options, declared);
    }
    const std::size_t rows = component_count(partials_.front().value_at(0, Stream(0, 0)).value);
    if (component_count(shape_) != rows * partials_.size()) {
      throw std::invalid_argument("gradient: the result has " + std::to_string(component_count(shape_)) +
                                  " components (must be " + std::to_string(rows) + " of f times " +
                                  std::to_string(partials_.size()) + " of the point)");
    }
  }

  Draw<J> operator()(std::int64_t level, const Stream& rng) const {
    Draw<J> all{shape_, shape_, 0};
    for (std::size_t i = 0; i < partials_.size(); ++i) {
      const auto draw = partials_[i](level, rng);
      set_column(all.value, i, draw.value);
      set_column(all.difference, i, draw.difference);
      all.work += draw.work;
    }
    return all;
  }

  Term<J> value_at(std::int64_t level, const Stream& rng) const {
    Term<J> all{shape_, 0};
    for (std::size_t i = 0; i < partials_.size(); ++i) {
      const auto term = partials_[i].value_at(level, rng);
      set_column(all.value, i, term.value);
      all.work += term.work;
    }
    return all;
  }

  [[nodiscard]] std::int64_t deepest_level() const {
    std::int64_t level = deepest_of_all;
    for (const Partial& p : partials_) level = std::min(level, p.deepest_level());
    return level;
  }

  /// On the norm of the error: as if each axis had the differences of all.
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const {
    double squares = 0;
    BiasBound largest;
    std::size_t axis = 0;
    for (std::size_t i = 0; i < partials_.size(); ++i) {
      BiasBound bound = partials_[i].bias_bound(levels);
      squares += bound.size * bound.size;
      if (i > 0 && bound.size <= largest.size) continue;
      largest = std::move(bound);
      axis = i;
    }
    return {std::sqrt(squares),
            "norm over the axes; the largest, of axis " + std::to_string(axis) + ": " + largest.sentence};
  }

  Rates rates;

 private:
  // Columns of a matrix of Eigen's default order lie one after the other.
  template <Value V>
  static void set_column(J& j, std::size_t column, const V& v) {
    const std::size_t rows = component_count(v);
    for (std::size_t r = 0; r < rows; ++r) set_component(j, column * rows + r, component(v, r));
  }

  std::vector<Partial> partials_;
  J shape_;
};

/// The gradient of x -> f(x) or x -> E f(x, rng) at a vector, as a vector of its type.
/// Throws as finite_difference does, for each axis.
template <class F, ArrayValue A>
requires ParameterFunction<detail::AlongAxis<F, A>> PartialDerivatives<F, A, A> gradient(
    F f, const A& at, const DifferenceOptions& options = {}) {
  return {f, at, at, options, detail::smooth_rates(options)};
}

/// The Jacobian of a vector-valued f, in a column-major matrix like `shape`: row r, column i is df_r / dx_i.
/// Throws as finite_difference does, and std::invalid_argument for a shape of another size.
template <class F, ArrayValue A, ArrayValue J>
requires ParameterFunction<detail::AlongAxis<F, A>> PartialDerivatives<F, A, J> jacobian(
    F f, const A& at, const J& shape, const DifferenceOptions& options = {}) {
  return {f, at, J(J::Zero(shape.rows(), shape.cols())), options, detail::smooth_rates(options)};
}

template <class F, ArrayValue A>
requires(!ParameterFunction<detail::AlongAxis<F, A>>) auto gradient(const F& /*f*/, const A& /*at*/,
                                                                    const DifferenceOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_parameter_function<F, detail::Mistake::no_function_of_parameter, const A&>(),
                        F>();
}
template <class F, ArrayValue A, class J>
requires(!ParameterFunction<detail::AlongAxis<F, A>>) auto jacobian(const F& /*f*/, const A& /*at*/, const J& /*shape*/,
                                                                    const DifferenceOptions& /*options*/ = {}) {
  return detail::refuse<detail::mistake_in_parameter_function<F, detail::Mistake::no_function_of_parameter, const A&>(),
                        F>();
}

}  // namespace debias

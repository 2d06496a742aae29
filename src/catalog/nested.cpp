// Nested expectations: an outer draw, 2^k inner draws, the antithetic split.

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include <debias/estimators/single_term.hpp>
#include <debias/functions.hpp>
#include <debias/nested.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

double standard_normal(Stream& rng) { return rng.normal(); }
double normal_around(double mean, Stream& rng) { return mean + rng.normal(); }

}  // namespace

Problem nested_max() {
  return make({.id = "F01",
               .name = "nested-max",
               .module = "nested.hpp",
               .truth = 0.3989422804014326779399,
               .formula = "E max(E[Y|X], 0), X ~ N(0, 1), Y|X ~ N(X, 1): 1/sqrt(2 pi)"},
              nested(standard_normal, normal_around, functions::PositivePart{}, Rates{1.5, 1}));
}

Problem nested_square() {
  return make({.id = "F02",
               .name = "nested-square",
               .module = "nested.hpp",
               .truth = 1,
               .formula = "E (E[Y|X])^2, X ~ N(0, 1), Y|X ~ N(X, 1): 1"},
              nested(standard_normal, normal_around, functions::Square{}));
}

Problem value_of_information() {
  // Means of (max(0, X + Y), X + Y) given X; what knowing Y too is worth.
  const auto inner = [](double x, Stream& rng) {
    const double s = x + rng.normal();
    return Eigen::Array2d(std::max(s, 0.0), s);
  };
  const auto gain = [](const Eigen::Array2d& mean) { return mean[0] - std::max(mean[1], 0.0); };
  return make({.id = "F05",
               .name = "value-of-information",
               .module = "nested.hpp",
               .truth = 0.1652473031463236090081,
               .formula = "E max(0, X + Y) - E max(0, E[X + Y|X]), X, Y ~ N(0, 1): 1/sqrt(pi) - 1/sqrt(2 pi)"},
              nested(standard_normal, inner, gain, Rates{1.5, 1}));
}

Problem nested_exp() {
  const auto outer = [](Stream& rng) { return rng.uniform(); };
  return make({.id = "F06",
               .name = "nested-exp",
               .module = "nested.hpp",
               .truth = 0.6321205588285576784045,
               .formula = "E exp(-E[Y|X]), X ~ U(0, 1), Y|X ~ N(X, 1): 1 - 1/e"},
              nested(outer, normal_around, functions::ExpMinus{}));
}

Problem doubly_nested_exp() {
  // The inner mean is E[(E[Z|Y])^2|X] = X^2 + 1: an inner draw is itself an unbiased estimate of a nested
  // expectation. Such estimates may be negative, the mean never is: f is extended below 0 by a constant,
  // where exp(-m) would have no mean.
  const auto given_x = [](double x) {
    const auto y = [x](Stream& rng) { return x + rng.normal(); };
    return single_term(nested(y, normal_around, functions::Square{}), Geometric::with_exponent(1.2));
  };
  const auto f = [](double m) { return std::exp(-std::max(m, 0.0)); };
  return make({.id = "F09",
               .name = "doubly-nested-exp",
               .module = "nested.hpp",
               .truth = 0.2123952943896613197705,
               .formula = "E exp(-E[(E[Z|Y])^2|X]), X ~ N(0, 1), Y|X ~ N(X, 1), Z|Y ~ N(Y, 1): e^-1 / sqrt 3"},
              nested(standard_normal, estimated(given_x), f));
}

}  // namespace debias::catalog

// Functions of an integral over [0, 1]^d or R^d, on scrambled nets.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/nested.hpp>
#include <debias/reciprocal.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

// log E exp(-|1 - t|^2 / 2), t ~ N(0, I_d): d (-(ln 2) / 2 - 1/4).
Problem evidence(const char* id, std::int64_t dimension, double truth) {
  const auto likelihood = [](std::span<const double> t) {
    double squares = 0;
    for (const double x : t) squares += (1 - x) * (1 - x);
    return std::exp(-0.5 * squares);
  };
  const std::string d = std::to_string(dimension);
  return make(
      {.id = id,
       .name = "evidence-in-" + d,
       .module = "function_of_mean.hpp",
       .truth = truth,
       .formula = "log E exp(-|1 - t|^2 / 2), t ~ N(0, I_" + d + "): -" + d + " (ln 2 / 2 + 1/4)"},
      function_of_integral(expectation_under(densities::Normal{}, likelihood), Cube(dimension), functions::Log{}));
}

}  // namespace

Problem evidence_in_2() { return evidence("I01", 2, -1.193147180559945309417); }
Problem evidence_in_4() { return evidence("I02", 4, -2.386294361119890618835); }
Problem evidence_in_8() { return evidence("I03", 8, -4.772588722239781237669); }

Problem sobol_g() {
  const auto product = [](std::span<const double> x) {
    double f = 1;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const auto a = static_cast<double>(i + 1);
      f *= (std::abs(4 * x[i] - 2) + a) / (1 + a);
    }
    return f;
  };
  return make({.id = "I04",
               .name = "exp-of-sobol-g",
               .module = "function_of_mean.hpp",
               .truth = 0.3678794411714423215955,
               .formula = "exp(-integral over [0,1]^5 of prod (|4 x_i - 2| + i) / (1 + i)): 1/e"},
              function_of_integral(product, Cube(5), functions::ExpMinus{}, {.rates = Rates{4.4, 1}}));
}

Problem reciprocal_over_cube() {
  const auto f = [](std::span<const double> x) {
    double total = 0;
    for (const double t : x) total += t;
    return std::exp(0.25 * total);
  };
  Problem p = make({.id = "I05",
                    .name = "reciprocal-over-cube",
                    .module = "function_of_mean.hpp",
                    .truth = 0.6002486777619569652583,
                    .formula = "1 / integral over [0,1]^4 of exp((x_1 + ... + x_4) / 4): (4 (e^(1/4) - 1))^-4"},
                   function_of_integral(f, Cube(4), functions::Reciprocal{}));
  const auto x = [](Stream& rng) {
    double total = 0;
    for (int t = 0; t < 4; ++t) total += rng.uniform();
    return std::exp(0.25 * total);
  };
  add(p, {.name = "independent", .description = "the same with independent draws in place of nets"},
      single_term(reciprocal(x)));
  return p;
}

namespace {

// -log m.
struct MinusLog {
  double operator()(double m) const { return -functions::Log{}(m); }
  double gap(double m, double d) const { return -functions::Log{}.gap(m, d); }
  double gap_of_halves(double a, double b) const { return -functions::Log{}.gap_of_halves(a, b); }
};

constexpr double precision = 4;  // of each observation

}  // namespace

Problem information_gain() {
  using Two = std::array<double, 2>;
  struct Observed {
    Two y;
    double residual;  // |y - theta|^2
  };
  const auto observe = [](Stream& rng) {
    Observed o{};
    Two theta;
    for (double& t : theta) t = rng.normal();
    for (std::size_t i = 0; i < 2; ++i) {
      const double noise = rng.normal() / std::sqrt(precision);
      o.y[i] = theta[i] + noise;
      o.residual += noise * noise;
    }
    return o;
  };
  // E p(y | theta') / p(y | theta) over the prior is a peak. Its middle and width at the mode, as Laplace has them, are those of
  // N(0.8 y, 0.2 I); half as much variance again keeps the weights bounded. Around y itself, with the deviation of the noise, they
  // have moments of low order only where |y| is large.
  const auto around = [](const Observed& o, std::span<const double> x) {
    constexpr double shrunk = precision / (1 + precision);
    constexpr double variance = 1.5 / (1 + precision);
    double exponent = precision * o.residual;  // twice that of the ratio
    for (std::size_t i = 0; i < 2; ++i) {
      const double z = normal_quantile(x[i]);
      const double theta = shrunk * o.y[i] + std::sqrt(variance) * z;
      exponent += z * z - theta * theta - precision * (o.y[i] - theta) * (o.y[i] - theta);
    }
    return std::exp(0.5 * exponent) * variance;
  };
  Problem p =
      make({.id = "I06",
            .name = "information-gain",
            .module = "nested.hpp",
            .truth = 1.609437912434100374600,
            .formula = "E log (p(y | theta) / E p(y | theta')), theta ~ N(0, I_2), y ~ N(theta, I_2 / 4): ln 5"},
           nested(observe, around, Cube(2), MinusLog{}, {.rates = Rates{2.5, 1}}));
  const auto from_prior = [](const Observed& o, Stream& rng) {
    double squares = 0;
    for (std::size_t i = 0; i < 2; ++i) {
      const double off = o.y[i] - rng.normal();
      squares += off * off;
    }
    return std::exp(-0.5 * precision * (squares - o.residual));
  };
  add(p, {.name = "independent", .description = "the same with independent draws in place of nets"},
      single_term(nested(observe, from_prior, MinusLog{}, {1.5, 1})));
  return p;
}

}  // namespace debias::catalog

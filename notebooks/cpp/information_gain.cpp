// Design of experiments: the information that an experiment is expected to give, and its slope in the design xi.
//
//   theta ~ N(0, I_2), y = xi theta + noise, noise ~ N(0, s^2 I_2)
//   gain(xi) = E[log p(y | theta) - log E[p(y | theta') | y]] = log(1 + xi^2 / s^2),  slope = 2 xi / (s^2 + xi^2)
//
// The inner expectation is over theta', on scrambled nets. Its slope is the mean of the score, weighted by the likelihood: both come
// from the same draws. A likelihood e^l of many observations underflows; exp_of(l) does not.

#include <cmath>
#include <cstddef>
#include <iostream>
#include <span>

#include <Eigen/Core>

#include <debias/debias.hpp>

namespace {

constexpr double xi = 0.8;
constexpr double s = 0.5;

struct Experiment {
  double theta[2];
  double noise[2];
};

Experiment experiment(debias::Stream& rng) {
  Experiment e;
  for (double& t : e.theta) t = rng.normal();
  for (double& n : e.noise) n = s * rng.normal();
  return e;
}

// Of theta' at a point of the cube: its likelihood, and that times d log p(y | theta') / d xi; y moves with xi, too.
debias::Weighted<Eigen::Array2d> likelihood(const Experiment& e, std::span<const double> u) {
  double log_likelihood = 0;
  double score = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const double apart = e.theta[i] - debias::normal_quantile(u[i]);
    const double residual = xi * apart + e.noise[i];
    log_likelihood -= residual * residual / (2 * s * s);
    score -= residual * apart / (s * s);
  }
  return debias::exp_of(log_likelihood, Eigen::Array2d(1, score));
}

// log p(y | theta), which does not depend on xi, less (log m_0, m_1 / m_0); constants of both drop out.
struct Gain {
  using Mean = debias::Weighted<Eigen::Array2d>;
  debias::functions::LogMeanExp log_mean_exp;
  Eigen::Array2d operator()(const Mean& m, const Experiment& e) const {
    const double squares = e.noise[0] * e.noise[0] + e.noise[1] * e.noise[1];
    return Eigen::Array2d(-squares / (2 * s * s), 0) - log_mean_exp(m);
  }
  Eigen::Array2d gap(const Mean& m, const Mean& d, const Experiment& /*e*/) const { return -log_mean_exp.gap(m, d); }
  Eigen::Array2d gap_of_halves(const Mean& a, const Mean& b, const Experiment& /*e*/) const {
    return -log_mean_exp.gap_of_halves(a, b);
  }
};

}  // namespace

int main() {
  const auto gain = debias::nested(experiment, likelihood, debias::Cube(2), Gain{}, {.rates = debias::Rates{2.5, 1}});
  const auto result = debias::estimate(debias::recipe(gain), {.samples = 1 << 16, .seed = 1});
  const double exact[] = {std::log1p(xi * xi / (s * s)), 2 * xi / (s * s + xi * xi)};
  const char* const names[] = {"information_gain", "slope"};
  for (int i = 0; i < 2; ++i) {
    std::cout << names[i] << ' ' << result.mean[i] << " +- " << result.standard_error[i] << ", exact " << exact[i]
              << '\n';
  }
}

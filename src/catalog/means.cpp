// Functions of the mean of independent draws, by doubling.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/reciprocal.hpp>
#include <debias/taylor.hpp>

#include "groups.hpp"
#include "make.hpp"

namespace debias::catalog {
namespace {

// What is known of the kurtosis of a sample.
struct Kurtosis {
  double value = 0;
  std::string reason = {};
};

// The power series of g about a centre, weighted and averaged in every way. `pmf` is that of the order,
// `reference` the size to which roulette on the running weight reduces terms.
template <RandomVariable X, Expandable G, class C, Pmf P>
void add_series(Problem& p, const X& x, const G& g, const C& centre, const P& pmf, double reference,
                const Kurtosis& known = {}) {
  const auto series = taylor(x, g, centre);
  const auto special = [&known](const char* name, const char* description) {
    return Special{name, description, known.value, known.reason};
  };
  add(p, special("taylor_single_term", "one term of the power series about a centre"),
      single_term(series, pmf, {.base = Base::one_outcome}));
  add(p, special("taylor", "the power series about a centre, with roulette"), roulette(series, pmf));
  add(p, special("taylor_prefix", "the power series, terms to the third, then roulette"),
      roulette(series, pmf, {.base_level = 3}));
  add(p, special("taylor_running_weight", "the power series with roulette on the running weight"),
      roulette(series, RunningWeight(reference)));
  add(p, special("taylor_cyclic", "the power series about a centre, with cyclic products"),
      taylor_sum(x, g, centre, pmf, {.products = Products::cyclic}));
  add(p, special("taylor_symmetric", "the power series about a centre, with symmetric products"),
      taylor_sum(x, g, centre, pmf));
}

// About the best centre for these moments of X. The survival 1 - r of the PMF lies above the cube root of
// E ((X - a) / R)^4, so that fourth moments are finite.
template <RandomVariable X, Expandable G>
void add_series(Problem& p, const X& x, const G& g, double mean, double square, double r, double reference = 0.5) {
  const Moments exact{.count = 1 << 20, .mean = mean, .m2 = (square - mean * mean) * (1 << 20)};
  add_series(p, x, g, centre(g, exact), Geometric(r), reference);
}

// E A / E B of X = (A, B), from one draw of A and an estimate of 1 / E B that is independent of it.
template <RandomVariable X, Estimator R>
auto ratio_by(const X& x, const R& reciprocal_of_second) {
  return [x, reciprocal_of_second](Stream& rng) {
    const double top = x(rng)[0];
    const Sample<double> s = reciprocal_of_second(rng);
    return Sample<double>{top * s.value, 1 + s.work, s.level};
  };
}

// f(x_1, ..., x_n) of 2^k draws for each of `per`; the coarse partner is the mean over the two halves.
template <class X, class F>
struct FunctionOfSample {
  X x;
  F f;
  std::int64_t per;
  Rates rates;

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    std::vector<double> draws(static_cast<std::size_t>(per * doubled_draws(level)));
    for (double& d : draws) d = x(rng);
    const std::span<double> all(draws);
    const auto work = static_cast<double>(draws.size());
    if (level == 0) return base(f(all), work);
    const std::size_t half = draws.size() / 2;
    const double coarse = 0.5 * (f(all.first(half)) + f(all.subspan(half)));
    return coupled(f(all), coarse, work);
  }
};

}  // namespace

Problem exp_of_mean() {
  const auto x = [](Stream& rng) { return 2 * rng.uniform(); };
  Problem p = make({.id = "A01",
                    .name = "exp-of-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 0.3678794411714423215955,
                    .formula = "exp(-E X), X ~ U(0, 2): 1/e"},
                   function_of_mean(x, functions::ExpMinus{}));
  add_series(p, x, functions::ExpMinus{}, centre_between(0, 2), Poisson(2), std::exp(-1));
  add(p, {.name = "u_statistics", .description = "symmetric products of combs about each of them (pivoted series)"},
      taylor_sum(x, functions::ExpMinus{}, drawn_pivot, BhanotKennedy(0.5, 2, 2)));
  return p;
}

Problem reciprocal_of_mean() {
  const auto x = [](Stream& rng) { return 0.5 + rng.uniform(); };
  Problem p = make({.id = "A03",
                    .name = "reciprocal-of-mean",
                    .module = "reciprocal.hpp",
                    .truth = 1,
                    .formula = "1 / E X, X ~ U(1/2, 3/2): 1"},
                   reciprocal(x));
  add_series(p, x, functions::Reciprocal{}, 1, 13.0 / 12, 0.5);
  add(p, {.name = "reciprocal_trials", .description = "the number of trials until one succeeds"},
      reciprocal_trials(x, 1.5));
  add(p, {.name = "reciprocal_residual", .description = "one term of the geometric series, by bounds from both sides"},
      reciprocal_residual(x, 0.5, 1.5));
  add(p, {.name = "reciprocal_product", .description = "one term of the geometric series, drawn geometrically"},
      ReciprocalProduct(x, 0.9, 0.4));
  add(p, {.name = "clamped", .description = "single_term with a clamp that vanishes with the level"},
      single_term(clamped_reciprocal(x)));
  return p;
}

Problem log_of_mean() {
  const auto x = [](Stream& rng) { return std::exp(rng.normal()); };
  Problem p = make({.id = "A06",
                    .name = "log-of-lognormal-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 0.5,
                    .formula = "log E X, X lognormal(0, 1): 1/2"},
                   function_of_mean(x, functions::Log{}));
  const Kurtosis infinite{std::numeric_limits<double>::infinity(),
                          "E (1 - X/a)^4 = 5.1 at a = E X^2 / E X: the fourth moment is infinite under any PMF"};
  add_series(p, x, functions::Log{}, std::exp(1.5), Geometric(0.25), 0.5, infinite);
  return p;
}

Problem sqrt_of_mean() {
  const auto x = [](Stream& rng) {
    const double u = rng.uniform();
    return u * u;
  };
  Problem p = make({.id = "A07",
                    .name = "sqrt-of-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 0.5773502691896257645091,
                    .formula = "sqrt(E U^2), U ~ U(0, 1): 1/sqrt 3"},
                   function_of_mean(x, functions::Sqrt{}));
  add_series(p, x, functions::Sqrt{}, 1.0 / 3, 0.2, 0.2);
  return p;
}

Problem power_of_mean() {
  // The mean of n uniforms to the power -q is integrable for n > q only: fourth moments need halves of 8
  // draws.
  const auto x = [](Stream& rng) { return rng.uniform(); };
  Problem p = make({.id = "A08",
                    .name = "power-of-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 2.828427124746190097603,
                    .formula = "(E X)^(-3/2), X ~ U(0, 1): 2^(3/2)",
                    .lowest_base = base_level_for_pole(1.5)},
                   function_of_mean(x, functions::Power{-1.5}));
  add_series(p, x, functions::Power{-1.5}, 0.5, 1.0 / 3, 0.4);
  return p;
}

Problem ratio_of_means() {
  const auto x = [](Stream& rng) {
    const double u = rng.uniform();
    const double weight = std::exp(u);
    return Eigen::Array2d(u * weight, weight);
  };
  Problem p = make({.id = "A09",
                    .name = "ratio-of-means",
                    .module = "function_of_mean.hpp",
                    .truth = 0.5819767068693264243850,
                    .formula = "E[U e^U] / E[e^U], U ~ U(0, 1): 1 / (e - 1)"},
                   function_of_mean(x, functions::Ratio{}));
  const auto weight = [x](Stream& rng) { return x(rng)[1]; };
  add(p, {.name = "reciprocal_residual", .description = "one term of the geometric series, by bounds from both sides"},
      ratio_by(x, reciprocal_residual(weight, 1, std::numbers::e)));
  add(p, {.name = "reciprocal_trials", .description = "the number of trials until one succeeds"},
      ratio_by(x, reciprocal_trials(weight, std::numbers::e)));
  return p;
}

Problem square_of_mean() {
  const auto x = [](Stream& rng) { return rng.exponential(); };
  Problem p = make({.id = "A10",
                    .name = "square-of-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 1,
                    .formula = "(E X)^2, X ~ Exp(1): 1"},
                   function_of_mean(x, functions::Square{}));
  add_series(p, x, functions::Square{}, 1.0, Geometric(0.5), 1.0);
  return p;
}

Problem log_evidence() {
  const auto likelihood = [](Stream& rng) {
    const double residual = 1 - rng.normal();
    return std::exp(-residual * residual / 2);
  };
  Problem p = make({.id = "A12",
                    .name = "log-evidence",
                    .module = "function_of_mean.hpp",
                    .truth = -0.5965735902799726547086,
                    .formula = "log E exp(-(1 - t)^2 / 2), t ~ N(0, 1): -(ln 2)/2 - 1/4"},
                   function_of_mean(likelihood, functions::Log{}));
  add_series(p, likelihood, functions::Log{}, std::exp(-0.5965735902799726547086), std::exp(-1.0 / 3) / std::sqrt(3.0),
             0.4);
  return p;
}

Problem logistic_of_mean() {
  const auto x = [](Stream& rng) { return 0.5 + rng.normal(); };
  Problem p = make({.id = "A13",
                    .name = "logistic-of-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 0.6224593312018545646389,
                    .formula = "logistic(E X), X ~ N(1/2, 1): 1 / (1 + exp(-1/2))"},
                   function_of_mean(x, functions::Logistic{}));
  add_series(p, x, functions::Logistic{}, 0.5, 1.25, 0.55);
  return p;
}

Problem log_cosh() {
  const auto x = [](Stream& rng) { return rng.uniform() < 0.5 ? std::exp(1.0) : std::exp(-1.0); };
  Problem p = make({.id = "A26",
                    .name = "log-cosh",
                    .module = "function_of_mean.hpp",
                    .truth = 0.4337808304830271870265,
                    .formula = "log E e^X, X = +-1 with equal chance: ln cosh 1"},
                   function_of_mean(x, functions::Log{}));
  add_series(p, x, functions::Log{}, std::cosh(1.0), std::cosh(2.0), 0.3);
  return p;
}

Problem posterior_mean() {
  const auto x = [](Stream& rng) {
    const double theta = rng.normal();
    const double weight = std::exp(-(1 - theta) * (1 - theta) / 2);
    return Eigen::Array2d(theta * weight, weight);
  };
  Problem p = make({.id = "A11",
                    .name = "posterior-mean",
                    .module = "function_of_mean.hpp",
                    .truth = 0.5,
                    .formula = "E[t w] / E[w], t ~ N(0, 1), w = exp(-(1 - t)^2 / 2): 1/2"},
                   function_of_mean(x, functions::Ratio{}));
  const auto weight = [x](Stream& rng) { return x(rng)[1]; };
  add(p, {.name = "reciprocal_trials", .description = "the number of trials until one succeeds"},
      ratio_by(x, reciprocal_trials(weight, 1)));
  add(p, {.name = "reciprocal_product", .description = "one term of the geometric series, drawn geometrically"},
      ratio_by(x, ReciprocalProduct(weight, 4.0 / 3, 0.65)));
  return p;
}

namespace {

// -x log x about a: -a log a, -(1 + log a), then -(-1)^k a / (k (k - 1)), in the scale a.
class MinusXLogXSeries {
 public:
  explicit MinusXLogXSeries(double a) : scale(a), radius(a) {}
  double operator()() {
    const double k = k_++;
    if (k == 0) return -scale * std::log(scale);
    if (k == 1) return -scale * (1 + std::log(scale));
    sign_ = -sign_;
    return sign_ * scale / (k * (k - 1));
  }
  double scale;
  double radius;

 private:
  double sign_ = 1;
  double k_ = 0;
};
struct MinusXLogX {
  MinusXLogXSeries expand(double a) const { return MinusXLogXSeries(a); }
};

}  // namespace

Problem entropy() {
  const auto x = [](Stream& rng) {
    const double u = rng.uniform();
    return Eigen::Array3d(u < 0.5 ? 1.0 : 0.0, u >= 0.5 && u < 0.8 ? 1.0 : 0.0, u >= 0.8 ? 1.0 : 0.0);
  };
  const auto g = [](const Eigen::Array3d& p) {
    double sum = 0;
    for (const double q : p) sum -= q > 0 ? q * std::log(q) : 0.0;
    return sum;
  };
  Problem p = make({.id = "A18",
                    .name = "entropy",
                    .module = "function_of_mean.hpp",
                    .truth = 1.029653014064573527416,
                    .formula = "entropy of (0.5, 0.3, 0.2) from counts, 0 log 0 = 0"},
                   function_of_mean(x, g));
  // Term by term about 1 = E X^2 / E X; the rarest outcome leaves b = E (1 - X)^2 = 0.8.
  const Geometric pmf(0.06);
  const auto summed = [](const auto& e) {
    return [e](Stream& rng) {
      NullRecord none;
      const auto s = e(rng, none);
      return Sample<double>{s.value.sum(), s.work, s.level};
    };
  };
  add(p, {.name = "taylor", .description = "the power series about a centre, with roulette"},
      summed(roulette(taylor(x, MinusXLogX{}, 1.0), pmf)));
  add(p, {.name = "taylor_cyclic", .description = "the power series about a centre, with cyclic products"},
      summed(taylor_sum(x, MinusXLogX{}, 1.0, pmf, {.products = Products::cyclic})));
  add(p, {.name = "taylor_symmetric", .description = "the power series about a centre, with symmetric products"},
      summed(taylor_sum(x, MinusXLogX{}, 1.0, pmf)));
  return p;
}

Problem median() {
  const auto x = [](Stream& rng) { return rng.exponential(); };
  const auto f = [](std::span<const double> draws) {
    std::vector<double> sorted(draws.begin(), draws.end());
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    if (sorted.size() % 2 == 1) return *middle;
    return 0.5 * (*middle + *std::max_element(sorted.begin(), middle));
  };
  return make({.id = "A19",
               .name = "median",
               .module = "core/sequence.hpp",
               .truth = 0.6931471805599453094172,
               .formula = "median of Exp(1) from that of 3 2^k draws: ln 2"},
              FunctionOfSample<decltype(x), decltype(f)>{x, f, 3, {1.5, 1}});
}

Problem newsvendor() {
  // The least mean cost of a stock q against the demands drawn: 1 for each unit left, 3 for each one missed.
  // It is attained at the order statistic 3/4.
  const auto x = [](Stream& rng) { return rng.exponential(); };
  const auto f = [](std::span<const double> demands) {
    std::vector<double> sorted(demands.begin(), demands.end());
    const auto best = sorted.begin() + static_cast<std::ptrdiff_t>((3 * sorted.size() + 3) / 4) - 1;
    std::nth_element(sorted.begin(), best, sorted.end());
    double cost = 0;
    for (const double d : sorted) cost += d < *best ? *best - d : 3 * (d - *best);
    return cost / static_cast<double>(sorted.size());
  };
  return make({.id = "A20",
               .name = "newsvendor",
               .module = "core/sequence.hpp",
               .truth = 1.386294361119890618834,
               .formula = "min over q of E[(q - X)+ + 3 (X - q)+], X ~ Exp(1), by sample averages: ln 4"},
              FunctionOfSample<decltype(x), decltype(f)>{x, f, 1, {2, 1}});
}

}  // namespace debias::catalog

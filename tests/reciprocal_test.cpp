#include <debias/reciprocal.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using debias::laws::estimator_laws;
using ::laws::Failures;
using ::laws::sequence_laws;

namespace {

const auto exponential = [](Stream& rng) { return rng.exponential(); };
const auto twice = [](double x) { return 2 * x; };

/// The larger |z| of the means of I_k and D_k against truth.
template <class S>
double worst_z(const S& s, std::int64_t level, int n, double value, double difference) {
  std::vector<double> values;
  std::vector<double> differences;
  for (int i = 0; i < n; ++i) {
    Stream rng = split_level(Stream(71, static_cast<std::uint64_t>(i)), level);
    const auto draw = s(level, rng);
    values.push_back(draw.value);
    differences.push_back(draw.difference);
  }
  const Moments v = Moments::of(values);
  const Moments d = Moments::of(differences);
  return std::max(std::abs(v.mean - value) / v.standard_error(), std::abs(d.mean - difference) / d.standard_error());
}

double mean_reciprocal_of_exponentials(std::int64_t level) {  // E 1 / (mean of n) = n / (n - 1), a Gamma law
  const double n = std::ldexp(1.0, static_cast<int>(level));
  return n / (n - 1);
}

double mean_reciprocal_of_linear_comb(std::int64_t level) {  // the mean is uniform in 1 +- 1 / n
  const double n = std::ldexp(1.0, static_cast<int>(level));
  return n * std::atanh(1 / n);
}

}  // namespace

TEST_CASE("reciprocals of means of exponential draws have the level means of the Gamma law",
          "[reciprocal][statistical]") {
  const auto s = reciprocal(exponential);
  const auto truth = mean_reciprocal_of_exponentials;
  for (std::int64_t k = 4; k <= 7; ++k) {  // halves of 8 draws and more: four moments
    CAPTURE(k);
    CHECK(worst_z(s, k, 40000, truth(k), truth(k) - truth(k - 1)) < 4.5);
  }
  CHECK(worst_z(s, 5, 40000, truth(4), truth(5) - truth(4)) > 4.5);  // power check: the level below
  CHECK(worst_z(s, 5, 40000, truth(5), truth(4) - truth(3)) > 4.5);
}

TEST_CASE("reciprocals of a comb on a linear function have closed-form level means", "[reciprocal][statistical]") {
  const auto s = reciprocal_of_integral(twice);
  const auto truth = mean_reciprocal_of_linear_comb;
  for (std::int64_t k = 2; k <= 6; ++k) {
    CAPTURE(k);
    CHECK(worst_z(s, k, 20000, truth(k), truth(k) - truth(k - 1)) < 4.5);
  }
  CHECK(worst_z(s, 4, 20000, truth(4), truth(3) - truth(2)) > 4.5);  // power check: the level below
}

TEST_CASE("reciprocals keep the laws of a sequence and their declared rates", "[reciprocal][law]") {
  const auto bounded = [](Stream& rng) { return 0.5 + rng.uniform(); };  // A03
  CHECK(sequence_laws(reciprocal(bounded)) == Failures{});
  CHECK(sequence_laws(reciprocal([](Stream& rng) { return -2 - rng.uniform(); })) == Failures{});
  CHECK(sequence_laws(reciprocal_of_integral([](double x) { return 1 + x; }, {.from = -0.5, .to = 2})) == Failures{});
  CHECK(sequence_laws(reciprocal(exponential), {.first = 4, .last = 8, .samples = 8192}) == Failures{});

  // Power check: other rates.
  CHECK(sequence_laws(reciprocal(bounded, {1.5, 1})) != Failures{});
  CHECK(sequence_laws(reciprocal_of_integral([](double x) { return 1 + x; }, {.rates = {2, 1}})) != Failures{});
}

TEST_CASE("draws near zero make the shallow levels heavy, and a base level above them does not see it",
          "[reciprocal][statistical]") {
  // With a density of 1 at zero, E I_0 = infinity, while I_3 has a fourth moment.
  const auto s = reciprocal(exponential);
  const auto share_of_largest = [&s](std::int64_t level) {
    double total = 0;
    double largest = 0;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Stream rng(72, i);
      const double square = std::pow(s.value_at(level, rng).value, 2);
      total += square;
      largest = std::max(largest, square);
    }
    return largest / total;
  };
  CHECK(share_of_largest(0) > 0.2);
  CHECK(share_of_largest(3) < 0.02);
}

TEST_CASE("a mean of zero gives a number that is not finite, never a clamped one", "[reciprocal][exact]") {
  const auto s = reciprocal([](Stream&) { return 0.0; });
  for (std::int64_t k = 0; k <= 3; ++k) {
    Stream rng(73, 0);
    const auto draw = s(k, rng);
    CHECK_FALSE(std::isfinite(draw.value));
    CHECK_FALSE(std::isfinite(draw.difference));
  }
  const auto half = reciprocal([](Stream& rng) { return rng.uniform() < 0.5 ? 0.0 : 1.0; });
  bool seen = false;  // one half of the draws zero, the other not: a finite value with an infinite difference
  for (std::uint64_t i = 0; i < 64; ++i) {
    Stream rng(74, i);
    const auto draw = half(1, rng);
    if (draw.value == 2) {
      seen = true;
      CHECK(draw.difference == -std::numeric_limits<double>::infinity());
    }
  }
  CHECK(seen);
}

// ---- series, trials, products

namespace {

const auto bounded = [](Stream& rng) { return 0.5 + rng.uniform(); };  // E X = 1, E X^2 = 13/12

template <class E>
bool unbiased(const E& e, double truth, std::int64_t samples = 1 << 16) {
  return estimator_laws(e, truth, {.samples = samples, .repeats = 0}).empty();
}

/// |z| of the variance of an estimator against a closed form.
template <class E>
double z_of_variance(const E& e, double exact) {
  const auto r = estimate(e, {.samples = 1 << 17, .seed = 2});
  const double error = exact * std::sqrt((r.moments.kurtosis() - 1) / static_cast<double>(r.samples));
  return std::abs(r.moments.variance() - exact) / error;
}

/// Trials that follow one shifted dyadic sequence: dependent. Of two neighbours one lies in [0, 1/2), so that
/// the mean is 3/2.
struct DependentTrials {
  double operator()(Stream& rng) const {
    const double shift = rng.uniform();
    double radical_inverse = 0;
    for (std::uint64_t n = 0;; ++n) {
      radical_inverse = 0;
      for (std::uint64_t bits = n, place = 1; bits != 0; bits >>= 1, ++place) {
        radical_inverse += static_cast<double>(bits & 1U) * std::ldexp(1.0, -static_cast<int>(place));
      }
      if (std::fmod(radical_inverse + shift, 1.0) < 0.5) return static_cast<double>(n + 1);
    }
  }
};

}  // namespace

TEST_CASE("every way to 1 / E X is unbiased with an honest error on draws between bounds",
          "[reciprocal][statistical]") {
  const Moments pilot = estimate(bounded, {.samples = 1000, .seed = 99}).moments;
  CHECK(estimator_laws(single_term(reciprocal(bounded)), 1) == Failures{});
  CHECK(estimator_laws(single_term(clamped_reciprocal(bounded)), 1) == Failures{});
  CHECK(estimator_laws(roulette(reciprocal_series(bounded, centre_between(0.5, 1.5))), 1) == Failures{});
  CHECK(estimator_laws(roulette(reciprocal_series(bounded, 1.5), RunningWeight(1 / 1.5)), 1) == Failures{});
  CHECK(estimator_laws(reciprocal_trials(bounded, 1.5), 1) == Failures{});
  CHECK(estimator_laws(reciprocal_residual(bounded, 0.5, 1.5), 1) == Failures{});
  CHECK(estimator_laws(reciprocal_product(bounded, 0.9, pilot), 1) == Failures{});

  // Power check: a majorant that cuts, and a survival that is off.
  const auto cut = [](Stream& rng) { return std::min(1.2, bounded(rng)); };
  CHECK_FALSE(unbiased(reciprocal_trials(cut, 1.5), 1));
  const auto off = [e = ReciprocalProduct(bounded, 0.9, 0.3)](Stream& rng) { return 0.7 / 0.68 * e(rng).value; };
  CHECK_FALSE(unbiased(off, 1));
}

TEST_CASE("trials on events of probability p have mean 1/p, variance (1-p)/p^2 and 1/p trials",
          "[reciprocal][statistical]") {
  const auto event = [](Stream& rng) { return rng.uniform() < 0.2 ? 1.0 : 0.0; };
  const auto trials = reciprocal_trials(event, 1);
  CHECK(unbiased(trials, 5));
  CHECK(z_of_variance(trials, 20) < 4.5);
  CHECK(z_of_variance(trials, 22) > 4.5);
  const auto r = estimate(trials, {.samples = 1 << 16});
  CHECK(r.work_per_sample() == Approx(5).epsilon(0.02));
  // The same from a number below a majorant: p = E X / M = 2/3.
  CHECK(z_of_variance(reciprocal_trials(bounded, 1.5), (1 - 2.0 / 3) / (4.0 / 9) / 2.25) < 4.5);
}

TEST_CASE("roulette on the running weight of the series is trials, in law: equal variance and work",
          "[reciprocal][statistical]") {
  const auto series = roulette(reciprocal_series(bounded, 1.5), RunningWeight(1 / 1.5));
  CHECK(z_of_variance(series, (1 - 2.0 / 3) / (4.0 / 9) / 2.25) < 4.5);
  const auto a = estimate(series, {.samples = 1 << 16});
  const auto b = estimate(reciprocal_trials(bounded, 1.5), {.samples = 1 << 16});
  CHECK(a.work_per_sample() == Approx(b.work_per_sample() + 1).epsilon(0.02));  // and 1 for 1 / a
}

TEST_CASE("dependent trials are rejected, independent ones are not", "[reciprocal][statistical]") {
  const auto half = [](Stream& rng) { return rng.uniform() < 0.5 ? 1.0 : 0.0; };
  CHECK_FALSE(unbiased(DependentTrials{}, 2));
  CHECK(estimate(DependentTrials{}, {.samples = 1 << 16}).mean == Approx(1.5).epsilon(0.02));
  CHECK(unbiased(reciprocal_trials(half, 1), 2));
}

TEST_CASE("the product has the variance of its formula, and its best survival from a pilot",
          "[reciprocal][statistical]") {
  // E Z^2 = w^2 / (1 - s) sum (b / s)^k, b = E (1 - w X)^2
  const double w = 0.8;
  const double b = 1 - 2 * w + w * w * 13 / 12;
  const auto variance = [&](double s) { return w * w / (1 - s) / (1 - b / s) - 1; };
  CHECK(z_of_variance(ReciprocalProduct(bounded, w, 0.5), variance(0.5)) < 4.5);
  CHECK(z_of_variance(ReciprocalProduct(bounded, w, 0.5), variance(0.45)) > 4.5);
  CHECK(z_of_variance(reciprocal_residual(bounded, 0.5, 1.5),
                      (1 / 2.25) / (1.0 / 3) / (1 - (1 - 2 / 1.5 + 13.0 / 12 / 2.25) / (2.0 / 3)) - 1) < 4.5);
  const Moments pilot = Moments::of(std::vector<double>{0.5, 1.5});  // E X = 1, E X^2 = 1.25
  CHECK(reciprocal_product(bounded, 0.5, pilot).describe() == "reciprocal_product, w 0.500000, survival 0.559017");
  CHECK_THROWS_WITH(reciprocal_product(bounded, 1.6, pilot), Catch::Contains("0.8"));
}

TEST_CASE("a clamp that vanishes with the level telescopes and makes draws of zero harmless",
          "[reciprocal][statistical]") {
  // X = 0 or 2 with equal chance: the plain doubling is infinite in every second sample.
  const auto sometimes_zero = [](Stream& rng) { return rng.uniform() < 0.5 ? 0.0 : 2.0; };
  const auto clamped = clamped_reciprocal(sometimes_zero);
  // All draws of level k zero: D_k is of the size 2^k, with probability 2^-2^(k-1); above level 6 nothing of
  // it is left.
  CHECK(sequence_laws(clamped, {.first = 2, .last = 8, .samples = 8192, .rates = false}) == Failures{});
  CHECK(unbiased(single_term(clamped, Geometric(0.6), {.base_level = 2}), 1, 1 << 18));
  const auto touching = clamped_reciprocal_of_integral(
      [](double x) { return 4 * (1 + std::sin(2 * std::numbers::pi * x)); }, 1, {.rates = {Rates::faster_than_any, 1}});
  CHECK(unbiased(single_term(touching, Geometric(0.6), {.base_level = 1}), 0.25));

  // A draw that is not a number is not clamped away.
  Stream rng(75, 0);
  const auto broken = clamped_reciprocal([](Stream&) { return std::nan(""); });
  CHECK(std::isnan(broken(0, rng).value));
  CHECK(std::isnan(broken(2, rng).difference));

  // Power check: a clamp that does not telescope.
  struct NoTelescope {
    double at(std::int64_t level, double m) const {
      return 1 / std::fmax(m, std::ldexp(1.0, -static_cast<int>(level) - 1));
    }
    double gap(std::int64_t level, double m, double d) const {
      return at(level, m) - 0.5 * (at(level, m + d) + at(level, m - d));
    }
  };
  CHECK(sequence_laws(function_of_mean(sometimes_zero, NoTelescope{}),
                      {.first = 1, .last = 4, .samples = 1 << 16, .rates = false}) != Failures{});
  CHECK(sequence_laws(clamped, {.first = 1, .last = 4, .samples = 1 << 16, .rates = false}) == Failures{});
}

TEST_CASE("the reciprocal of an array is taken component by component", "[reciprocal][statistical]") {
  const auto rgb = [](Stream& rng) {
    const double u = rng.uniform();
    return Eigen::Array3d(0.5 + u, 1 + u, 3 - u);
  };
  const Eigen::Array3d truth(1, 2.0 / 3, 0.4);
  CHECK(estimator_laws(single_term(reciprocal(rgb)), truth) == Failures{});
  CHECK(estimator_laws(roulette(reciprocal_series(rgb, 1.8), Geometric(0.3)), truth) == Failures{});
}

TEST_CASE("arguments that no reciprocal can have are refused, and draws beyond a majorant thrown out loud",
          "[reciprocal][exact]") {
  CHECK_THROWS_AS(reciprocal_trials(bounded, 0), std::invalid_argument);
  CHECK_THROWS_AS(clamped_reciprocal(bounded, 0), std::invalid_argument);
  CHECK_THROWS_AS(clamped_reciprocal_of_integral(twice, std::nan("")), std::invalid_argument);
  CHECK_THROWS_WITH(reciprocal_residual(bounded, 0, 1.5), Catch::Contains("reciprocal_trials"));
  CHECK_THROWS_AS(reciprocal_residual(bounded, 2, 1.5), std::invalid_argument);
  CHECK_THROWS_AS(ReciprocalProduct(bounded, 0, 0.5), std::invalid_argument);
  CHECK_THROWS_AS(ReciprocalProduct(bounded, 1, 1), std::invalid_argument);
  CHECK_THROWS_AS(reciprocal_product(bounded, 1, Moments{}), std::invalid_argument);
  Stream rng(1, 0);
  CHECK_THROWS_AS(reciprocal_trials([](Stream&) { return 2.0; }, 1.5)(rng), std::domain_error);
  CHECK_THROWS_AS(reciprocal_trials([](Stream&) { return std::nan(""); }, 1.5)(rng), std::domain_error);
}

TEST_CASE("what would never end is given up aloud after 10^9 trials or terms", "[reciprocal][.long]") {
  Stream rng(1, 0);
  NullRecord none;
  CHECK_THROWS_AS(reciprocal_trials([](Stream&) { return 0.0; }, 1)(rng), std::length_error);
  const auto at_the_edge = [](Stream&) { return 0.0; };  // |1 - X / a| = 1: the terms do not fall
  CHECK_THROWS_AS(roulette(reciprocal_series(at_the_edge, 1.0), RunningWeight(1))(rng, none), std::length_error);
}

// ---- draws outside what a method assumes

namespace {

template <class E>
bool refuses_a_draw(const E& e) {
  NullRecord record;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    Stream rng(1, i);
    try {
      (void)draw_sample(e, rng, record);
    } catch (const std::domain_error&) {
      return true;
    }
  }
  return false;
}

}  // namespace

TEST_CASE("draws outside the bounds of trials, residual and clamp are refused, with the value", "[reciprocal][exact]") {
  const auto mostly_one = [](double other) {
    return [other](Stream& rng) { return rng.uniform() < 0.1 ? other : 1.0; };
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double wrong : {-0.5, 2.5, nan, std::numeric_limits<double>::infinity()}) {
    INFO(wrong);
    CHECK(refuses_a_draw(reciprocal_trials(mostly_one(wrong), 2)));
    CHECK(refuses_a_draw(reciprocal_residual(mostly_one(wrong), 0.5, 2)));
  }
  CHECK_FALSE(refuses_a_draw(reciprocal_residual(mostly_one(0.0), 0.5, 2)));  // below m, above 0: unbiased all the same
  CHECK_FALSE(refuses_a_draw(reciprocal_residual(mostly_one(2.0), 0.5, 2)));
  CHECK_FALSE(refuses_a_draw(ReciprocalProduct(mostly_one(-0.5), 0.5, 0.6)));  // converges: E (1 - X / 2)^2 < 0.6
  CHECK(refuses_a_draw(ReciprocalProduct(mostly_one(nan), 0.5, 0.6)));
  for (const double negative : {-1e-9, -3.0}) {
    CHECK(refuses_a_draw(single_term(clamped_reciprocal(mostly_one(negative)))));
    CHECK(refuses_a_draw(single_term(clamped_reciprocal([negative](Stream&) { return negative; }), {.base_level = 3})));
    CHECK(refuses_a_draw(single_term(clamped_reciprocal_of_integral([negative](double) { return negative; }))));
  }
  CHECK_FALSE(refuses_a_draw(single_term(clamped_reciprocal(mostly_one(0.0)))));
}

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/diagnostics.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/pmf/zeta.hpp>

using namespace debias;

namespace {

constexpr double forever = std::numeric_limits<double>::infinity();
constexpr TailExponent of_power(double s) { return {s, Decay::polynomial}; }

}  // namespace

TEST_CASE("r = 0.65 at variance rate 2 and work rate 1: finite, with tail index 0.340", "[diagnostics][exact]") {
  const DeclaredFiniteness v = judge({2, 1}, Geometric(0.65).tail_exponent());
  CHECK(v.finite_variance);
  CHECK(v.finite_work);
  CHECK(std::abs(v.tail_index - 0.340) < 5e-4);
  CHECK_THAT(v.sentence, Catch::Contains("variance finite") && Catch::Contains("work finite") &&
                             Catch::Contains("tail index 0.34") && Catch::Contains("fourth moment is infinite"));
  const DeclaredFiniteness lighter = judge({2, 1}, Geometric(0.60).tail_exponent());
  CHECK(std::abs(lighter.tail_index - 0.244) < 5e-4);
  CHECK_THAT(lighter.sentence, !Catch::Contains("fourth"));
}

TEST_CASE("the borders belong to the infinite", "[diagnostics][exact]") {
  CHECK_FALSE(judge({2, 1}, {2}).finite_variance);
  CHECK(judge({2, 1}, {1.999}).finite_variance);
  CHECK(judge({2, 1}, {2}).tail_index == 0.5);
  CHECK_FALSE(judge({2, 1}, {1}).finite_work);
  CHECK(judge({2, 1}, {1.001}).finite_work);
  CHECK_FALSE(judge({4, 1, Decay::polynomial}, of_power(3)).finite_variance);
  CHECK_FALSE(judge({4, 1, Decay::polynomial}, of_power(2)).finite_work);
  CHECK(judge({4, 1, Decay::polynomial}, of_power(3)).tail_index == 0.5);
  CHECK_THAT(judge({2, 1}, {2.5}).sentence, Catch::Contains("variance INFINITE") && Catch::Contains("between 1 and 2"));
  CHECK_THAT(judge({1, 1}, {1}).sentence, Catch::Contains("no PMF has both"));
}

TEST_CASE("a sum over levels pays for all of them: a power law needs an exponent above 2 beside constant work",
          "[diagnostics][exact]") {
  const Rates zeta_of_two{4, 0, Decay::polynomial};  // terms k^-2
  const Rates sums = rates_of_sum(zeta_of_two);
  CHECK(judge(zeta_of_two, of_power(2)).finite_work);
  CHECK_FALSE(judge(sums, of_power(2)).finite_work);
  CHECK(judge(sums, of_power(2.5)).finite_work);
  CHECK(judge(sums, of_power(2.5)).finite_variance);
  CHECK_FALSE(judge(sums, of_power(3)).finite_variance);
  CHECK(default_exponent(sums) == Approx(13.0 / 6));
  CHECK_FALSE(pmf_exists(rates_of_sum({3, 0, Decay::polynomial})));
  CHECK(rates_of_sum({2, 1}).work_growth == 1);
  // the expected number of terms, sum_k P(N >= k): zeta(3/2) / zeta(5/2), or the logarithm of where it is cut
  const auto terms = [](double s, std::int64_t first, std::int64_t last) {
    const Zeta pmf(s);
    double sum = 0;
    for (std::int64_t k = first; k < last; ++k) sum += pmf.tail(k);
    return sum;
  };
  CHECK(terms(2.5, 0, 100000) == Approx(1.9473 - 0.0031).epsilon(1e-3));
  CHECK(terms(2, 10000, 100000) == Approx(std::log(10.0) * 6 / (std::acos(-1.0) * std::acos(-1.0))).epsilon(1e-3));
}

TEST_CASE("the variance is finite exactly when the tail index is below 1/2", "[diagnostics][exact]") {
  for (const Decay decay : {Decay::geometric, Decay::polynomial}) {
    for (const double variance : {0.5, 1.0, 2.0, 4.0}) {
      for (int i = 9; i < 64; ++i) {  // a power law has an exponent above 1
        const DeclaredFiniteness v = judge({variance, 1, decay}, {i / 8.0, decay});
        REQUIRE(v.finite_variance == (v.tail_index < 0.5));
        REQUIRE(v.tail_index >= 0);
      }
    }
  }
}

TEST_CASE("zeta(2) by its terms: a power law between 1 and 3, a geometric PMF never", "[diagnostics][exact]") {
  const Rates rates{4, 0, Decay::polynomial};
  const DeclaredFiniteness good = judge(rates, Zeta(2).tail_exponent());
  CHECK(good.finite_variance);
  CHECK(good.finite_work);
  CHECK(good.tail_index == 0);  // D_k / p_k is bounded
  CHECK(judge(rates, Zeta(2.5).tail_exponent()).tail_index == Approx(1.0 / 3));
  CHECK_FALSE(judge(rates, Zeta(3).tail_exponent()).finite_variance);
  const DeclaredFiniteness steep = judge(rates, Geometric(0.5).tail_exponent());
  CHECK_FALSE(steep.finite_variance);
  CHECK(steep.finite_work);
  CHECK(steep.tail_index == std::nextafter(1.0, 0.0));  // sum E|D_k| converges, and so does the mean
  CHECK_THAT(steep.sentence, !Catch::Contains("even the mean"));
}

TEST_CASE("a power law is too flat for growing work, a Poisson law too steep for geometric differences",
          "[diagnostics][exact]") {
  const DeclaredFiniteness flat = judge({2, 1}, Zeta(2.5).tail_exponent());
  CHECK(flat.finite_variance);
  CHECK_FALSE(flat.finite_work);
  CHECK(judge({2, 0}, Zeta(2.5).tail_exponent()).finite_work);
  const DeclaredFiniteness steep = judge({2, 1}, Poisson(3).tail_exponent());
  CHECK_FALSE(steep.finite_variance);
  CHECK(steep.finite_work);
  CHECK(steep.tail_index == std::nextafter(1.0, 0.0));  // sum E|D_k| converges, and so does the mean
  CHECK_THAT(steep.sentence, !Catch::Contains("even the mean"));
}

TEST_CASE("differences that end bring a finite variance under every PMF", "[diagnostics][exact]") {
  for (const TailExponent& pmf : {TailExponent{1.5}, of_power(3), TailExponent{forever}}) {
    const DeclaredFiniteness v = judge({Rates::faster_than_any, 1}, pmf);
    CHECK(v.finite_variance);
    CHECK(v.tail_index == 0);
  }
}

TEST_CASE("rates cannot tell what falls faster than any rate from another such thing", "[diagnostics][exact]") {
  const DeclaredFiniteness v = judge({Rates::faster_than_any, 0}, Poisson(3).tail_exponent());
  CHECK_FALSE(v.decided);
  CHECK_THAT(v.sentence,
             Catch::Contains("undecided by rates") && Catch::Contains("sum E D_k^2 / p_k") && !Catch::Contains("inf"));
  const DeclaredFiniteness geometric = judge({Rates::faster_than_any, 0}, Geometric(0.5).tail_exponent());
  CHECK(geometric.decided);
  CHECK_THAT(geometric.sentence, Catch::Contains("variance finite (PMF exponent 1 < faster than any)"));
  const DeclaredFiniteness steep = judge({2, 1}, Poisson(3).tail_exponent());
  CHECK(steep.decided);
  CHECK_THAT(steep.sentence, Catch::Contains("INFINITE (PMF exponent faster than any >= 2)"));
}

TEST_CASE("measured rates decide beyond two of their errors, and never guess", "[diagnostics][exact]") {
  const auto measured = [](double beta, double error, double beta4, RateKind kind = RateKind::geometric) {
    return MeasuredRates{kind, {beta / 2, error}, {beta, error}, {beta4, error}, {1, 0.01}};
  };
  const TailExponent pmf{1.5};
  const MeasuredFiniteness finite = judge(measured(2, 0.1, 4), pmf);
  CHECK(finite.variance == Finiteness::finite);
  CHECK(finite.work == Finiteness::finite);
  CHECK(finite.fourth_moment == Finiteness::infinite);  // 3 x 1.5 > 4
  CHECK(finite.tail_index == Approx(1 - 2 / 3.0));
  CHECK(finite.error == Approx(0.1 / 3));
  CHECK(judge(measured(2, 0.1, 5), pmf).fourth_moment == Finiteness::finite);
  CHECK(judge(measured(2, 0.1, 4.5), pmf).fourth_moment == Finiteness::undecided);
  CHECK(judge(measured(1, 0.1, 2), pmf).variance == Finiteness::infinite);
  CHECK(judge(measured(1.6, 0.1, 3.2), pmf).variance == Finiteness::undecided);
  CHECK(judge(measured(1.4, 0.1, 2.8), pmf).variance == Finiteness::undecided);
  CHECK(judge(measured(2, 0.1, 4), TailExponent{0.9}).work == Finiteness::infinite);
  CHECK(judge(measured(2, 0.1, 4), TailExponent{1.01}).work == Finiteness::undecided);
  CHECK_THAT(judge(measured(1.6, 0.1, 3.2), pmf).sentence,
             Catch::Contains("variance undecided") && Catch::Contains("1.6 +- 0.1") && Catch::Contains("survey"));
  // Power laws: finite iff rho < beta - 1, work finite iff rho > gamma + 1.
  const MeasuredFiniteness power = judge(measured(4, 0.1, 8, RateKind::polynomial), of_power(2.5));
  CHECK(power.variance == Finiteness::finite);
  CHECK(power.work == Finiteness::finite);
  CHECK(judge(measured(4, 0.1, 8, RateKind::polynomial), of_power(3.05)).variance == Finiteness::undecided);
  // Ends and super-exponential falls.
  CHECK(judge(measured(forever, 0, forever, RateKind::exact_zero), Poisson(1).tail_exponent()).variance ==
        Finiteness::finite);
  CHECK(judge(measured(forever, 0, forever, RateKind::super_exponential), pmf).variance == Finiteness::finite);
  const MeasuredFiniteness both =
      judge(measured(forever, 0, forever, RateKind::super_exponential), Poisson(1).tail_exponent());
  CHECK(both.variance == Finiteness::undecided);
  CHECK_THAT(both.sentence, Catch::Contains("sum E D_k^2 / p_k") && !Catch::Contains("inf"));
}

TEST_CASE("the median of means is the median of group means", "[diagnostics][exact]") {
  // ceil(8 ln(1 / 0.5)) = 6 groups of two values; the thirteenth is left out.
  const std::vector<double> values = {0, 2, 10, 30, 4, 6, 1, 1, 7, 9, 3, 3, 1e9};
  const BiasedEstimate e = median_of_means(values, 0.5);
  CHECK(e.groups == 6);
  CHECK(e.value == 4);  // of 1, 20, 5, 1, 8, 3: between 3 and 5
  CHECK(median_of_means(std::vector<double>(24, 2.5)).groups == 24);
  CHECK(median_of_means(std::vector<double>(24, 2.5)).value == 2.5);
  CHECK_THROWS_AS(median_of_means(std::vector<double>(23, 1.0)), std::invalid_argument);
  for (const double delta : {0.0, 1.0, -1.0, std::nan("")}) {
    CHECK_THROWS_AS(median_of_means(values, delta), std::invalid_argument);
  }
}

TEST_CASE("the median of means keeps its bound where the mean does not, and is biased", "[diagnostics][statistical]") {
  // Rare large values: x = 1 / p with probability p = 0.001, so mean 1 and variance 999.
  constexpr int n = 2400;
  constexpr double delta = 0.05;
  const double bound = std::sqrt(999 * 32 * std::log(1 / delta) / n);
  int beyond = 0;
  double sum = 0;
  constexpr int runs = 400;
  for (std::uint64_t seed = 0; seed < runs; ++seed) {
    Stream rng(seed, 0);
    std::vector<double> x;
    for (int i = 0; i < n; ++i) x.push_back(rng.uniform() < 0.001 ? 1000 : 0);
    const double estimate = median_of_means(x, delta).value;
    beyond += std::abs(estimate - 1) > bound ? 1 : 0;
    sum += estimate;
  }
  CHECK(beyond <= runs * delta);
  CHECK(sum / runs < 0.1);  // the truth is 1: a median of skewed means
}

TEST_CASE("batches take quantiles of Student's law", "[diagnostics][exact]") {
  const Interval i = batch_interval(std::vector<double>{1, 2, 3});
  CHECK(i.high == Approx(2 + 4.3026527297494619 / std::sqrt(3)).epsilon(1e-12));
  CHECK(i.low == Approx(2 - 4.3026527297494619 / std::sqrt(3)).epsilon(1e-12));
  CHECK(batch_interval(std::vector<double>{1, 2, 3}, 0.5).high ==
        Approx(2 + 0.816496580927726 / std::sqrt(3)).epsilon(1e-12));
  CHECK_THROWS_AS(batch_interval(std::vector<double>{1}), std::invalid_argument);
  CHECK_THROWS_AS(batch_interval(std::vector<double>{1, 2}, 1), std::invalid_argument);
}

TEST_CASE("blocks double in length before there are too many", "[diagnostics][exact]") {
  BlockMeans blocks;
  for (int i = 0; i < 1023; ++i) blocks.add(i);
  CHECK(blocks.length() == 1);
  CHECK(blocks.means().size() == 1023);
  for (int i = 1023; i < 5000; ++i) blocks.add(i);
  CHECK(blocks.length() == 8);
  REQUIRE(blocks.means().size() == 625);
  for (std::size_t b = 0; b < 625; ++b) REQUIRE(blocks.means()[b] == 8 * static_cast<double>(b) + 3.5);
}

TEST_CASE("batches cover the mean of a chain, which single values do not", "[diagnostics][statistical]") {
  // x' = 0.9 x + noise: neighbours resemble each other, the naive error is 4.4 times too small.
  int covered = 0;
  int naive = 0;
  constexpr int runs = 400;
  for (std::uint64_t seed = 0; seed < runs; ++seed) {
    Stream rng(seed, 1);
    BlockMeans blocks;
    std::vector<double> values;
    double x = rng.normal() / std::sqrt(1 - 0.81);
    for (int i = 0; i < 1 << 14; ++i) {
      x = 0.9 * x + rng.normal();
      blocks.add(x);
      values.push_back(x);
    }
    std::vector<double> batches;  // 32 of 512
    for (std::size_t b = 0; b < blocks.means().size(); b += 16) {
      double sum = 0;
      for (std::size_t k = b; k < b + 16; ++k) sum += blocks.means()[k];
      batches.push_back(sum / 16);
    }
    const Interval i = batch_interval(batches);
    covered += i.low <= 0 && 0 <= i.high ? 1 : 0;
    const Interval j = batch_interval(values);
    naive += j.low <= 0 && 0 <= j.high ? 1 : 0;
  }
  // 4.5 standard errors of a proportion of 0.95 in 400 runs are 0.049; batches of 512 leave 0.7 % of the error out.
  CHECK(covered >= runs * (0.94 - 0.049));
  CHECK(covered <= runs * 0.999);
  CHECK(naive < runs * 0.6);
}

namespace {

/// log P(|Z| > t) falls by 1 / xi for each unit of log t. Measured on Z = D_N / p_N, D_k = 2^(-beta k / 2) times
/// a normal number, between two thresholds four periods of the PMF's lattice apart.
struct MeasuredTail {
  double inverse_index;
  double error;

  [[nodiscard]] bool agrees(double xi) const { return std::abs(inverse_index - 1 / xi) <= 4.5 * error; }
};

MeasuredTail measure_tail(const Geometric& pmf, double beta) {
  constexpr std::int64_t n = 1'000'000;
  const double period = pmf.tail_exponent().exponent - beta / 2;  // log2 of Z from level to level
  const double low = 16;
  const double high = low * std::exp2(4 * period);
  double above_low = 0;
  double above_high = 0;
  for (std::int64_t i = 0; i < n; ++i) {
    Stream rng(17, static_cast<std::uint64_t>(i));
    const std::int64_t level = pmf.sample(rng.uniform());
    const double d = rng.normal() * std::exp2(-beta / 2 * static_cast<double>(level));
    const double z = std::abs(d / pmf.mass(level));
    above_low += z > low ? 1 : 0;
    above_high += z > high ? 1 : 0;
  }
  const double log_ratio = std::log(high / low);
  return {std::log(above_low / above_high) / log_ratio, std::sqrt(1 / above_high - 1 / above_low) / log_ratio};
}

}  // namespace

TEST_CASE("simulated weights have the tail index of the verdict, and no neighbouring one",
          "[diagnostics][statistical]") {
  const auto index = [](double beta, double r) { return judge({beta, 1}, Geometric(r).tail_exponent()).tail_index; };
  const MeasuredTail at_65 = measure_tail(Geometric(0.65), 2);
  CAPTURE(at_65.inverse_index, at_65.error);
  CHECK(at_65.agrees(index(2, 0.65)));
  CHECK_FALSE(at_65.agrees(index(2, 0.60)));
  CHECK_FALSE(at_65.agrees(index(2.25, 0.65)));
  const MeasuredTail at_75 = measure_tail(Geometric(0.75), 1.5);
  CAPTURE(at_75.inverse_index, at_75.error);
  CHECK(at_75.agrees(index(1.5, 0.75)));
  CHECK_FALSE(at_75.agrees(index(1.5, 0.65)));
}

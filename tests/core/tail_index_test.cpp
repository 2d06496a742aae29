#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/tail_index.hpp>
#include <debias/pmf/geometric.hpp>

using namespace debias;

namespace {

constexpr double forever = std::numeric_limits<double>::infinity();

// As in tail_index_reference.R: quantiles of a generalised Pareto law, shifted a little, in ascending order.
std::vector<double> quantiles(int n, double xi, double shift) {
  std::vector<double> values;
  for (int i = n; i >= 1; --i) {
    const double u = (i - 0.5 + 0.4 * std::sin(shift * i)) / n;
    values.push_back(xi == 0 ? -std::log(u) : std::expm1(-xi * std::log(u)) / xi);
  }
  std::sort(values.begin(), values.end());
  return values;
}

TailIndex index_of(std::vector<double> values) {
  std::sort(values.begin(), values.end(), std::greater<>());
  const auto n = static_cast<std::int64_t>(values.size());
  values.resize(static_cast<std::size_t>(std::min<std::int64_t>(n, 4096)));
  return tail_index(values, n, 0);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// A law of numbers with tail index xi, and whether they lie on a lattice.
struct Family {
  std::string name;
  bool lattice;
  double beta;  // of the differences
  std::function<double(double xi, Stream& rng)> draw;
};

// D_N / p_N with D_k = 2^(-beta k / 2) times a factor, and a geometric PMF that makes its tail index xi.
template <class Factor>
auto single(double beta, Factor factor) {
  return [=](double xi, Stream& rng) {
    const auto pmf = Geometric::with_exponent(beta / (2 * (1 - xi)));
    const std::int64_t level = pmf.sample(rng.uniform());
    return factor(rng) * std::exp2(-beta / 2 * static_cast<double>(level)) / pmf.mass(level);
  };
}

// sum_(k <= N) q^k / P(N >= k) with P(N >= k) = r^k.
auto roulette_of_series(double q) {
  return [q](double xi, Stream& rng) {
    const double survival = std::pow(q, 1 / (1 - xi));
    double sum = 1;
    double term = 1;
    while (rng.uniform() < survival) sum += term *= q / survival;
    return sum;
  };
}

std::vector<Family> families() {
  const auto one = [](Stream&) { return 1.0; };
  return {
      {"roulette of the sum of 0.8^k", true, 0.644, roulette_of_series(0.8)},
      {"roulette of the sum of 0.95^k", true, 0.148, roulette_of_series(0.95)},
      {"roulette of the sum of 0.5^k", true, 2, roulette_of_series(0.5)},
      {"single term, beta = 0.6", true, 0.6, single(0.6, one)},
      {"single term, beta = 2", true, 2, single(2, one)},
      {"generalised Pareto", false, 0,
       [](double xi, Stream& rng) { return std::expm1(-xi * std::log(rng.uniform())) / xi; }},
      {"single term x exponential, beta = 0.5", false, 0.5, single(0.5, [](Stream& rng) { return rng.exponential(); })},
      {"single term x normal squared, beta = 1", false, 1,
       single(1,
              [](Stream& rng) {
                const double z = rng.normal();
                return z * z;
              })},
  };
}

struct Medians {
  double k;
  double plain;
};

Medians medians(const Family& family, double xi, int seeds) {
  std::vector<double> k;
  std::vector<double> plain;
  for (int s = 1; s <= seeds; ++s) {
    const auto r = estimate([&](Stream& rng) { return family.draw(xi, rng); },
                            {.samples = 10'000, .seed = static_cast<std::uint64_t>(s), .threads = 1});
    const TailIndex index = tail_index(r.upper_tail, r.moments.count, r.moments.mean);
    k.push_back(index.k);
    plain.push_back(index.plain);
  }
  return {median(k), median(plain)};
}

}  // namespace

TEST_CASE("the fit is that of loo::gpdfit to 1e-9 on twenty data sets", "[tail_index][exact]") {
  struct Reference {
    int n;
    double xi, shift, k, sigma;
  };
  // Rscript tests/core/tail_index_reference.R
  const std::vector<Reference> all = {
      {20, -0.4, 3.4571428571428573, -0.24544279667733387, 0.87005197500075682},
      {20, 0.0, 3.8571428571428572, 0.16431342216831282, 0.86584919052685128},
      {20, 0.3, 4.1571428571428575, 0.48320962807186651, 0.86728943609688469},
      {20, 0.7, 4.5571428571428569, 0.89700735657445818, 0.89715824629417884},
      {20, 1.2, 5.0571428571428569, 1.3708633320548615, 0.94657868638568143},
      {60, -0.4, 9.1714285714285708, -0.35673415077524195, 0.95688712905665685},
      {60, 0.0, 9.5714285714285712, 0.043085810513850409, 0.95536413628523098},
      {60, 0.3, 9.8714285714285719, 0.34413538179057673, 0.95747731486755372},
      {60, 0.7, 10.27142857142857, 0.74773077707972968, 0.96499886733296947},
      {60, 1.2, 10.77142857142857, 1.2540918878131562, 0.98357888250010672},
      {300, -0.4, 43.457142857142856, -0.37853416703457127, 0.98050833551515959},
      {300, 0.0, 43.857142857142854, 0.013526178577239083, 0.98790583123416309},
      {300, 0.3, 44.157142857142851, 0.29580493991508355, 0.99959456958724946},
      {300, 0.7, 44.557142857142857, 0.68979304583227286, 1.0042435918981683},
      {300, 1.2, 45.057142857142857, 1.1851114882454283, 1.0079885801586399},
      {3000, -0.4, 429.17142857142858, -0.40042528869925315, 1.0002812783559765},
      {3000, 0.0, 429.57142857142856, 7.7040232149846267e-06, 0.99980227993959003},
      {3000, 0.3, 429.87142857142857, 0.30008214475279238, 0.99970457640395793},
      {3000, 0.7, 430.27142857142854, 0.69984037359479057, 0.9999387549403006},
      {3000, 1.2, 430.77142857142854, 1.1996788934183162, 1.0002770302830586},
  };
  REQUIRE(all.size() == 20);
  for (const Reference& r : all) {
    const ParetoFit fit = fit_pareto(quantiles(r.n, r.xi, r.shift));
    CAPTURE(r.n, r.xi, fit.k, fit.sigma);
    CHECK(std::abs(fit.k - r.k) < 1e-9);
    CHECK(std::abs(fit.sigma - r.sigma) < 1e-9);
  }
}

TEST_CASE("on continuous numbers k is the pareto_k of loo::psis, prior, tail size and cutoff included",
          "[tail_index][exact]") {
  struct Reference {
    int n;
    double xi, shift, k;
  };
  const std::vector<Reference> all = {
      {400, 0.2, 58.342857142857149, 0.22772981676097251},  {400, 0.6, 58.742857142857147, 0.55442194114228349},
      {2500, 0.2, 358.34285714285716, 0.21372740301521037}, {2500, 0.6, 358.74285714285719, 0.57064884930171278},
      {10000, 0.2, 1429.7714285714287, 0.2155463479055893}, {10000, 0.6, 1430.1714285714286, 0.60114850622279736},
  };
  for (const Reference& r : all) {
    const TailIndex index = index_of(quantiles(r.n, r.xi, r.shift));
    CAPTURE(r.n, r.xi, index.k);
    CHECK(std::abs(index.k - r.k) < 1e-9);
    CHECK(index.plain == index.k);
    CHECK_FALSE(index.ties);
  }
}

TEST_CASE("the tail has 3 sqrt n values, at least five and at most half", "[tail_index][exact]") {
  CHECK(tail_size(10'000) == 300);
  CHECK(tail_size(10'100) == 301);
  CHECK(tail_size(226) == 45);
  CHECK(tail_size(225) == 45);
  CHECK(tail_size(100) == 20);
  CHECK(tail_size(20) == 5);
  CHECK(tail_size(8) == 4);
  CHECK(tail_size(1) == 0);
}

TEST_CASE("the median of k is within 0.1 of the tail index, on lattices as on continuous numbers",
          "[tail_index][statistical][stat]") {
  int plain_off = 0;
  int lattices = 0;
  for (const Family& family : families()) {
    for (const double xi : {0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}) {
      // A PMF that falls by more than 10 from level to level shows 10^4 samples fewer than four of them.
      if (family.beta / (2 * (1 - xi)) > 3.4) continue;
      const Medians m = medians(family, xi, 31);
      CAPTURE(family.name, xi, m.k, m.plain);
      CHECK(std::abs(m.k - xi) < 0.1);
      if (!family.lattice) {
        CHECK(m.plain == m.k);
      } else {
        ++lattices;
        plain_off += std::abs(m.plain - xi) < 0.1 ? 0 : 1;
      }
    }
  }
  // The power check: the fit that takes ties as they are fails the same test on most lattices.
  CAPTURE(plain_off, lattices);
  CHECK(10 * plain_off > 8 * lattices);
}

TEST_CASE("bounded numbers have no heavy tail", "[tail_index][statistical]") {
  const auto index = [](auto draw) {
    const auto r = estimate(draw, {.samples = 10'000, .seed = 3, .threads = 1});
    return tail_index(r.upper_tail, r.moments.count, r.moments.mean);
  };
  const TailIndex uniform = index([](Stream& rng) { return rng.uniform(); });
  CHECK(uniform.k < -0.5);
  const TailIndex coin = index([](Stream& rng) { return rng.uniform() < 0.5 ? 1.0 : 0.0; });
  CHECK(coin.state == TailState::bounded);
  const TailIndex die = index([](Stream& rng) { return std::floor(6 * rng.uniform()); });
  CHECK(die.k < -0.5);
  const TailIndex seldom = index([](Stream& rng) { return rng.uniform() < 0.015 ? 1.0 : 0.0; });
  CHECK(seldom.state == TailState::bounded);
  const TailIndex weights = index([](Stream& rng) {  // D_k / p_k bounded: a PMF as flat as the differences
    const Geometric pmf(0.5);
    const std::int64_t level = pmf.sample(rng.uniform());
    return rng.uniform() * std::exp2(static_cast<double>(-level)) / pmf.mass(level);
  });
  CHECK(weights.k < 0);
  for (const TailIndex* light : {&coin, &seldom}) CHECK(light->k == -forever);
}

TEST_CASE("too few values to see a shape are no tail at all", "[tail_index][exact]") {
  CHECK(index_of({}).state == TailState::too_few);
  CHECK(index_of({1}).state == TailState::too_few);
  CHECK(index_of({1, 2, 3, 4}).state == TailState::too_few);
  std::vector<double> rare(10'000, 0.0);
  std::fill(rare.begin(), rare.begin() + 20, 1.0);  // twenty of one value: what lies beyond it?
  CHECK(index_of(rare).state == TailState::too_few);
  CHECK(index_of(std::vector<double>(1000, 7.0)).state == TailState::bounded);
}

TEST_CASE("k does not depend on scale and place of the numbers", "[tail_index][exact]") {
  const auto pmf = Geometric::with_exponent(2);
  std::vector<double> lattice;
  std::vector<double> smooth = quantiles(5000, 0.4, 1.5);
  for (std::uint64_t i = 0; i < 5000; ++i) {
    const std::int64_t level = pmf.sample(Stream(1, i).uniform());
    lattice.push_back(std::exp2(static_cast<double>(-level)) / pmf.mass(level));
  }
  for (const std::vector<double>& values : {lattice, smooth}) {
    const double k = index_of(values).k;
    for (const double scale : {1e-150, 0.37, 1e150}) {
      std::vector<double> scaled = values;
      for (double& x : scaled) x *= scale;
      CHECK(std::abs(index_of(scaled).k - k) < 1e-9);
    }
    std::vector<double> moved = values;
    for (double& x : moved) x -= 1000;
    CHECK(std::abs(index_of(moved).k - k) < 1e-6);
  }
  CHECK(index_of(lattice).ties);
  CHECK_FALSE(index_of(smooth).ties);
}

TEST_CASE("values that differ by rounding only are ties", "[tail_index][exact]") {
  const auto pmf = Geometric::with_exponent(2);
  std::vector<double> exact;
  std::vector<double> rounded;
  for (std::uint64_t i = 0; i < 10'000; ++i) {
    Stream rng(1, i);
    const std::int64_t level = pmf.sample(rng.uniform());
    exact.push_back(std::exp2(static_cast<double>(-level)) / pmf.mass(level));
    rounded.push_back(exact.back() * (1 + 1e-15 * (rng.uniform() - 0.5)));
  }
  CHECK(std::abs(index_of(rounded).k - index_of(exact).k) < 1e-9);
}

TEST_CASE("Hill, moment and Pickands estimators on exact Pareto quantiles", "[tail_index][exact]") {
  // x = u^(-1/2) has index 1/2: Hill is consistent there, the others everywhere.
  std::vector<double> values;
  for (int i = 1; i <= 1'000'000; ++i) values.push_back(std::sqrt(1'000'000 / (i - 0.5)));
  const TailIndex index = index_of(values);
  CHECK(std::abs(index.hill - 0.5) < 0.01);
  CHECK(std::abs(index.moment - 0.5) < 0.02);
  CHECK(std::abs(index.pickands - 0.5) < 0.01);
  CHECK(std::abs(index.k - 0.5) < 0.01);
}

TEST_CASE("sample size, threshold and rate of convergence at a tail index", "[tail_index][exact]") {
  CHECK(samples_for_mean(0.5) == Approx(100));
  CHECK(samples_for_mean(0.7) == Approx(2154.43469));
  CHECK(samples_for_mean(-1) == Approx(10));
  CHECK(samples_for_mean(1) == forever);
  CHECK(usable_tail_index(100) == Approx(0.5));
  CHECK(usable_tail_index(320) == Approx(0.6).margin(0.01));
  CHECK(usable_tail_index(10'000) == 0.7);
  CHECK(convergence_rate(0.2, 1'000'000) == Approx(1).margin(0.01));
  CHECK(convergence_rate(0.5, 1000) == Approx(1000.0 / 999 - 1 / std::log(1000)));
  CHECK(convergence_rate(0.5 + 1e-10, 1000) == Approx(convergence_rate(0.5, 1000)).epsilon(1e-6));
  CHECK(convergence_rate(0.75, 100'000'000) == Approx(0.5).margin(0.01));
  CHECK(convergence_rate(1, 1000) == 0);
}

TEST_CASE("a fit asks for five exceedances, most of them positive", "[tail_index][exact]") {
  CHECK_THROWS_AS(fit_pareto(std::vector<double>{1, 2, 3, 4}), std::invalid_argument);
  CHECK_THROWS_AS(fit_pareto(std::vector<double>{0, 0, 0, 0, 1}), std::invalid_argument);
  CHECK_NOTHROW(fit_pareto(std::vector<double>{1, 2, 3, 4, 5}));
}

TEST_CASE("the error of k is no less than that of a Pareto law, (1 + k) / sqrt(values)", "[tail_index][exact]") {
  for (const double k : {0.5, 1.0, 1.5}) {
    std::vector<double> x;
    constexpr int n = 4096;
    for (int i = 1; i <= n; ++i) x.push_back(std::pow(static_cast<double>(n + 1) / i, k));  // quantiles, descending
    x.resize(1024);
    const TailIndex t = tail_index(x, n, 0);
    CAPTURE(k, t.k, t.error, t.values);
    REQUIRE(t.k > 0.8 * k);
    CHECK(t.error * std::sqrt(static_cast<double>(t.values)) > 0.97 * (1 + t.k));
  }
}

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"
#include "recipe/choice.hpp"

#include <debias/core/stream.hpp>
#include <debias/recipe/optimal_pmf.hpp>

using namespace debias;

namespace {

double power(double x, double k) { return std::pow(x, k); }

// 10^(-3 ... 3)
double any_size(Stream& rng) { return power(10, 6 * rng.uniform() - 3); }

/// (sum nu / q) (sum w q), with q_0 = 1.
double product_of_tails(const std::vector<double>& nu, const std::vector<double>& work, const std::vector<double>& q) {
  double variance = 0;
  double cost = 0;
  for (std::size_t k = 0; k < nu.size(); ++k) {
    variance += nu[k] / q[k];
    cost += work[k] * q[k];
  }
  return variance * cost;
}

/// The least product over all falling q, by trying every way to cut the levels into pools of equal q: within a
/// pool and with the order left out, the best q is sqrt(sum nu / sum w).
double brute_force_tails(const std::vector<double>& nu, const std::vector<double>& work) {
  const std::size_t n = nu.size();
  double best = std::numeric_limits<double>::infinity();
  for (std::uint32_t cuts = 0; cuts < std::uint32_t{1} << (n - 1); ++cuts) {
    std::vector<double> q(n);
    bool valid = true;
    for (std::size_t first = 0; first < n;) {
      std::size_t last = first + 1;
      while (last < n && (cuts >> (last - 1) & 1) == 0) ++last;
      double increment = 0;
      double cost = 0;
      for (std::size_t k = first; k < last; ++k) {
        increment += nu[k];
        cost += work[k];
      }
      valid = valid && increment > 0;
      for (std::size_t k = first; k < last; ++k) q[k] = std::sqrt(std::max(increment, 0.0) / cost);
      valid = valid && (first == 0 || q[first] <= q[first - 1]);
      first = last;
    }
    if (valid) best = std::min(best, product_of_tails(nu, work, q));
  }
  return best;
}

TermMoments random_moments(Stream& rng, std::size_t n) {
  TermMoments m;
  for (std::size_t k = 0; k < n; ++k) {
    m.variance.push_back(any_size(rng));
    m.mean_square.push_back(any_size(rng));
    m.work.push_back(any_size(rng));
  }
  return m;
}

/// True when no exchange of mass between two levels lowers the product.
bool is_local_optimum(const TermMoments& m, const std::vector<double>& p) {
  const double product = predict(m, p).product();
  for (std::size_t i = 0; i < p.size(); ++i) {
    for (std::size_t j = 0; j < p.size(); ++j) {
      for (const double share : {0.1, 0.01}) {
        std::vector<double> moved = p;
        moved[i] -= share * p[i];
        moved[j] += share * p[i];
        if (i != j && predict(m, moved).product() < product * (1 - 1e-9)) return false;
      }
    }
  }
  return true;
}

// E D_k^2 and the work of A10 [facts: 0.75 (n + 1) / n^3, n = 2^j; work 2 n].
TermMoments square_of_mean(int levels) {
  TermMoments m;
  for (int j = 0; j < levels; ++j) {
    const double n = power(2, j);
    const double mean = -1 / (2 * n);
    m.mean_square.push_back(mean * mean);
    m.variance.push_back(0.75 * (n + 1) / (n * n * n) - mean * mean);
    m.work.push_back(2 * n);
  }
  return m;
}

}  // namespace

TEST_CASE("the hull PMF is the best of all falling survival PMFs on 1000 random problems",
          "[recipe][optimal_pmf][exact]") {
  Stream rng(20220811, 0);
  for (int i = 0; i < 1000; ++i) {
    const auto n = static_cast<std::size_t>(2 + i % 7);
    std::vector<double> nu;
    std::vector<double> work;
    for (std::size_t k = 0; k < n; ++k) {
      // Some increments are negative: the distance to the limit need not fall at every level.
      const double sign = k > 0 && rng.uniform() < 0.2 ? -0.1 : 1;
      nu.push_back(sign * any_size(rng));
      work.push_back(any_size(rng));
    }
    const std::vector<double> q = best_tails(nu, work);
    CAPTURE(i, n);
    REQUIRE(q.front() == 1);
    bool ends = false;
    for (std::size_t k = 1; k < n; ++k) {
      REQUIRE(q[k] <= q[k - 1]);
      ends = ends || q[k] == 0;  // increments that sum to less than nothing: no reason to go there
    }
    if (ends) continue;
    REQUIRE(product_of_tails(nu, work, q) == Approx(brute_force_tails(nu, work)).epsilon(1e-10));
  }
}

TEST_CASE("the best masses cannot be improved, with a base, a fixed part, strata or none of them",
          "[recipe][optimal_pmf][exact]") {
  Stream rng(20220811, 1);
  for (int i = 0; i < 200; ++i) {
    TermMoments m = random_moments(rng, 3 + static_cast<std::size_t>(i % 5));
    if (i % 2 == 1) {
      m.fixed_variance = any_size(rng);
      m.fixed_work = any_size(rng);
    }
    if (i % 3 == 1) {
      for (std::size_t k = 0; k < m.work.size(); ++k) m.base_variance.push_back(any_size(rng));
    }
    if (i % 4 == 3) m.block = 16;
    const std::vector<double> p = best_masses(m);
    double sum = 0;
    for (const double x : p) sum += x;
    CAPTURE(i);
    REQUIRE(sum == Approx(1).epsilon(1e-12));
    if (m.block == 1) REQUIRE(is_local_optimum(m, p));
    if (m.block > 1) {  // not convex there: near enough
      for (std::size_t k = 0; k < p.size(); ++k) REQUIRE(p[k] > 0);
    }
  }
  // Power: equal masses are not optimal.
  TermMoments m = random_moments(rng, 4);
  CHECK_FALSE(is_local_optimum(m, {0.25, 0.25, 0.25, 0.25}));
}

TEST_CASE("a variance predicted of correlated terms is the exact one of all that can be drawn",
          "[recipe][optimal_pmf][exact]") {
  // Outcomes of one draw, each as likely: the base B and the difference D of level k. Every base has mean 2; covariances
  // of both signs.
  const std::vector<std::vector<double>> bases{{1, 3, 2, 2}, {0, 1, 3, 4}, {5, 1, 2, 0}};
  const std::vector<std::vector<double>> differences{{1, 4, 2, 3}, {-1, 0.5, 0.25, 2}, {-0.5, 0.25, 0.5, 0.125}};
  const auto mean_of = [](const std::vector<double>& x) { return (x[0] + x[1] + x[2] + x[3]) / 4; };
  TermMoments m;
  double above = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::vector<double>& b = bases[k];
    const std::vector<double>& d = differences[k];
    const double mean = mean_of(d);
    m.mean_square.push_back(mean * mean);
    m.variance.push_back((d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + d[3] * d[3]) / 4 - mean * mean);
    m.base_variance.push_back((b[0] * b[0] + b[1] * b[1] + b[2] * b[2] + b[3] * b[3]) / 4 - 4);
    m.covariance.push_back((b[0] * d[0] + b[1] * d[1] + b[2] * d[2] + b[3] * d[3]) / 4 - 2 * mean);
    m.work.push_back(power(2, static_cast<double>(k)));
    above += mean;
  }
  m.fixed_variance = -above * above;
  for (const std::vector<double>& p : {std::vector<double>{0.5, 0.3, 0.2}, {0.1, 0.2, 0.7}, {0.9, 0.09, 0.01}}) {
    // Z = B_k + D_k / p_k with probability p_k
    double first = 0;
    double second = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t i = 0; i < 4; ++i) {
        const double z = bases[k][i] + differences[k][i] / p[k];
        first += p[k] / 4 * z;
        second += p[k] / 4 * z * z;
      }
    }
    CAPTURE(p);
    CHECK(first == Approx(2 + above).epsilon(1e-12));
    CHECK(predict(m, p).variance == Approx(second - first * first).epsilon(1e-10));
    CHECK(predict(m, p).work == Approx(p[0] + 2 * p[1] + 4 * p[2]).epsilon(1e-12));
  }
}

TEST_CASE("a covariance falls like the deviations of base and difference where members run together",
          "[recipe][optimal_pmf][exact]") {
  TermMoments m;
  m.variance = {3, 5};
  m.mean_square = {0, 0};
  m.work = {1, 2};
  m.base_variance = {7, 11};
  m.covariance = {-1.5, 2.5};
  m.block = 16;
  // Of 1, 2, 4, 8 members.
  m.variance_left = {{1, 0.5, 0.25, 0.0625}, {1, 0.81, 0.36, 0.16}};
  m.base_left = {{1, 0.5, 0.36, 0.25}, {1, 0.64, 0.25, 0.04}};
  // 8 members of each.
  CHECK(predict(m, std::vector<double>{0.5, 0.5}).variance ==
        Approx(0.5 * 7 * 0.25 + 0.5 * 11 * 0.04 + 3 * 0.0625 / 0.5 + 5 * 0.16 / 0.5 +
               2 * (-1.5 * 0.5 * 0.25 + 2.5 * 0.2 * 0.4)));
  // 4 and 2 of them, which need not be all.
  CHECK(predict(m, std::vector<double>{0.25, 0.125}).variance ==
        Approx(0.25 * 7 * 0.36 + 0.125 * 11 * 0.64 + 3 * 0.25 / 0.25 + 5 * 0.81 / 0.125 +
               2 * (-1.5 * 0.6 * 0.5 + 2.5 * 0.8 * 0.9)));
}

TEST_CASE(
    "strata leave a quarter of a squared mean by the members of a level, and all of it below a quarter of a member",
    "[recipe][optimal_pmf][exact]") {
  TermMoments m;
  m.variance = {3, 5, 7};
  m.mean_square = {4, 9, 16};
  m.work = {1, 2, 4};
  m.fixed_variance = 0.5;
  m.block = 64;
  // 32, 1 and 1/8 members: 1/128, 1/4 and all.
  CHECK(predict(m, std::vector<double>{0.5, 0x1p-6, 0x1p-9}).variance ==
        Approx(0.5 + (3 + 4.0 / 128) * 2 + (5 + 9.0 / 4) * 64 + (7 + 16.0) * 512));
  // 1/4, 1/2 and 48: all, a half and 1/192.
  CHECK(predict(m, std::vector<double>{0x1p-8, 0x1p-7, 0.75}).variance ==
        Approx(0.5 + (3 + 4.0) * 256 + (5 + 9.0 / 2) * 128 + (7 + 16.0 / 192) / 0.75));
  // Never less than what n members can do at best: a number of them that is 0 or 1 has the variance f (1 - f).
  for (double f = 1.0 / 16; f < 1; f += 1.0 / 16) {
    const double p = f / 64;
    TermMoments one;
    one.variance = {0};
    one.mean_square = {1};
    one.work = {1};
    one.block = 64;
    CAPTURE(f);
    CHECK(predict(one, std::vector<double>{p}).variance >= f * (1 - f) / (64 * p * p) * (1 - 1e-12));
  }
  m.block = 1;
  CHECK(predict(m, std::vector<double>{0.5, 0.25, 0.25}).variance == Approx(0.5 + 7 * 2 + 14 * 4 + 23 * 4));
}

TEST_CASE("the best masses know no unit, and nothing is below their bound", "[recipe][optimal_pmf][exact]") {
  Stream rng(20261130, 0);
  for (int i = 0; i < 200; ++i) {
    TermMoments m = random_moments(rng, 3 + static_cast<std::size_t>(i % 30));
    m.fixed_work = any_size(rng);
    m.fixed_variance = any_size(rng);
    if (i % 3 == 1) m.base_variance.assign(m.work.size(), any_size(rng));
    if (i % 2 == 1) {
      m.block = 64;
      m.variance_left.assign(m.work.size(), {1, 0.4, 0.2, 0.1});
    }
    const std::vector<double> p = best_masses(m);
    CAPTURE(i);
    CHECK(predict(m, p).product() >= least_product(m) * (1 - 1e-12));
    CHECK(least_product(m) > 0);
    TermMoments tiny = m;
    for (std::vector<double>* squares : {&tiny.variance, &tiny.mean_square, &tiny.base_variance}) {
      for (double& x : *squares) x *= 0x1p-900;
    }
    tiny.fixed_variance *= 0x1p-900;
    CHECK(best_masses(tiny) == p);
  }
  TermMoments m = random_moments(rng, 4);
  m.fixed_variance = -1e9;
  CHECK(least_product(m) == 0);
}

TEST_CASE("where the members of a level run together no other masses are better by three percent",
          "[recipe][optimal_pmf][exact]") {
  // What is left of a variance: nothing in the limit, falling like c^-e, or a part of it for ever.
  const auto falling = [](double e, double rest) {
    std::vector<double> shares;
    for (int i = 0; i < 10; ++i) shares.push_back(rest + (1 - rest) * power(2, -e * i));
    return shares;
  };
  Stream rng(20220811, 2);
  double worst = 0;
  double gain = 1;
  for (int i = 0; i < 100; ++i) {
    TermMoments m = random_moments(rng, 3);
    m.block = 4096;
    m.mean_square = {1e-9, 1e-9, 1e-9};
    const std::vector<double> blind = best_masses(m);
    for (int k = 0; k < 3; ++k) {
      const double e = 3 * rng.uniform();
      m.variance_left.push_back(falling(e, i % 2 == 0 ? 0 : rng.uniform()));
    }
    const double found = predict(m, best_masses(m)).product();
    gain = std::min(gain, found / predict(m, blind).product());
    double best = found;
    for (double a = 1e-3; a < 1; a *= 1.1) {
      for (double b = 1e-3; b < 1e3; b *= 1.1) {
        const std::vector<double> p{a, (1 - a) * b / (1 + b), (1 - a) / (1 + b)};
        best = std::min(best, predict(m, p).product());
      }
    }
    worst = std::max(worst, found / best);
  }
  CAPTURE(worst, gain);
  CHECK(worst < 1.03);  // it is not convex where a level has about one member
  CHECK(gain < 0.2);    // masses that know nothing of it are up to that much worse
}

TEST_CASE("without base the masses are sqrt(a / (w + kappa)), with a costly base sqrt(a / w)",
          "[recipe][optimal_pmf][exact]") {
  TermMoments m = square_of_mean(24);
  const double mean = 1;
  m.fixed_variance = -mean * mean;  // Base::one_outcome with independent members: V = sum a / p - I^2
  const std::vector<double> p = best_masses(m);
  const VarianceAndWork best = predict(m, p);
  const double kappa = best.work * mean * mean / best.variance;
  for (std::size_t k = 1; k < 8; ++k) {
    const auto ratio = [&](std::size_t i) {
      return p[i] / std::sqrt((m.variance[i] + m.mean_square[i]) / (m.work[i] + kappa));
    };
    CHECK(ratio(k) == Approx(ratio(0)).epsilon(1e-6));
  }
  m.fixed_variance = 0;
  const std::vector<double> plain = best_masses(m);
  CHECK(plain[1] / plain[0] == Approx(std::sqrt(0.28125 / 1.5 / 2)).epsilon(1e-9));
}

TEST_CASE("A10 has its optimum at 24.97 and at 19.01 with strata and geometric PMFs have their known products",
          "[recipe][optimal_pmf][exact]") {
  TermMoments m = square_of_mean(60);
  CHECK(predict(m, best_masses(m)).product() == Approx(24.9665).epsilon(1e-4));
  const auto geometric = [&](double r) {
    std::vector<double> p;
    for (int j = 0; j < 60; ++j) p.push_back(r * power(1 - r, j));
    return predict(m, p).product();
  };
  CHECK(geometric(0.60) == Approx(30.909).epsilon(1e-3));
  CHECK(geometric(0.65) == Approx(25.278).epsilon(1e-3));
  CHECK(geometric(0.70) == Approx(28.929).epsilon(2e-2));  // 60 levels of a slow sum
  m.block = std::int64_t{1} << 50;
  CHECK(predict(m, best_masses(m)).product() == Approx(19.0052).epsilon(1e-4));
}

TEST_CASE("PMFs from impossible moments are refused", "[recipe][optimal_pmf][exact]") {
  TermMoments m = square_of_mean(3);
  m.variance[1] = m.mean_square[1] = 0;
  CHECK_THROWS_WITH(best_masses(m), Catch::Contains("level 1 = 0") && Catch::Contains("upper bound"));
  m = square_of_mean(3);
  m.work.pop_back();
  CHECK_THROWS_AS(best_masses(m), std::invalid_argument);
  CHECK_THROWS_AS(predict(square_of_mean(3), std::vector<double>{0.5, 0.5}), std::invalid_argument);
  const std::vector<double> one{1};
  CHECK_THROWS_AS(best_tails(one, std::vector<double>{0.0}), std::invalid_argument);
  CHECK_THROWS_AS(best_tails(one, std::vector<double>{}), std::invalid_argument);
}

#include <debias/steady_state.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;
using laws::SequenceLawOptions;

namespace {

double square(double x) { return x * x; }
double itself(double x) { return x; }

// The chains of the catalogue, group H.
double autoregressive(double x, Stream& rng) { return 0.5 * x + rng.normal(); }
double halving(double x, Stream& rng) { return (x + (rng.uniform() < 0.5 ? 0 : 1)) / 2; }
double cantor(double x, Stream& rng) { return (x + (rng.uniform() < 0.5 ? 0 : 2)) / 3; }
double dickman(double x, Stream& rng) { return rng.uniform() * (1 + x); }
double waiting_time(double x, Stream& rng) {  // M/M/1, arrivals 1/2, service 1
  const double service = rng.exponential();
  const double pause = 2 * rng.exponential();
  return std::max(x + service - pause, 0.0);
}

// Uses two numbers near 0, where it starts, and one elsewhere.
double thirsty(double x, Stream& rng) {
  double noise = rng.uniform() - 0.5;
  if (std::abs(x) < 0.25) noise += rng.uniform() - 0.5;
  return 0.5 * x + noise;
}

const Rates queue_rates{std::log2(9.0 / 8), 0};

// The levels where the linear growth of the work is flat enough to count as none.
SequenceLawOptions levels(std::int64_t first, std::int64_t last) {
  return {.last = last, .rates_from = first, .work_tolerance = 0.15};
}
// Shallower ones, where a few thousand draws see what decides E D_k^2.
SequenceLawOptions shallow(std::int64_t first, std::int64_t last) {
  return {.last = last, .rates_from = first, .work_tolerance = 0.5};
}

template <class Draws>
Moments moments(std::size_t n, const Draws& draw) {
  std::vector<double> values;
  for (std::uint64_t i = 0; i < n; ++i) {
    Stream rng(2014, i);
    values.push_back(draw(rng));
  }
  return Moments::of(values);
}

double z_score(const Moments& m, double truth) { return std::abs(m.mean - truth) / m.standard_error(); }

// E I_k of levels 0 ... 6 against exact(k), and against exact(k - 1) as a power check where they differ much.
template <class S, class Exact>
void check_level_means(const S& s, const Exact& exact) {
  for (std::int64_t k = 0; k <= 6; ++k) {
    INFO("level " << k);
    const Moments m = moments(1 << 15, [&](Stream& rng) { return s(k, rng).value; });
    if (k == 0) {
      CHECK(m.mean == exact(0));
      continue;
    }
    CHECK(z_score(m, exact(k)) < 5.5);
    if (k <= 2) CHECK(z_score(m, exact(k - 1)) > 5.5);
  }
}

double powers(double q, std::int64_t n) {  // 1 + q + ... + q^(n-1)
  return (1 - std::pow(q, static_cast<double>(n))) / (1 - q);
}

}  // namespace

TEST_CASE("H01: an autoregressive chain has E I_k = sum rho^(2 i) and the known E D_k^2",
          "[steady_state][statistical]") {
  const auto s = steady_state(autoregressive, 0.0, square, contraction(0.5));
  check_level_means(s, [](std::int64_t k) { return powers(0.25, k); });
  CHECK(powers(0.25, 60) == Approx(4.0 / 3));
  for (std::int64_t k = 1; k <= 5; ++k) {
    // D = e (2 X' + e) with e = rho^(k-1) normal, X' normal of the variance of level k - 1
    const double e2 = std::pow(0.25, static_cast<double>(k - 1));
    const double exact = e2 * (4 * powers(0.25, k - 1) + 3 * e2);
    const Moments m = moments(1 << 15, [&](Stream& rng) { return square(s(k, rng).difference); });
    CHECK(z_score(m, exact) < 5.5);
    CHECK(z_score(m, exact / 4) > 5.5);
  }
  CHECK(sequence_laws(s, levels(14, 20)) == Failures{});
  CHECK(sequence_laws(steady_state(autoregressive, 0.0, square, contraction(0.6)), levels(14, 20)) != Failures{});
}

TEST_CASE("H02: the queue has the level means of Spitzer's identity", "[steady_state][statistical]") {
  const auto s = steady_state(waiting_time, 0.0, itself, queue_rates);
  // E W_k = sum_(j<=k) E S_j^+ / j; the k-th arrival finds i of k services done with a negative binomial law
  const auto exact = [](std::int64_t k) {
    double mean = 0;
    for (std::int64_t j = 1; j <= k; ++j) {
      double weight = std::pow(1.0 / 3, static_cast<double>(j));
      for (std::int64_t i = 0; i < j; ++i) {
        mean += weight * static_cast<double>(j - i) / static_cast<double>(j);
        weight *= 2.0 / 3 * static_cast<double>(j + i) / static_cast<double>(i + 1);
      }
    }
    return mean;
  };
  CHECK(exact(1) == Approx(1.0 / 3));
  CHECK(exact(400) == Approx(1).epsilon(1e-6));
  check_level_means(s, exact);
  CHECK(sequence_laws(s, {.last = 8, .rates = false}) == Failures{});
}

TEST_CASE("H02: the differences of the queue fall like (8/9)^k times a power", "[steady_state][law][stat]") {
  const auto s = steady_state(waiting_time, 0.0, itself, queue_rates);
  CHECK(sequence_laws(s, {.first = 30, .last = 50, .variance_tolerance = 0.12}) == Failures{});
  const auto optimist = steady_state(waiting_time, 0.0, itself, contraction(0.7));
  CHECK(sequence_laws(optimist, {.first = 30, .last = 50, .variance_tolerance = 0.12}) != Failures{});
}

TEST_CASE("H04, H05: the limits of halving and Cantor chains have the known level means",
          "[steady_state][statistical]") {
  const auto uniform = steady_state(halving, 0.0, square, contraction(1.0 / 2));
  check_level_means(uniform, [](std::int64_t k) {
    const double mean = (1 - std::pow(0.5, static_cast<double>(k))) / 2;
    return mean * mean + powers(0.25, k) / 16;
  });
  const auto singular = steady_state(cantor, 0.0, square, contraction(1.0 / 3));
  check_level_means(singular, [](std::int64_t k) {
    const double mean = (1 - std::pow(1.0 / 3, static_cast<double>(k))) / 2;
    return mean * mean + powers(1.0 / 9, k) / 9;
  });
  CHECK(sequence_laws(uniform, levels(14, 20)) == Failures{});
  CHECK(sequence_laws(singular, shallow(4, 12)) == Failures{});
  CHECK(sequence_laws(steady_state(cantor, 0.0, square, contraction(0.5)), shallow(4, 12)) != Failures{});
}

TEST_CASE("H07: the Dickman chain has the known level means and a contraction of 1 / sqrt 3",
          "[steady_state][statistical]") {
  const auto s = steady_state(dickman, 0.0, square, contraction(std::sqrt(1.0 / 3)));
  check_level_means(s, [](std::int64_t k) {
    double mean = 0;
    double mean_square = 0;
    for (std::int64_t i = 0; i < k; ++i) {
      mean_square = (1 + 2 * mean + mean_square) / 3;
      mean = (1 + mean) / 2;
    }
    return mean_square;
  });
  // D = P (2 X' + P), P a product of k uniforms; a factor u^q of a step tilts its uniform to (q + 1) u^q
  for (std::int64_t k = 1; k <= 4; ++k) {
    double square_under_2 = 0;
    double mean_under_2 = 0;
    double mean_under_3 = 0;
    for (std::int64_t i = 1; i < k; ++i) {
      square_under_2 = 3.0 / 5 * (1 + 2 * mean_under_2 + square_under_2);
      mean_under_2 = 3.0 / 4 * (1 + mean_under_2);
      mean_under_3 = 4.0 / 5 * (1 + mean_under_3);
    }
    const double n = static_cast<double>(k);
    const double exact = 4 * std::pow(3, -n) * square_under_2 + 4 * std::pow(4, -n) * mean_under_3 + std::pow(5, -n);
    const Moments m = moments(1 << 15, [&](Stream& rng) { return square(s(k, rng).difference); });
    CHECK(z_score(m, exact) < 5.5);
  }
  CHECK(sequence_laws(s, {.rates = false}) == Failures{});
  // E D_k^2 = 3^-k of X itself; that of its square gets there only after X' has reached its tilted PMF
  const auto mean = steady_state(dickman, 0.0, itself, contraction(std::sqrt(1.0 / 3)));
  CHECK(sequence_laws(mean, shallow(3, 8)) == Failures{});
  CHECK(sequence_laws(steady_state(dickman, 0.0, itself, contraction(1.0 / 3)), shallow(3, 8)) != Failures{});
}

TEST_CASE("the halving chain is the binary number of its coin tosses, exactly", "[steady_state][exact]") {
  const auto s = steady_state(halving, 0.0, itself, contraction(0.5));
  for (std::int64_t k = 0; k <= 40; ++k) {
    const Stream rng(6, 3);
    double x = 0;
    for (std::int64_t j = 1; j <= k; ++j) {  // the last step, j = 1, has the largest digit
      Stream toss = rng.split(static_cast<std::uint64_t>(j));
      if (toss.uniform() >= 0.5) x += std::ldexp(1.0, -static_cast<int>(j));
    }
    CHECK(s(k, rng).value == x);
  }
}

TEST_CASE("on one stream the levels telescope sample by sample, whatever a step draws", "[steady_state][exact]") {
  const auto check = [](const auto& s) {
    for (std::uint64_t i = 0; i < 50; ++i) {
      const Stream rng(8, i);
      CHECK(s(0, rng).difference == s.value_at(0, rng).value);
      for (std::int64_t k = 1; k <= 20; ++k) {
        const auto draw = s(k, rng);
        CHECK(draw.value == s.value_at(k, rng).value);
        CHECK(draw.difference == s.value_at(k, rng).value - s.value_at(k - 1, rng).value);
      }
    }
  };
  check(steady_state(autoregressive, 0.3, square, contraction(0.5)));
  check(steady_state(waiting_time, 0.0, itself, queue_rates));
  check(steady_state(thirsty, 0.0, square, contraction(0.5)));
}

TEST_CASE("a step may use more random numbers on one path than on the other", "[steady_state][law]") {
  const auto s = steady_state(thirsty, 0.0, square, contraction(0.5));
  CHECK(sequence_laws(s, {.rates = false}) == Failures{});
  // One running stream, of which the coarse path gets a copy at each step: where it drinks more than the fine
  // path, its next step sees a number again.
  const auto running = [](std::int64_t level, Stream& rng) {
    if (level == 0) return base(0.0);
    double fine = thirsty(0.0, rng);
    double coarse = 0.0;
    for (std::int64_t i = 1; i < level; ++i) {
      Stream same(rng);
      coarse = thirsty(coarse, same);
      fine = thirsty(fine, rng);
    }
    return coupled(square(fine), square(coarse));
  };
  CHECK(sequence_laws(running) != Failures{});
}

TEST_CASE("innovations that are not shared lose the rate, a swapped sign the telescoping", "[steady_state][law]") {
  const auto s = steady_state(halving, 0.0, square, contraction(0.5));
  struct NotShared {
    Rates rates = contraction(0.5);
    Draw<double> operator()(std::int64_t level, const Stream& rng) const {
      const auto s = steady_state(halving, 0.0, square, rates);
      const double fine = s.value_at(level, rng).value;
      if (level == 0) return base(fine);
      return coupled(fine, s.value_at(level - 1, rng.split(1000)).value, 2 * static_cast<double>(level) - 1);
    }
  };
  const auto swapped = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference = -d.difference;
    return d;
  };
  CHECK(sequence_laws(s, levels(14, 20)) == Failures{});
  CHECK(sequence_laws(NotShared{}, levels(14, 20)) != Failures{});
  CHECK(sequence_laws(swapped) != Failures{});
}

TEST_CASE("the work counts the steps of both chains, and is 1 at level 0", "[steady_state][exact]") {
  int steps = 0;
  const auto step = [&steps](double x, Stream&) {
    ++steps;
    return x / 2;
  };
  const auto s = steady_state(step, 1.0, itself, contraction(0.5));
  const Stream rng(1, 1);
  CHECK(s(0, rng).work == 1);
  CHECK(s.value_at(0, rng).work == 1);
  CHECK(steps == 0);
  for (std::int64_t k = 1; k <= 9; ++k) {
    steps = 0;
    CHECK(s(k, rng).work == steps);
    CHECK(steps == 2 * k - 1);
    steps = 0;
    CHECK(s.value_at(k, rng).work == steps);
    CHECK(steps == k);
  }
}

TEST_CASE("the state is what a step returns, of any copyable type", "[steady_state][exact]") {
  const Stream rng(2, 5);
  const auto from_int = steady_state(autoregressive, 0, itself, contraction(0.5));
  const auto from_double = steady_state(autoregressive, 0.0, itself, contraction(0.5));
  CHECK(from_int(5, rng).value == from_double(5, rng).value);

  const auto vectors = steady_state(
      [](std::vector<double> x, Stream& innovations) {
        x[0] = autoregressive(x[0], innovations);
        x[1] = halving(x[1], innovations);
        return x;
      },
      std::vector<double>{0.0, 0.0}, [](const std::vector<double>& x) { return Eigen::Vector2d(x[0], x[1]); },
      contraction(0.5));
  CHECK(vectors(5, rng).value.x() == from_double(5, rng).value);
  CHECK(sequence_laws(vectors, levels(14, 20)) == Failures{});
}

TEST_CASE("contraction declares -2 log2 c and refuses what does not contract", "[steady_state][exact]") {
  CHECK(contraction(0.25).variance_decay == 4);
  CHECK(contraction(0.25).work_growth == 0);
  CHECK(contraction(0).variance_decay == Rates::faster_than_any);
  CHECK(pmf_exists(contraction(0.999)));
  for (const double c : {1.0, -0.5, 2.0, std::nan("")}) CHECK_THROWS_AS(contraction(c), std::invalid_argument);
}

TEST_CASE("a steady state is a sequence that declares its rates", "[steady_state][compile]") {
  using S = decltype(steady_state(autoregressive, 0.0, square, contraction(0.5)));
  STATIC_REQUIRE(BiasedSequence<S>);
  STATIC_REQUIRE(DeclaresRates<S>);
  STATIC_REQUIRE(OffersValueAt<S>);
  STATIC_REQUIRE_FALSE(MarkovStep<decltype(square), double>);  // a step needs a Stream
}

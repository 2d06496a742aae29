#include <debias/chains/advise.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/chains.hpp>
#include <debias/core/estimate.hpp>

using namespace debias;

namespace {

double square(double x) { return x * x; }
double density(double x) { return -0.5 * x * x; }
double wide(Stream& rng) { return 3 * rng.normal(); }
using Pair = std::array<double, 2>;

// n Var of the mean of one long plain chain, by means of batches.
template <class K, class Start, class F>
double asymptotic_variance(const K& kernel, const Start& start, const F& f, std::int64_t steps) {
  Stream rng(31, 0);
  auto x = detail::begin_state(kernel, start(rng));
  const std::int64_t batches = 1000;
  std::vector<double> means;
  for (std::int64_t t = 0; t < 1000; ++t) kernel.step(x, rng);
  for (std::int64_t b = 0; b < batches; ++b) {
    double sum = 0;
    for (std::int64_t t = 0; t < steps / batches; ++t) {
      kernel.step(x, rng);
      sum += f(detail::point_of(kernel, x));
    }
    means.push_back(sum / static_cast<double>(steps / batches));
  }
  return Moments::of(means).variance() * static_cast<double>(steps / batches);
}

// Advice, and the inefficiency of a run by it beside the long chain.
template <class K, class Start, class F>
void check_inefficiency(const K& kernel, const Start& start, const F& f, std::int64_t samples) {
  const auto chain = coupled_chain(kernel, start, f);
  const ChainAdvice advice = advise(chain);
  INFO(advice);
  CHECK(advice.tail.kind == MeetingKind::light);
  CHECK(advice.inefficiency > 1 - 3 * advice.inefficiency_error);
  CHECK(advice.inefficiency < 1.35);
  CHECK(advice.options.length == 20 * advice.options.burn_in);
  const auto r = estimate(chain.with(advice.options), {.samples = samples, .seed = 3});
  const double plain = asymptotic_variance(kernel, start, f, 4'000'000);
  const double measured = r.components[0].variance * r.work_per_sample() / plain;
  INFO("measured " << measured << " beside a long chain of asymptotic variance " << plain);
  CHECK(measured < 1.35);
  CHECK(measured > 0.85);
  CHECK(std::abs(r.work_per_sample() / advice.work - 1) < 0.05);
}

}  // namespace

TEST_CASE("K01: chains of the advised length cost at most 1.35 of a plain long chain", "[chains][advise][stat]") {
  check_inefficiency(random_walk(density, 2.4), wide, square, 4000);
}

TEST_CASE("K01: Hamiltonian steps with a random walk, and Langevin steps, cost at most 1.35 of their plain chains",
          "[chains][advise][stat]") {
  const auto slope = [](double x) { return -x; };
  check_inefficiency(mixture({0.9, 0.1}, hamiltonian(density, slope, 0.4, 3), random_walk(density, 0.5)), wide, square,
                     4000);
  check_inefficiency(mala(density, slope, 1.4), wide, square, 4000);
}

TEST_CASE("K02: chains of the advised length cost at most 1.35 of a plain long chain", "[chains][advise][stat]") {
  const auto given = [](std::size_t i, const Pair& x) { return NormalLaw{0.9 * x[1 - i], 0.4358898943540674}; };
  const auto start = [](Stream& rng) {
    const double a = 3 * rng.normal();
    return Pair{a, 3 * rng.normal()};
  };
  check_inefficiency(
      gibbs(given), start, [](const Pair& x) { return x[0] * x[1]; }, 4000);
}

TEST_CASE("K03: chains of the advised length cost at most 1.35 of a plain long chain", "[chains][advise][stat]") {
  const auto modes = [](double x) {
    const double near = std::abs(x) - 3;
    return -0.5 * near * near + std::log1p(std::exp(-6 * std::abs(x)));
  };
  check_inefficiency(
      random_walk(modes, 4), [](Stream& rng) { return 4 * rng.normal(); }, [](double x) { return std::abs(x); }, 4000);
}

TEST_CASE("chains without burn-in and length cost many times a plain chain, and advice says what they cost",
          "[chains][advise][statistical]") {
  const auto chain = coupled_chain(random_walk(density, 2.4), wide, square);
  const ChainAdvice advice = advise(chain, {.multiple = 2});
  INFO(advice);
  CHECK(advice.inefficiency > 1.35);
}

TEST_CASE("the bound on the distance to the steady state bounds the distance of a chain of two states",
          "[chains][advise][statistical]") {
  // 0 -> 1 with probability a, 1 -> 0 with b: d(t) = b/(a+b) (1 - a - b)^t from state 1... of the mass at 0, from 1.
  constexpr double a = 0.03;
  constexpr double b = 0.05;
  struct Flip {
    void step(int& x, Stream& rng) const { x = next(x, rng.uniform()); }
    void coupled_step(int& x, int& y, Stream& rng) const {
      const double u = rng.uniform();
      x = next(x, u);
      y = next(y, u);
    }
    static int next(int x, double u) { return x == 0 ? (u < a ? 1 : 0) : (u < 1 - b ? 1 : 0); }
  };
  const auto exact = [](std::int64_t t) { return b / (a + b) * std::pow(1 - a - b, static_cast<double>(t)); };
  const ChainAdvice advice =
      advise(coupled_chain(Flip{}, 1, [](int x) { return static_cast<double>(x); }), {.chains = 4000});
  INFO(advice);
  REQUIRE(advice.distance.size() > 5);
  for (const DistanceBound& d : advice.distance) {
    const double error = 4.5 / std::sqrt(4000.0) * std::sqrt(std::max(d.bound, 1e-3));
    CHECK(d.bound > exact(d.time) - error);
    CHECK(d.bound < 1.5 * exact(d.time) + error);  // this coupling is nearly the best, and the lag long
  }
  const std::int64_t one_percent = advice.burn_in_for(0.01);
  CHECK(one_percent >= 40);
  CHECK(one_percent <= 90);
  CHECK(advice.burn_in_for(-1) == -1);
  std::ostringstream text;
  text << advice;
  CHECK_THAT(text.str(), Catch::Contains("burn_in ") && Catch::Contains("inefficiency") && Catch::Contains("####"));
}

TEST_CASE("a bimodal target with small steps gets no light verdict from the pilot", "[chains][advise][statistical]") {
  const auto two = [](double x) { return -0.5 * (std::abs(x) - 3.5) * (std::abs(x) - 3.5); };
  const auto near = [](Stream& rng) { return rng.uniform() < 0.02 ? 3.5 : -3.5; };
  const ChainAdvice cut = advise(coupled_chain(random_walk(two, 0.7), near, square), {.limit = 3000});
  INFO(cut);
  CHECK_FALSE(cut.available());
  CHECK(cut.tail.kind != MeetingKind::light);
  std::ostringstream text;
  text << cut;
  CHECK_THAT(text.str(), Catch::Contains("more than 1 % of the chains had not met"));
}

TEST_CASE("advice is a function of its seed, and refuses too few chains", "[chains][advise][exact]") {
  const auto chain = coupled_chain(random_walk(density, 2.4), wide, square);
  const ChainAdvice one = advise(chain, {.chains = 200});
  const ChainAdvice two = advise(chain.with({.burn_in = 3, .length = 9}), {.chains = 200});
  CHECK(one.inefficiency == two.inefficiency);
  CHECK(one.options.burn_in == two.options.burn_in);
  CHECK(advise(chain, {.chains = 200, .seed = 2}).inefficiency != one.inefficiency);
  std::int64_t chains = 0;
  for (const MeetingInterval& t : one.meetings) chains += t.chains;
  CHECK(chains == 200);
  CHECK_THROWS_WITH(advise(chain, {.chains = 99}), Catch::Contains("chains = 99 (must be at least 100"));
  CHECK_THROWS_WITH(advise(chain, {.multiple = 1}), Catch::Contains("multiple = 1"));
}

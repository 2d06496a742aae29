// The kernels: they leave their law invariant, and their couplings are couplings.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"

#include <debias/chains.hpp>
#include <debias/core/estimate.hpp>

using namespace debias;

namespace {

double itself(double x) { return x; }
double density(double x) { return -0.5 * x * x; }
double slope(double x) { return -x; }

using Pair = std::array<double, 2>;
Eigen::Array2d both(const Pair& x) { return {x[0], x[1]}; }
NormalLaw given(std::size_t i, const Pair& x) { return {0.9 * x[1 - i], 0.4358898943540674}; }

// A random walk that is wrong on purpose.
enum class Slip { none, two_uniforms, other_step, no_mirror };
struct Wrong {
  Slip slip;
  void step(double& x, Stream& rng) const { move(x, x + 2 * rng.normal(), rng.uniform()); }
  void coupled_step(double& x, double& y, Stream& rng) const {
    const double z = (x - y) / 2;
    const double w = rng.normal();
    const bool same = std::log(rng.uniform()) <= -w * z - 0.5 * z * z;
    const double to_x = x + 2 * w;
    const double mirrored = slip == Slip::no_mirror ? y + 2 * w : y - 2 * w;
    const double to_y = same ? to_x : slip == Slip::other_step ? y - 2.2 * w : mirrored;
    const double u = rng.uniform();
    move(x, to_x, u);
    move(y, to_y, slip == Slip::two_uniforms ? rng.uniform() : u);
  }
  static void move(double& x, double to, double u) {
    if (std::log(u) <= density(to) - density(x)) x = to;
  }
};

// E of a law by one step from exact draws of it: features of x' against those of x.
template <class K, class Draw, class F>
double change_by_a_step(const K& kernel, const Draw& draw, const F& f, std::int64_t n = 1 << 16) {
  std::vector<double> changes;
  for (std::int64_t i = 0; i < n; ++i) {
    Stream rng(11, static_cast<std::uint64_t>(i));
    const auto before = draw(rng);
    auto x = detail::begin_state(kernel, before);
    kernel.step(x, rng);
    changes.push_back(f(detail::point_of(kernel, x)) - f(before));
  }
  const Moments m = Moments::of(changes);
  return std::abs(m.mean) / m.standard_error();
}

// The share of equal draws of two laws.
template <class L>
double share_equal(const L& p, const L& q, int n = 1 << 16) {
  int equal = 0;
  for (int i = 0; i < n; ++i) {
    Stream rng(12, static_cast<std::uint64_t>(i));
    const auto drawn = L::couple(p, q, rng);
    equal += drawn.first == drawn.second;
  }
  return static_cast<double>(equal) / n;
}

template <class L>
Moments second_of(const L& p, const L& q, bool second, int n = 1 << 16) {
  std::vector<double> x;
  for (int i = 0; i < n; ++i) {
    Stream rng(13, static_cast<std::uint64_t>(i));
    const auto drawn = L::couple(p, q, rng);
    x.push_back(second ? drawn.second : drawn.first);
  }
  return Moments::of(x);
}

}  // namespace

TEST_CASE("every kernel of the house keeps the marginals of its coupling, and stays together",
          "[chains][statistical]") {
  const auto good = [](const CouplingCheck& c) {
    INFO(c.sentence());
    CHECK(c.passed());
    CHECK(c.meetings > 0);
  };
  const std::vector<double> places{-1, 0.3, 2.5};
  good(check_coupling(random_walk(density, 2.4), places, itself));
  good(check_coupling(mala(density, slope, 1.3), places, itself));
  good(check_coupling(mixture({0.7, 0.3}, random_walk(density, 2.4), random_walk(density, 0.5)), places, itself));
  good(check_coupling(
      mixture({1, 2, 3}, random_walk(density, 2.4), mala(density, slope, 1.0), random_walk(density, 0.5)), places,
      itself));
  good(check_coupling(gibbs(given), std::vector<Pair>{{0, 0}, {1, 1.5}, {-2, 0}}, both));
  const auto mixed = mixture({0.8, 0.2}, hamiltonian(density, slope, 0.7, 2), random_walk(density, 0.5));
  good(check_coupling(mixed, places, itself));
  const auto two = [](const Pair& x) { return -0.5 * (x[0] * x[0] + x[1] * x[1] + x[0] * x[1]); };
  const auto slopes = [](const Pair& x) { return Pair{-x[0] - 0.5 * x[1], -x[1] - 0.5 * x[0]}; };
  good(check_coupling(random_walk(two, 1.2), std::vector<Pair>{{0, 0}, {1, 1.5}, {-2, 0}}, both));
  good(check_coupling(mala(two, slopes, 1.0), std::vector<Pair>{{0, 0}, {1, 1.5}, {-2, 0}}, both));
  good(check_coupling(Wrong{Slip::none}, places, itself));
}

TEST_CASE("a coupling that moves a chain otherwise than a step, or parts equal chains, is named",
          "[chains][statistical]") {
  const std::vector<double> places{-1, 0.3, 2.5};
  const CouplingCheck uniforms = check_coupling(Wrong{Slip::two_uniforms}, places, itself);
  CHECK(uniforms.keeps_marginals());
  CHECK_FALSE(uniforms.stays_together());
  CHECK_THAT(uniforms.sentence(), Catch::Contains("do NOT stay together") && Catch::Contains("one uniform for both"));
  const CouplingCheck wide = check_coupling(Wrong{Slip::other_step}, places, itself, {.draws = 1 << 16});
  INFO(wide.sentence());
  CHECK_FALSE(wide.keeps_marginals());
  CHECK(wide.stays_together());
  CHECK_FALSE(wide.first_chain);
  // The remainder of the overlap, not mirrored, has another law than the one it should have.
  const CouplingCheck shifted = check_coupling(Wrong{Slip::no_mirror}, places, itself);
  INFO(shifted.sentence());
  CHECK_FALSE(shifted.keeps_marginals());
  CHECK_THROWS_WITH(check_coupling(Wrong{Slip::none}, std::vector<double>{1}, itself), Catch::Contains("1 states"));
  CHECK_THROWS_WITH(check_coupling(Wrong{Slip::none}, places, itself, {.draws = 10}), Catch::Contains("draws = 10"));
}

TEST_CASE("a step of each kernel leaves its law invariant, and a wrong density does not", "[chains][statistical]") {
  const auto normal = [](Stream& rng) { return rng.normal(); };
  const auto square = [](double x) { return x * x; };
  const auto fourth = [](double x) { return x * x * x * x; };
  for (const auto& f : {+square, +fourth}) {
    CHECK(change_by_a_step(random_walk(density, 2.4), normal, f) < 5);
    CHECK(change_by_a_step(mala(density, slope, 1.3), normal, f) < 5);
    CHECK(change_by_a_step(hamiltonian(density, slope, 0.9, 2), normal, f) < 5);
    CHECK(change_by_a_step(mixture({0.5, 0.5}, random_walk(density, 2.4), mala(density, slope, 1.3)), normal, f) < 5);
    const auto wrong = [](double x) { return -0.55 * x * x; };
    CHECK(change_by_a_step(hamiltonian(wrong, slope, 0.9, 2), normal, f) > 5);
    CHECK(change_by_a_step(random_walk(wrong, 2.4), normal, f) > 5);
    CHECK(change_by_a_step(mala(wrong, slope, 1.3), normal, f) > 5);
  }
  const auto pair = [](Stream& rng) {
    const double a = rng.normal();
    return Pair{a, 0.9 * a + 0.4358898943540674 * rng.normal()};
  };
  const auto product = [](const Pair& x) { return x[0] * x[1]; };
  CHECK(change_by_a_step(gibbs(given), pair, product) < 4.5);
  const auto other = [](std::size_t i, const Pair& x) { return NormalLaw{0.85 * x[1 - i], 0.4358898943540674}; };
  CHECK(change_by_a_step(gibbs(other), pair, product) > 4.5);
}

TEST_CASE("couplings of laws are equal as often as two laws allow, and keep both", "[chains][statistical]") {
  const auto phi = [](double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; };
  constexpr double margin = 4.5 * 0.5 / 256;  // of a share of 2^16
  const NormalLaw p{0, 1};
  for (const double z : {0.0, 0.2, 1.0, 3.0})
    CHECK(std::abs(share_equal(p, NormalLaw{z, 1}) - 2 * phi(-z / 2)) <= margin);
  // N(0, 1) and N(0, 4): they cross at +-c, c^2 (1 - 1/4) = 2 log 2.
  const double c = std::sqrt(2 * std::log(2.0) / 0.75);
  const double distance = 2 * (phi(c) - phi(c / 2));
  CHECK(std::abs(share_equal(p, NormalLaw{0, 2}) - (1 - distance)) <= margin);
  CHECK(share_equal(BernoulliLaw{0.3}, BernoulliLaw{0.3}) == 1);
  CHECK(std::abs(share_equal(BernoulliLaw{0.3}, BernoulliLaw{0.8}) - 0.5) <= margin);
  // Exponentials of rate 1 and 2: the distance is 1/4. Shapes 1 and 2 of rate 1 cross at 1: e^-1.
  CHECK(std::abs(share_equal(GammaLaw{1, 1}, GammaLaw{1, 2}) - 0.75) <= margin);
  CHECK(std::abs(share_equal(GammaLaw{1, 1}, GammaLaw{2, 1}) - (1 - std::exp(-1.0))) <= margin);
  CHECK(share_equal(GammaLaw{0.3, 2}, GammaLaw{0.3, 2}) == 1);

  const auto has = [](const Moments& m, double mean, double variance) {
    CHECK(std::abs(m.mean - mean) < 4.5 * m.standard_error());
    const double error = std::sqrt((m.kurtosis() - 1) / static_cast<double>(m.count));
    CHECK(std::abs(m.variance() / variance - 1) < 4.5 * error);
  };
  has(second_of(p, NormalLaw{1, 1}, true), 1, 1);
  has(second_of(p, NormalLaw{1, 2}, true), 1, 4);
  has(second_of(p, NormalLaw{1, 2}, false), 0, 1);
  has(second_of(GammaLaw{2.5, 1}, GammaLaw{0.5, 3}, true), 0.5 / 3, 0.5 / 9);
  has(second_of(GammaLaw{2.5, 1}, GammaLaw{0.5, 3}, false), 2.5, 2.5);
  has(second_of(BernoulliLaw{0.3}, BernoulliLaw{0.8}, true), 0.8, 0.16);
}

TEST_CASE("sites of several families share one Gibbs kernel", "[chains][statistical]") {
  // Lambda ~ Gamma(2, 1), X given Lambda ~ N(Lambda, 1), B given X ~ Bernoulli: E X = 2 by exact conditionals of a product law.
  using Law = std::variant<NormalLaw, BernoulliLaw, GammaLaw>;
  using Three = std::array<double, 3>;
  const auto law = [](std::size_t i, const Three& x) -> Law {
    if (i == 0) return GammaLaw{2, 1};
    if (i == 1) return NormalLaw{x[0], 1};
    return BernoulliLaw{x[1] > 2 ? 0.9 : 0.1};
  };
  const auto r = estimate(
      coupled_chain(gibbs(law), Three{1, 0, 0}, [](const Three& x) { return x[1]; }, {.burn_in = 5, .length = 50}),
      {.samples = 4000, .seed = 3});
  CHECK(std::abs(r.mean - 2) < 4.5 * r.standard_error);
  const auto changing = [](std::size_t, const std::array<double, 1>& x) -> Law {
    if (x[0] > 0) return NormalLaw{0, 1};
    return GammaLaw{1, 1};
  };
  CHECK_THROWS_WITH(estimate(coupled_chain(
                                 gibbs(changing), [](Stream& rng) { return std::array<double, 1>{rng.normal()}; },
                                 [](const std::array<double, 1>& x) { return x[0]; }),
                             {.samples = 100}),
                    Catch::Contains("two families"));
}

TEST_CASE("kernels refuse what is no step, no density and no law", "[chains][exact]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double h : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()}) {
    CHECK_THROWS_AS(random_walk(density, h), std::invalid_argument);
    CHECK_THROWS_AS(mala(density, slope, h), std::invalid_argument);
    CHECK_THROWS_AS(hamiltonian(density, slope, h, 3), std::invalid_argument);
  }
  CHECK_THROWS_WITH(hamiltonian(density, slope, 0.5, 0), Catch::Contains("steps = 0"));
  CHECK_THROWS_WITH(mixture({0.5, 0.0}, random_walk(density, 1), random_walk(density, 2)),
                    Catch::Contains("a weight of 0"));
  const auto half = [](double x) { return x > 0 ? -x : -std::numeric_limits<double>::infinity(); };
  CHECK_THROWS_WITH(estimate(coupled_chain(random_walk(half, 1), -1.0, itself), {.samples = 1}),
                    Catch::Contains("starts where the density is zero"));
  const auto r = estimate(coupled_chain(random_walk(half, 2), 1.0, itself, {.burn_in = 20, .length = 200}),
                          {.samples = 4000, .seed = 3});
  CHECK(std::abs(r.mean - 1) < 4.5 * r.standard_error);
  const auto no_number = [nan](double x) { return x > 1 ? nan : -x * x; };
  CHECK_THROWS_WITH(estimate(coupled_chain(random_walk(no_number, 1), 0.0, itself, {.length = 100}), {.samples = 10}),
                    Catch::Contains("the log density is"));
  for (const auto& wrong : {NormalLaw{nan, 1}, NormalLaw{0, 0}, NormalLaw{0, nan}}) {
    Stream rng(1, 1);
    CHECK_THROWS_AS(wrong.draw(rng), std::domain_error);
    CHECK_THROWS_AS(NormalLaw::couple(NormalLaw{}, wrong, rng), std::domain_error);
  }
  Stream rng(1, 1);
  CHECK_THROWS_AS(BernoulliLaw{1.5}.draw(rng), std::domain_error);
  CHECK_THROWS_AS((GammaLaw{0, 1}.draw(rng)), std::domain_error);
  CHECK_THROWS_AS((GammaLaw{1, nan}.draw(rng)), std::domain_error);
}

TEST_CASE("a kernel of two callables may work in place or by value, and 0 is a number", "[chains][exact]") {
  const auto by_value = kernel_of([](double x, Stream& rng) { return 0.5 * x + rng.uniform(); },
                                  [](double x, double y, Stream& rng) {
                                    const double u = rng.uniform();
                                    const bool meets = rng.uniform() < 0.5;
                                    return meets ? std::pair(u, u) : std::pair(0.5 * x + u, 0.5 * y + u);
                                  });
  const auto in_place = kernel_of([](double& x, Stream& rng) { x = 0.5 * x + rng.uniform(); },
                                  [](double& x, double& y, Stream& rng) {
                                    const double u = rng.uniform();
                                    const bool meets = rng.uniform() < 0.5;
                                    x = meets ? u : 0.5 * x + u;
                                    y = meets ? u : 0.5 * y + u;
                                  });
  const ChainOptions o{.burn_in = 1, .length = 5};
  const auto a = estimate(coupled_chain(by_value, 0, itself, o), {.samples = 100, .seed = 2});
  const auto b = estimate(coupled_chain(in_place, 0, itself, o), {.samples = 100, .seed = 2});
  const auto c = estimate(coupled_chain(in_place, 0.0, itself, o), {.samples = 100, .seed = 2});
  CHECK(a.mean == b.mean);
  CHECK(a.mean == c.mean);
}

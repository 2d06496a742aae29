#include <debias/taylor.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>

#include "catch_shim.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using debias::laws::estimator_laws;
using debias::laws::Failures;

namespace {

const auto uniform = [](Stream& rng) { return rng.uniform(); };
/// Optical depth 1 of the linear medium: E X = 1, X in (0, 2).
const auto depth = [](Stream& rng) { return 2 * rng.uniform(); };
/// E X = 1, X in (1/2, 3/2).
const auto near_one = [](Stream& rng) { return 0.5 + rng.uniform(); };

template <class E>
bool rejected(const E& wrong, double truth, std::int64_t samples = 1 << 16) {
  return debias::laws::names(estimator_laws(wrong, truth, {.samples = samples, .repeats = 0}), "unbiased");
}
/// Right by the same assertion that rejects the wrong ones.
template <class E>
bool accepted(const E& right, double truth, std::int64_t samples = 1 << 16) {
  return estimator_laws(right, truth, {.samples = samples, .repeats = 0}) == Failures{};
}

/// The largest |z| of (mean, second moment) against exact values.
template <class E>
double z_of_second_moment(const E& e, double exact, std::int64_t samples) {
  std::vector<double> squares;
  NullRecord record;
  for (std::int64_t i = 0; i < samples; ++i) {
    Stream rng(4, static_cast<std::uint64_t>(i));
    const double z = draw_sample(e, rng, record).value;
    squares.push_back(z * z);
  }
  const Moments m = Moments::of(squares);
  return (m.mean - exact) / m.standard_error();
}

}  // namespace

TEST_CASE("the centre of a function is refused outside its domain", "[taylor][exact]") {
  CHECK_THROWS_AS(functions::Log{}.expand(0), std::invalid_argument);
  CHECK_THROWS_AS(functions::Reciprocal{}.expand(0), std::invalid_argument);
  CHECK_THROWS_AS(functions::Sqrt{}.expand(-1), std::invalid_argument);
  CHECK_THROWS_AS(functions::Power{-1.5}.expand(-1), std::invalid_argument);
  CHECK_THROWS_AS(functions::Davis{0.5}.expand(-4), std::invalid_argument);
  CHECK_THROWS_WITH(functions::ExpMinus{}.expand(800), Catch::Contains("[-700, 700]"));
  CHECK_THROWS_AS(taylor(depth, functions::Log{}, -1.0), std::invalid_argument);
  CHECK_THROWS_AS(taylor(depth, functions::ExpMinus{}, std::nan("")), std::invalid_argument);
}

TEST_CASE("averages of products are those over all subsets, over the blocks of a ring, and of the first ones",
          "[taylor][exact]") {
  const std::vector<double> f = {1.5, -0.25, 0.75, 2, -1, 0.5};
  const std::size_t n = f.size();
  std::vector<double> averages(n + 1);
  std::vector<double> spare(n);
  const auto average = [&](Products products) {
    detail::average_products(products, f, averages, spare);
    return averages;
  };
  std::vector<double> subsets(n + 1);
  std::vector<double> counts(n + 1);
  for (unsigned set = 0; set < 1U << n; ++set) {
    double product = 1;
    std::size_t k = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if ((set >> i & 1U) == 0) continue;
      product *= f[i];
      ++k;
    }
    subsets[k] += product;
    counts[k] += 1;
  }
  const std::vector<double> symmetric = average(Products::symmetric);
  const std::vector<double> cyclic = average(Products::cyclic);
  const std::vector<double> simple = average(Products::simple);
  double product = 1;
  for (std::size_t k = 0; k <= n; ++k) {
    CHECK(symmetric[k] == Approx(subsets[k] / counts[k]).epsilon(1e-13));
    double ring = 0;
    for (std::size_t i = 0; i < n; ++i) {
      double block = 1;
      for (std::size_t j = 0; j < k; ++j) block *= f[(i + j) % n];
      ring += block / static_cast<double>(n);
    }
    CHECK(cyclic[k] == Approx(ring).epsilon(1e-13));
    CHECK(simple[k] == Approx(product).epsilon(1e-13));
    if (k < n) product *= f[k];
  }
  // fewer orders than factors: the first averages of the same
  for (const Products products : {Products::simple, Products::cyclic, Products::symmetric}) {
    std::vector<double> first(4);
    detail::average_products(products, f, first, spare);
    const std::vector<double> all = average(products);
    CHECK(std::equal(first.begin(), first.end(), all.begin()));
  }
  std::vector<double> one(1);
  detail::average_products(Products::symmetric, {}, one, spare);
  CHECK(one[0] == 1);
}

// ---- unbiased, honest

TEST_CASE("the terms of a series with roulette are unbiased for each function", "[taylor][statistical]") {
  const double e = std::exp(-1);
  CHECK(estimator_laws(roulette(taylor(depth, functions::ExpMinus{}, 2.0), Poisson(2)), e) == Failures{});
  CHECK(estimator_laws(roulette(taylor(depth, functions::ExpMinus{}, 2.0), IndexRoulette(2), {.base_level = 7}), e) ==
        Failures{});
  CHECK(estimator_laws(roulette(taylor(depth, functions::ExpMinus{}, 2.0), RunningWeight(std::exp(-2))), e) ==
        Failures{});
  CHECK(estimator_laws(roulette(taylor(near_one, functions::Reciprocal{}, centre_between(0.5, 1.5))), 1) == Failures{});
  CHECK(estimator_laws(roulette(taylor(near_one, functions::Log{}, centre_between(0.5, 1.5))), 0) == Failures{});
  CHECK(estimator_laws(roulette(taylor(near_one, functions::Sqrt{}, centre_between(0.5, 1.5))), 1) == Failures{});
  CHECK(estimator_laws(roulette(taylor(near_one, functions::Power{-1.5}, centre_between(0.5, 1.5))), 1) == Failures{});
  CHECK(estimator_laws(roulette(taylor(near_one, functions::Logistic{}, centre_between(0.5, 1.5))),
                       1 / (1 + std::exp(-1))) == Failures{});
  for (const double c : {0.5, 0.8}) {
    const functions::Davis davis{c};
    CHECK(estimator_laws(roulette(taylor(depth, davis, centre_between(0, 2))), davis(1)) == Failures{});
  }
  CHECK(estimator_laws(roulette(taylor(depth, functions::Square{}, 0.5), Geometric(0.2)), 1) == Failures{});

  // Power check: the centre of another series, and one draw for all factors.
  const auto shared_draw = [](Stream& rng) {
    return [x = depth(rng), c = functions::ExpMinus{}.expand(2), power = 1.0]() mutable {
      const double now = power;
      power *= (x - 2) / c.scale;
      return Term<double>{c() * now};
    };
  };
  CHECK(rejected(roulette(shared_draw, Poisson(2)), e));
}

TEST_CASE(
    "sums over all draws are unbiased with simple, cyclic and symmetric products, about a centre and about "
    "each draw",
    "[taylor][statistical]") {
  const double e = std::exp(-1);
  for (const Products products : {Products::simple, Products::cyclic, Products::symmetric}) {
    CAPTURE(static_cast<int>(products));
    const TaylorSumOptions options{.products = products};
    CHECK(estimator_laws(taylor_sum(depth, functions::ExpMinus{}, 2.0, Poisson(2), options), e) == Failures{});
    CHECK(estimator_laws(taylor_sum(depth, functions::ExpMinus{}, drawn_pivot, BhanotKennedy(0.5, 2, 2), options), e) ==
          Failures{});
    CHECK(estimator_laws(taylor_sum(near_one, functions::Log{}, centre_between(0.5, 1.5), Geometric(0.5), options),
                         0) == Failures{});
    CHECK(estimator_laws(taylor_sum(near_one, functions::Reciprocal{}, centre_between(0.5, 1.5), Geometric(0.5),
                                    {.products = products, .base_level = 2}),
                         1) == Failures{});
  }
  for (const double c : {0.5, 0.8}) {
    const functions::Davis davis{c};
    const auto comb = comb_mean([](double x) { return 2 * x; }, 5);
    CHECK(estimator_laws(taylor_sum(comb, davis, drawn_pivot, Geometric(0.7)), davis(1)) == Failures{});
  }
  CHECK(estimator_laws(taylor_sum(near_one, functions::Logistic{}, drawn_pivot, Geometric(0.5)),
                       1 / (1 + std::exp(-1))) == Failures{});
}

TEST_CASE("averaging products over all draws quiets the sum: symmetric below cyclic below simple",
          "[taylor][statistical]") {
  const auto variance = [](Products products) {
    const auto e = taylor_sum(depth, functions::ExpMinus{}, 2.0, Poisson(6), {.products = products, .base_level = 6});
    return estimate(e, {.samples = 1 << 16}).moments.variance();
  };
  const double simple = variance(Products::simple);
  const double cyclic = variance(Products::cyclic);
  const double symmetric = variance(Products::symmetric);
  CHECK(cyclic < 0.9 * simple);
  CHECK(symmetric < 0.99 * cyclic);
}

TEST_CASE("more draws than the order quiet every average, and are paid for once", "[taylor][statistical]") {
  const double e = std::exp(-1);
  const functions::ExpMinus g;
  for (const Products products : {Products::cyclic, Products::symmetric}) {
    const TaylorSumOptions many{.products = products, .draws = 8};
    CAPTURE(static_cast<int>(products));
    CHECK(estimator_laws(taylor_sum(depth, g, 1.0, Geometric(0.5), many), e) == Failures{});
    CHECK(estimator_laws(taylor_sum(depth, g, drawn_pivot, Geometric(0.5), many), e) == Failures{});
    const auto few = estimate(taylor_sum(depth, g, 1.0, Geometric(0.5), {.products = products}), {.samples = 1 << 16});
    const auto more = estimate(taylor_sum(depth, g, 1.0, Geometric(0.5), many), {.samples = 1 << 16});
    CHECK(more.moments.variance() < 0.5 * few.moments.variance());
  }
  // about a given centre order 0 looks nothing up, the orders 1 to 8 take 8 draws, order 12 takes 12
  const auto sum = taylor_sum(depth, g, 1.0, Geometric(0.1), {.draws = 8});
  const auto pivoted = taylor_sum(depth, g, drawn_pivot, Geometric(0.1), {.draws = 8});
  for (std::int64_t i = 0; i < 200; ++i) {
    const auto t = trace(sum, 1, i);
    const auto p = trace(pivoted, 1, i);
    const auto work = static_cast<double>(std::max<std::int64_t>(8, t.sample.level));
    CHECK(t.sample.work == (t.sample.level == 0 ? 1 : 1 + work));
    CHECK(p.sample.work == 1 + work);
    double recorded = 0;
    for (const TracedLevel& l : t.levels) recorded += l.work;
    CHECK(recorded == t.sample.work);
  }
  CHECK_THROWS_WITH(taylor_sum(depth, g, 1.0, Geometric(0.5), {.draws = -1}), Catch::Contains("draws = -1"));
  CHECK_THROWS_WITH(taylor_sum(depth, g, 1.0, Geometric(0.5), {.products = Products::simple, .draws = 2}),
                    Catch::Contains("simple products"));
}

TEST_CASE("an array of three colours is its components one by one, in every form", "[taylor][statistical]") {
  const auto rgb = [](Stream& rng) {
    const double u = rng.uniform();
    const double v = rng.uniform();
    return Eigen::Array3d(2 * u, 0.5 + u, u + v);
  };
  const Eigen::Array3d truth = Eigen::Array3d(1, 1, 1).exp().inverse();
  const functions::ExpMinus g;
  CHECK(estimator_laws(roulette(taylor(rgb, g, 2.0), Poisson(2)), truth) == Failures{});
  CHECK(estimator_laws(roulette(taylor(rgb, g, 2.0), RunningWeight(std::sqrt(3.0) * std::exp(-2))), truth) ==
        Failures{});
  CHECK(estimator_laws(single_term(taylor(rgb, g, 2.0), Poisson(2), {.base = Base::one_outcome}), truth) == Failures{});
  for (const Products products : {Products::simple, Products::cyclic, Products::symmetric}) {
    CHECK(estimator_laws(taylor_sum(rgb, g, 2.0, Poisson(2), {.products = products}), truth) == Failures{});
  }
  CHECK(estimator_laws(taylor_sum(rgb, g, drawn_pivot, BhanotKennedy(0.5, 2, 2)), truth) == Failures{});

  // Component by component the same numbers as a real X, and a wrong component is seen.
  const auto second = [&rgb](Stream& rng) { return rgb(rng)[1]; };
  NullRecord none;
  for (std::uint64_t i = 0; i < 50; ++i) {
    Stream one(3, i);
    Stream two(3, i);
    const auto vector = taylor_sum(rgb, g, drawn_pivot, BhanotKennedy(0.5, 2, 2))(one, none);
    const auto scalar = taylor_sum(second, g, drawn_pivot, BhanotKennedy(0.5, 2, 2))(two, none);
    CHECK(vector.value[1] == scalar.value);
    CHECK(vector.work == scalar.work);
  }
  const Eigen::Array3d wrong = truth * Eigen::Array3d(1, 1.05, 1);
  CHECK(estimator_laws(taylor_sum(rgb, g, 2.0, Poisson(2)), wrong, {.repeats = 0}) != Failures{});
  CHECK_THROWS_WITH(taylor([](Stream& rng) { return Eigen::ArrayXd::Constant(3, rng.uniform()).eval(); }, g, 2.0),
                    Catch::Contains("fixed"));
}

TEST_CASE("ratio tracking is the drawn single term of the series, with its closed-form second moment",
          "[taylor][statistical]") {
  // E Z^2 = exp(-a + E (a - X)^2 / a), a = majorant
  for (const double a : {2.0, 4.0}) {
    const auto e = single_term(taylor(depth, functions::ExpMinus{}, a), Poisson(a), {.base = Base::one_outcome});
    CHECK(estimator_laws(e, std::exp(-1)) == Failures{});
    const double square = std::exp(-a + (a * a - 2 * a + 4.0 / 3) / a);
    CHECK(std::abs(z_of_second_moment(e, square, 1 << 17)) < 4.5);
    CHECK(std::abs(z_of_second_moment(e, 1.05 * square, 1 << 17)) > 4.5);
  }
}

// ---- the mistakes of earlier code

namespace {

/// p-series "CMF" whose terms after the deterministic prefix are weighted but never added.
struct PrefixOnly {
  double tau;
  double majorant;
  int prefix;
  double operator()(Stream& rng) const {
    double term = std::exp(-majorant);
    double total = term;
    for (int k = 1; k <= prefix; ++k) total += term *= (majorant - 2 * tau * rng.uniform()) / k;
    return total;
  }
};

/// Elementary symmetric means whose loop starts at the second draw, for a drawn pivot.
template <class X>
struct IndexOff {
  X x;
  BhanotKennedy pmf;
  std::size_t first_used;  // 1 is the mistake, 0 is right

  double operator()(Stream& rng) const {
    const auto n = static_cast<std::size_t>(pmf.sample(rng.uniform()));
    std::vector<double> draws(n + 1);
    for (double& d : draws) d = x(rng);
    double total = 0;
    for (std::size_t p = 0; p <= n; ++p) {
      std::vector<double> m(n + 1, 0.0);
      m[0] = 1;
      std::size_t used = 0;
      for (std::size_t i = 0, seen = 0; i <= n; ++i) {
        if (i == p || seen++ < first_used) continue;
        ++used;
        for (std::size_t k = used; k > 0; --k) {
          m[k] += static_cast<double>(k) / static_cast<double>(used) * (m[k - 1] * (draws[p] - draws[i]) - m[k]);
        }
      }
      double factorial = 1;
      for (std::size_t k = 0; k <= n; ++k) {
        if (k > 0) factorial *= static_cast<double>(k);
        total += std::exp(-draws[p]) * m[k] / factorial / pmf.tail(static_cast<std::int64_t>(k)) /
                 static_cast<double>(n + 1);
      }
    }
    return total;
  }
};

/// The function of Davis with the derivatives' alternating sign forgotten, or kept.
struct DavisSeries {
  functions::BinomialSeries right;
  bool forget_sign;
  double scale;
  double radius;
  double operator()() {
    const double c = right();
    return forget_sign ? std::abs(c) : c;
  }
};
struct DavisMaybe {
  functions::Davis davis;
  bool forget_sign;
  DavisSeries expand(double a) const {
    const auto right = davis.expand(a);
    return {right, forget_sign, right.scale, right.radius};
  }
};

}  // namespace

TEST_CASE("a deterministic prefix whose random tail is never added is rejected, ours is not", "[taylor][statistical]") {
  // majorant 8 above tau 1: the bias is -exp(-tau) P(Poisson(majorant - tau) >= prefix + 1), here 3.6e-4
  constexpr std::int64_t samples = 1 << 21;
  CHECK(rejected(PrefixOnly{1, 8, 15}, std::exp(-1), samples));
  const auto ours = roulette(taylor(depth, functions::ExpMinus{}, 8.0), IndexRoulette(8), {.base_level = 15});
  CHECK(accepted(ours, std::exp(-1), samples));
}

TEST_CASE("symmetric means whose index is off by one are rejected, ours are not", "[taylor][statistical]") {
  const auto step = [](Stream& rng) { return rng.uniform() < 1.0 / 3 ? 4.8 : 0.6; };  // tau = 2
  const BhanotKennedy pmf(0.5, 2, 2);
  const double truth = std::exp(-2);
  CHECK(rejected(IndexOff<decltype(step)>{step, pmf, 1}, truth));
  CHECK(accepted(IndexOff<decltype(step)>{step, pmf, 0}, truth));
  CHECK(accepted(taylor_sum(step, functions::ExpMinus{}, drawn_pivot, pmf), truth));
  // On the linear medium, combs of two points and the published PMF, the mistake is small, and still seen.
  const auto linear = comb_mean([](double x) { return 4 * x; }, 2);
  const BhanotKennedy published(0.9, 2, 2);
  CHECK(rejected(IndexOff<decltype(linear)>{linear, published, 1}, truth, 1 << 20));
  CHECK(accepted(taylor_sum(linear, functions::ExpMinus{}, drawn_pivot, published), truth, 1 << 20));
}

TEST_CASE("derivatives without their alternating sign are rejected, ours are not", "[taylor][statistical]") {
  const functions::Davis davis{0.5};
  const auto comb = comb_mean([](double x) { return 4 * x; }, 2);
  const BhanotKennedy pmf(0.5, 2, 2);
  CHECK(rejected(taylor_sum(comb, DavisMaybe{davis, true}, drawn_pivot, pmf), davis(2), 1 << 18));
  CHECK(accepted(taylor_sum(comb, DavisMaybe{davis, false}, drawn_pivot, pmf), davis(2), 1 << 18));
  CHECK(accepted(taylor_sum(comb, davis, drawn_pivot, pmf), davis(2), 1 << 18));
}

TEST_CASE("a coefficient of zero does not end a sum by running weight, a factor of zero does",
          "[taylor][statistical]") {
  // logistic about 0: every second coefficient is zero; E X = 3/2, and the third term is 0.07
  const double truth = 1 / (1 + std::exp(-1.5));
  const auto above_one = [](Stream& rng) { return 1 + rng.uniform(); };
  const auto series = taylor(above_one, functions::Logistic{}, 0.0);
  CHECK(accepted(roulette(series, RunningWeight(0.5)), truth));
  struct StopsAtZero {  // what earlier code did
    double operator()(std::int64_t, double size) const { return std::min(1.0, size / 0.5); }
  };
  CHECK(rejected(roulette(series, StopsAtZero{}), truth));

  const auto at_majorant = [](Stream&) { return 2.0; };
  NullRecord none;
  for (std::uint64_t i = 0; i < 50; ++i) {
    Stream rng(6, i);
    const auto s = roulette(taylor(at_majorant, functions::ExpMinus{}, 2.0), RunningWeight(std::exp(-2)))(rng, none);
    CHECK(s.level == 1);
    CHECK(s.value == std::exp(-2));
  }
}

// ---- conditions

TEST_CASE("the best centre is E X^2 / E X where 0 is the singularity, the mean for exp", "[taylor][exact]") {
  const std::vector<double> xs = {0.5, 1, 1.5, 4};
  const Moments pilot = Moments::of(xs);
  const double best = (0.25 + 1 + 2.25 + 16) / 7;
  CHECK(centre(functions::Reciprocal{}, pilot).at == Approx(best));
  CHECK(centre(functions::Log{}, pilot).at == Approx(best));
  CHECK(centre(functions::Power{-2.5}, pilot).at == Approx(best));
  CHECK(centre(functions::ExpMinus{}, pilot).at == pilot.mean);
  CHECK(centre(functions::Davis{0.5}, pilot).at == Approx(pilot.mean + pilot.m2 / 4 / (pilot.mean + 4)));
  CHECK(detail::decay(functions::Log{}, centre(functions::Log{}, pilot)) ==
        Approx(pilot.m2 / 4 / ((0.25 + 1 + 2.25 + 16) / 4)));
  CHECK(centre_between(0.5, 1.5).at == 1);
  CHECK(centre_between(0.5, 1.5).mean_square == 0.25);
}

TEST_CASE("a centre from a pilot run is as good as the exact one, and unbiased", "[taylor][statistical]") {
  const auto x = [](Stream& rng) { return 0.2 + 2 * rng.uniform(); };  // E X = 1.2, E X^2 = 1.44 + 1/3
  const functions::Log g;
  const Centre exact{(1.44 + 1.0 / 3) / 1.2, 0};
  const Centre pilot = centre(g, estimate(x, {.samples = 1000, .seed = 99}).moments);
  CHECK(pilot.at == Approx(exact.at).epsilon(0.02));
  const auto e = roulette(taylor(x, g, pilot));
  CHECK(estimator_laws(e, std::log(1.2)) == Failures{});
  const auto best = roulette(taylor(x, g, exact.at), e.pmf());
  const auto far = roulette(taylor(x, g, 2.0), e.pmf());
  const auto variance = [](const auto& estimator) {
    return estimate(estimator, {.samples = 1 << 17}).moments.variance();
  };
  CHECK(variance(e) < 1.05 * variance(best));
  CHECK(variance(far) > 1.3 * variance(best));  // power check
}

TEST_CASE("a centre or a PMF without finite variance is refused with a feasible one", "[taylor][exact]") {
  const Moments pilot = Moments::of(std::vector<double>{0.5, 1, 1.5, 4});  // E X = 1.75, E X^2 = 4.875
  CHECK_THROWS_WITH(centre(functions::Reciprocal{}, pilot, 1.0),
                    Catch::Contains("at = 1.0") && Catch::Contains("2.78"));
  CHECK(centre(functions::Reciprocal{}, pilot, 2.0).at == 2);
  CHECK_THROWS_WITH(taylor(uniform, functions::Reciprocal{}, centre_between(-1, 2)), Catch::Contains("below 1"));
  CHECK_THROWS_AS(centre_between(1, 1), std::invalid_argument);
  CHECK_THROWS_AS(centre_between(0, std::numeric_limits<double>::infinity()), std::invalid_argument);
  CHECK_THROWS_AS(centre(functions::Log{}, Moments{}), std::invalid_argument);

  // b = 1/4 about the middle of (1/2, 3/2): a PMF has to fall by more than 1/4 a term
  const auto terms = taylor(near_one, functions::Reciprocal{}, centre_between(0.5, 1.5));
  CHECK(terms.rates.variance_decay == Approx(2));
  CHECK(roulette(terms).pmf().tail_exponent().exponent == Approx(1));
  CHECK_NOTHROW(roulette(terms, Geometric(0.7)));
  CHECK_THROWS_WITH(roulette(terms, Geometric(0.8)), Catch::Contains("0.25") && Catch::Contains("Geometric(0.5"));
  CHECK_THROWS_WITH(roulette(terms, Poisson(5)), Catch::Contains("finite variance"));
  CHECK_THROWS_WITH(roulette(terms, IndexRoulette(5)), Catch::Contains("finite variance"));
  CHECK_NOTHROW(roulette(taylor(depth, functions::ExpMinus{}, centre_between(0, 2)), IndexRoulette(2)));
  CHECK_THROWS_AS(taylor_sum(near_one, functions::Log{}, centre_between(0.5, 1.5), Geometric(0.8)),
                  std::invalid_argument);
  CHECK_THROWS_AS(taylor_sum(near_one, functions::Log{}, 1.0, Geometric(0.8), {.base_level = -1}),
                  std::invalid_argument);
  CHECK_NOTHROW(roulette(taylor(depth, functions::ExpMinus{}, centre_between(0, 2)), Poisson(2)));
}

// ---- stability

TEST_CASE("thick media keep their relative accuracy: exp(-30) and exp(-100)", "[taylor][exact]") {
  // With X = tau the symmetric sum about a pivot is exact, and the terms about a majorant add up to rounding.
  NullRecord none;
  for (const double tau : {30.0, 100.0}) {
    const auto constant = [tau](Stream&) { return tau; };
    Stream rng(5, 0);
    const auto drawn = taylor_sum(constant, functions::ExpMinus{}, drawn_pivot, BhanotKennedy(0.5, 2, 2))(rng, none);
    CHECK(drawn.value == Approx(std::exp(-tau)).epsilon(1e-15));
    const auto prefix = taylor_sum(constant, functions::ExpMinus{}, 1.5 * tau, Poisson(1),
                                   {.base_level = static_cast<std::int64_t>(6 * tau)})(rng, none);
    CHECK(prefix.value == Approx(std::exp(-tau)).epsilon(1e-13));
  }
}

TEST_CASE("estimates of exp(-30) and exp(-100) are unbiased to a few per cent or better", "[taylor][statistical]") {
  for (const double tau : {30.0, 100.0}) {
    CAPTURE(tau);
    const double truth = std::exp(-tau);
    const auto comb = comb_mean([tau](double x) { return 2 * tau * x; }, 64);
    const auto pivoted = taylor_sum(comb, functions::ExpMinus{}, drawn_pivot, BhanotKennedy(0.9, 2, 2));
    const auto result = estimate(pivoted, {.samples = 1 << 17});
    CHECK(std::abs(result.mean - truth) < 4.5 * result.standard_error);
    CHECK(result.standard_error < 0.02 * truth);
    // Term by term about a majorant of the comb, by running weight.
    const auto series = roulette(taylor(comb, functions::ExpMinus{}, 1.05 * tau), RunningWeight(std::exp(-1.05 * tau)));
    const auto p_series = estimate(series, {.samples = 1 << 17});
    CHECK(std::abs(p_series.mean - truth) < 4.5 * p_series.standard_error);
    CHECK(p_series.standard_error < 0.1 * truth);
  }
}

TEST_CASE("the terms keep the laws of a sequence: partial sums telescope, and rates are those declared",
          "[taylor][law]") {
  const auto reciprocals = taylor(near_one, functions::Reciprocal{}, centre_between(0.5, 1.5));
  CHECK(reciprocals.rates.variance_decay == 2);  // from the bounds; (X - 1)^2 itself has mean 1/12
  const Centre exact{1, 1.0 / 12};
  CHECK(::laws::sequence_laws(taylor(near_one, functions::Reciprocal{}, exact), {.rates = false}) == Failures{});
  CHECK(taylor(near_one, functions::Reciprocal{}, exact).rates.variance_decay == Approx(std::log2(12.0)));
  CHECK(::laws::sequence_laws(taylor(depth, functions::ExpMinus{}, 2.0)) == Failures{});
}

#include <debias/derivative.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/survey.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

constexpr double eps = std::numeric_limits<double>::epsilon();
const double pi = std::acos(-1.0);
const Stream unused(1, 0);

// The bound of the header: f is off by eps |f| in each evaluation.
double rounding(double f, double first_step, std::int64_t level, int power = 1) {
  return 8 * eps * f * std::pow(std::ldexp(1 / first_step, static_cast<int>(level)), power);
}

double step(double first_step, std::int64_t level) { return std::ldexp(first_step, -static_cast<int>(level)); }

// I_k against a closed form without cancellation, and D_k against the difference of two of them.
template <class S, class ClosedForm>
void check_levels(const S& s, const ClosedForm& level_value, double first_step, double f, int power = 1) {
  for (std::int64_t k = 0; k <= 12; ++k) {
    const double h = step(first_step, k);
    const double exact = level_value(h);
    const double exact_difference = k == 0 ? exact : exact - level_value(2 * h);
    const double bound = rounding(f, first_step, k, power);
    const Draw<double> draw = s(k, unused);
    INFO("level " << k << ", bound " << bound);
    CHECK(std::abs(draw.value - exact) < bound);
    CHECK(std::abs(draw.difference - exact_difference) < 2 * bound);
    CHECK(s.value_at(k, unused).value == draw.value);
  }
}

// E max(S_T - K, 0) e^-r as a function of S_0: its samples have a kink.
double call_payoff(double spot, Stream& rng) {
  const double growth = std::exp(0.05 - 0.02 + 0.2 * rng.normal());
  return std::exp(-0.05) * std::max(spot * growth - 100, 0.0);
}

}  // namespace

TEST_CASE("C01: the forward quotients of sin at 1 are their closed form", "[derivative][exact]") {
  const auto s = finite_difference([](double x) { return std::sin(x); }, 1.0);
  check_levels(
      s, [](double h) { return std::cos(1 + h / 2) * std::sin(h / 2) / (h / 2); }, 1.5, 1);
  CHECK(s.value_at(24, unused).value == Approx(0.5403023058681397174).epsilon(1e-6));
  CHECK(sequence_laws(s, {.last = 12}) == Failures{});
}

TEST_CASE("C02: the central quotients of exp at 0 are sinh(h) / h", "[derivative][exact]") {
  const auto s = finite_difference([](double x) { return std::exp(x); }, 0.0, {.kind = Difference::central});
  check_levels(
      s, [](double h) { return std::sinh(h) / h; }, 1.5, std::exp(1.5));
  CHECK(sequence_laws(s, {.last = 10}) == Failures{});
}

TEST_CASE("C03: a first step that spans more than a period is a bias like any other", "[derivative][exact]") {
  const auto f = [](double x) { return 2.5 * (1 + std::sin(2 * pi * x)); };
  const auto s = finite_difference(f, 0.2);
  check_levels(
      s, [](double h) { return 5 * std::cos(2 * pi * (0.2 + h / 2)) * std::sin(pi * h) / h; }, 1.5, 30);
  CHECK(s.value_at(24, unused).value == Approx(4.854027596813666443).epsilon(1e-5));
  CHECK(sequence_laws(s, {.last = 14, .rates_from = 6}) == Failures{});
}

TEST_CASE("C04: |x|^(3/2) at 0 has the quotients sqrt(h), and their differences fall like 2^-k",
          "[derivative][exact]") {
  const auto f = [](double x) { return std::pow(std::abs(x), 1.5); };
  const auto s = finite_difference(f, 0.0, {}, {1, 0});
  check_levels(
      s, [](double h) { return std::sqrt(h); }, 1.5, 2);
  CHECK(s.rates.variance_decay == 1);
  CHECK(sequence_laws(s, {.last = 16}) == Failures{});
  // the rates of a smooth function would not stand
  CHECK(sequence_laws(finite_difference(f, 0.0), {.last = 16}) != Failures{});
}

TEST_CASE("C05: the second quotients of log at 2 are log(1 - h^2/4) / h^2", "[derivative][exact]") {
  const auto s = finite_difference([](double x) { return std::log(x); }, 2.0, {.kind = Difference::second});
  check_levels(
      s, [](double h) { return std::log1p(-h * h / 4) / (h * h); }, 1.5, 1.5, 2);
  CHECK(s.value_at(8, unused).value == Approx(-0.25).epsilon(1e-5));
  CHECK(sequence_laws(s, {.last = 8}) == Failures{});
}

TEST_CASE("a difference that is zero in theory is exactly zero", "[derivative][exact]") {
  const auto square = [](double x) { return x * x; };
  const auto slope = finite_difference(square, 1.0, {.kind = Difference::central});
  const auto curvature = finite_difference(square, 1.0, {.kind = Difference::second});
  // while (1 + h)^2 is exact, 26 bits of h
  for (std::int64_t k = 1; k <= 24; ++k) {
    CHECK(slope(k, unused).value == 2);
    CHECK(slope(k, unused).difference == 0);
    CHECK(curvature(k, unused).value == 2);
    CHECK(curvature(k, unused).difference == 0);
  }
}

TEST_CASE("the slope of f(x) = x is exactly 1 at every level, wherever it is taken", "[derivative][exact]") {
  const auto identity = [](double x) { return x; };
  int naive_misses = 0;
  for (const double at : {0.1, -0.3, 1.0 / 3, 7.7, 1e-5, -123.456, 1e9 + 0.1}) {
    for (const double first_step : {1.5, 0.1, 1.0 / 3}) {
      const auto s = finite_difference(identity, at, {.first_step = first_step});
      for (std::int64_t k = 0; k <= s.last_level(); ++k) {
        INFO("at " << at << ", level " << k);
        CHECK(s(k, unused).value == 1);
        CHECK(s(k, unused).difference == (k == 0 ? 1 : 0));
        const double h = step(first_step, k);
        if (((at + h) - at) / h != 1) ++naive_misses;
      }
    }
  }
  CHECK(naive_misses > 100);  // what the exact step is for
}

TEST_CASE("the rounding error stays below 2^k eps |f| / h_0 down to the last level that has a step",
          "[derivative][exact]") {
  const auto s = finite_difference([](double x) { return std::sin(x); }, 1.0, {.last_level = 50});
  REQUIRE(s.last_level() == 50);  // 1.5 * 2^-50 is six neighbours of 1
  CHECK_THROWS_AS(finite_difference([](double x) { return std::sin(x); }, 1.0, {.last_level = 51}),
                  std::invalid_argument);
  for (std::int64_t k = 13; k <= s.last_level(); ++k) {
    const double h = (1 + step(1.5, k)) - 1;
    const double exact = std::cos(1 + h / 2) * std::sin(h / 2) / (h / 2);
    CHECK(std::abs(s(k, unused).value - exact) < rounding(1, 1.5, k));
    CHECK(std::abs(s(k, unused).value - exact) < 1.01 * s.rounding_error(k));
  }
}

TEST_CASE("levels stop where rounding outgrows the difference: about the roots of eps of order 2, 3, 4 and 3/2",
          "[derivative][exact]") {
  const auto f = [](double x) { return std::sin(x); };
  // h_0^-p |f(x + h_0) - f(x)| 2^(-beta k / 2) meets c eps |f| 2^(p k), c h_0^p = 2, 1, 4 roundings
  const double bits = std::log2(std::abs(std::sin(2.5) - std::sin(1.0)) / (eps * std::sin(1.0)));
  const auto last = [&f](Difference kind, const Rates& rates) {
    return static_cast<double>(finite_difference(f, 1.0, {.kind = kind}, rates).last_level());
  };
  CHECK(last(Difference::forward, {2, 0}) == std::floor((bits - 1) / 2));
  CHECK(last(Difference::central, {4, 0}) == std::floor(bits / 3));
  CHECK(last(Difference::second, {4, 0}) == std::floor((bits - 2) / 4));
  CHECK(last(Difference::forward, {1, 0}) == std::floor((bits - 1) / 1.5));
  // cancellation costs levels: 20 bits of f are lost to the 1e6, a half of them at each end
  const auto lifted = [](double x) { return std::exp(x) + 1e6; };
  const auto plain = [](double x) { return std::exp(x); };
  CHECK(std::abs(finite_difference(plain, 0.0).last_level() - finite_difference(lifted, 0.0).last_level() - 10) <= 1);
  // at a zero of f nothing rounds
  CHECK(finite_difference(f, 0.0).last_level() == 500);
}

TEST_CASE("beyond the last level the difference is 0 and the value that of the last, or it throws on request",
          "[derivative][exact]") {
  const auto f = [](double x) { return std::sin(x); };
  const auto s = finite_difference(f, 1.0);
  const std::int64_t last = s.last_level();
  for (const std::int64_t level : {last + 1, last + 40, std::int64_t{1} << 40}) {
    CHECK(s(level, unused).difference == 0);
    CHECK(s(level, unused).value == s(last, unused).value);
    CHECK(s.value_at(level, unused).value == s(last, unused).value);
    CHECK(s(level, unused).work == 1);
  }
  const auto strict = finite_difference(f, 1.0, {.last_level = 50, .beyond = BeyondLast::throws});
  CHECK_NOTHROW(strict(50, unused));
  CHECK_THROWS_AS(strict(51, unused), std::length_error);
  CHECK_THROWS_AS(strict.value_at(51, unused), std::length_error);
  CHECK_THROWS_AS(strict(std::int64_t{1} << 40, unused), std::length_error);
  CHECK_THROWS_WITH(strict(51, unused), Catch::Contains("the last level is 50") && Catch::Contains("truncates"));
  CHECK(finite_difference([](double x) { return x * x; }, 0.0, {.kind = Difference::second})
            .value_at(500, unused)
            .value == 2);
}

TEST_CASE(
    "the result knows its bias: a sweep over the deepest level stays below the bound, which is least where "
    "rounding takes over",
    "[derivative][statistical]") {
  struct Trial {
    double (*f)(double);
    double at;
    double truth;
    double first_step = 1.5;
  };
  // Black and Scholes, K = 100, r = 0.05, sigma = 0.2, T = 1; the delta at 100 is Phi(d1)
  const auto price = [](double s) {
    const auto phi = [](double x) { return std::erfc(-x / std::sqrt(2.0)) / 2; };
    const double d1 = (std::log(s / 100) + 0.07) / 0.2;
    return s * phi(d1) - 100 * std::exp(-0.05) * phi(d1 - 0.2);
  };
  for (const Trial& t :
       {Trial{[](double x) { return std::sin(x); }, 1.0, std::cos(1.0)},
        Trial{[](double x) { return std::exp(x) + 1e6; }, 0.0, 1.0}, Trial{price, 100, 0.6368306511756190712, 10}}) {
    const std::int64_t own = finite_difference(t.f, t.at, {.first_step = t.first_step}).last_level();
    double least = std::numeric_limits<double>::infinity();
    std::int64_t least_level = -1;
    double rounding_seen = 0;  // as a share of its bound
    for (std::int64_t last = 2; last <= 44; ++last) {
      const auto s = finite_difference(t.f, t.at, {.first_step = t.first_step, .last_level = last});
      const Result<double> r = estimate(single_term(s), {.samples = 1 << 12, .seed = 4});
      // nothing is random but the level: the mean over the PMF is I_last itself
      const double error = std::abs(s.value_at(last, unused).value - t.truth);
      INFO("last level " << last << ", error " << error << ", bound " << r.bias_bound.size);
      CHECK(error <= r.bias_bound.size);
      if (last > own + 3) rounding_seen = std::max(rounding_seen, error / s.rounding_error(last));
      if (r.bias_bound.size < least) {
        least = r.bias_bound.size;
        least_level = last;
      }
    }
    CHECK(std::abs(least_level - own) <= 3);
    CHECK(rounding_seen > 0.1);  // the bound is not generous
    // power check: a bound without its rounding term, h |f''| / 2 < 2^-43, would have failed at the deepest
    // level
    const auto deep = finite_difference(t.f, t.at, {.first_step = t.first_step, .last_level = 44});
    CHECK(std::abs(deep.value_at(44, unused).value - t.truth) > std::ldexp(1.0, -40));
  }
}

TEST_CASE("a function in single precision ends where its own rounding takes over, and keeps its bound",
          "[derivative][statistical]") {
  const auto f = [](double x, Stream& rng) { return static_cast<float>(std::exp(x * rng.uniform())); };
  const auto single = finite_difference(f, 1.0);
  const auto r = estimate(single_term(single), {.samples = 1 << 17, .seed = 5});
  CHECK(single.last_level() < 14);
  CHECK(r.bias_bound.size < 0.01);
  CHECK(std::abs(r.mean - 1) <= 4.5 * r.standard_error + r.bias_bound.size);
  CHECK(r.standard_error < 0.01);  // 0.9 where the levels go on as in double precision
}

TEST_CASE("any ratio and Richardson extrapolation have the declared rates", "[derivative][law]") {
  const auto f = [](double x) { return std::sin(x); };
  const auto check = [&f](const DifferenceOptions& o, std::int64_t last, double beta, std::int64_t from = 2) {
    const auto s = finite_difference(f, 1.0, o);
    INFO("kind " << static_cast<int>(o.kind) << ", ratio " << o.ratio << ", " << o.extrapolations << " extrapolations");
    CHECK(s.rates.variance_decay == Approx(beta));
    CHECK(sequence_laws(s, {.last = last, .rounding = 1e-12, .rates_from = from}) == Failures{});
  };
  check({.ratio = 0.25}, 7, 4);
  check({.ratio = 0.8}, 16, -2 * std::log2(0.8));
  // h^2 cos 1 and h^3 sin 1 cancel between levels 1 and 2: asymptotic from level 4 on only
  check({.extrapolations = 1}, 10, 4, 4);
  check({.extrapolations = 2}, 7, 6);
  check({.kind = Difference::central, .extrapolations = 1}, 6, 8);
  check({.kind = Difference::central, .ratio = 0.7, .extrapolations = 1}, 8, -8 * std::log2(0.7));
  check({.kind = Difference::second, .extrapolations = 1}, 6, 8);
  // the power check: without the extrapolation the rate is another
  CHECK(sequence_laws(finite_difference(f, 1.0, {}, {4, 0}), {.last = 8}) != Failures{});
  // one central quotient more for each extrapolation: exact for polynomials of degree 4
  const auto quartic = finite_difference([](double x) { return x * x * x * x + x * x * x; }, 1.0,
                                         {.kind = Difference::central, .extrapolations = 1});
  CHECK(quartic.value_at(0, unused).value == Approx(7).epsilon(1e-13));
}

TEST_CASE("the complex step is the derivative to the last digits, without a level", "[derivative][exact]") {
  const auto wave = [](const std::complex<double>& x) { return std::sin(x) * std::exp(x); };
  Stream rng(1, 1);
  CHECK(complex_step(wave, 0.7)(rng) == Approx((std::sin(0.7) + std::cos(0.7)) * std::exp(0.7)).epsilon(1e-15));
  const auto random = [](const std::complex<double>& x, Stream& r) { return std::sin(x * r.uniform()); };
  const auto result = estimate(complex_step(random, 1.0), {.samples = 1 << 14});
  CHECK(std::abs(result.mean - (std::sin(1.0) + std::cos(1.0) - 1)) < 4.5 * result.standard_error);  // C09
  CHECK(result.bias_bound.size == 0);
}

TEST_CASE("a jump and noise that is not shared are a no before a run, and INFINITE after it",
          "[derivative][statistical]") {
  const auto smooth = [](double x, Stream& rng) { return std::sin(x * rng.uniform()); };
  const auto jump = [](double x, Stream& rng) { return rng.uniform() < 0.2 * x ? 1.0 : 0.0; };
  const auto own_noise = [](double x, Stream& rng) {  // numbers that depend on x are not common
    return std::sin(x) + Stream(rng.bits(), std::bit_cast<std::uint64_t>(x)).normal();
  };
  const auto check = [](const auto& s, double beta, bool helps) {
    const Survey before = survey(s, 10, {.samples = 1 << 14});
    INFO(before);
    CHECK(std::abs(before.rates.variance_decay.value - beta) < 0.15);
    CHECK(before.pmf_exists == (helps ? Answer::yes : Answer::no));
    const auto after = estimate(single_term(s, Geometric(0.5)), {.samples = 1 << 14, .threads = 1});
    INFO(after.bias_bound.sentence);
    CHECK(std::isinf(after.bias_bound.size) != helps);
    if (helps) return;
    CHECK_THAT(after.bias_bound.sentence, Catch::Contains("do not help"));
    CHECK(after.verdict().variance == Finiteness::infinite);
  };
  check(finite_difference(smooth, 1.0), 2, true);
  check(finite_difference(call_payoff, 100.0, {.first_step = 10}, {1, 0}), 1, true);
  check(finite_difference(jump, 1.0), -1, false);
  check(finite_difference(own_noise, 1.0), -2, false);
}

TEST_CASE("impossible arguments of finite_difference are refused", "[derivative][exact]") {
  const auto f = [](double x) { return x; };
  const double inf = std::numeric_limits<double>::infinity();
  for (const double first_step : {0.0, -1.5, inf, std::nan("")}) {
    CHECK_THROWS_AS(finite_difference(f, 1.0, {.first_step = first_step}), std::invalid_argument);
  }
  for (const double at : {inf, -inf, std::nan("")}) {
    CHECK_THROWS_AS(finite_difference(f, at), std::invalid_argument);
  }
  CHECK_THROWS_WITH(finite_difference(f, 1e20), Catch::Contains("lost"));
  for (const double ratio : {0.0, 1.0, -0.5, std::nan("")}) {
    CHECK_THROWS_AS(finite_difference(f, 1.0, {.ratio = ratio}), std::invalid_argument);
  }
  CHECK_THROWS_AS(finite_difference(f, 1.0, {.extrapolations = 7}), std::invalid_argument);
  CHECK_THROWS_AS(finite_difference(f, 1.0, {.last_level = -1}), std::invalid_argument);
}

TEST_CASE("the work is the number of evaluations, and shared ones are made once", "[derivative][exact]") {
  int calls = 0;
  const auto f = [&calls](double x) {
    ++calls;
    return std::sin(x);
  };
  const auto count = [&calls](const auto& evaluation) {
    calls = 0;
    const double work = evaluation().work;
    CHECK(work == calls);
    return calls;
  };
  struct Expected {
    Difference kind;
    int base, coupled;
  };
  for (const Expected& e :
       {Expected{Difference::forward, 1, 2}, Expected{Difference::central, 2, 4}, Expected{Difference::second, 2, 4}}) {
    const auto s = finite_difference(f, 1.0, {.kind = e.kind});
    CHECK(count([&] { return s(0, unused); }) == e.base);
    CHECK(count([&] { return s(3, unused); }) == e.coupled);
    CHECK(count([&] { return s.value_at(3, unused); }) == e.base);
  }
}

TEST_CASE("C09: every evaluation of a draw sees the same random numbers", "[derivative][exact]") {
  const auto f = [](double theta, Stream& rng) { return std::sin(theta * rng.uniform()); };
  const auto s = finite_difference(f, 1.0, {.kind = Difference::central});
  for (std::uint64_t i = 0; i < 100; ++i) {
    const double u = Stream(7, i).uniform();
    for (std::int64_t k = 0; k <= 8; ++k) {
      const double h = step(1.5, k);
      const auto quotient = [u](double h_) { return std::cos(u) * std::sin(u * h_) / h_; };
      const Draw<double> draw = s(k, Stream(7, i));
      CHECK(std::abs(draw.value - quotient(h)) < rounding(1, 1.5, k));
      const double exact = k == 0 ? quotient(h) : quotient(h) - quotient(2 * h);
      CHECK(std::abs(draw.difference - exact) < 2 * rounding(1, 1.5, k));
    }
  }
}

TEST_CASE("common random numbers keep the declared rates, independent ones do not", "[derivative][law]") {
  const auto f = [](double theta, Stream& rng) { return std::sin(theta * rng.uniform()); };
  CHECK(sequence_laws(finite_difference(f, 1.0, {.kind = Difference::central}), {.last = 8}) == Failures{});
  CHECK(sequence_laws(finite_difference(f, 1.0), {.last = 8}) == Failures{});

  struct IndependentNumbers {
    Rates rates{2, 0};
    Draw<double> operator()(std::int64_t level, Stream& rng) const {
      const double h = step(1.5, level);
      const double here = std::sin(rng.uniform());
      const double fine = (std::sin((1 + h) * rng.uniform()) - here) / h;
      if (level == 0) return base(fine, 2);
      return coupled(fine, (std::sin((1 + 2 * h) * rng.uniform()) - here) / (2 * h), 3);
    }
  };
  CHECK(sequence_laws(IndependentNumbers{}, {.last = 8}) != Failures{});
}

TEST_CASE("C06: samples with a kink have the rate 1, not 2", "[derivative][law]") {
  const DifferenceOptions ten{.first_step = 10};
  const auto kinked = finite_difference(call_payoff, 100.0, ten, {1, 0});
  CHECK(sequence_laws(kinked, {.last = 7, .samples = 16384}) == Failures{});
  CHECK(sequence_laws(finite_difference(call_payoff, 100.0, ten), {.last = 7, .samples = 16384}) != Failures{});
}

TEST_CASE("C12: the second difference of samples with a kink grows, and no PMF exists", "[derivative][law]") {
  const DifferenceOptions second{.kind = Difference::second, .first_step = 40};
  const auto s = finite_difference(call_payoff, 100.0, second, {-1, 0});
  CHECK(sequence_laws(s, {.last = 7, .samples = 16384}) == Failures{});
  CHECK_FALSE(pmf_exists(s.rates));
}

TEST_CASE("a swapped sign, a missing factor and an unhalved step are seen", "[derivative][law]") {
  const auto s = finite_difference([](double x) { return std::sin(x); }, 1.0);
  const auto swapped = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference = -d.difference;
    return d;
  };
  const auto scaled_down = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference *= 1 - 1e-9;
    return d;
  };
  const auto shifted = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference = s(k + 1, rng).difference;
    return d;
  };
  CHECK(sequence_laws(swapped) != Failures{});
  CHECK(sequence_laws(scaled_down) != Failures{});
  CHECK(sequence_laws(shifted) != Failures{});
}

TEST_CASE("vectors and complex numbers are differentiated component by component", "[derivative][exact]") {
  const auto circle = [](double t) { return Eigen::Vector2d(std::cos(t), std::sin(t)); };
  const auto wave = [](double t) { return std::polar(1.0, t); };
  const auto cosine = finite_difference([](double t) { return std::cos(t); }, 0.7);
  const auto sine = finite_difference([](double t) { return std::sin(t); }, 0.7);
  for (std::int64_t k = 0; k <= 10; ++k) {
    const auto v = finite_difference(circle, 0.7)(k, unused).difference;
    const auto z = finite_difference(wave, 0.7)(k, unused).difference;
    CHECK(v.x() == cosine(k, unused).difference);
    CHECK(v.y() == sine(k, unused).difference);
    CHECK(z.real() == cosine(k, unused).difference);
    CHECK(z.imag() == sine(k, unused).difference);
  }
  CHECK(sequence_laws(finite_difference(circle, 0.7), {.last = 10}) == Failures{});
}

TEST_CASE("finite_difference is a sequence that declares the rates of its kind", "[derivative][compile]") {
  const auto f = [](double x) { return x; };
  using S = decltype(finite_difference(f, 0.0));
  STATIC_REQUIRE(BiasedSequence<S>);
  STATIC_REQUIRE(DeclaresRates<S>);
  STATIC_REQUIRE(OffersValueAt<S>);
  STATIC_REQUIRE_FALSE(ParameterFunction<int (*)(double)>);  // an integer is not a Value
  CHECK(finite_difference(f, 0.0).rates.variance_decay == 2);
  CHECK(finite_difference(f, 0.0, {.kind = Difference::central}).rates.variance_decay == 4);
  CHECK(finite_difference(f, 0.0, {.kind = Difference::second}).rates.variance_decay == 4);
}

#include <debias/derivative.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include <Eigen/Core>

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

double step(double first_step, std::int64_t level) {
  return std::ldexp(first_step, -static_cast<int>(level));
}

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
  CHECK(s.rates.variance == 1);
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

TEST_CASE("the rounding error stays below 2^k eps |f| / h_0 down to the last level", "[derivative][exact]") {
  const auto s = finite_difference([](double x) { return std::sin(x); }, 1.0);
  REQUIRE(s.last_level() == 50);  // 1.5 * 2^-50 is six neighbours of 1
  for (std::int64_t k = 13; k <= s.last_level(); ++k) {
    const double h = (1 + step(1.5, k)) - 1;
    const double exact = std::cos(1 + h / 2) * std::sin(h / 2) / (h / 2);
    CHECK(std::abs(s(k, unused).value - exact) < rounding(1, 1.5, k));
  }
}

TEST_CASE("a level whose step is lost throws, and the message says which level is the last",
          "[derivative][exact]") {
  const auto f = [](double x) { return std::sin(x); };
  const auto s = finite_difference(f, 1.0);
  CHECK_NOTHROW(s(50, unused));
  CHECK_THROWS_AS(s(51, unused), std::length_error);
  CHECK_THROWS_AS(s.value_at(51, unused), std::length_error);
  CHECK_THROWS_AS(s(std::int64_t{1} << 40, unused), std::length_error);
  CHECK_THROWS_WITH(s(51, unused), Catch::Contains("the last level is 50") && Catch::Contains("truncated"));
  CHECK(finite_difference(f, 1024.0).last_level() == 40);
  CHECK(finite_difference(f, 0.0).last_level() == 500);
  CHECK(finite_difference([](double x) { return x * x; }, 0.0, {.kind = Difference::second})
            .value_at(500, unused)
            .value == 2);
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
  for (const Expected& e : {Expected{Difference::forward, 2, 3}, Expected{Difference::central, 2, 4},
                            Expected{Difference::second, 3, 5}}) {
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
  CHECK(sequence_laws(finite_difference(call_payoff, 100.0, ten), {.last = 7, .samples = 16384}) !=
        Failures{});
}

TEST_CASE("C12: the second difference of samples with a kink grows, and no law exists", "[derivative][law]") {
  const DifferenceOptions second{.kind = Difference::second, .first_step = 40};
  const auto s = finite_difference(call_payoff, 100.0, second, {-1, 0});
  CHECK(sequence_laws(s, {.last = 7, .samples = 16384}) == Failures{});
  CHECK_FALSE(law_exists(s.rates));
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
  CHECK(finite_difference(f, 0.0).rates.variance == 2);
  CHECK(finite_difference(f, 0.0, {.kind = Difference::central}).rates.variance == 4);
  CHECK(finite_difference(f, 0.0, {.kind = Difference::second}).rates.variance == 4);
}

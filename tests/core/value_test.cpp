#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"
#include "laws/value_laws.hpp"

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/core/value.hpp>
#include <debias/estimators/single_term.hpp>

using namespace debias;
using laws::Failures;
using laws::value_laws;

namespace elsewhere {

/// The least that a user's type may bring: no default constructor, no *, no ==, functions found by ADL alone.
class Pair {
 public:
  Pair(double a, double b) : a_(a), b_(b) {}
  friend Pair operator+(const Pair& x, const Pair& y) { return {x.a_ + y.a_, x.b_ + y.b_}; }
  friend Pair operator-(const Pair& x, const Pair& y) { return {x.a_ - y.a_, x.b_ - y.b_}; }
  friend std::size_t component_count(const Pair&) { return 2; }
  friend double component(const Pair& p, std::size_t i) { return i == 0 ? p.a_ : p.b_; }
  friend void set_component(Pair& p, std::size_t i, double x) { (i == 0 ? p.a_ : p.b_) = x; }

 private:
  double a_;
  double b_;
};

/// Wrong in one way each, for the power of the suite.
struct Lossy {
  double a = 0, b = 0;
  friend Lossy operator+(const Lossy& x, const Lossy& y) { return {x.a + y.a, x.b}; }
  friend Lossy operator-(const Lossy& x, const Lossy& y) { return {x.a - y.a, x.b - y.b}; }
};
inline std::size_t component_count(const Lossy&) { return 2; }
inline double component(const Lossy& v, std::size_t i) { return i == 0 ? v.a : v.b; }
inline void set_component(Lossy& v, std::size_t i, double x) { (i == 0 ? v.a : v.b) = x; }

struct Shared {  // a copy is the same number
  double* x;
  friend Shared operator+(const Shared& p, const Shared&) { return p; }
  friend Shared operator-(const Shared& p, const Shared&) { return p; }
};
inline std::size_t component_count(const Shared&) { return 1; }
inline double component(const Shared& v, std::size_t) { return *v.x; }
inline void set_component(Shared& v, std::size_t, double x) { *v.x = x; }

struct NoMinus {
  double x = 0;
  friend NoMinus operator+(const NoMinus& p, const NoMinus& q) { return {p.x + q.x}; }
};
inline std::size_t component_count(const NoMinus&) { return 1; }
inline double component(const NoMinus& v, std::size_t) { return v.x; }
inline void set_component(NoMinus& v, std::size_t, double x) { v.x = x; }

}  // namespace elsewhere

namespace {

/// `shape` with the components 1 u, 2 u, 3 u, ...
template <Value V>
V filled(V shape, double u) {
  for (std::size_t i = 0; i < component_count(shape); ++i) set_component(shape, i, static_cast<double>(i + 1) * u);
  return shape;
}

template <Value V>
std::vector<V> examples(const V& shape) {
  return {filled(shape, 0.3), filled(shape, -1e7), filled(shape, 1e-9), zero_like(shape)};
}

/// Runs E[(i + 1) U] = (i + 1) / 2, variance (i + 1)^2 / 12, and says what is wrong with the answer.
/// `claimed_step` is the slope of the claim over the components: 1, unless its power is at stake.
template <Value V>
Failures estimate_of(const V& shape, double claimed_step = 1) {
  Failures failures;
  const std::size_t n = component_count(shape);
  const Plan plan{.samples = 10'000, .seed = 4};
  const auto sample = [&shape](Stream& rng) { return filled(shape, rng.uniform()); };
  const Result<V> result = estimate(sample, plan);
  std::vector<std::vector<double>> columns(n);
  for (std::int64_t i = 0; i < plan.samples; ++i) {
    Stream rng(plan.seed, static_cast<std::uint64_t>(i));
    const V v = sample(rng);
    for (std::size_t c = 0; c < n; ++c) columns[c].push_back(component(v, c));
  }
  const double rounding = component(filled(shape, 0.1), 0) == 0.1 ? 1e-13 : 1e-6;  // float keeps 24 bits
  const auto require = [&](bool holds, const std::string& claim, std::size_t c) {
    if (!holds) failures.push_back(claim + ", not so for component " + std::to_string(c));
  };
  for (std::size_t c = 0; c < n; ++c) {
    const Moments exact = Moments::of(columns[c]);
    const double mean = component(result.mean, c);
    const double error = component(result.standard_error, c);
    const double step = 1 + claimed_step * static_cast<double>(c);
    require(std::abs(mean - exact.mean) <= rounding * exact.mean, "mean of the samples", c);
    require(std::abs(error - exact.standard_error()) <= rounding * error, "standard error of the samples", c);
    require(std::abs(mean - step / 2) <= 4.5 * error, "unbiased", c);
    const double exact_error = step / std::sqrt(12 * static_cast<double>(plan.samples));
    require(std::abs(error / exact_error - 1) <= 4.5 * std::sqrt(0.8 / 4 / 1e4), "standard error of the law", c);
  }
  if (result.components.size() != n) failures.emplace_back("as many component estimates as components");
  return failures;
}

template <Value V>
void check_value(const V& shape) {
  CHECK(value_laws<V>(examples(shape)) == Failures{});
  CHECK(estimate_of(shape) == Failures{});
}

template <class A>
using plus_t = decltype(std::declval<const A&>() + std::declval<const A&>());

}  // namespace

TEST_CASE("real, complex, array and user-defined values keep the laws and are estimated component by component",
          "[core][value][law]") {
  check_value(0.0);
  check_value(0.0F);
  check_value(std::complex<double>{});
  check_value(std::complex<float>{});
  check_value(elsewhere::Pair(0, 0));
}

TEST_CASE("plain Eigen arrays and matrices, fixed or dynamic, keep the laws too", "[core][value][law]") {
  check_value(Eigen::Array3d(0, 0, 0));
  check_value(Eigen::ArrayXd(Eigen::ArrayXd::Zero(5)));
  check_value(Eigen::ArrayXf(Eigen::ArrayXf::Zero(4)));
  check_value(Eigen::Matrix2d(Eigen::Matrix2d::Zero()));
  check_value(Eigen::ArrayXcd(Eigen::ArrayXcd::Zero(3)));
}

TEST_CASE("the suite rejects a sum that forgets a component, a copy that is no copy, and a wrong mean",
          "[core][value][law]") {
  CHECK(value_laws<elsewhere::Lossy>({{1, 2}, {3, 4}}) == Failures{"a + b adds the components"});
  double x = 0.25;
  CHECK(value_laws<elsewhere::Shared>({{&x}}) != Failures{});
  CHECK(estimate_of(Eigen::Array3d(0, 0, 0), 1.05) != Failures{});
}

TEST_CASE("what is not a list of real components is not a Value", "[core][value][compile]") {
  STATIC_REQUIRE(Value<elsewhere::Pair>);
  STATIC_REQUIRE_FALSE(Value<int>);
  STATIC_REQUIRE_FALSE(Value<bool>);
  STATIC_REQUIRE_FALSE(Value<long double>);
  STATIC_REQUIRE_FALSE(Value<std::string>);
  STATIC_REQUIRE_FALSE(Value<double*>);
  STATIC_REQUIRE_FALSE(Value<const char*>);
  STATIC_REQUIRE_FALSE(Value<std::vector<double>>);
  STATIC_REQUIRE_FALSE(Value<std::complex<int>>);
  STATIC_REQUIRE_FALSE(Value<elsewhere::NoMinus>);
  STATIC_REQUIRE_FALSE(Value<plus_t<Eigen::ArrayXd>>);  // an expression holds references to what it adds
  STATIC_REQUIRE_FALSE(Value<Eigen::Map<Eigen::ArrayXd>>);
  STATIC_REQUIRE_FALSE(Value<Eigen::ArrayXi>);
  STATIC_REQUIRE_FALSE(Value<const double>);
}

TEST_CASE("means are double for scalars, of float too, and of the value's own type otherwise",
          "[core][value][compile]") {
  STATIC_REQUIRE(std::same_as<mean_t<float>, double>);
  STATIC_REQUIRE(std::same_as<mean_t<std::complex<float>>, std::complex<double>>);
  STATIC_REQUIRE(std::same_as<mean_t<Eigen::ArrayXf>, Eigen::ArrayXf>);
  STATIC_REQUIRE(std::same_as<mean_t<elsewhere::Pair>, elsewhere::Pair>);
}

TEST_CASE("the norm neither over- nor underflows where the result is a double", "[core][value][exact]") {
  const auto near = [](double got, double exact) { return std::abs(got - exact) <= 1e-15 * exact; };
  CHECK(near(as_scalar(std::complex<double>(3e300, -4e300)), 5e300));
  CHECK(near(as_scalar(std::complex<double>(3e-300, 4e-300)), 5e-300));
  CHECK(as_scalar(std::complex<double>(0, -0x1p-1074)) == 0x1p-1074);
  CHECK(as_scalar(-2.5) == -2.5);
  CHECK(as_scalar(-2.5F) == -2.5);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  constexpr double inf = std::numeric_limits<double>::infinity();
  CHECK(std::isnan(as_scalar(Eigen::Array3d(nan, 1, 2))));
  CHECK(std::isnan(as_scalar(Eigen::Array3d(1, 2, nan))));
  CHECK(as_scalar(Eigen::Array3d(1, -inf, 2)) == inf);
}

TEST_CASE("arrays of different shapes are refused, not read beyond their end", "[core][value][exact]") {
  const Eigen::ArrayXd two = Eigen::ArrayXd::Zero(2);
  const Eigen::ArrayXd three = Eigen::ArrayXd::Zero(3);
  CHECK_THROWS_WITH(sum(two, three), Catch::Contains("2 x 1 and 3 x 1"));
  CHECK_THROWS_AS(difference(three, two), std::invalid_argument);
  CHECK_THROWS_AS(sum(Eigen::MatrixXd(2, 3), Eigen::MatrixXd(3, 2)), std::invalid_argument);
  const auto growing = [](std::int64_t level, Stream&) {
    const Eigen::ArrayXd ones = Eigen::ArrayXd::Ones(level + 1);
    return Draw<Eigen::ArrayXd>{ones, ones, 1};
  };
  CHECK_THROWS_AS(estimate(single_term(growing, Geometric(0.5)), {.samples = 10}), SampleError);
}

TEST_CASE("debiasing works on a type without a default constructor", "[core][value][exact]") {
  // I_k = (1 - 2^-k) (2, 4), without noise: the limit is (2, 4).
  const auto series = [](std::int64_t level, Stream&) {
    const auto value = [](std::int64_t k) {
      return filled(elsewhere::Pair(0, 0), 2 - std::ldexp(2.0, -static_cast<int>(k)));
    };
    return level == 0 ? base(value(0)) : coupled(value(level), value(level - 1));
  };
  const auto result = estimate(single_term(series, Geometric(0.5)), {.samples = 1000, .seed = 1});
  CHECK(component(result.mean, 0) == 2);  // D_k / p_k is the same number for every k
  CHECK(component(result.mean, 1) == 4);
  CHECK(component(result.standard_error, 1) == 0);
}

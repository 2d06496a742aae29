#include <debias/function_of_mean/doubling.hpp>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

const auto exponential = [](Stream& rng) { return rng.exponential(); };
const auto uniform = [](Stream& rng) { return rng.uniform(); };
const auto twice = [](double x) { return 2 * x; };
const auto wave = [](double x) { return 1 + std::sin(2 * std::numbers::pi * x); };

/// max(0, 1 - tau / 3), with its gap.
struct LinearTransmittance {
  double operator()(double m) const { return functions::PositivePart{}(1 - m / 3); }
  double gap(double m, double d) const { return functions::PositivePart{}.gap(1 - m / 3, d / 3); }
};

/// g without its gap.
template <class G>
auto plain(const G& g) {
  return [g](double m) { return g(m); };
}

}  // namespace

TEST_CASE("the shared base is far quieter than a base of its own on a comb", "[function_of_mean][statistical]") {
  const auto s = function_of_integral(twice, functions::ExpMinus{});
  std::vector<double> shared;
  std::vector<double> alone;
  for (std::uint64_t i = 0; i < 4096; ++i) {
    Stream rng(82, i);
    Stream other = rng.split(1);
    shared.push_back(s.shared(4, 1, rng).base);
    alone.push_back(s.value_at(1, other).value);
  }
  CHECK(Moments::of(shared).variance() < 0.05 * Moments::of(alone).variance());
}

// ---- exact statements

TEST_CASE("the shared base is the average of g over the groups of a comb, both halves", "[function_of_mean][exact]") {
  const auto s = function_of_integral(wave, functions::ExpMinus{}, {.from = 0.2, .to = 0.9});
  for (std::int64_t level = 1; level <= 5; ++level) {
    for (std::int64_t m = 0; m < level; ++m) {
      Stream rng(83, 5);
      Stream replay(rng);
      Stream again(rng);
      const double offset = replay.uniform();
      const std::int64_t groups = std::int64_t{1} << (level - m);
      const std::int64_t size = std::int64_t{1} << m;
      const double step = 0.7 / static_cast<double>(groups * size);
      double expected = 0;
      for (std::int64_t r = 0; r < groups; ++r) {
        double total = 0;
        for (std::int64_t i = r; i < groups * size; i += groups) {
          total += wave(0.2 + step * (static_cast<double>(i) + offset));
        }
        expected += std::exp(-0.7 * total / static_cast<double>(size)) / static_cast<double>(groups);
      }
      const auto draw = s.shared(level, m, rng);
      CHECK(draw.base == Approx(expected).epsilon(1e-14));
      CHECK(draw.work == static_cast<double>(groups * size));
      CHECK(draw.difference == Approx(s(level, again).difference).epsilon(1e-10).margin(1e-25));
    }
  }
}

TEST_CASE("halves are the even and the odd draws of the stream", "[function_of_mean][exact]") {
  const auto s = function_of_mean(uniform, plain(functions::Square{}));
  Stream rng(84, 0);
  Stream replay(rng);
  std::array<double, 8> u{};
  replay.fill(u);
  const double even = (u[0] + u[2] + u[4] + u[6]) / 4;
  const double odd = (u[1] + u[3] + u[5] + u[7]) / 4;
  const auto draw = s(3, rng);
  CHECK(draw.value == Approx((even + odd) * (even + odd) / 4).epsilon(1e-15));
  CHECK(draw.difference == Approx(-(even - odd) * (even - odd) / 4).epsilon(1e-12));
  CHECK(draw.work == 8);
  CHECK(rng.bits() == replay.bits());  // 8 draws, no more
}

TEST_CASE("differences that are zero in theory are exactly zero", "[function_of_mean][exact]") {
  const auto three = [](Stream& rng) { return rng.uniform() < 2 ? 3.1 : 0.0; };
  const auto constant = [](double) { return 3.1; };
  const auto functions_of_constants = std::make_tuple(
      function_of_mean(three, functions::ExpMinus{}), function_of_mean(three, plain(functions::ExpMinus{})),
      function_of_integral(constant, functions::Log{}, {.from = 0.1, .to = 0.8}),
      function_of_integral(constant, plain(functions::Log{}), {.from = 0.1, .to = 0.8}),
      function_of_integral(twice, LinearTransmittance{}));  // B17: g is linear where it is visited
  std::apply(
      [](const auto&... s) {
        const auto check = [](const auto& one) {
          for (std::int64_t k = 1; k <= 12; ++k) {
            Stream rng(85, static_cast<std::uint64_t>(k));
            CHECK(one(k, rng).difference == 0.0);
            CHECK(one.shared(k, k / 2, rng).difference == 0.0);
          }
        };
        (check(s), ...);
      },
      functions_of_constants);
}

TEST_CASE("above the band of a periodic medium a gap leaves nothing and a subtraction one ulp",
          "[function_of_mean][exact]") {
  // B04: the halves agree to their last digits, d = 1e-16. Measured largest |D|: 1.8e-31 by the gap, 5.6e-17
  // (an ulp of e^-1) by subtraction; a PMF divides either by p_k.
  const auto with_gap = function_of_integral(wave, functions::ExpMinus{});
  const auto without = function_of_integral(wave, plain(functions::ExpMinus{}));
  double largest_gap = 0;
  double largest_subtraction = 0;
  for (std::int64_t k = 2; k <= 10; ++k) {
    for (std::uint64_t i = 0; i < 200; ++i) {
      Stream one(86, i);
      Stream two(86, i);
      largest_gap = std::max(largest_gap, std::abs(with_gap(k, one).difference));
      largest_subtraction = std::max(largest_subtraction, std::abs(without(k, two).difference));
    }
  }
  CAPTURE(largest_gap, largest_subtraction);
  CHECK(largest_gap < 1e-28);
  CHECK(largest_subtraction > 1e-17);
  CHECK(largest_subtraction < 5e-16);
}

TEST_CASE("a result says where differences are rounding, and only there", "[function_of_mean][statistical]") {
  const Plan plan{.samples = 1 << 14};
  const Geometric pmf(0.65);
  const auto bound = [&](const auto& g) {
    return estimate(single_term(function_of_integral(wave, g), pmf), plan).bias_bound;
  };
  CHECK(bound(functions::ExpMinus{}).size == 0);
  const BiasBound rounding = bound(plain(functions::ExpMinus{}));
  CHECK(rounding.size > 1e-17);
  CHECK(rounding.size < 1e-15);
  CHECK(rounding.sentence.find("from level 2 on") == 0);
  const auto linear = function_of_integral(twice, plain(functions::ExpMinus{}));
  CHECK(estimate(single_term(linear, Geometric(0.75)), {.samples = 64}).bias_bound.size == 0);  // levels 1 ... 4
}

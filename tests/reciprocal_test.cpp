#include <debias/reciprocal.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <debias/core/accumulator.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

const auto exponential = [](Stream& rng) { return rng.exponential(); };
const auto twice = [](double x) { return 2 * x; };

/// The larger |z| of the means of I_k and D_k against truth.
template <class S>
double worst_z(const S& s, std::int64_t level, int n, double value, double difference) {
  std::vector<double> values;
  std::vector<double> differences;
  for (int i = 0; i < n; ++i) {
    Stream rng = split_level(Stream(71, static_cast<std::uint64_t>(i)), level);
    const auto draw = s(level, rng);
    values.push_back(draw.value);
    differences.push_back(draw.difference);
  }
  const Moments v = Moments::of(values);
  const Moments d = Moments::of(differences);
  return std::max(std::abs(v.mean - value) / v.standard_error(),
                  std::abs(d.mean - difference) / d.standard_error());
}

double mean_reciprocal_of_exponentials(std::int64_t level) {  // E 1 / (mean of n) = n / (n - 1), a Gamma law
  const double n = std::ldexp(1.0, static_cast<int>(level));
  return n / (n - 1);
}

double mean_reciprocal_of_linear_comb(std::int64_t level) {  // the mean is uniform in 1 +- 1 / n
  const double n = std::ldexp(1.0, static_cast<int>(level));
  return n * std::atanh(1 / n);
}

}  // namespace

TEST_CASE("reciprocals of means of exponential draws have the level means of the Gamma law",
          "[reciprocal][statistical]") {
  const auto s = reciprocal(exponential);
  const auto truth = mean_reciprocal_of_exponentials;
  for (std::int64_t k = 4; k <= 7; ++k) {  // halves of 8 draws and more: four moments
    CAPTURE(k);
    CHECK(worst_z(s, k, 40000, truth(k), truth(k) - truth(k - 1)) < 4.5);
  }
  CHECK(worst_z(s, 5, 40000, truth(4), truth(5) - truth(4)) > 4.5);  // power check: the level below
  CHECK(worst_z(s, 5, 40000, truth(5), truth(4) - truth(3)) > 4.5);
}

TEST_CASE("reciprocals of a comb on a linear function have closed-form level means",
          "[reciprocal][statistical]") {
  const auto s = reciprocal_of_integral(twice);
  const auto truth = mean_reciprocal_of_linear_comb;
  for (std::int64_t k = 2; k <= 6; ++k) {
    CAPTURE(k);
    CHECK(worst_z(s, k, 20000, truth(k), truth(k) - truth(k - 1)) < 4.5);
  }
  CHECK(worst_z(s, 4, 20000, truth(4), truth(3) - truth(2)) > 4.5);  // power check: the level below
}

TEST_CASE("reciprocals keep the laws of a sequence and their declared rates", "[reciprocal][law]") {
  const auto bounded = [](Stream& rng) { return 0.5 + rng.uniform(); };  // A03
  CHECK(sequence_laws(reciprocal(bounded)) == Failures{});
  CHECK(sequence_laws(reciprocal([](Stream& rng) { return -2 - rng.uniform(); })) == Failures{});
  CHECK(sequence_laws(reciprocal_of_integral([](double x) { return 1 + x; }, {.from = -0.5, .to = 2})) ==
        Failures{});
  CHECK(sequence_laws(reciprocal(exponential), {.first = 4, .last = 8, .samples = 8192}) == Failures{});

  // Power check: other rates.
  CHECK(sequence_laws(reciprocal(bounded, {1.5, 1})) != Failures{});
  CHECK(sequence_laws(reciprocal_of_integral([](double x) { return 1 + x; }, {.rates = {2, 1}})) !=
        Failures{});
}

TEST_CASE("draws near zero make the shallow levels heavy, and a base level above them does not see it",
          "[reciprocal][statistical]") {
  // With a density of 1 at zero, E I_0 = infinity, while I_3 has a fourth moment.
  const auto s = reciprocal(exponential);
  const auto share_of_largest = [&s](std::int64_t level) {
    double total = 0;
    double largest = 0;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Stream rng(72, i);
      const double square = std::pow(s.value_at(level, rng).value, 2);
      total += square;
      largest = std::max(largest, square);
    }
    return largest / total;
  };
  CHECK(share_of_largest(0) > 0.2);
  CHECK(share_of_largest(3) < 0.02);
}

TEST_CASE("a mean of zero gives a number that is not finite, never a clamped one", "[reciprocal][exact]") {
  const auto s = reciprocal([](Stream&) { return 0.0; });
  for (std::int64_t k = 0; k <= 3; ++k) {
    Stream rng(73, 0);
    const auto draw = s(k, rng);
    CHECK_FALSE(std::isfinite(draw.value));
    CHECK_FALSE(std::isfinite(draw.difference));
  }
  const auto half = reciprocal([](Stream& rng) { return rng.uniform() < 0.5 ? 0.0 : 1.0; });
  bool seen = false;  // one half of the draws zero, the other not: a finite value with an infinite difference
  for (std::uint64_t i = 0; i < 64; ++i) {
    Stream rng(74, i);
    const auto draw = half(1, rng);
    if (draw.value == 2) {
      seen = true;
      CHECK(draw.difference == -std::numeric_limits<double>::infinity());
    }
  }
  CHECK(seen);
}

#include <debias/function_of_mean/points.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

const auto twice = [](double x) { return 2 * x; };

}  // namespace

TEST_CASE("jittered points keep the laws of a sequence, shared bases included, and beat the comb by two powers",
          "[function_of_mean][law]") {
  const auto bent = [](double x) { return std::exp(1.5 * x); };
  CHECK(sequence_laws(function_of_jittered_integral(bent, functions::ExpMinus{}, {.to = 0.7}),
                      {.last = 7, .samples = 8192}) == Failures{});
  CHECK(sequence_laws(function_of_jittered_integral(bent, functions::Davis{0.8}, {.from = -1}),
                      {.last = 9, .rates_from = 4}) == Failures{});
  const auto step = [](double x) { return x < 1.0 / 3 ? 4.0 : 0.5; };
  CHECK(sequence_laws(function_of_jittered_integral(step, functions::ExpMinus{}, {.rates = {4, 1}}),
                      {.last = 7, .samples = 8192, .variance_tolerance = 0.4}) == Failures{});

  // Power check: the halves of plain jittered points, even and odd parts, are not jittered points of the
  // level below.
  struct PlainJitter {
    Draw<double> operator()(std::int64_t level, Stream& rng) const {
      double even = 0;
      double odd = 0;
      const std::int64_t count = doubled_draws(level);
      for (std::int64_t i = 0; i < count; ++i) {
        ((i & 1) == 0 ? even : odd) += 3 * (static_cast<double>(i) + rng.uniform()) / static_cast<double>(count);
      }
      const double n = static_cast<double>(count);
      const double fine = std::exp(-(even + odd) / n);
      if (level == 0) return base(fine, n);
      return coupled(fine, 0.5 * (std::exp(-2 * even / n) + std::exp(-2 * odd / n)), n);
    }
  };
  CHECK(sequence_laws(PlainJitter{}) != Failures{});
}

TEST_CASE("each group of jittered points has one point in each part of its own level", "[function_of_mean][exact]") {
  for (std::uint64_t i = 0; i < 20; ++i) {
    for (const std::int64_t group_level : {0, 1, 3}) {
      Stream rng(90, i);
      const std::int64_t level = 5;
      detail::JitteredPositions positions(level, group_level, rng);
      std::vector<int> seen(32, 0);
      std::vector<int> even(16, 0);
      for (std::int64_t group = 0; group < (1 << (level - group_level)); ++group) {
        std::vector<int> in_group(std::size_t{1} << group_level, 0);
        auto at = positions.next_group();
        for (std::int64_t k = 0; k < (1 << group_level); ++k) {
          const double x = at() / 32;
          ++seen[static_cast<std::size_t>(x * 32)];
          if (group % 2 == 0) ++even[static_cast<std::size_t>(x * 16)];
          ++in_group[static_cast<std::size_t>(x * static_cast<double>(in_group.size()))];
        }
        CHECK(std::count(in_group.begin(), in_group.end(), 1) == 1 << group_level);
      }
      CHECK(std::count(seen.begin(), seen.end(), 1) == 32);
      CHECK(std::count(even.begin(), even.end(), 1) == 16);
    }
  }
}

namespace {

/// exp(u), one draw at a time or in batches of Eigen arrays.
struct BatchedExp {
  double operator()(Stream& rng) const { return std::exp(rng.uniform()); }
  void draws(Stream& rng, std::span<double> out) const {
    rng.fill(out);
    Eigen::Map<Eigen::ArrayXd> x(out.data(), static_cast<Eigen::Index>(out.size()));
    x = x.exp();
  }
};
struct BatchedIntegral {
  double operator()(double x) const { return std::exp(-x); }
  void operator()(std::span<const double> at, std::span<double> out) const {
    const Eigen::Map<const Eigen::ArrayXd> x(at.data(), static_cast<Eigen::Index>(at.size()));
    Eigen::Map<Eigen::ArrayXd>(out.data(), static_cast<Eigen::Index>(out.size())) = (-x).exp();
  }
};
static_assert(BatchedVariable<BatchedExp> && BatchedIntegrand<BatchedIntegral>);

template <class Batched, class Scalar>
void check_batches(const Batched& batched, const Scalar& scalar) {
  for (const std::int64_t level : {0, 1, 2, 5, 8, 9, 11}) {
    Stream one(91, static_cast<std::uint64_t>(level));
    Stream two(one);
    const auto a = batched(level, one);
    const auto b = scalar(level, two);
    CHECK(a.value == Approx(b.value).epsilon(1e-14));
    CHECK(a.difference == Approx(b.difference).epsilon(1e-6).margin(1e-15));
    CHECK(a.work == b.work);
    CHECK(one.bits() == two.bits());  // the very same random numbers, and no more
    if (level < 2) continue;
    const auto c = batched.shared(level, 1, one);
    const auto d = scalar.shared(level, 1, two);
    CHECK(c.base == Approx(d.base).epsilon(1e-14));
    CHECK(one.bits() == two.bits());
  }
}

}  // namespace

TEST_CASE("a batch hook uses the same random numbers bit for bit and gives values equal to rounding",
          "[function_of_mean][exact]") {
  const BatchedExp x;
  const BatchedIntegral f;
  const auto plain_x = [x](Stream& rng) { return x(rng); };
  const auto plain_f = [f](double at) { return f(at); };
  check_batches(function_of_mean(x, functions::Log{}), function_of_mean(plain_x, functions::Log{}));
  check_batches(function_of_integral(f, functions::Log{}), function_of_integral(plain_f, functions::Log{}));
  check_batches(function_of_jittered_integral(f, functions::Log{}),
                function_of_jittered_integral(plain_f, functions::Log{}));
  CHECK(sequence_laws(function_of_mean(x, functions::Log{})) == Failures{});
}

TEST_CASE("a comb is a random variable whose draws are those of a level", "[function_of_mean][exact]") {
  const auto level_three = function_of_integral(twice, [](double m) { return m; }, {.to = 3});
  const auto eight = comb_mean(twice, 8, 0, 3);
  CHECK(eight.work == 8);
  for (std::uint64_t i = 0; i < 10; ++i) {
    Stream one(92, i);
    Stream two(one);
    CHECK(eight(one) == Approx(level_three.value_at(3, two).value).epsilon(1e-14));
    CHECK(one.bits() == two.bits());
  }
  CHECK_THROWS_AS(comb_mean(twice, 0), std::invalid_argument);
  CHECK_THROWS_AS(comb_mean(twice, 4, 0, std::nan("")), std::invalid_argument);
}

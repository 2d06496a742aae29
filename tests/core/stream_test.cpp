// Known answers, the frozen layout, and the independence of neighbouring streams.
//
// The golden numbers come from a separate implementation of the layout in integer arithmetic.

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

#include <Random123/philox.h>
#include <boost/math/special_functions/erf.hpp>

#include "catch_shim.hpp"

#include <debias/core/estimate.hpp>
#include <debias/core/stream.hpp>

using namespace debias;

namespace {

constexpr std::uint64_t ones = ~std::uint64_t{0};

std::array<std::uint64_t, 2> philox(std::uint64_t c0, std::uint64_t c1, std::uint64_t key) {
  const auto block = r123::Philox2x64()({{c0, c1}}, {{key}});
  return {block[0], block[1]};
}

std::vector<double> uniforms(Stream rng, std::size_t n) {
  std::vector<double> u(n);
  rng.fill(u);
  return u;
}

/// The largest |got / exact - 1| that two correct computations of a quantile may show.
constexpr double quantile_rounding = 2e-15;

double exact_quantile(long double u) {  // u <= 1/2
  return static_cast<double>(-std::sqrt(2.0L) * boost::math::erfc_inv(2 * u));
}

}  // namespace

TEST_CASE("philox2x64-10 gives the published known answers", "[core][stream][exact]") {
  CHECK(philox(0, 0, 0) == std::array<std::uint64_t, 2>{0xca00a0459843d731, 0x66c24222c9a845b5});
  CHECK(philox(ones, ones, ones) == std::array<std::uint64_t, 2>{0x65b021d60cd8310f, 0x4d02f3222f86df20});
  CHECK(philox(0x243f6a8885a308d3, 0x13198a2e03707344, 0xa4093822299f31d0) ==
        std::array<std::uint64_t, 2>{0x0a5e742c2997341c, 0xb0f883d38000de5d});
}

TEST_CASE("a stream is philox with the counter (position / 2, index) and the seed as key", "[core][stream][exact]") {
  Stream zero(0, 0);
  CHECK(zero.bits() == 0xca00a0459843d731);
  CHECK(zero.bits() == 0x66c24222c9a845b5);
  for (const std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{0xa4093822299f31d0}, ones}) {
    for (const std::uint64_t index : {std::uint64_t{0}, std::uint64_t{7}, std::uint64_t{1} << 40, ones}) {
      Stream rng(seed, index);
      CHECK(rng.index() == index);
      for (std::uint64_t block = 0; block < 3; ++block) {
        const auto expected = philox(block, index, seed);
        CHECK(rng.bits() == expected[0]);
        CHECK(rng.bits() == expected[1]);
      }
    }
  }
}

TEST_CASE("layout version 1: seed 1, index 0 gives these numbers for ever", "[core][stream][exact]") {
  STATIC_REQUIRE(Stream::layout_version == 1);
  constexpr std::array<double, 16> expected_uniforms = {
      0x1.d7a4a4f00a661p-1, 0x1.e251065d078a8p-4, 0x1.b32854b84bb9dp-1, 0x1.44b0540b6eb3ep-2,
      0x1.7f6aac159e6eep-2, 0x1.90b2f4acd48dbp-1, 0x1.1c984b16f6ff3p-1, 0x1.055eb09908b25p-1,
      0x1.cf7768dab6ac7p-1, 0x1.84f8f42dbb503p-1, 0x1.c37b7e0d62066p-2, 0x1.b395a8416430dp-1,
      0x1.9706f06c79c06p-2, 0x1.c8e258107a098p-4, 0x1.9c108fc0baf7dp-1, 0x1.47969b2f6dc8bp-1};
  constexpr std::array<double, 16> expected_normals = {
      1.4130399514231802,  -1.1862942789990594, 1.0360777987994876,   -0.47588293809164306,
      -0.320141959095647,  0.7810563523207961,  0.14045413474038904,  0.026292674519494748,
      1.311810135430539,   0.7053760151578822,  -0.14868582466085234, 1.039660492576299,
      -0.2598560465818374, -1.2183579771215491, 0.8589424077546441,   0.3579801321429231};
  constexpr std::array<double, 16> expected_exponentials = {
      0.08210198102478877, 2.139165622216732,   0.1626164923378318,  1.148604674609122,
      0.9823494488086757,  0.24511398836850118, 0.5872578742670364,  0.6723880478997769,
      0.09959064028030727, 0.2748160400417393,  0.8189354320519228,  0.16163559129953942,
      0.9225920226815852,  2.1933362953643534,  0.21714426497200442, 0.44656697138005397};
  Stream uniform(1, 0);
  Stream normal(1, 0);
  Stream exponential(1, 0);
  for (std::size_t i = 0; i < 16; ++i) {
    CHECK(uniform.uniform() == expected_uniforms[i]);
    CHECK(std::abs(normal.normal() / expected_normals[i] - 1) < quantile_rounding);
    CHECK(std::abs(exponential.exponential() / expected_exponentials[i] - 1) < 1e-15);
  }
  const auto check_bits = [](Stream rng, const std::array<std::uint64_t, 4>& expected) {
    for (const std::uint64_t bits : expected) CHECK(rng.bits() == bits);
  };
  const Stream root(1, 0);
  check_bits(root.split(7), {0x4c43d1729ea621bc, 0x34e35f3d8a5674a0, 0xfb96b15844c5a0ba, 0xdf98c6599ec51beb});
  check_bits(split_level(root, 7), {0x4c43d1729ea621bc, 0x34e35f3d8a5674a0, 0xfb96b15844c5a0ba, 0xdf98c6599ec51beb});
  check_bits(split(root, Branch::pmf),
             {0x658474cc1ebb1bef, 0xf49b9f1d9bfea250, 0xdfc2e19092fcc406, 0xf9001175bf41b4cd});
  check_bits(split(Stream(1, 5).split(7), Branch::pmf),
             {0xb326e0d6d15524db, 0x2f3e7c6fc01e1049, 0x56c88b380cb201be, 0x5264e795cd6b6e84});
}

// A copy is made where it is written, and nowhere else.
static_assert(std::is_constructible_v<Stream, const Stream&> && !std::is_convertible_v<const Stream&, Stream>);
static_assert(!std::is_copy_assignable_v<Stream> && std::is_move_assignable_v<Stream>);
static_assert(!std::invocable<double (*)(Stream), Stream&> && std::invocable<double (*)(Stream), Stream>);

TEST_CASE("a Stream feeds the distributions of the standard library", "[core][stream][exact]") {
  static_assert(std::uniform_random_bit_generator<Stream> && std::same_as<Stream::result_type, std::uint64_t>);
  CHECK(Stream::min() == 0);
  CHECK(Stream::max() == std::numeric_limits<std::uint64_t>::max());
  Stream one(3, 9);
  Stream two(one);
  for (int i = 0; i < 5; ++i) CHECK(one() == two.bits());

  // Gamma with shape 3 and scale 0.5: mean 1.5, variance 0.75, and a permutation of what was there.
  constexpr std::int64_t n = 20'000;
  const auto gamma = [](Stream& rng) { return std::gamma_distribution<>(3, 0.5)(rng); };
  const auto result = estimate(gamma, {.samples = n, .seed = 12});
  CHECK(std::abs(result.mean - 1.5) < 4.5 * std::sqrt(0.75 / n));
  CHECK(std::abs(result.mean - 1.55) > 4.5 * std::sqrt(0.75 / n));  // a bias of 3 % would be seen
  std::vector<int> shuffled = {1, 2, 3, 4, 5, 6};
  std::shuffle(shuffled.begin(), shuffled.end(), one);
  std::sort(shuffled.begin(), shuffled.end());
  CHECK(shuffled == std::vector<int>{1, 2, 3, 4, 5, 6});
}

TEST_CASE("fill gives the numbers of as many calls, from odd and even positions", "[core][stream][exact]") {
  for (std::size_t start = 0; start < 4; ++start) {
    for (const std::size_t length : std::initializer_list<std::size_t>{0, 1, 2, 3, 9, 63, 64, 65, 127, 128, 129, 300}) {
      Stream one(3, 9);
      for (std::size_t i = 0; i < start; ++i) one.bits();
      Stream two(one);
      std::vector<double> filled(length, -1.0);
      one.fill(filled);
      for (const double u : filled) CHECK(u == two.uniform());
      CHECK(one.bits() == two.bits());
      CHECK(one.bits() == two.bits());
    }
  }
}

TEST_CASE("a copy draws the same numbers, and a split does not depend on the position", "[core][stream][exact]") {
  Stream rng(5, 2);
  Stream child = rng.split(4);
  const std::vector<double> of_child = uniforms(Stream(child), 5);
  for (int used = 0; used < 5; ++used) {
    CHECK(uniforms(rng.split(4), 5) == of_child);
    Stream copy(rng);
    CHECK(copy.bits() == rng.bits());
  }
  CHECK(rng.split(4).index() == 2);
  CHECK(uniforms(rng.split(5), 5) != of_child);
  CHECK(uniforms(child.split(4), 5) != of_child);
}

TEST_CASE("no branch gives the numbers of its parent or of another branch, seed 0 included", "[core][stream][exact]") {
  constexpr std::array<std::uint64_t, 8> branches = {0, 1, 2, 63, std::uint64_t{1} << 62, ones - 2, ones - 1, ones};
  std::vector<std::uint64_t> first;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    Stream root(seed, 0);
    first.push_back(root.bits());
    for (const std::uint64_t branch : branches) {
      Stream child = root.split(branch);
      Stream grandchild = child.split(branch);
      first.push_back(child.bits());
      first.push_back(grandchild.bits());
    }
  }
  std::sort(first.begin(), first.end());
  CHECK(std::adjacent_find(first.begin(), first.end()) == first.end());
}

TEST_CASE("a uniform is an odd multiple of 2^-53 inside (0, 1), whatever the bits", "[core][stream][exact]") {
  // The formula of the header at its extremes: all bits zero, all bits one.
  constexpr auto formula = [](std::uint64_t bits) { return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52; };
  STATIC_REQUIRE(formula(0) == 0x1p-53);
  STATIC_REQUIRE(formula(ones) == 1 - 0x1p-53);
  Stream rng(11, 0);
  for (int i = 0; i < 10000; ++i) {
    Stream copy(rng);
    const double u = rng.uniform();
    REQUIRE(u == formula(copy.bits()));
    REQUIRE(std::fmod(u * 0x1p53, 2.0) == 1.0);
    REQUIRE(std::fmod((1 - u) * 0x1p53, 2.0) == 1.0);
  }
  CHECK(std::isfinite(normal_quantile(0x1p-53)));
  CHECK(std::isfinite(normal_quantile(1 - 0x1p-53)));
}

TEST_CASE("the normal quantile is right to rounding from 2^-53 to 1 - 2^-53, odd, and monotone",
          "[core][stream][exact]") {
  CHECK(normal_quantile(0.5) == 0);
  double worst = 0;
  const auto compare = [&worst](double u) {  // u <= 1/2, on the lattice of uniforms
    const double q = normal_quantile(u);
    worst = std::max(worst, std::abs(q / exact_quantile(u) - 1));
    REQUIRE(normal_quantile(1 - u) == -q);
  };
  const auto on_lattice = [](double u) { return (2 * std::floor(u * 0x1p52) + 1) * 0x1p-53; };
  for (int e = 2; e <= 53; ++e) compare(on_lattice(std::ldexp(1.0, -e)));
  for (int i = 1; i < 4000; ++i) compare(on_lattice(i / 8000.0));                // the centre
  for (int i = 0; i < 4000; ++i) compare(on_lattice(std::exp2(-1 - i / 77.0)));  // the tail
  for (const double border : {0.075, std::exp(-25.0)}) {                         // where the formula changes
    for (int i = -20; i <= 20; ++i) compare(on_lattice(border * (1 + 1e-3 * i)));
  }
  CAPTURE(worst);
  CHECK(worst < quantile_rounding);

  double last = -std::numeric_limits<double>::infinity();
  for (int i = -53 * 64; i <= -64; ++i) {
    const double q = normal_quantile(std::exp2(i / 64.0));
    REQUIRE(q > last);
    last = q;
  }
}

// ---- independence; each claim once on the stream, once on a wrong variant that it must reject

namespace {

/// Kolmogorov-Smirnov: sqrt(n) sup |F_n - F| is above 2.7 with probability 1e-6.
double kolmogorov(std::vector<double> u) {
  std::sort(u.begin(), u.end());
  const auto n = static_cast<double>(u.size());
  double d = 0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    d = std::max({d, static_cast<double>(i + 1) / n - u[i], u[i] - static_cast<double>(i) / n});
  }
  return d * std::sqrt(n);
}

/// Chi-square over `bins` equal bins, as a number of standard deviations from its mean.
double chi_square(const std::vector<double>& u, std::size_t bins) {
  std::vector<double> count(bins);
  for (const double x : u) ++count[static_cast<std::size_t>(x * static_cast<double>(bins))];
  const double expected = static_cast<double>(u.size()) / static_cast<double>(bins);
  double sum = 0;
  for (const double c : count) sum += (c - expected) * (c - expected) / expected;
  const auto freedom = static_cast<double>(bins - 1);
  return (sum - freedom) / std::sqrt(2 * freedom);
}

/// The correlation of two sets of uniforms, in standard errors.
double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - 0.5) * (b[i] - 0.5);
  return 12 * sum / std::sqrt(static_cast<double>(a.size()));
}

constexpr std::uint64_t family = 256;
constexpr std::size_t length = 4096;
constexpr double z_of_family = 5.9;  // a false alarm of 1e-6 over 256 pairs

/// The largest correlation between neighbours of a family of streams, at lag 0 and 1.
template <class MakeStream>
double neighbour_correlation(const MakeStream& make) {
  double worst = 0;
  std::vector<double> last = uniforms(make(0), length);
  for (std::uint64_t i = 1; i <= family; ++i) {
    std::vector<double> next = uniforms(make(i), length);
    worst = std::max(worst, std::abs(correlation(last, next)));
    std::vector<double> shifted(last.begin() + 1, last.end());
    shifted.push_back(last.front());
    worst = std::max(worst, std::abs(correlation(shifted, next)));
    last = std::move(next);
  }
  return worst;
}

}  // namespace

TEST_CASE("uniforms are uniform: Kolmogorov-Smirnov and chi-square over a million", "[core][stream][statistical]") {
  constexpr std::size_t n = 1'000'000;
  const std::vector<double> along = uniforms(Stream(2, 0), n);
  std::vector<double> across;  // the first number of each sample
  for (std::uint64_t i = 0; i < n; ++i) across.push_back(Stream(2, i).uniform());
  std::vector<double> wrong = along;
  for (double& u : wrong) u = std::pow(u, 1.03);
  CHECK(kolmogorov(along) < 2.7);
  CHECK(kolmogorov(across) < 2.7);
  CHECK_FALSE(kolmogorov(wrong) < 2.7);
  CHECK(std::abs(chi_square(along, 1024)) < 4.5);
  CHECK(std::abs(chi_square(across, 1024)) < 4.5);
  CHECK_FALSE(std::abs(chi_square(wrong, 1024)) < 4.5);
}

TEST_CASE("256 neighbouring samples, seeds and branches are uncorrelated", "[core][stream][statistical]") {
  CHECK(neighbour_correlation([](std::uint64_t i) { return Stream(1, i); }) < z_of_family);
  CHECK(neighbour_correlation([](std::uint64_t i) { return Stream(i, 0); }) < z_of_family);
  CHECK(neighbour_correlation([](std::uint64_t i) { return Stream(1, 0).split(i); }) < z_of_family);
  CHECK(neighbour_correlation([](std::uint64_t i) { return split(Stream(i, 0), Branch::pmf); }) < z_of_family);
  // Power: one pair of equal neighbours in 256, and a family one step along one stream.
  CHECK_FALSE(neighbour_correlation([](std::uint64_t i) { return Stream(1, i == 100 ? 99 : i); }) < z_of_family);
  CHECK_FALSE(neighbour_correlation([](std::uint64_t i) {
                Stream rng(1, 0);
                for (std::uint64_t k = 0; k < i; ++k) rng.bits();
                return rng;
              }) < z_of_family);
}

#include <algorithm>
#include <bit>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "catch_shim.hpp"

#include <debias/core/accumulator.hpp>
#include <debias/core/stream.hpp>

using namespace debias;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

struct Exact {
  long double mean = 0, m2 = 0, m3 = 0, m4 = 0;
};

Exact exact_moments(std::span<const double> x) {
  Exact e;
  for (const double v : x) e.mean += v;
  e.mean /= static_cast<long double>(x.size());
  for (const double v : x) {
    const long double d = v - e.mean;
    e.m2 += d * d;
    e.m3 += d * d * d;
    e.m4 += d * d * d * d;
  }
  return e;
}

/// Mean to `rounding` of the largest value; central sums to it relative to what is being summed.
bool agrees(const Moments& m, std::span<const double> x, double rounding = 1e-13) {
  const Exact e = exact_moments(x);
  double largest = 0;
  for (const double v : x) largest = std::max(largest, std::abs(v));
  const auto near = [rounding](double got, long double exact, long double scale) {
    return std::abs(static_cast<long double>(got) - exact) <= rounding * scale;
  };
  const auto n = static_cast<long double>(x.size());
  return m.count == static_cast<std::int64_t>(x.size()) && near(m.mean, e.mean, largest) && near(m.m2, e.m2, e.m2) &&
         near(m.m3, e.m3, n * std::pow(e.m2 / n, 1.5L) + std::abs(e.m3)) && near(m.m4, e.m4, e.m4);
}

/// As a run does it: blocks of 256, merged from left to right.
Moments in_blocks(std::span<const double> x, std::size_t block = 256) {
  Moments m;
  for (std::size_t i = 0; i < x.size(); i += block) m.merge(Moments::of(x.subspan(i, std::min(block, x.size() - i))));
  return m;
}

template <class Draw>
std::vector<double> data(std::size_t n, const Draw& draw) {
  Stream rng(21, n);
  std::vector<double> x(n);
  for (double& v : x) v = draw(rng);
  return x;
}

double uniform(Stream& rng) { return rng.uniform(); }
double offset(Stream& rng) { return 1e9 + rng.uniform(); }
double skewed(Stream& rng) { return rng.exponential() - 1; }
double huge(Stream& rng) { return 1e70 * rng.normal(); }
double tiny(Stream& rng) { return 1e-60 * (rng.uniform() - 0.3); }
double heavy(Stream& rng) { return std::pow(rng.uniform(), -0.4); }

}  // namespace

TEST_CASE("moments agree with two passes in long double, cancellation and scale notwithstanding",
          "[core][accumulator][exact]") {
  for (const auto draw : {uniform, skewed, huge, tiny, heavy}) {
    for (const std::size_t n : {2U, 3U, 7U, 8U, 9U, 255U, 256U, 257U, 10'000U}) {
      const std::vector<double> x = data(n, draw);
      CHECK(agrees(Moments::of(x), x));
      CHECK(agrees(in_blocks(x), x));
    }
  }
  // The mean of a block of numbers near 1e9 is a double that is off by up to 6e-8, and so is its distance
  // from the mean of the next block: some 1e-9 of the sum of squares is lost in the merge.
  for (const std::size_t n : {2U, 9U, 256U, 10'000U}) {
    const std::vector<double> x = data(n, offset);
    CHECK(agrees(Moments::of(x), x, 1e-6));
    CHECK(agrees(in_blocks(x), x, 1e-6));
    CHECK(std::abs(in_blocks(x).m2 / static_cast<double>(exact_moments(x).m2) - 1) < 1e-8);
  }
}

TEST_CASE("the comparison above rejects one-pass sums and a value left out", "[core][accumulator][exact]") {
  const std::vector<double> x = data(1000, offset);
  Moments naive = Moments::of(x);
  double squares = 0;
  for (const double v : x) squares += v * v;
  naive.m2 = squares - 1000 * naive.mean * naive.mean;
  CHECK_FALSE(agrees(naive, x, 1e-6));
  const std::vector<double> y = data(1000, uniform);
  CHECK_FALSE(agrees(Moments::of(std::span(y).first(999)), y));
}

TEST_CASE("equal values have their own value as mean and a variance of exactly 0", "[core][accumulator][exact]") {
  for (const double x : {0.1, -1.0 / 3, 1e9 + 0.1, 1e300, 1e-300, 0x1p-1074, 0.0}) {
    for (const std::size_t n : {1U, 2U, 5U, 13U, 256U, 1000U, 5001U}) {
      const Moments m = in_blocks(std::vector<double>(n, x));
      REQUIRE(m.mean == x);
      REQUIRE(m.m2 == 0);
      REQUIRE(m.m3 == 0);
      REQUIRE(m.m4 == 0);
      REQUIRE(m.kurtosis() == 0);
      REQUIRE(m.skewness() == 0);
    }
  }
}

TEST_CASE("the shape of tiny and of huge values is that of the same ones near 1", "[core][accumulator][exact]") {
  const std::vector<double> near = data(3000, uniform);
  const Moments expected = in_blocks(near);
  for (const double unit : {0x1p-500, 0x1p-300, 0x1p-199, 0x1p-100, 0x1p199, 0x1p300, 0x1p500}) {
    std::vector<double> x = near;
    for (double& v : x) v *= unit;
    CAPTURE(unit);
    const Moments m = in_blocks(x);
    CHECK(m.kurtosis() == Approx(expected.kurtosis()).epsilon(1e-12));
    CHECK(m.skewness() == Approx(expected.skewness()).epsilon(1e-12).margin(1e-14));
    // With some that are near 1: these have all the weight, or none.
    Moments mixed = m;
    mixed.merge(Moments::of(near));
    Moments other = Moments::of(near);
    other.merge(m);
    CHECK(mixed.kurtosis() == Approx(other.kurtosis()).epsilon(1e-9));
    CHECK(mixed.kurtosis() > 1);
    CHECK(std::isfinite(mixed.kurtosis()));
  }
}

TEST_CASE("a variance beyond the range of a double is infinite, never zero", "[core][accumulator][exact]") {
  const std::vector<double> x = {1e300, -1e300, 3e300, 2e300, 0, 1e300};
  const Moments m = Moments::of(x);
  CHECK(std::abs(m.mean / 1e300 - 1) < 1e-15);
  CHECK(m.variance() == infinite);
  CHECK(m.standard_error() == infinite);
}

TEST_CASE("one value that is not finite spoils mean and variance, in one block or in many",
          "[core][accumulator][exact]") {
  for (const double bad : {not_a_number, infinite, -infinite}) {
    for (const std::size_t n : {2U, 100U, 1000U}) {
      std::vector<double> x(n, 0.5);
      x[n / 2] = bad;
      const Moments m = in_blocks(x);
      CHECK_FALSE(std::isfinite(m.mean));
      CHECK(std::isnan(m.variance()));
    }
  }
}

TEST_CASE("merging gives the moments of the concatenation, wherever it is cut", "[core][accumulator][exact]") {
  const std::vector<double> x = data(5000, heavy);
  for (const std::size_t cut : {0U, 1U, 2U, 100U, 2500U, 4999U, 5000U}) {
    Moments left = Moments::of(std::span(x).first(cut));
    left.merge(Moments::of(std::span(x).subspan(cut)));
    CHECK(agrees(left, x));
  }
  CHECK(agrees(in_blocks(x, 1), x));
}

TEST_CASE("variance, standard error, skewness and kurtosis are those of the textbook", "[core][accumulator][exact]") {
  const Moments m = Moments::of(std::vector<double>{1, 2, 3, 4, 10});
  CHECK(m.mean == 4);
  CHECK(m.variance() == 12.5);  // 9 + 4 + 1 + 0 + 36 over 4
  CHECK(m.standard_error() == Approx(std::sqrt(2.5)));
  CHECK(m.skewness() == Approx(36 / std::pow(10.0, 1.5)));  // -27 - 8 - 1 + 0 + 216 over 5
  CHECK(m.kurtosis() == Approx(278.8 / 100));               // 81 + 16 + 1 + 0 + 1296 over 5
  CHECK(std::isnan(Moments::of(std::vector<double>{3}).variance()));
  CHECK(std::isnan(Moments{}.variance()));
}

// ---- components

TEST_CASE("component moments are those of each column, added singly or merged", "[core][accumulator][exact]") {
  const std::vector<double> re = data(1000, offset);
  const std::vector<double> im = data(1000, skewed);
  ComponentMoments whole;
  ComponentMoments parts[3];
  for (std::size_t i = 0; i < 1000; ++i) {
    whole.add(std::complex<double>(re[i], im[i]));
    parts[i < 1 ? 0 : i < 400 ? 1 : 2].add(std::complex<double>(re[i], im[i]));
  }
  ComponentMoments merged;
  for (const ComponentMoments& part : parts) merged.merge(part);
  merged.merge(ComponentMoments{});
  for (const ComponentMoments* m : {&whole, &merged}) {  // a running mean rounds once a sample: 6e-8 near 1e9
    REQUIRE(m->entries().size() == 2);
    CHECK(std::abs(m->entries()[0].mean - static_cast<double>(exact_moments(re).mean)) < 1e-5);
    CHECK(std::abs(m->entries()[0].m2 / static_cast<double>(exact_moments(re).m2) - 1) < 1e-6);
    CHECK(std::abs(m->entries()[1].mean - static_cast<double>(exact_moments(im).mean)) < 1e-14);
    CHECK(std::abs(m->entries()[1].m2 / static_cast<double>(exact_moments(im).m2) - 1) < 1e-13);
  }
}

// ---- the level table

TEST_CASE("levels have a row each up to 63 and one an octave beyond, to 2^63 - 1", "[core][accumulator][exact]") {
  constexpr std::int64_t top = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t octave = std::int64_t{1} << 62;
  const std::vector<std::pair<std::int64_t, std::size_t>> rows = {
      {0, 0},    {1, 1},    {63, 63},          {64, 64},      {127, 64}, {128, 65},
      {255, 65}, {256, 66}, {octave - 1, 119}, {octave, 120}, {top, 120}};
  for (const auto& [level, row] : rows) {
    LevelTable table;
    table.add(level, 2, 3);
    REQUIRE(table.rows().size() == row + 1);
    CHECK(table.rows()[row].count == 1);
    CHECK(table.rows()[row].difference == 2);
    CHECK(table.rows()[row].square == 4);
    CHECK(table.rows()[row].fourth == 16);
    CHECK(table.rows()[row].work == 3);
    CHECK(LevelTable::levels_of_row(row).first <= level);
    CHECK(level <= LevelTable::levels_of_row(row).second);
  }
  CHECK(LevelTable::levels_of_row(120) == std::pair(octave, top));
  for (std::size_t row = 0; row < 120; ++row) {  // no gap, no overlap
    REQUIRE(LevelTable::levels_of_row(row).second + 1 == LevelTable::levels_of_row(row + 1).first);
  }
}

TEST_CASE("level tables merge row by row, the base with them", "[core][accumulator][exact]") {
  LevelTable a;
  LevelTable b;
  a.add(3, 1, 1);
  a.add(70, 2, 5);
  b.add(3, 3, 2);
  b.add_base(2, 10, 4);
  a.merge(b);
  CHECK(a.base_level() == 2);
  CHECK(a.base().count == 1);
  CHECK(a.base().difference == 10);
  CHECK(a.rows()[3].count == 2);
  CHECK(a.rows()[3].difference == 4);
  CHECK(a.rows()[3].square == 10);
  CHECK(a.rows()[3].work == 3);
  CHECK(a.rows()[64].count == 1);
  CHECK(a.rows().size() == 65);
}

// ---- extremes

namespace {

/// Data full of ties, with zeros of both signs, in a fixed order.
std::vector<double> ties(std::size_t n) {
  return data(n, [](Stream& rng) {
    const double x = std::floor(rng.normal() * 20) / 10;
    return x == 0 && rng.uniform() < 0.5 ? -0.0 : x;
  });
}

std::vector<std::int64_t> levels_for(std::size_t n) {
  std::vector<std::int64_t> levels(n);
  for (std::size_t i = 0; i < n; ++i) levels[i] = static_cast<std::int64_t>(i % 11);
  return levels;
}

bool equal_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) {
           return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
         });
}

bool same(const Extremes& a, const Extremes& b) {
  return equal_bits(a.upper_tail(), b.upper_tail()) && equal_bits(a.lower_tail(), b.lower_tail()) &&
         a.largest() == b.largest() && a.nonfinite() == b.nonfinite() && a.first_nonfinite() == b.first_nonfinite();
}

}  // namespace

TEST_CASE("the kept extremes are those of a full sort, ties by index and zeros without sign",
          "[core][accumulator][exact]") {
  for (const std::size_t n : {1U, 31U, 33U, 4096U, 8192U, 30'000U}) {
    const std::vector<double> x = ties(n);
    const std::vector<std::int64_t> levels = levels_for(n);
    constexpr std::int64_t first = 1'000'000;
    Extremes e;
    e.add(x, levels, first);

    std::vector<double> sorted = x;
    for (double& v : sorted) v += 0.0;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t kept = std::min(n, Extremes::tail_capacity);
    const auto count = static_cast<std::ptrdiff_t>(kept);
    CHECK(equal_bits(e.lower_tail(), std::vector<double>(sorted.begin(), sorted.begin() + count)));
    CHECK(equal_bits(e.upper_tail(), std::vector<double>(sorted.rbegin(), sorted.rbegin() + count)));

    std::vector<LargeSample> by_magnitude;
    for (std::size_t i = 0; i < n; ++i) {
      by_magnitude.push_back({first + static_cast<std::int64_t>(i), levels[i], x[i] + 0.0});
    }
    std::stable_sort(by_magnitude.begin(), by_magnitude.end(),
                     [](const LargeSample& a, const LargeSample& b) { return std::abs(a.value) > std::abs(b.value); });
    by_magnitude.resize(std::min(n, Extremes::largest_capacity));
    CHECK(e.largest() == by_magnitude);
  }
}

TEST_CASE("extremes do not depend on how samples were spread over parts, nor on the order of merging",
          "[core][accumulator][exact]") {
  constexpr std::size_t n = 30'000;
  std::vector<double> x = ties(n);
  x[777] = not_a_number;
  x[20'000] = infinite;
  const std::vector<std::int64_t> levels = levels_for(n);
  Extremes whole;
  whole.add(x, levels, 0);
  CHECK(whole.nonfinite() == 2);
  CHECK(whole.first_nonfinite() == 777);
  for (std::uint64_t spread = 0; spread < 6; ++spread) {
    Stream rng(33, spread);
    std::vector<Extremes> parts(5);
    for (std::size_t i = 0; i < n;) {  // pieces of random length to random parts
      const auto length = std::min(n - i, 1 + static_cast<std::size_t>(rng.uniform() * 3000));
      const auto part = static_cast<std::size_t>(rng.uniform() * 5);
      parts[part].add(std::span(x).subspan(i, length), std::span(levels).subspan(i, length),
                      static_cast<std::int64_t>(i));
      i += length;
    }
    Extremes forward;
    for (const Extremes& part : parts) forward.merge(part);
    Extremes backward;
    for (std::size_t p = parts.size(); p-- > 0;) backward.merge(parts[p]);
    CHECK(same(forward, whole));
    CHECK(same(backward, whole));
  }
  Extremes other;
  x[5] += 10;
  other.add(x, levels, 0);
  CHECK_FALSE(same(other, whole));
}

// ---- the recorder

TEST_CASE("a recorder counts samples, work and levels, and starts afresh with each chunk",
          "[core][accumulator][exact]") {
  const auto recorder = std::make_unique<Recorder>();
  for (int chunk = 0; chunk < 2; ++chunk) {
    recorder->begin_chunk(1000 * chunk);
    for (int i = 0; i < 300; ++i) {
      CHECK(recorder->next_index() == 1000 * chunk + i);
      recorder->base(0, 1, 0.5);
      recorder->difference(2, 3, 1.5);
      recorder->add(Sample<double>{static_cast<double>(i), 2, 2});
    }
    const Accumulator& sums = recorder->end_chunk();
    CHECK(sums.moments.count == 300);
    CHECK(sums.moments.mean == 149.5);
    CHECK(sums.work == 600);
    CHECK(sums.levels.base().count == 300);
    CHECK(sums.levels.base().work == 150);
    CHECK(sums.levels.rows()[2].count == 300);
    CHECK(sums.components.entries().empty());
  }
  CHECK(recorder->extremes().upper_tail().size() == 600);
  CHECK(recorder->extremes().largest().front() == LargeSample{299, 2, 299});
}

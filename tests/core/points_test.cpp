// Scrambled nets: known answers, elementary intervals, and variances against scrambling drawn digit by digit.
//
// The golden bits and the hash of the direction numbers come from a separate implementation in integer arithmetic over
// SciPy's table of Joe and Kuo.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <map>
#include <span>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"
#include "core/sobol.hpp"

#include <debias/core/points.hpp>
#include <debias/core/stream.hpp>
#include <debias/core/stream_batch.hpp>

using namespace debias;

namespace {

constexpr std::uint64_t ones = ~std::uint64_t{0};

std::uint32_t reversed(std::uint32_t x) {
  std::uint32_t r = 0;
  for (int i = 0; i < 32; ++i, x >>= 1) r = (r << 1) | (x & 1);
  return r;
}

/// Coordinate t of point r of Sobol's sequence, unscrambled, in units of 2^-32.
std::uint32_t sobol(std::uint32_t r, std::size_t t) {
  std::uint32_t x = 0;
  for (std::uint32_t b = 0; b < 32; ++b) x ^= (r >> b & 1) * reversed(detail::sobol_table().of_bit[b][t]);
  return x;
}

double to_uniform(std::uint64_t bits) { return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52; }

/// A key as random as those of streams.
std::uint64_t key_of(std::uint64_t i) { return Stream(90, i).bits(); }

using Coordinates = std::function<std::uint64_t(std::uint64_t key, std::uint64_t point, std::uint64_t dimension)>;

/// How many points each of the 2^(a + b) boxes of sides 2^-a (dimension s) and 2^-b (dimension t) holds, sorted.
std::vector<int> counts(const Coordinates& bits, std::uint64_t key, std::uint64_t first, std::uint64_t size,
                        std::uint64_t s, std::uint64_t t, int a, int b) {
  std::vector<int> boxes(std::size_t{1} << (a + b));
  for (std::uint64_t r = first; r < first + size; ++r) {
    const std::uint64_t i = a == 0 ? 0 : bits(key, r, s) >> (64 - a);
    const std::uint64_t j = b == 0 ? 0 : bits(key, r, t) >> (64 - b);
    ++boxes[i << b | j];
  }
  std::sort(boxes.begin(), boxes.end());
  return boxes;
}

/// Owen's scrambling itself: every node of every tree has a random bit of its own.
std::uint64_t exact_bits(std::uint64_t key, std::uint64_t r, std::uint64_t t) {
  constexpr int digits = 40;
  const std::uint64_t x = std::uint64_t{sobol(static_cast<std::uint32_t>(r), t)} << 32;
  std::uint64_t result = Stream(key, t).split(r).bits() >> digits;  // what comes after is independent
  for (int d = 0; d < digits; ++d) {
    const std::uint64_t node = (std::uint64_t{1} << d) | (d == 0 ? 0 : x >> (64 - d));
    result ^= ((Stream(key, t).split(node + ones / 2).bits() ^ (x >> (63 - d))) & 1) << (63 - d);
  }
  return result;
}

/// Sobol's points under a digital shift alone, and as they are.
std::uint64_t shifted_bits(std::uint64_t key, std::uint64_t r, std::uint64_t t) {
  return (std::uint64_t{sobol(static_cast<std::uint32_t>(r), t)} << 32) ^ Stream(key, t).bits();
}
std::uint64_t raw_bits(std::uint64_t /*key*/, std::uint64_t r, std::uint64_t t) {
  return std::uint64_t{sobol(static_cast<std::uint32_t>(r), t)} << 32;
}

struct Spread {
  double variance;
  double error;  ///< its relative standard error
};

/// The variance of means of f over the first `size` points, of many nets.
template <class F>
Spread spread_of_means(const Coordinates& bits, const F& f, std::uint64_t size, std::uint64_t nets,
                       std::uint64_t first_net) {
  std::vector<double> means;
  double mean = 0;
  for (std::uint64_t i = 0; i < nets; ++i) {
    double sum = 0;
    for (std::uint64_t r = 0; r < size; ++r) {
      sum += f([&](std::uint64_t t) { return to_uniform(bits(key_of(first_net + i), r, t)); });
    }
    means.push_back(sum / static_cast<double>(size));
    mean += means.back() / static_cast<double>(nets);
  }
  double square = 0;
  double fourth = 0;
  for (const double m : means) square += std::pow(m - mean, 2), fourth += std::pow(m - mean, 4);
  const auto n = static_cast<double>(nets);
  return {square / n, std::sqrt(std::max(0.0, fourth / n / std::pow(square / n, 2) - 1) / n)};
}

/// The logarithm of the ratio of two variances, in standard errors, beyond a tenth.
double beyond_a_tenth(const Spread& a, const Spread& b) {
  return std::max(0.0, std::abs(std::log(a.variance / b.variance)) - 0.1) / std::hypot(a.error, b.error);
}

}  // namespace

TEST_CASE("the direction numbers are those of Joe and Kuo, as SciPy and the authors' page have them",
          "[core][points][exact]") {
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a over 256 dimensions of 32 numbers
  for (std::size_t t = 0; t < net_dimensions; ++t) {
    for (std::uint32_t b = 0; b < 32; ++b) hash = (hash ^ sobol(std::uint32_t{1} << b, t)) * 0x100000001b3u;
  }
  CHECK(hash == 0xda1259261349bc4bu);
  // The authors' page, three dimensions; it counts in Gray code.
  constexpr double published[10][3] = {{0, 0, 0},
                                       {0.5, 0.5, 0.5},
                                       {0.75, 0.25, 0.25},
                                       {0.25, 0.75, 0.75},
                                       {0.375, 0.375, 0.625},
                                       {0.875, 0.875, 0.125},
                                       {0.625, 0.125, 0.875},
                                       {0.125, 0.625, 0.375},
                                       {0.1875, 0.3125, 0.9375},
                                       {0.6875, 0.8125, 0.4375}};
  for (std::uint32_t n = 0; n < 10; ++n) {
    for (std::size_t t = 0; t < 3; ++t) CHECK(sobol(n ^ (n >> 1), t) * 0x1p-32 == published[n][t]);
  }
}

TEST_CASE("coordinates of points are these bits for ever", "[core][points][exact]") {
  struct Golden {
    std::uint64_t key, point, dimension, bits;
  };
  constexpr Golden golden[] = {
      {0x0, 0, 0, 0x3564b439cd1e1f16},           {0x1, 1, 0, 0x41851927e76ef524},
      {0x1, 2, 1, 0x7de05bc55dc97ac0},           {0xa4093822299f31d0, 5, 2, 0x809db513774140a8},
      {ones, 12345, 7, 0x09d85ec76c030041},      {0x7, 134217727, 255, 0xc4b8b3983d589a4c},
      {0x2a, 67108864, 128, 0x38a9ca7c7e848e77}, {0x3, 99999, 254, 0xa142d022c81916bf}};
  for (const Golden& g : golden) CHECK(net_bits(g.key, g.point, g.dimension) == g.bits);
  // Beyond the table: Philox, with a key of the point.
  const auto block = r123::Philox2x64()({{128, 0}}, {{point_key(7, 5)}});
  CHECK(net_bits(7, 5, 256) == block[0]);
  CHECK(net_bits(7, 5, 257) == block[1]);
  STATIC_REQUIRE(point_key(point_key(7, 5), 5) == 7);
}

TEST_CASE("rows of many points are their coordinates one by one, wherever the first one lies",
          "[core][points][exact]") {
  std::size_t wrong = 0;
  for (const std::size_t size : std::initializer_list<std::size_t>{1, 2, 3, 4, 7, 8, 9, 16, 31, 32, 33, 63, 64}) {
    for (const std::uint64_t first :
         std::initializer_list<std::uint64_t>{0, 1, 7, 8, 32, 63, 64, 100, 120, 1 << 20, (1 << 26) - 5}) {
      for (const std::uint64_t dimension : std::initializer_list<std::uint64_t>{0, 1, 97, 250}) {
        std::vector<double> u(6 * size, -1);
        net_uniforms(5, first, size, dimension, u);
        for (std::size_t q = 0; q < 6; ++q) {
          for (std::size_t b = 0; b < size; ++b) {
            wrong += u[q * size + b] != to_uniform(net_bits(5, first + b, dimension + q));
          }
        }
      }
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("2^m points fill each elementary interval as often as Sobol's do", "[core][points][exact]") {
  const auto differs = [](const Coordinates& bits, std::uint64_t key, std::uint64_t first, int m, std::uint64_t s,
                          std::uint64_t t) {
    std::size_t wrong = 0;
    for (int a = 0; a <= m; ++a) {
      for (int b = 0; a + b <= m; ++b) {
        const std::uint64_t size = std::uint64_t{1} << m;
        wrong += counts(bits, key, first, size, s, t, a, b) != counts(raw_bits, key, first, size, s, t, a, b);
      }
    }
    return wrong;
  };
  std::size_t wrong = 0;
  for (std::uint64_t i = 0; i < 20; ++i) {
    wrong += differs(net_bits, key_of(i), 0, 7, 0, 1);
    wrong += differs(net_bits, key_of(i), 3 << 5, 5, 0, 1);
    wrong += differs(net_bits, key_of(i), 64, 6, 2 + 11 * i, 5 + 12 * i);
  }
  CHECK(wrong == 0);
  // The first two dimensions are a perfect net, and each one alone has a point in each interval.
  for (std::uint64_t t = 0; t < net_dimensions; ++t) {
    wrong += counts(net_bits, key_of(t), 512, 256, t, 0, 8, 0) != std::vector<int>(256, 1);
  }
  for (int a = 0; a <= 8; ++a) wrong += counts(net_bits, 9, 0, 256, 0, 1, a, 8 - a) != std::vector<int>(256, 1);
  CHECK(wrong == 0);
  // Power: one point twice, the key of another net in one dimension, plain numbers.
  const Coordinates twice = [](std::uint64_t key, std::uint64_t r, std::uint64_t t) {
    return net_bits(key, r == 7 ? 6 : r, t);
  };
  const Coordinates plain = [](std::uint64_t key, std::uint64_t r, std::uint64_t t) {
    return Stream(key, r).split(t).bits();
  };
  CHECK(differs(twice, key_of(0), 0, 7, 0, 1) > 0);
  CHECK(differs(plain, key_of(0), 0, 7, 0, 1) > 0);
}

TEST_CASE("each point alone is uniform over the nets, in all its digits", "[core][points][statistical]") {
  // Chi-square over 256 bins of eight digits, at four places among the 64.
  const auto worst = [](const Coordinates& bits, std::uint64_t r, std::uint64_t t) {
    double deviation = 0;
    for (const int place : {56, 44, 20, 0}) {
      std::vector<double> count(256);
      constexpr std::uint64_t nets = 1 << 14;
      for (std::uint64_t i = 0; i < nets; ++i) ++count[bits(key_of(i), r, t) >> place & 255];
      double sum = 0;
      for (const double c : count) sum += (c - nets / 256.0) * (c - nets / 256.0) / (nets / 256.0);
      deviation = std::max(deviation, std::abs(sum - 255) / std::sqrt(2 * 255.0));
    }
    return deviation;
  };
  for (const std::uint64_t r : std::initializer_list<std::uint64_t>{0, 1, 6, 1000}) {
    for (const std::uint64_t t : std::initializer_list<std::uint64_t>{0, 1, 3, 255, 256}) {
      CAPTURE(r, t);
      CHECK(worst(net_bits, r, t) < 5.5);
    }
  }
  CHECK_FALSE(worst(raw_bits, 6, 1) < 5.5);
}

TEST_CASE("the variance of a mean is that of exact Owen scrambling within a tenth", "[core][points][statistical]") {
  using Number = std::function<double(std::uint64_t)>;
  const auto exponential = [](const Number& u) { return std::exp(u(0) + u(1)); };
  const auto product = [](const Number& u) { return (u(0) - 0.5) * (u(2) - 0.5) * (u(5) - 0.5) * 8; };
  const auto kink = [](const Number& u) { return std::max(u(0) + u(3) + u(7) - 1.5, 0.0); };
  const auto check = [](const auto& f, std::uint64_t size, std::uint64_t nets) {
    const Spread exact = spread_of_means(exact_bits, f, size, nets, 0);
    const Spread hash = spread_of_means(net_bits, f, size, nets, nets);
    CAPTURE(size, exact.variance, hash.variance, exact.error, hash.error);
    CHECK(beyond_a_tenth(hash, exact) < 4.5);
    return exact;
  };
  check(product, 16, 1500);
  check(kink, 32, 1000);
  const Spread exact = check(exponential, 64, 600);
  // A shift alone is ten times worse here, and an exact formula in one dimension: 1 / (12 N^3) for f = u.
  CHECK_FALSE(beyond_a_tenth(spread_of_means(shifted_bits, exponential, 64, 600, 0), exact) < 4.5);
  const Spread line = spread_of_means(
      net_bits, [](const Number& u) { return u(0); }, 32, 2000, 0);
  CHECK(std::abs(line.variance * 12 * 32 * 32 * 32 - 1) < 4.5 * line.error);
}

// ---- streams and batches

TEST_CASE("a point's stream hands out its coordinates in order, then plain numbers", "[core][points][stream][exact]") {
  const Stream level = Stream(3, 9).split(4);
  Stream used(level);
  for (int i = 0; i < 5; ++i) used.bits();
  std::size_t wrong = 0;
  for (const std::uint64_t r : std::initializer_list<std::uint64_t>{0, 1, 2, 77, (1 << 27) - 1}) {
    Stream point = level.point(r);
    Stream again = used.point(r);
    CHECK(point.is_point());
    CHECK(point.index() == 9);
    std::vector<double> filled(300);
    again.fill(filled);
    std::vector<double> drawn;
    for (int t = 0; t < 300; ++t) drawn.push_back(point.uniform());
    wrong += drawn != filled;
    // A copy goes on where the first one stands.
    Stream copy(point);
    wrong += copy.bits() != point.bits();
  }
  CHECK(wrong == 0);
  CHECK_FALSE(level.is_point());
  CHECK_THROWS_AS(level.point(net_points), std::length_error);
  // The whole net fills each interval of each dimension once, and nets of other samples or levels are others.
  for (const std::size_t t : std::initializer_list<std::size_t>{0, 1, 100, 255}) {
    std::vector<int> seen(64);
    for (std::uint64_t r = 0; r < 64; ++r) {
      std::vector<double> u(t + 1);
      level.point(r).fill(u);
      ++seen[static_cast<std::size_t>(u[t] * 64)];
    }
    CHECK(seen == std::vector<int>(64, 1));
  }
  CHECK(level.point(1).uniform() != Stream(3, 10).split(4).point(1).uniform());
  CHECK(level.point(1).uniform() != Stream(3, 9).split(5).point(1).uniform());
}

TEST_CASE("splits of a point are plain, depend on the point and not on what was drawn",
          "[core][points][stream][exact]") {
  const Stream level = Stream(3, 9).split(4);
  Stream point = level.point(5);
  Stream child = point.split(2);
  CHECK_FALSE(child.is_point());
  CHECK(child.index() == 9);
  const std::uint64_t first = child.bits();
  for (int i = 0; i < 300; ++i) point.bits();
  CHECK(point.split(2).bits() == first);
  CHECK(level.point(6).split(2).bits() != first);
  CHECK(level.split(2).bits() != first);
  CHECK(point.split(3).bits() != first);
  CHECK(point.point(1).bits() != level.point(1).bits());
  CHECK(point.point(1).is_point());
}

TEST_CASE("a split of a point may have one coordinate as its first number, a split of a plain stream has its own",
          "[core][points][stream][exact]") {
  const Stream plain = Stream(3, 9).split(4);
  Stream point = plain.point(5);
  for (int i = 0; i < 3; ++i) point.bits();
  std::vector<double> coordinates(300);
  plain.point(5).fill(coordinates);
  for (const std::uint64_t t : std::initializer_list<std::uint64_t>{0, 7, 255, 256}) {
    Stream child = point.split(2, t);
    Stream same = point.split(2);
    CHECK_FALSE(child.is_point());
    std::vector<double> u(5);
    std::vector<double> of_same(6);
    child.fill(u);
    same.fill(of_same);
    CHECK((u[0] == coordinates[t]) == (t < 256));
    for (std::size_t i = 1; i < 5; ++i) CHECK(u[i] == of_same[t < 256 ? i + 1 : i]);
    CHECK(point.split(2, t).split(1).bits() == point.split(2).split(1).bits());
    CHECK(plain.split(2, t).bits() == plain.split(2).bits());
  }
}

TEST_CASE("splits of the points of a net are independent: no sum of theirs falls faster than that of plain numbers",
          "[core][points][stream][statistical]") {
  // With the same dimensions under another key the mean of (u - 1/2)(v - 1/2) would not fall at all.
  constexpr std::uint64_t size = 256;
  constexpr std::uint64_t nets = 1000;
  double square = 0;
  for (std::uint64_t i = 0; i < nets; ++i) {
    double sum = 0;
    for (std::uint64_t r = 0; r < size; ++r) {
      Stream point = Stream(8, i).point(r);
      const double u = point.uniform();
      sum += 12 * (u - 0.5) * (point.split(0).uniform() - 0.5);
    }
    square += sum * sum / size / nets;
  }
  CHECK(std::abs(square - 1) < 4.5 * std::sqrt(2.0 / nets));
}

TEST_CASE("a batch of points draws the numbers of each point alone, whatever its size and position",
          "[core][points][stream][exact]") {
  const Stream level = Stream(5, 77).split(3);
  std::size_t wrong = 0;
  for (const std::size_t size : std::initializer_list<std::size_t>{1, 2, 3, 4, 7, 8, 31, 64}) {
    for (const std::uint64_t start : std::initializer_list<std::uint64_t>{0, 5, 60, 192}) {
      for (const std::size_t rows : std::initializer_list<std::size_t>{1, 2, 3, 255, 256, 257}) {
        StreamBatch batch = StreamBatch::points(level, start, size);
        CHECK(batch.is_net());
        std::vector<double> u(rows * size);
        std::vector<double> z(4 * size);
        batch.uniforms(u);
        batch.normals(z);
        for (std::size_t b = 0; b < size; ++b) {
          Stream alone = level.point(start + b);
          for (std::size_t t = 0; t < rows; ++t) wrong += u[t * size + b] != alone.uniform();
          for (std::size_t t = 0; t < 4; ++t) wrong += z[t * size + b] != alone.normal();
          Stream rest = batch.stream(b);
          wrong += rest.split(1).bits() != alone.split(1).bits();
          wrong += rest.index() != 77;
          for (int t = 0; t < 3; ++t) wrong += rest.uniform() != alone.uniform();
        }
      }
    }
  }
  CHECK(wrong == 0);
  CHECK_THROWS_AS(StreamBatch::points(level, net_points - 3, 4), std::length_error);
}

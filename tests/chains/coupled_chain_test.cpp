#include <debias/chains/coupled_chain.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"

#include "core/run_state_bytes.hpp"

#include <debias/chains/metropolis.hpp>
#include <debias/core/estimate.hpp>

using namespace debias;
using laws::estimator_laws;
using laws::Failures;

namespace {

double square(double x) { return x * x; }

// A walk on 0 ... 4 with a law that is far from where it starts: up with .6, down with .3, one uniform for both chains.
struct Ladder {
  static int next(int x, double u) { return u < 0.6 ? std::min(4, x + 1) : u < 0.9 ? std::max(0, x - 1) : x; }
  void step(int& x, Stream& rng) const { x = next(x, rng.uniform()); }
  void coupled_step(int& x, int& y, Stream& rng) const {
    const double u = rng.uniform();
    x = next(x, u);
    y = next(y, u);
  }
};
double cube(int x) { return static_cast<double>(x * x * x); }
// Invariant: proportional to 2^x. E x^3.
constexpr double mean_cube = (2 * 1 + 4 * 8 + 8 * 27 + 16 * 64) / 31.0;

// One sample by its definition, with what may be wrong in it: the paths are kept, and H_(k:m) is the mean of all H_k'.
struct Slips {
  std::int64_t weight = 0;   // added to each weight
  bool floors = false;       // floor for ceil
  std::int64_t burn_in = 0;  // of the correction alone
};
double by_definition(const ChainOptions& o, Stream& rng, const Slips& slips = {}) {
  const Ladder kernel;
  std::vector<int> x{0};
  std::vector<int> y;
  for (std::int64_t t = 0; t < o.lag; ++t) {
    x.push_back(x.back());
    kernel.step(x.back(), rng);
  }
  y.push_back(0);
  while (x.back() != y.back()) {
    x.push_back(x.back());
    y.push_back(y.back());
    kernel.coupled_step(x.back(), y.back(), rng);
  }
  const auto meeting = static_cast<std::int64_t>(x.size()) - 1;
  while (static_cast<std::int64_t>(x.size()) <= o.length) {
    x.push_back(x.back());
    kernel.step(x.back(), rng);
  }
  const auto at = [](const std::vector<int>& path, std::int64_t t) { return cube(path[static_cast<std::size_t>(t)]); };
  const std::int64_t n = o.length - o.burn_in + 1;
  double sum = 0;
  for (std::int64_t t = o.burn_in; t <= o.length; ++t) sum += at(x, t);
  const std::int64_t k = o.burn_in + slips.burn_in;
  for (std::int64_t t = k + o.lag; t < meeting; ++t) {
    const std::int64_t late = std::max(o.lag, t - o.length);
    const std::int64_t ceiling = slips.floors ? late / o.lag : (late + o.lag - 1) / o.lag;
    sum += static_cast<double>((t - k) / o.lag - ceiling + 1 + slips.weight) * (at(x, t) - at(y, t - o.lag));
  }
  return sum / static_cast<double>(n);
}

// The mean of H_k' for k' = k ... m, each by the telescoping sum itself.
double by_telescoping(const ChainOptions& o, Stream& rng) {
  double sum = 0;
  for (std::int64_t k = o.burn_in; k <= o.length; ++k) {
    const Ladder kernel;
    Stream again(rng);
    std::vector<int> xs{0};
    std::vector<int> ys{0};
    for (std::int64_t t = 0; t < o.lag; ++t) {
      xs.push_back(xs.back());
      kernel.step(xs.back(), again);
    }
    while (xs.back() != ys.back()) {
      xs.push_back(xs.back());
      ys.push_back(ys.back());
      kernel.coupled_step(xs.back(), ys.back(), again);
    }
    const auto meeting = static_cast<std::int64_t>(xs.size()) - 1;
    while (static_cast<std::int64_t>(xs.size()) <= o.length) {
      xs.push_back(xs.back());
      kernel.step(xs.back(), again);
    }
    sum += cube(xs[static_cast<std::size_t>(k)]);
    for (std::int64_t t = k + o.lag; t < meeting; t += o.lag) {
      sum += cube(xs[static_cast<std::size_t>(t)]) - cube(ys[static_cast<std::size_t>(t - o.lag)]);
    }
  }
  return sum / static_cast<double>(o.length - o.burn_in + 1);
}

const std::vector<ChainOptions> all_options = {
    {},
    {.burn_in = 1, .length = 1},
    {.burn_in = 0, .length = 5},
    {.burn_in = 3, .length = 4, .lag = 3},
    {.burn_in = 2, .length = 9, .lag = 2},
    {.burn_in = 0, .length = 0, .lag = 4},
    {.burn_in = 0, .length = 1, .lag = 5},
    {.burn_in = 1, .length = 40, .lag = 3},
};

double z_of(const Moments& m, double truth) { return (m.mean - truth) / m.standard_error(); }

template <class Draw>
Moments moments_of(std::int64_t n, const Draw& draw) {
  std::vector<double> values;
  for (std::int64_t i = 0; i < n; ++i) {
    Stream rng(77, static_cast<std::uint64_t>(i));
    values.push_back(draw(rng));
  }
  return Moments::of(values);
}

double density(double x) { return -0.5 * x * x; }
double start(Stream& rng) { return 3 * rng.normal(); }

}  // namespace

TEST_CASE("a sample of coupled_chain is the mean of the telescoping sums from burn_in to length", "[chains][exact]") {
  for (const ChainOptions& o : all_options) {
    const auto chain = coupled_chain(Ladder{}, 0, cube, o);
    double largest_gap = 0;
    double gap_of_weights = 0;
    for (std::uint64_t i = 0; i < 500; ++i) {
      Stream a(5, i);
      Stream b(5, i);
      Stream c(5, i);
      Stream d(5, i);
      NullRecord none;
      const double value = chain(a, none).value;
      largest_gap = std::max(largest_gap, std::abs(value - by_telescoping(o, c)));
      largest_gap = std::max(largest_gap, std::abs(value - by_definition(o, b)));
      gap_of_weights = std::max(gap_of_weights, std::abs(value - by_definition(o, d, {.weight = 1})));
    }
    INFO("burn_in " << o.burn_in << ", length " << o.length << ", lag " << o.lag);
    CHECK(largest_gap < 1e-12 * 64);
    if (o.length < 20) CHECK(gap_of_weights > 0.1);
  }
}

TEST_CASE("coupled_chain is unbiased for any burn-in, length and lag, and its weights off by one are not",
          "[chains][statistical]") {
  constexpr std::int64_t n = 40000;
  constexpr double family = 5.6;
  for (const ChainOptions& o : all_options) {
    INFO("burn_in " << o.burn_in << ", length " << o.length << ", lag " << o.lag);
    const auto r = estimate(coupled_chain(Ladder{}, 0, cube, o), {.samples = n, .seed = 3});
    CHECK(std::abs(r.mean - mean_cube) < family * r.standard_error);
  }
  const ChainOptions o{.burn_in = 1, .length = 4, .lag = 2};
  const auto z = [&](const Slips& slips) {
    return std::abs(z_of(moments_of(n, [&](Stream& rng) { return by_definition(o, rng, slips); }), mean_cube));
  };
  CHECK(z({}) < family);
  CHECK(z({.weight = 1}) > family);
  CHECK(z({.weight = -1}) > family);
  CHECK(z({.floors = true}) > family);
  CHECK(z({.burn_in = 1}) > family);
  CHECK(z({.burn_in = -1}) > family);
}

TEST_CASE("coupled_chain keeps the laws of an estimator", "[chains][law][stat]") {
  const auto walk = random_walk(density, 2.4);
  CHECK(estimator_laws(coupled_chain(walk, start, square, {.burn_in = 5, .length = 20, .lag = 4}), 1.0) == Failures{});
  CHECK(estimator_laws(coupled_chain(walk, start, square, {.burn_in = 5, .length = 20, .lag = 4}), 1.1) != Failures{});
}

TEST_CASE("work counts the steps of both chains, and the meeting time is the level", "[chains][exact]") {
  const auto chain = coupled_chain(Ladder{}, 0, cube, {.burn_in = 2, .length = 12, .lag = 3});
  for (std::int64_t i = 0; i < 200; ++i) {
    const auto t = trace(chain, 9, i);
    const auto level = static_cast<double>(t.sample.level);
    CHECK(t.sample.level >= 3);
    CHECK(t.sample.work == std::max(12.0, level) + level - 3);
    REQUIRE(t.levels.size() == 2);
    CHECK(t.levels[0].is_base);
    CHECK(t.levels[1].level == t.sample.level);
    CHECK(t.levels[0].difference + t.levels[1].difference == Approx(t.sample.value).epsilon(1e-13));
  }
}

TEST_CASE("coupled chains have the same bits over threads, shards and extensions", "[chains][exact]") {
  const auto chain = coupled_chain(random_walk(density, 2.4), start, square, {.burn_in = 5, .length = 20, .lag = 4});
  const auto whole = estimate(chain, {.samples = 4096, .seed = 3, .threads = 1});
  for (const int threads : {2, 3, 64}) {
    const auto r = estimate(chain, {.samples = 4096, .seed = 3, .threads = threads});
    CHECK(r.mean == whole.mean);
    CHECK(r.standard_error == whole.standard_error);
  }
  const auto a = estimate(chain, {.samples = 1024, .seed = 3, .whole = 4096});
  const auto b = estimate(chain, {.samples = 3072, .seed = 3, .first = 1024, .whole = 4096});
  CHECK(merge(b, a).mean == whole.mean);
  CHECK(merge(b, a).verdict().sentence() == whole.verdict().sentence());
  CHECK(extend(chain, a, {.samples = 4096}).mean == whole.mean);
  CHECK(trace(chain, 3, whole.largest.front().index).sample.value == whole.largest.front().value);
  CHECK_THROWS_AS(merge(a, estimate(chain.with({.burn_in = 6, .length = 20, .lag = 4}),
                                    {.samples = 3072, .seed = 3, .first = 1024})),
                  std::invalid_argument);
}

TEST_CASE("a run of coupled chains that was kept as bytes is one of coupled chains still", "[chains][exact]") {
  const auto chain = coupled_chain(Ladder{}, 0, cube, {.burn_in = 2, .length = 12, .lag = 3, .limit = 50});
  const auto whole = estimate(chain, {.samples = 2048, .seed = 3});
  const auto part = estimate(chain, {.samples = 1024, .seed = 3, .whole = 2048});
  const RunState kept = decode(encode(part.state));
  CHECK(kept.pilot.sequence.meeting_times);
  CHECK(kept.pilot.sequence.exact_from == 50);
  const auto resumed = extend(chain, kept, {.samples = 2048});
  CHECK(resumed.mean == whole.mean);
  CHECK(resumed.verdict().sentence() == whole.verdict().sentence());
  const auto plain = estimate([](Stream& rng) { return rng.uniform(); }, {.samples = 1024, .seed = 3});
  CHECK_FALSE(decode(encode(plain.state)).pilot.sequence.meeting_times);
}

TEST_CASE("the verdict on coupled chains is likely at best, and names the meeting times",
          "[chains][verdict][statistical]") {
  const auto chain = coupled_chain(random_walk(density, 2.4), start, square, {.burn_in = 20, .length = 400, .lag = 20});
  const auto r = estimate(chain, {.samples = 20000, .seed = 3});
  const RunVerdict v = r.verdict();
  CHECK(v.variance == Finiteness::finite);
  CHECK(v.grade == Grade::likely);
  CHECK(v.meeting.kind == MeetingKind::light);
  CHECK(v.meeting.chains == 20000);
  CHECK_THAT(v.sentence(), Catch::Contains("meeting times have a light tail: half of 20000 chains met by"));
}

TEST_CASE("a heavy tail of the meeting times is called, where values alone look harmless",
          "[chains][verdict][statistical]") {
  // Two modes 8 apart and steps of .5: a chain that starts in the other mode takes 10^4 steps and more.
  const auto two = [](double x) { return -0.5 * (std::abs(x) - 3.3) * (std::abs(x) - 3.3); };
  const auto near = [](Stream& rng) { return rng.uniform() < 0.005 ? 3.3 : -3.3; };
  const ChainOptions o{.burn_in = 100, .length = 1000, .lag = 50};
  const auto bounded = [](double x) { return x > 0 ? 1.0 : 0.0; };
  const auto r = estimate(coupled_chain(random_walk(two, 1.0), near, bounded, o), {.samples = 1000, .seed = 3});
  INFO(r);
  CHECK(r.verdict().variance != Finiteness::finite);
  CHECK(r.verdict().meeting.kind != MeetingKind::light);
  // A meeting time with the tail t^-1.2.
  struct Wait {
    double left;
    bool operator==(const Wait& o2) const { return left == o2.left; }
  };
  const auto wait = kernel_of([](Wait& x, Stream&) { x.left = std::max(0.0, x.left - 1); },
                              [](Wait& x, Wait& y, Stream&) {
                                x.left = std::max(0.0, x.left - 1);
                                y.left = std::max(0.0, y.left - 1);
                              });
  const auto pareto = [](Stream& rng) { return Wait{std::floor(4 * std::pow(rng.uniform(), -1 / 1.2))}; };
  const auto h = estimate(
      coupled_chain(wait, pareto, [](const Wait& x) { return x.left > 0 ? 1.0 : 0.0; }, {.burn_in = 3, .length = 10}),
      {.samples = 20000, .seed = 3});
  INFO(h);
  CHECK(h.verdict().variance == Finiteness::infinite);
  CHECK(h.verdict().meeting.exponent == Approx(1.2).margin(0.2));
  CHECK_THAT(h.verdict().sentence(), Catch::Contains("HEAVY"));
}

TEST_CASE("where more than an eighth of the chains are cut the bias is not bounded", "[chains][statistical]") {
  const auto cut = coupled_chain(Ladder{}, 0, cube, {.burn_in = 0, .length = 4, .lag = 1, .limit = 6});
  const auto r = estimate(cut, {.samples = 20000, .seed = 3});
  CHECK(r.bias_bound.size > std::abs(r.mean - mean_cube));
  CHECK_THAT(r.bias_bound.sentence, Catch::Contains("more than an eighth"));
}

TEST_CASE("chains that are cut are truncated, and the result says so", "[chains][statistical]") {
  const ChainOptions o{.burn_in = 0, .length = 4, .lag = 1, .limit = 12};
  const auto cut = coupled_chain(Ladder{}, 0, cube, o);
  const auto r = estimate(cut, {.samples = 20000, .seed = 3});
  CHECK_THAT(r.estimator, Catch::Contains("truncated"));
  CHECK(std::abs(r.mean - mean_cube) > 4.5 * r.standard_error);
  CHECK(r.bias_bound.size > std::abs(r.mean - mean_cube));
  CHECK_THAT(r.bias_bound.sentence, Catch::Contains("had not met at the limit of 12 steps and were cut"));
  CHECK(r.verdict().meeting.cut > 0);
  // A limit that no chain reaches changes no bit.
  ChainOptions far = o;
  far.limit = 100000;
  const auto all = estimate(coupled_chain(Ladder{}, 0, cube, far), {.samples = 2000, .seed = 3});
  far.limit = 0;
  CHECK(all.mean == estimate(coupled_chain(Ladder{}, 0, cube, far), {.samples = 2000, .seed = 3}).mean);
  CHECK(all.bias_bound.size == 0);
  CHECK_THAT(all.estimator, Catch::Contains("truncated"));
  // As many as did not meet by the limit, for limits in single rows and in octaves of the level table.
  for (const std::int64_t limit : {6, 62, 63, 64, 100, 128}) {
    const auto slow =
        coupled_chain(random_walk(density, 0.1), start, square, {.burn_in = 0, .length = 4, .limit = limit});
    const auto waited = coupled_chain(random_walk(density, 0.1), start, square, {.burn_in = 0, .length = 4});
    std::int64_t late = 0;
    for (std::int64_t i = 0; i < 512; ++i) late += trace(waited, 3, i).sample.level > limit;
    INFO("limit " << limit);
    CHECK(estimate(slow, {.samples = 512, .seed = 3}).verdict().meeting.cut == late);
  }
}

TEST_CASE("a chain that has not met goes on, and is reported", "[chains][exact]") {
  std::vector<std::pair<std::uint64_t, std::int64_t>> told;
  ChainOptions o;
  o.progress = [&told](std::uint64_t index, std::int64_t steps) {
    told.emplace_back(index, steps);
    if (steps >= 1 << 19) throw std::runtime_error("enough");
  };
  const auto never = kernel_of([](double&, Stream&) {}, [](double&, double&, Stream&) {});
  const auto chain = coupled_chain(
      never, [](Stream& rng) { return rng.normal(); }, square, o);
  CHECK_THROWS_WITH(estimate(chain, {.samples = 1, .seed = 4, .first = 7}), Catch::Contains("sample 7 of seed 4"));
  const std::vector<std::pair<std::uint64_t, std::int64_t>> expected{
      {7, 1 << 16}, {7, 1 << 17}, {7, 1 << 18}, {7, 1 << 19}};
  CHECK(told == expected);
}

TEST_CASE("options that no chain has are refused, with the reason", "[chains][exact]") {
  const auto make = [](const ChainOptions& o) { return coupled_chain(Ladder{}, 0, cube, o); };
  CHECK_THROWS_WITH(make({.burn_in = -1}), Catch::Contains("burn_in = -1"));
  CHECK_THROWS_WITH(make({.burn_in = 10, .length = 9}), Catch::Contains("length = 9 (must be at least burn_in = 10"));
  CHECK_THROWS_WITH(make({.lag = 0}), Catch::Contains("lag = 0 (must be at least 1)"));
  CHECK_THROWS_WITH(make({.length = 20, .limit = 19}), Catch::Contains("limit = 19 (must be at least length = 20"));
  CHECK_THROWS_WITH(make({.lag = 20, .limit = 20}), Catch::Contains("above lag = 20"));
  CHECK_THROWS_WITH(make({.limit = -1}), Catch::Contains("limit = -1"));
  CHECK_NOTHROW(make({.length = 20, .lag = 3, .limit = 20}));
}

TEST_CASE("vectors, floats and arrays of states go through coupled_chain", "[chains][statistical]") {
  const auto density2 = [](const Eigen::Vector2d& x) { return -0.5 * x.squaredNorm(); };
  const auto start2 = [](Stream& rng) {
    const double a = rng.normal();
    const double b = 2 * rng.normal();
    return Eigen::Vector2d(a, b);
  };
  const auto squares = [](const Eigen::Vector2d& x) -> Eigen::ArrayXd { return x.array().square(); };
  const auto r = estimate(coupled_chain(random_walk(density2, 1.7), start2, squares, {.burn_in = 10, .length = 60}),
                          {.samples = 4000, .seed = 3});
  for (const ComponentEstimate& c : r.components) CHECK(std::abs(c.mean - 1) < 4.5 * c.standard_error);
  CHECK(r.components.size() == 2);
  const auto single =
      estimate(coupled_chain(random_walk(density, 2.4), 0, [](double x) { return static_cast<float>(x * x); },
                             {.burn_in = 10, .length = 60}),
               {.samples = 4000, .seed = 3});
  CHECK(std::abs(single.mean - 1) < 4.5 * single.standard_error);
  const auto density_v = [](const std::vector<double>& x) { return -0.5 * (x[0] * x[0] + x[1] * x[1]); };
  const auto v =
      estimate(coupled_chain(random_walk(density_v, 1.7), std::vector<double>{1, 2},
                             [](const std::vector<double>& x) { return x[0] * x[0]; }, {.burn_in = 10, .length = 60}),
               {.samples = 4000, .seed = 3});
  CHECK(std::abs(v.mean - 1) < 4.5 * v.standard_error);
}

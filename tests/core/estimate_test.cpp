// The runner: equal bits however a run is cut and spread, replay, and what happens when samples go wrong.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <cstdint>
#include <functional>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"
#include "python/collecting.hpp"
#include "validation/bits.hpp"

#include <debias/core/estimate.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>

using namespace debias;
using validation::bits_of;

namespace {

/// (E X)^2 = 1 with X exponential: the square of a mean of 2^k draws, against those of its halves.
Draw<double> squared_mean(std::int64_t level, Stream& rng) {
  const auto half_sum = [&rng](std::int64_t n) {
    double sum = 0;
    for (std::int64_t i = 0; i < n; ++i) sum += rng.exponential();
    return sum;
  };
  if (level == 0) {
    const double x = half_sum(1);
    return base(x * x);
  }
  const std::int64_t n = std::int64_t{1} << (level - 1);
  const auto size = static_cast<double>(n);
  const double a = half_sum(n) / size;
  const double b = half_sum(n) / size;
  const double mean = (a + b) / 2;
  return coupled(mean * mean, (a * a + b * b) / 2, 2 * size);
}

/// Terms 2^-k times uniforms of one path; the sum has mean 1.
struct NoisyHalves {
  auto operator()(Stream& rng) const {
    return [rng, k = 0]() mutable { return Term<double>{std::ldexp(rng.uniform(), -k++)}; };
  }
};

const auto debiased = single_term(squared_mean, Geometric(0.6));

struct Memory {
  std::vector<Sample<double>> samples;
  std::size_t next = 0;
  bool collecting = false;

  void collect_queries(const std::function<void()>& draws) {
    *this = {.samples = {}, .next = 0, .collecting = true};
    draws();
    collecting = false;
  }
};

/// The same, made in the first pass and only handed out in the run.
struct Collected {
  Memory* memory;

  Sample<double> operator()(Stream& rng) const {
    if (!memory->collecting) return memory->samples.at(memory->next++);
    NullRecord record;
    memory->samples.push_back(debiased(rng, record));
    return {};
  }
};

template <class E>
auto run(const E& estimator, std::int64_t first, std::int64_t samples, int threads = 2, std::uint64_t seed = 7) {
  return estimate(estimator, {.samples = samples, .seed = seed, .first = first, .threads = threads});
}

}  // namespace

// ---- equal bits

TEST_CASE("a run that collects its queries sees each draw before it counts, in order", "[core][estimate][exact]") {
  Memory memory;
  const auto silent = [](Stream& rng) {
    NullRecord record;
    return debiased(rng, record);
  };
  for (const Plan& plan : {Plan{.samples = 10, .seed = 7, .first = 5, .threads = 1},
                           Plan{.samples = 100'000, .seed = 7, .first = 4095, .threads = 1},
                           Plan{.seed = 7, .threads = 1, .goal = {.error = 0.02}}}) {
    CAPTURE(plan.samples);
    const auto expected = estimate(silent, plan);
    const auto collected = python::estimate_collected(memory, Collected{&memory}, plan);
    CHECK(bits_of(collected) == bits_of(expected));
    CHECK(memory.next == memory.samples.size());
  }
}

TEST_CASE("the whole state has the same bits on 1, 2, 3, 7 and 64 threads", "[core][estimate][exact]") {
  for (const std::int64_t n : {1000, 4096, 4097, 100'000}) {
    const auto reference = bits_of(run(debiased, 0, n, 1));
    for (const int threads : {2, 3, 7, 64, 0}) {
      CAPTURE(n, threads);
      CHECK(bits_of(run(debiased, 0, n, threads)) == reference);
    }
    CHECK(bits_of(run(debiased, 1, n, 1)) != reference);
    CHECK(bits_of(run(debiased, 0, n, 1, 8)) != reference);
  }
}

TEST_CASE("array-valued results have the same bits on any number of threads, and when merged",
          "[core][estimate][exact]") {
  const auto pair = [](Stream& rng) {
    Eigen::ArrayXd v(2);
    v[0] = rng.normal();
    v[1] = v[0] * rng.uniform();
    return v;
  };
  const auto whole = run(pair, 0, 20'000, 1);
  CHECK(bits_of(run(pair, 0, 20'000, 7)) == bits_of(whole));
  const auto merged = merge(run(pair, 8192, 11'808), run(pair, 0, 8192));
  CHECK(bits_of(merged) == bits_of(whole));
  CHECK((merged.mean == whole.mean).all());
  CHECK((merged.standard_error == whole.standard_error).all());
}

TEST_CASE("a run that starts inside a chunk has the same bits on any number of threads", "[core][estimate][exact]") {
  for (const std::int64_t first : {1, 4095, 4096, 1'000'003}) {
    const auto reference = bits_of(run(debiased, first, 20'000, 1));
    CHECK(bits_of(run(debiased, first, 20'000, 7)) == reference);
  }
}

TEST_CASE("a sample is the same number in whichever run it lies", "[core][estimate][exact]") {
  const auto alone = run(debiased, 123'456, 1);
  CHECK(alone.mean == trace(debiased, 7, 123'456).sample.value);
  CHECK(alone.largest.at(0).index == 123'456);
}

namespace {

/// All results of merging parts [begin, end) in every order that joins neighbours, either operand first.
std::vector<Result<double>> all_merges(const std::vector<Result<double>>& parts, std::size_t begin, std::size_t end) {
  if (end - begin == 1) return {parts[begin]};
  std::vector<Result<double>> results;
  for (std::size_t cut = begin + 1; cut < end; ++cut) {
    for (const auto& left : all_merges(parts, begin, cut)) {
      for (const auto& right : all_merges(parts, cut, end)) {
        results.push_back(merge(left, right));
        results.push_back(merge(right, left));
      }
    }
  }
  return results;
}

}  // namespace

TEST_CASE("halves and quarters merge in any order into the bits of the whole", "[core][estimate][exact]") {
  // Cuts at multiples of the chunk of 512; the first and the last chunk may be partial.
  const std::vector<std::vector<std::int64_t>> cuts = {{0, 8192, 16'384},
                                                       {0, 4096, 12'288, 16'384, 20'480},
                                                       {0, 12'288, 16'384, 24'576, 25'000},
                                                       {5000, 8192, 20'480, 28'672, 40'000},
                                                       {4096, 8192, 12'288}};
  for (const auto& cut : cuts) {
    std::vector<Result<double>> parts;
    for (std::size_t i = 0; i + 1 < cut.size(); ++i) parts.push_back(run(debiased, cut[i], cut[i + 1] - cut[i]));
    const auto whole = run(debiased, cut.front(), cut.back() - cut.front());
    const auto merges = all_merges(parts, 0, parts.size());
    CHECK(merges.size() == (parts.size() == 2 ? 2U : 40U));
    for (const auto& merged : merges) {
      REQUIRE(bits_of(merged) == bits_of(whole));
      REQUIRE(merged.mean == whole.mean);
      REQUIRE(merged.standard_error == whole.standard_error);
    }
  }
}

TEST_CASE("results that do not belong together refuse to merge, and say why", "[core][estimate][exact]") {
  using Catch::Contains;
  const auto a = run(debiased, 0, 8192);
  CHECK_THROWS_WITH(merge(a, a), Contains("both results hold sample 0"));
  CHECK_THROWS_WITH(merge(a, run(debiased, 4096, 8192)), Contains("both results hold sample"));
  CHECK_THROWS_WITH(merge(run(debiased, 8000, 100), a), Contains("both results hold sample"));
  CHECK_THROWS_WITH(merge(a, run(debiased, 12'288, 4096)), Contains("do not meet"));
  CHECK_THROWS_WITH(merge(run(debiased, 0, 5000), run(debiased, 5000, 3192)), Contains("multiple of 512"));
  CHECK_THROWS_WITH(merge(a, run(debiased, 8192, 4096, 2, 8)), Contains("seeds 7 and 8"));
  const auto other_pmf = single_term(squared_mean, Geometric(0.65));
  CHECK_THROWS_WITH(merge(a, run(other_pmf, 8192, 4096)),
                    Contains("different estimators") && Contains("geometric:r=0.65"));
  const auto other_base = single_term(squared_mean, Geometric(0.6), {.base_level = 1});
  CHECK_THROWS_AS(merge(a, run(other_base, 8192, 4096)), std::invalid_argument);
  const auto other_estimator = independent_sum(squared_mean, Geometric(0.6));
  CHECK_THROWS_AS(merge(a, run(other_estimator, 8192, 4096)), std::invalid_argument);
  CHECK_NOTHROW(merge(a, run(debiased, 8192, 4096)));
}

TEST_CASE("the last indices of 64 bits can be run", "[core][estimate][exact]") {
  constexpr std::int64_t last = std::numeric_limits<std::int64_t>::max();
  for (const int threads : {1, 3}) {
    CHECK(run(debiased, last - 10, 10, threads).moments.count == 10);
    CHECK(run(debiased, last - 10'000, 10'000, threads).moments.count == 10'000);
  }
}

// ---- replay

namespace {

/// The value put together again from the traced levels.
template <class E, class Weight>
void check_replay(const E& estimator, const Weight& weight) {
  const auto result = run(estimator, 1000, 20'000);
  REQUIRE(result.largest.size() == 32);
  for (const LargeSample& large : result.largest) {
    const auto replayed = trace(estimator, 7, large.index);
    REQUIRE(replayed.sample.value == large.value);
    REQUIRE(replayed.sample.level == large.level);
    double value = 0;
    double work = 0;
    for (const TracedLevel& level : replayed.levels) {
      value += level.is_base ? level.difference : level.difference * weight(level.level);
      work += level.work;
    }
    REQUIRE(std::abs(value - large.value) <= 1e-14 * std::abs(large.value));
    REQUIRE(work == replayed.sample.work);
    REQUIRE(replayed.levels.back().level == large.level);
  }
  CHECK(std::abs(result.largest.front().value) == std::max(result.upper_tail.front(), -result.lower_tail.front()));
}

}  // namespace

TEST_CASE("trace gives each of the largest samples again, and its levels sum up to its value",
          "[core][estimate][exact]") {
  const Geometric pmf(0.6);
  check_replay(debiased, [&pmf](std::int64_t level) { return 1 / pmf.mass(level - 1); });
  check_replay(independent_sum(squared_mean, pmf), [&pmf](std::int64_t level) { return 1 / pmf.tail(level); });
  check_replay(roulette(NoisyHalves{}, pmf, {.base_level = 2}),
               [&pmf](std::int64_t level) { return 1 / pmf.tail(level - 2); });
}

// ---- when samples go wrong

namespace {

struct OwnError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace

TEST_CASE("a callable that throws is reported with seed and smallest index, whatever the threads",
          "[core][estimate][exact]") {
  const auto fragile = [](Stream& rng) {
    if (rng.index() >= 30'001 && rng.index() % 7 == 0) throw OwnError("odd weather");  // 30'002 = 7 x 4286
    return rng.uniform();
  };
  for (const int threads : {1, 2, 3, 7, 64}) {
    CAPTURE(threads);
    try {
      run(fragile, 5, 100'000, threads);
      FAIL("does not throw");
    } catch (const SampleError& e) {
      CHECK(e.seed() == 7);
      CHECK(e.index() == 30'002);
      CHECK_THAT(e.what(), Catch::Contains("sample 30002 of seed 7") && Catch::Contains("odd weather") &&
                               Catch::Contains("trace(estimator, 7, 30002)"));
      CHECK_THROWS_AS(std::rethrow_if_nested(e), OwnError);
    }
  }
  CHECK_NOTHROW(run(fragile, 0, 30'000));
}

TEST_CASE("an exception that is no std::exception is reported too, and trace reports like estimate",
          "[core][estimate][exact]") {
  const auto rude = [](Stream& rng) {
    if (rng.index() == 3) throw 42;
    return rng.uniform();
  };
  try {
    trace(rude, 9, 3);
    FAIL("does not throw");
  } catch (const SampleError& e) {
    CHECK(e.seed() == 9);
    CHECK(e.index() == 3);
    CHECK_THROWS_AS(std::rethrow_if_nested(e), int);
  }
  CHECK_THROWS_AS(run(rude, 0, 10), SampleError);
}

TEST_CASE("a sample of another shape is an error, not a mean over what there is", "[core][estimate][exact]") {
  const auto growing = [](Stream& rng) {
    return Eigen::ArrayXd(Eigen::ArrayXd::Constant(rng.index() < 2000 ? 2 : 3, rng.uniform()));
  };
  try {
    run(growing, 0, 4096);
    FAIL("does not throw");
  } catch (const SampleError& e) {
    CHECK(e.index() == 2000);
    CHECK_THAT(e.what(), Catch::Contains("3 components where an earlier one had 2"));
  }
}

TEST_CASE("samples that are not finite are counted, named and never skipped", "[core][estimate][exact]") {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const auto broken = [bad](Stream& rng) { return rng.index() == 70 || rng.index() == 9000 ? bad : rng.uniform(); };
    for (const std::int64_t n : {100, 10'000}) {
      const auto result = run(broken, 0, n);
      CHECK(std::isnan(result.mean));
      CHECK(std::isnan(result.standard_error));
      CHECK(result.nonfinite == (n == 100 ? 1 : 2));
      CHECK(result.first_nonfinite == 70);
      REQUIRE(result.warnings.size() == 1);
      CHECK_THAT(result.warnings[0].text, Catch::Contains("not finite") && Catch::Contains("seed 7, sample 70"));
      CHECK(result.largest.front().value < 1);
      std::ostringstream text;
      text << result;
      CHECK_THAT(text.str(), Catch::Contains("not a number") && Catch::Contains("not finite"));
      CHECK_THAT(text.str(), !Catch::Contains("nan") && !Catch::Contains(" inf") && !Catch::Contains("-inf"));
    }
    CHECK(run(broken, 71, 100).nonfinite == 0);
    CHECK(run(broken, 4096, 8192).first_nonfinite == 9000);
  }
}

TEST_CASE("one bad component of an array makes the sample not finite", "[core][estimate][exact]") {
  const auto broken = [](Stream& rng) {
    return std::complex<double>(rng.uniform(), rng.index() == 12 ? std::numeric_limits<double>::infinity() : 1);
  };
  const auto result = run(broken, 0, 100);
  CHECK(result.nonfinite == 1);
  CHECK(result.first_nonfinite == 12);
  CHECK(std::isnan(result.mean.real()));
  CHECK(std::isnan(result.mean.imag()));
}

// ---- progress

TEST_CASE("progress counts finished samples, changes no bits, and can end a run", "[core][estimate][exact]") {
  const auto x = [](Stream& rng) { return rng.uniform(); };
  for (const int threads : {1, 3}) {
    std::vector<std::int64_t> seen;
    Plan plan{.samples = 50'000, .seed = 7, .threads = threads};
    plan.progress = [&seen](std::int64_t done) {
      seen.push_back(done);
      return true;
    };
    CHECK(bits_of(estimate(x, plan)) == bits_of(run(x, 0, 50'000, 1)));
    CHECK(std::is_sorted(seen.begin(), seen.end()));
    if (threads == 1) CHECK(seen.size() == 98);
    if (threads == 1) CHECK(seen.back() == 50'000);

    std::atomic<std::int64_t> drawn = 0;
    const auto counted = [&drawn](Stream& rng) {
      ++drawn;
      return rng.uniform();
    };
    plan.samples = 100'000'000;
    plan.progress = [](std::int64_t) { return false; };
    CHECK_THROWS_AS(estimate(counted, plan), Interrupted);
    plan.progress = [](std::int64_t) -> bool { throw OwnError("no terminal"); };
    CHECK_THROWS_AS(estimate(counted, plan), OwnError);
    CHECK(drawn < 10'000'000);
  }
}

// ---- plans

TEST_CASE("impossible plans are refused with their number", "[core][estimate][exact]") {
  using Catch::Contains;
  const auto x = [](Stream& rng) { return rng.uniform(); };
  CHECK_THROWS_WITH(estimate(x, {.samples = 0}), Contains("samples = 0"));
  CHECK_THROWS_AS(estimate(x, {.samples = -5}), std::invalid_argument);
  CHECK_THROWS_WITH(estimate(x, {.samples = 10, .first = -1}), Contains("first = -1"));
  CHECK_THROWS_WITH(estimate(x, {.samples = 10, .threads = -2}), Contains("threads = -2"));
  CHECK_THROWS_WITH(estimate(x, {.samples = 10, .first = std::numeric_limits<std::int64_t>::max() - 5}),
                    Contains("does not fit 64 bits"));
}

TEST_CASE("what is asked for is what is run", "[core][estimate][exact]") {
  const auto result = run(debiased, 100, 5000);
  CHECK(result.samples == 5000);
  CHECK(result.first == 100);
  CHECK(result.seed == 7);
  CHECK(result.moments.count == 5000);
  CHECK(result.seconds > 0);
  CHECK(result.estimator == "single_term, geometric:r=0.6, base level 0");
  std::int64_t base_draws = 0;
  std::int64_t draws = 0;
  double work = 0;
  for (const LevelRow& row : result.levels) {
    (row.is_base ? base_draws : draws) += row.count;
    work += row.work * static_cast<double>(row.count);
  }
  CHECK(base_draws == 5000);
  CHECK(draws == 5000);
  CHECK(work == Approx(result.work).epsilon(1e-12));
  CHECK(result.levels.at(0).probability == 0);
  CHECK(result.levels.at(2).probability == Geometric(0.6).mass(1));
  CHECK(result.work_per_sample() == result.work / 5000);
  const double variance = result.components.at(0).variance;
  CHECK(result.efficiency() == Approx(5000 / (variance * result.seconds)));
  CHECK(result.standard_error == Approx(std::sqrt(variance / 5000)));
}

TEST_CASE("the interval is the mean plus and minus a quantile of standard errors", "[core][estimate][exact]") {
  const auto plain = [](Stream& rng) { return rng.exponential(); };
  const auto result = estimate(plain, {.samples = 5000});
  const Interval i = result.interval();
  const double t_4999 = 1.960438646661524;  // of Student's law; the normal one has 1.95996
  CHECK(i.low == Approx(result.mean - t_4999 * result.standard_error).epsilon(1e-14));
  CHECK(i.high == Approx(result.mean + t_4999 * result.standard_error).epsilon(1e-14));
  const auto five = estimate(plain, {.samples = 5});
  CHECK(five.interval().high - five.mean == Approx(2.7764451051977934 * five.standard_error).epsilon(1e-12));
  const Interval wide = result.interval(1 - 0x1p-53);
  CHECK(wide.high - wide.low > -2 * normal_quantile(0x1p-54) * result.standard_error);
  CHECK(std::isfinite(wide.high));
  CHECK_THROWS_AS(result.interval(0), std::invalid_argument);
  CHECK_THROWS_AS(result.interval(1), std::invalid_argument);
  CHECK_THROWS_AS(result.interval(std::numeric_limits<double>::quiet_NaN()), std::invalid_argument);
  CHECK_THROWS_AS(result.interval(0.95, 1), std::out_of_range);
}

// ---- doubt

TEST_CASE("a sample that carries the variance brings a warning, and a light tail none", "[core][estimate][exact]") {
  const auto spiked = [](Stream& rng) { return rng.index() == 77 ? 1000.0 : rng.uniform(); };
  const auto dominated = run(spiked, 0, 10'000);
  REQUIRE(dominated.warnings.size() == 1);
  CHECK(dominated.warnings[0].code == WarningCode::dominant_sample);
  CHECK_THAT(dominated.warnings[0].text, Catch::Contains("one sample carries 100 %") && Catch::Contains("sample 77"));

  const auto heavy = [](Stream& rng) { return std::pow(rng.uniform(), -0.49); };  // no fourth moment
  const auto uncertain = run(heavy, 0, 200);
  REQUIRE(uncertain.warnings.size() == 1);
  CHECK_THAT(uncertain.warnings[0].text, Catch::Contains("uncertain by") || Catch::Contains("one sample carries"));

  const auto few = run([](Stream& rng) { return rng.normal(); }, 0, 20);
  REQUIRE(few.warnings.size() == 1);
  CHECK(few.warnings[0].code == WarningCode::uncertain_error);
  CHECK_THAT(few.warnings[0].text, Catch::Contains("standard error is itself uncertain by"));

  CHECK(run([](Stream& rng) { return rng.normal(); }, 0, 10'000).warnings.empty());
}

TEST_CASE("one sample has a mean and no standard error", "[core][estimate][exact]") {
  const auto result = run([](Stream&) { return 2.0; }, 0, 1);
  CHECK(result.mean == 2);
  CHECK(std::isnan(result.standard_error));
  REQUIRE(result.warnings.size() == 1);
  CHECK_THAT(result.warnings[0].text, Catch::Contains("one sample has no standard error"));
}

TEST_CASE("a constant has no error, and infinite efficiency", "[core][estimate][exact]") {
  const auto result = run([](Stream&) { return 0.1; }, 0, 12'345);
  CHECK(result.mean == 0.1);
  CHECK(result.standard_error == 0);
  CHECK(result.efficiency() == std::numeric_limits<double>::infinity());
}

// ---- in print

TEST_CASE("the mean prints with two digits of its error, counted in its last two digits", "[core][result][exact]") {
  CHECK(with_error(0.750031, 0.000124) == "0.75003(12)");
  CHECK(with_error(-0.750036, 0.000126) == "-0.75004(13)");
  CHECK(with_error(3.14159265, 1e-7) == "3.14159265(10)");
  CHECK(with_error(0.75, 0.0994) == "0.750(99)");
  CHECK(with_error(0.75, 0.0996) == "0.75(10)");  // rounds up to another power of ten
  CHECK(with_error(0.75, 0.0099999) == "0.750(10)");
  CHECK(with_error(12.34, 0.996) == "12.3(1.0)");
  CHECK(with_error(12.34, 0.99) == "12.34(99)");
  CHECK(with_error(123.4, 1.2) == "123.4(1.2)");  // straddles the decimal point, and shows it
  CHECK(with_error(123.4, 9.96) == "123(10)");
  CHECK(with_error(1234.4, 12.3) == "1234(12)");
  CHECK(with_error(1234.5, 99.7) == "1230(100)");
  CHECK(with_error(12345.6, 123.4) == "12350(120)");
  CHECK(with_error(1.5e6, 34567) == "1500000(35000)");
  CHECK(with_error(0, 0.0123) == "0.000(12)");
  CHECK(with_error(2, 0) == "2(0)");
  CHECK(with_error(0.1, 0) == "0.1(0)");
  CHECK(with_error(1e20, 1e10) == "1e+20 +- 1e+10");
  CHECK(with_error(1e-30, 1e-32) == "1e-30 +- 1e-32");
  CHECK(with_error(std::numeric_limits<double>::quiet_NaN(), 1) == "not a number");
  CHECK(with_error(1, std::numeric_limits<double>::infinity()) == "1 (no standard error)");
  CHECK(with_error(1, std::numeric_limits<double>::quiet_NaN()) == "1 (no standard error)");
}

TEST_CASE("a result says when its samples are all equal, overflow, underflow or are coarser than their error",
          "[estimate][exact]") {
  const auto first_warning = [](const auto& e) {
    const auto result = estimate(e, {.samples = 1000});
    return result.warnings.empty() ? std::string() : result.warnings.front().text;
  };
  const auto scaled_uniform = [](double scale) { return [scale](Stream& rng) { return scale * rng.uniform(); }; };
  CHECK(first_warning(scaled_uniform(1)).empty());
  CHECK_THAT(first_warning(scaled_uniform(0)), Catch::Contains("all 1000 samples are equal"));
  CHECK_THAT(first_warning([](Stream&) { return 0.1; }), Catch::Contains("all 1000 samples are equal"));
  CHECK_THAT(first_warning(scaled_uniform(1e-200)), Catch::Contains("underflow"));
  CHECK_THAT(first_warning(scaled_uniform(5e-324)), Catch::Contains("underflow"));
  CHECK_THAT(first_warning(scaled_uniform(1e200)), Catch::Contains("squares of these samples overflow"));
  CHECK_THAT(first_warning(scaled_uniform(1e308)), Catch::Contains("the mean is not a number"));
  const auto third = [](auto one) {
    return [one](Stream& rng) { return one / 3 + one * static_cast<decltype(one)>(1e-9 * rng.uniform()); };
  };
  CHECK(first_warning(third(1.0)).empty());
  CHECK_THAT(first_warning([](Stream& rng) { return rng.uniform() < 0.5 ? 1.0F / 3 : std::nextafter(1.0F / 3, 1.0F); }),
             Catch::Contains("single-precision"));
  // a vector that turns: every norm is 1, no two values are equal
  CHECK(first_warning([](Stream& rng) {
          const double phi = 6.3 * rng.uniform();
          return std::complex<double>(std::cos(phi), std::sin(phi));
        }).empty());
}

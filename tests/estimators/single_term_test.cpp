#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "catch_shim.hpp"
#include "estimators/sequences.hpp"
#include "estimators/wrong.hpp"
#include "laws/estimator_laws.hpp"

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/poisson.hpp>

using namespace debias;
using namespace debias::trial;
using laws::estimator_laws;
using laws::Failures;

namespace {

const Geometric pmf(0.55);

template <class S>
void check_everywhere(const S& sequence) {
  for (const std::int64_t m : {0, 1, 3}) {
    for (const Base how : {Base::every_sample, Base::one_outcome}) {
      CAPTURE(m, how == Base::one_outcome);
      CHECK(estimator_laws(single_term(sequence, pmf, {.base_level = m, .base = how}), sequence.truth()) == Failures{});
    }
  }
}

struct Slow : SquaredMean {  // only its declaration is
  static constexpr Rates rates{1, 1};
};

struct Polynomial : SquaredMean {
  static constexpr Rates rates{4, 0, Decay::polynomial};
};

}  // namespace

TEST_CASE("single_term is unbiased and honest on a series without noise", "[single_term][statistical]") {
  check_everywhere(GeometricSeries{});
}

TEST_CASE("single_term is unbiased and honest where the differences are zero", "[single_term][statistical]") {
  check_everywhere(Steady{});
}

TEST_CASE("single_term is unbiased and honest on a noisy square of a mean", "[single_term][statistical][stat]") {
  check_everywhere(SquaredMean{});
}

TEST_CASE("single_term is unbiased and honest with a base that shares the draws of the level",
          "[single_term][statistical][stat]") {
  check_everywhere(SharingSquaredMean{});
  check_everywhere(Comb{});
}

TEST_CASE("single_term without a PMF takes the one that the declared rates ask for", "[single_term][exact]") {
  const auto e = single_term(SquaredMean{});
  CHECK(e.pmf().tail_exponent().exponent == Approx(7.0 / 6));
  CHECK(estimator_laws(e, 1, {.repeats = 0}) == Failures{});
  CHECK_THROWS_AS(single_term(Slow{}), std::invalid_argument);
  CHECK_THROWS_WITH(single_term(Polynomial{}), Catch::Contains("Zeta(2"));
  CHECK_THROWS_WITH(single_term(SquaredMean{}, pmf, {.base_level = -1}),
                    Catch::Contains("base_level = -1") && Catch::Contains("single_term"));
}

TEST_CASE("single_term names its PMF, base level and kind of base", "[single_term][exact]") {
  CHECK(single_term(Steady{}, pmf).describe() == "single_term, geometric:r=0.55, base level 0");
  CHECK(single_term(Steady{}, pmf, {.base_level = 3, .base = Base::one_outcome}).describe() ==
        "single_term, base one outcome, geometric:r=0.55, base level 3");
}

// ---- power

TEST_CASE("the laws reject a bias of three times what can be detected", "[single_term][statistical]") {
  const laws::EstimatorLawOptions options;
  const Plan plan{.samples = options.samples, .seed = options.seed};
  const auto check = [&](const auto& e, double truth) {
    CHECK(rejected(scaled_detectably(e, truth, plan, options.z_limit), truth));
  };
  check(single_term(GeometricSeries{}, Geometric(0.5)), GeometricSeries{}.truth());
  check(single_term(SquaredMean{}, pmf), 1);
  check(single_term(Comb{}, pmf), Comb{}.truth());
  check(single_term(Steady{}, pmf), 0.5);
}

TEST_CASE("the laws reject a PMF off by one, no weights, and a PMF that is cut and renormalised",
          "[single_term][statistical]") {
  const Geometric steep(0.7);  // with 0.55, the square of a mean without weights comes out right by accident
  const auto check = [&steep](const auto& sequence) {
    const double truth = sequence.truth();
    for (const Base how : {Base::every_sample, Base::one_outcome}) {
      CHECK(rejected(single_term(sequence, PmfOffByOne{steep}, {.base = how}), truth));
      CHECK(rejected(single_term(sequence, NoReweighting{steep}, {.base = how}), truth));
      CHECK(rejected(single_term(sequence, Renormalised{steep, 1}, {.base = how}), truth));
    }
  };
  check(GeometricSeries{});
  check(SquaredMean{});
  check(SharingSquaredMean{});
  check(Comb{});
}

TEST_CASE("the laws reject a dropped base, and a shared base of one residue of a comb", "[single_term][statistical]") {
  for (const std::int64_t m : {0, 2}) {
    for (const Base how : {Base::every_sample, Base::one_outcome}) {
      const SingleTermOptions options{.base_level = m, .base = how};
      CHECK(rejected(single_term(BaseDropped<GeometricSeries>{{}}, pmf, options), GeometricSeries{}.truth()));
      CHECK(rejected(single_term(BaseDropped<SquaredMean>{{}}, pmf, options), 1));
      CHECK(rejected(single_term(BaseDropped<Steady>{{}}, pmf, options), 0.5));
    }
    CHECK(rejected(single_term(OneResidue{}, pmf, {.base_level = m}), Comb{}.truth()));
  }
}

TEST_CASE("the laws reject infinite variance, a sample that replays as another, and work for nothing",
          "[single_term][statistical]") {
  CHECK(laws::names(estimator_laws(single_term(SquaredMean{}, Geometric(0.95)), 1), "honest"));
  const auto unstable = [calls = std::make_shared<std::atomic<int>>(0)](Stream& rng) {
    return rng.uniform() + 1e-9 * ++*calls;
  };
  const auto idle = [](Stream& rng) { return Sample<double>{rng.uniform(), 0}; };
  CHECK(laws::names(estimator_laws(unstable, 0.5, {.repeats = 0}), "replay"));
  CHECK(laws::names(estimator_laws(idle, 0.5, {.repeats = 0}), "record"));
}

// ---- variance and work by formula

namespace {

/// sum_k second_moment(k) / p(k - first) over k = first, first + 1, ...
template <class SecondMoment>
double weighted(const Geometric& p, std::int64_t first, const SecondMoment& second_moment) {
  double sum = 0;
  for (std::int64_t j = 0; j < 400; ++j) sum += second_moment(first + j) / p.mass(j);
  return sum;
}

}  // namespace

TEST_CASE("without noise the variance is sum D^2 / p - (sum D)^2, base in every sample or one outcome",
          "[single_term][statistical]") {
  const GeometricSeries series;
  const Geometric p(0.5);
  for (const std::int64_t m : {0, 1, 3}) {
    const double rest = series.truth() - series.partial(m);
    const auto square = [&series](std::int64_t k) { return power(series.q, 2 * k); };
    const double always = weighted(p, m + 1, square) - rest * rest;
    const double drawn =
        weighted(p, m, [&](std::int64_t k) { return k == m ? std::pow(series.partial(m), 2) : square(k); }) -
        series.truth() * series.truth();
    const auto run = [&](Base how) {
      return estimate(single_term(series, p, {.base_level = m, .base = how}), {.samples = 200'000, .seed = 3});
    };
    CAPTURE(m, always, drawn);
    CHECK(has_variance(run(Base::every_sample), always));
    CHECK(has_variance(run(Base::one_outcome), drawn));
    // Power: the formulas are told apart, and so is one with the masses of the next level.
    CHECK_FALSE(has_variance(run(Base::one_outcome), always));
    CHECK_FALSE(has_variance(run(Base::every_sample), weighted(p, m + 2, square) - rest * rest));
  }
}

TEST_CASE("with noise the variance is that of the base plus sum E D^2 / p - (sum E D)^2",
          "[single_term][statistical]") {
  const Geometric p(0.5);  // a light tail, so that the variance is measured well
  for (const std::int64_t m : {0, 1, 3}) {
    const double rest = 1 - SquaredMean::value_mean(m);
    const double second = weighted(p, m + 1, SquaredMean::difference_square);
    const double exact = SquaredMean::value_variance(m) + second - rest * rest;
    const auto result = estimate(single_term(SquaredMean{}, p, {.base_level = m}), {.samples = 100'000, .seed = 3});
    CAPTURE(m, exact, result.moments.variance());
    CHECK(has_variance(result, exact));
    CHECK_FALSE(has_variance(result, second - rest * rest));
  }
  // Known answer: sum E D^2 / p at r = 0.65 is 5.8333 (facts of problem A10).
  CHECK(weighted(Geometric(0.65), 1, SquaredMean::difference_square) == Approx(5.8333333333).epsilon(1e-9));
}

TEST_CASE("a shared base costs no draw of its own and varies less", "[single_term][statistical]") {
  const Plan plan{.samples = 50'000, .seed = 3};
  const auto separate = estimate(single_term(SquaredMean{}, pmf, {.base_level = 1}), plan);
  const auto shared = estimate(single_term(SharingSquaredMean{}, pmf, {.base_level = 1}), plan);
  CHECK(shared.work == separate.work - 2 * 50'000.0);
  CHECK(shared.moments.variance() < separate.moments.variance());
  CHECK(shared.levels.at(0).is_base);
  CHECK(shared.levels.at(0).work == 0);
  CHECK(shared.levels.at(1).mean == separate.levels.at(1).mean);  // the level draws are the same
}

TEST_CASE("the mean work is that of the base plus sum work p", "[single_term][statistical]") {
  const Geometric p(0.5);
  for (const std::int64_t m : {0, 3}) {
    for (const Base how : {Base::every_sample, Base::one_outcome}) {
      const auto e = single_term(GeometricSeries{}, p, {.base_level = m, .base = how});
      std::vector<double> work;
      NullRecord record;
      for (std::uint64_t i = 0; i < 50'000; ++i) {
        Stream rng(4, i);
        work.push_back(e(rng, record).work);
      }
      const auto base_work = static_cast<double>(m + 1);
      // 1 is the mean outcome of the PMF; a level k costs k + 1.
      const double exact = how == Base::one_outcome ? base_work + 1 : base_work + base_work + 1 + 1;
      const Moments measured = Moments::of(work);
      CHECK(std::abs(measured.mean - exact) <= 4.5 * measured.standard_error());
      CHECK_FALSE(std::abs(measured.mean - exact - 0.1) <= 4.5 * measured.standard_error());
    }
  }
}

// ---- draws

TEST_CASE("two PMFs, and two estimators, see the same level draws at one seed", "[single_term][exact]") {
  const auto flat = single_term(SquaredMean{}, Geometric(0.4));
  const auto steep = single_term(SquaredMean{}, Geometric(0.7));
  const auto every = independent_sum(SquaredMean{}, Geometric(0.3));
  int met = 0;
  for (std::int64_t i = 0; i < 300; ++i) {
    const auto a = trace(flat, 5, i).levels;
    const auto b = trace(steep, 5, i).levels;
    const auto c = trace(every, 5, i).levels;
    REQUIRE(a[0].difference == b[0].difference);
    REQUIRE(a[0].difference == c[0].difference);
    if (a[1].level == b[1].level) REQUIRE(a[1].difference == b[1].difference);
    if (a[1].level < static_cast<std::int64_t>(c.size())) {
      REQUIRE(a[1].difference == c[static_cast<std::size_t>(a[1].level)].difference);
      ++met;
    }
  }
  CHECK(met > 100);
}

TEST_CASE("draw gives the sample of a named level", "[single_term][exact]") {
  const auto e = single_term(SquaredMean{}, pmf, {.base_level = 1});
  NullRecord record;
  for (std::int64_t i = 0; i < 50; ++i) {
    Stream rng(6, static_cast<std::uint64_t>(i));
    const auto sample = e(rng, record);
    CHECK(e.draw(sample.level, Stream(6, static_cast<std::uint64_t>(i)), record).value == sample.value);
  }
}

// ---- levels beyond 2^31

namespace {

/// 1 - 1 / (k + 1), in the same time at every level; the limit is 1.
struct Algebraic {
  Draw<double> operator()(std::int64_t level, Stream&) const {
    const auto k = static_cast<double>(level);
    return {k / (k + 1), level == 0 ? 0 : 1 / (k * (k + 1)), 1};
  }
};

/// Half of the mass on 0, half on one deep level.
struct TwoLevels {
  std::int64_t deep;
  double mass(std::int64_t j) const { return j == 0 || j == deep ? 0.5 : 0; }
  double tail(std::int64_t j) const { return j == 0 ? 1 : j <= deep ? 0.5 : 0; }
  std::int64_t sample(double u) const { return u <= 0.5 ? deep : 0; }
};

}  // namespace

TEST_CASE("levels of 2^40 and of almost 2^63 are drawn, weighted and recorded like any other", "[single_term][exact]") {
  for (const std::int64_t deep : {std::int64_t{1} << 40, std::numeric_limits<std::int64_t>::max() - 1}) {
    const auto result = estimate(single_term(Algebraic{}, TwoLevels{deep}), {.samples = 10'000, .seed = 2});
    REQUIRE(result.levels.size() == 3);  // the base, level 1, and one octave
    const LevelRow& row = result.levels.back();
    CHECK(row.level <= deep + 1);
    CHECK(row.last_level >= deep + 1);
    CHECK(row.count + result.levels[1].count == 10'000);
    const auto k = static_cast<double>(deep + 1);
    CHECK(row.mean == 1 / (k * (k + 1)));
    // 2 (1/2) at level 1, half of the time: 0.5 in the mean.
    CHECK(std::abs(result.mean - 0.5) <= 4.5 * result.standard_error);
    CHECK(trace(single_term(Algebraic{}, TwoLevels{deep}), 2, result.largest.back().index).sample.level > 0);
  }
}

TEST_CASE("a probability that has underflowed is an error with its level, never a weight", "[single_term][exact]") {
  struct Vanishing {
    double mass(std::int64_t) const { return 1e-310; }
    double tail(std::int64_t) const { return 1e-310; }
    std::int64_t sample(double) const { return 6; }
  };
  try {
    estimate(single_term(Steady{}, Vanishing{}), {.samples = 10});
    FAIL("does not throw");
  } catch (const SampleError& e) {
    CHECK(e.index() == 0);
    CHECK_THAT(e.what(), Catch::Contains("level 7") && Catch::Contains("underflowed"));
    CHECK_THROWS_AS(std::rethrow_if_nested(e), std::length_error);
  }
}

namespace {

// Uniform on the first `levels` levels.
struct Ending {
  std::int64_t levels;

  [[nodiscard]] double mass(std::int64_t j) const { return j < levels ? 1 / static_cast<double>(levels) : 0; }
  [[nodiscard]] double tail(std::int64_t j) const {
    return j < levels ? 1 - static_cast<double>(j) / static_cast<double>(levels) : 0;
  }
  [[nodiscard]] std::int64_t sample(double u) const {
    return std::min(levels - 1, static_cast<std::int64_t>((1 - u) * static_cast<double>(levels)));
  }
};

// Half of what is left on each even level.
struct Even {
  [[nodiscard]] double mass(std::int64_t j) const {
    return j % 2 == 0 ? std::exp2(-0.5 * static_cast<double>(j) - 1) : 0;
  }
  [[nodiscard]] double tail(std::int64_t j) const { return std::exp2(-std::ceil(0.5 * static_cast<double>(j))); }
  [[nodiscard]] std::int64_t sample(double u) const { return 2 * static_cast<std::int64_t>(-std::log2(u)); }
};

// u (1 + 0.8 + ... + 0.8^level), to which no level after `end` adds anything.
struct Powers {
  std::int64_t end;
  bool says_so = false;

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double u = 0.5 + rng.uniform();
    const auto last = std::min(level, end);
    if (level == 0) return {u, u, 1};
    return {5 * u * (1 - power(0.8, last + 1)), level <= end ? u * power(0.8, level) : 0, 1};
  }
  [[nodiscard]] SequenceFacts facts() const {
    SequenceFacts f;
    if (says_so) f.exact_from = end;
    return f;
  }
};

}  // namespace

// A mean 15 standard errors off was "finite (shown)" and its interval reliable.
TEST_CASE("a PMF that ends before the differences do states a bias without a bound", "[estimators][exact]") {
  constexpr std::int64_t forever = 1000;
  const Plan plan{.samples = 20'000, .threads = 1};
  const auto is_biased = [&](const auto& estimator) {
    const Statistics s = estimate(estimator, plan);
    const bool biased = s.bias_bound.size > 0;
    if (biased) {
      CHECK(std::isinf(s.bias_bound.size));
      CHECK_THAT(s.bias_bound.sentence, Catch::Contains("the PMF ends at level 1"));
      CHECK_FALSE(s.verdict().interval_reliable());
      CHECK(std::abs(s.components.front().mean - 5) > 4.5 * s.components.front().standard_error);
    }
    return biased;
  };
  CHECK(is_biased(single_term(Powers{forever}, Ending{12})));
  CHECK(is_biased(independent_sum(Powers{forever}, Ending{12})));
  CHECK(is_biased(single_term(Powers{forever, true}, Ending{12})));
  CHECK_FALSE(is_biased(single_term(Powers{8}, Ending{12})));
  CHECK_FALSE(is_biased(single_term(Powers{12, true}, Ending{16})));
  CHECK_FALSE(is_biased(single_term(Powers{forever}, Geometric(0.3))));
  CHECK_FALSE(is_biased(single_term(Powers{forever}, Poisson(3))));
  // The level above the base has an index of 0.
  const auto every_second = [](std::int64_t level, Stream& rng) {
    const double u = 0.5 + rng.uniform();
    const std::int64_t last = (level + 1) / 2;
    if (level == 0) return Draw<double>{u, u, 1};
    return Draw<double>{2 * u * (1 - power(0.5, last + 1)), level % 2 == 1 ? u * power(0.5, last) : 0, 1};
  };
  CHECK_FALSE(is_biased(single_term(every_second, Even{})));
}

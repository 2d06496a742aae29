#include <debias/series.hpp>

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/diagnostics.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/pmf/zeta.hpp>
#include <debias/survey.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;
using laws::SequenceLawOptions;

namespace {

const double pi = std::acos(-1.0);
const Stream unused(1, 0);

double power(double ratio, std::int64_t k) { return std::pow(ratio, static_cast<double>(k)); }
double halves(std::int64_t k) { return std::ldexp(1.0, -static_cast<int>(k)); }
double squares(std::int64_t k) { return 1 / (static_cast<double>(k + 1) * static_cast<double>(k + 1)); }
double leibniz(std::int64_t k) { return (k % 2 == 0 ? 4 : -4) / (2 * static_cast<double>(k) + 1); }
double factorials(std::int64_t k) { return 1 / std::tgamma(static_cast<double>(k) + 1); }

// Mean halves(k), and a noise that uses one or two numbers, as it comes.
double noisy_halves(std::int64_t k, Stream& rng) {
  const double u = rng.uniform();
  const double noise = u < 0.5 ? u - 0.25 : rng.uniform() - 0.5;
  return halves(k) * (1 + noise);
}

// What a draw as a whole costs grows with its partial sum. The declared work is that of a term alone.
SequenceLawOptions terms_up_to(std::int64_t last) { return {.last = last, .work_tolerance = 1.5}; }

// The sum by small terms first.
template <class S>
double sum_of(const S& s, std::int64_t terms) {
  double total = 0;
  for (std::int64_t k = terms - 1; k >= 0; --k) total += s.difference_at(k, unused).value;
  return total;
}

}  // namespace

TEST_CASE("D01: the levels of sum 2^-k are 2 - 2^-k, the differences the terms, to the last bit", "[series][exact]") {
  const auto s = series(halves, geometric_terms(0.5));
  for (std::int64_t k = 0; k <= 52; ++k) {
    const Draw<double> draw = s(k, unused);
    CHECK(draw.value == 2 - halves(k));
    CHECK(draw.difference == halves(k));
    CHECK(draw.work == static_cast<double>(k + 1));
    CHECK(s.value_at(k, unused).value == draw.value);
    CHECK(s.value_at(k, unused).work == draw.work);
    CHECK(s.difference_at(k, unused).value == draw.difference);
    CHECK(s.difference_at(k, unused).work == 1);
  }
  // far below the last digit of the partial sums
  CHECK(s.difference_at(1000, unused).value == 0x1p-1000);
}

TEST_CASE("D01, D02, D03, D07, D18: the terms of the catalogue sum to its values", "[series][exact]") {
  CHECK(sum_of(series(halves), 60) == 2);
  CHECK(sum_of(series([](std::int64_t k) { return power(0.95, k); }), 1000) == Approx(20).epsilon(1e-14));
  CHECK(sum_of(series(squares), 1000000) == Approx(pi * pi / 6 - 1e-6).epsilon(1e-12));
  CHECK(sum_of(series(factorials), 30) == Approx(std::exp(1.0)).epsilon(1e-15));
  const auto log_terms = [](std::int64_t k) { return power(0.9, k + 1) / static_cast<double>(k + 1); };
  CHECK(sum_of(series(log_terms), 1000) == Approx(std::log(10.0)).epsilon(1e-14));
}

TEST_CASE("the declared rates of series are those of their terms", "[series][law]") {
  CHECK(sequence_laws(series(halves, geometric_terms(0.5)), terms_up_to(12)) == Failures{});
  CHECK(sequence_laws(series(halves, geometric_terms(-0.5)), terms_up_to(12)) == Failures{});
  const auto slow = [](std::int64_t k) { return power(0.95, k); };
  CHECK(sequence_laws(series(slow, geometric_terms(0.95)), terms_up_to(12)) == Failures{});
  SequenceLawOptions far = terms_up_to(40);
  far.rates_from = 20;
  far.samples = 64;  // nothing is random
  CHECK(sequence_laws(series(squares, polynomial_terms(2)), far) == Failures{});
  CHECK(sequence_laws(series(factorials, factorial_terms), terms_up_to(12)) == Failures{});

  CHECK(sequence_laws(series(halves, geometric_terms(0.4)), terms_up_to(12)) != Failures{});
  CHECK(sequence_laws(series(halves, factorial_terms), terms_up_to(12)) != Failures{});
  CHECK(sequence_laws(series(squares, polynomial_terms(3)), far) != Failures{});
  CHECK(sequence_laws(series(squares, geometric_terms(0.5)), far) != Failures{});
}

TEST_CASE("rates of terms: beta = -2 log2|ratio|, 2 s for k^-s, impossible ones are refused", "[series][exact]") {
  CHECK(geometric_terms(0.25).variance_decay == 4);
  CHECK(geometric_terms(-0.25).variance_decay == 4);
  CHECK(geometric_terms(0).variance_decay == Rates::faster_than_any);
  CHECK(geometric_terms(0.25).work_growth == 0);
  CHECK(polynomial_terms(2).variance_decay == 4);
  CHECK(polynomial_terms(2).decay == Decay::polynomial);
  for (const double ratio : {1.0, -1.0, 1.5, std::nan("")}) {
    CHECK_THROWS_AS(geometric_terms(ratio), std::invalid_argument);
  }
  for (const double s : {0.0, -1.0, std::nan("")}) CHECK_THROWS_AS(polynomial_terms(s), std::invalid_argument);
  CHECK(pmf_exists(polynomial_terms(1.01)));
  CHECK_FALSE(pmf_exists(polynomial_terms(1)));
}

TEST_CASE("a random term is the same number on every way to it", "[series][exact]") {
  const auto s = series(noisy_halves, geometric_terms(0.5));
  for (std::uint64_t i = 0; i < 20; ++i) {
    Stream rng(11, i);
    auto cursor = s(rng);
    double partial = 0;
    for (std::int64_t k = 0; k <= 20; ++k) {
      const double term = cursor().value;
      partial += term;
      CHECK(s.difference_at(k, rng).value == term);
      CHECK(s(k, rng).difference == term);
      CHECK(s(k, rng).value == partial);
      CHECK(s.value_at(k, rng).value == partial);
      Stream used(11, i);  // nor does it matter what else was drawn
      for (std::int64_t n = 0; n < k; ++n) used.uniform();
      CHECK(s.difference_at(k, used).value == term);
    }
  }
}

TEST_CASE("random terms have the means of the series, and are independent of each other", "[series][statistical]") {
  const auto s = series(noisy_halves, geometric_terms(0.5));
  CHECK(sequence_laws(s, terms_up_to(10)) == Failures{});

  const auto covariance_z = [](const auto& draw_pair) {
    std::vector<double> products;
    for (std::uint64_t i = 0; i < 20000; ++i) products.push_back(draw_pair(Stream(3, i)));
    const Moments m = Moments::of(products);
    return std::abs(m.mean / m.standard_error());
  };
  CHECK(covariance_z([&s](const Stream& rng) {
          return (s.difference_at(0, rng).value - 1) * (s.difference_at(1, rng).value - 0.5);
        }) < 4.5);
  // terms that draw from copies of one stream are not
  CHECK(covariance_z([](const Stream& rng) {
          Stream one(rng);
          Stream two(rng);
          return (noisy_halves(0, one) - 1) * (noisy_halves(1, two) - 0.5);
        }) > 4.5);
}

TEST_CASE("a difference with another sign, or of another level, is seen", "[series][law]") {
  const auto s = series(noisy_halves);
  const auto swapped = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference = -d.difference;
    return d;
  };
  const auto shifted = [&s](std::int64_t k, Stream& rng) {
    Draw<double> d = s(k, rng);
    if (k > 0) d.difference = s.difference_at(k + 1, rng).value;
    return d;
  };
  CHECK(sequence_laws(s) == Failures{});
  CHECK(sequence_laws(swapped) != Failures{});
  CHECK(sequence_laws(shifted) != Failures{});
}

TEST_CASE("the levels along a path agree with the levels of the series itself", "[series][exact]") {
  const auto s = series(noisy_halves, geometric_terms(0.5));
  const auto levels = levels_of(s);
  for (std::int64_t k = 0; k <= 12; ++k) {
    Stream rng(5, 1);
    const Draw<double> own = s(k, rng);
    const Draw<double> adapted = levels(k, rng);
    CHECK(own.value == adapted.value);
    CHECK(own.difference == adapted.difference);
    CHECK(own.work == adapted.work);
  }
}

TEST_CASE("paired terms are the sums of neighbours, for twice the work", "[series][exact]") {
  const auto s = series(leibniz, polynomial_terms(1));
  const auto pairs = paired(s);
  for (std::int64_t k = 0; k <= 60; ++k) {
    const double n = 4 * static_cast<double>(k);
    CHECK(pairs.difference_at(k, unused).value == Approx(8 / ((n + 1) * (n + 3))).epsilon(1e-13));
    CHECK(pairs.difference_at(k, unused).value ==
          s.difference_at(2 * k, unused).value + s.difference_at(2 * k + 1, unused).value);
    CHECK(pairs.value_at(k, unused).value == Approx(s.value_at(2 * k + 1, unused).value).epsilon(1e-14));
    CHECK(pairs.difference_at(k, unused).work == 2);
    CHECK(pairs(k, unused).work == 2 * static_cast<double>(k + 1));
  }
  CHECK(sum_of(pairs, 1000000) == Approx(pi - 5e-7).epsilon(1e-12));
}

TEST_CASE("pairing an alternating series of terms like 1/k makes a PMF possible", "[series][law]") {
  const auto s = series(leibniz, polynomial_terms(1));
  const auto pairs = paired(s);
  CHECK_FALSE(pmf_exists(s.rates));
  CHECK(pmf_exists(pairs.rates));
  SequenceLawOptions far = terms_up_to(60);
  far.rates_from = 30;
  far.samples = 64;  // nothing is random
  CHECK(sequence_laws(s, far) == Failures{});
  CHECK(sequence_laws(pairs, far) == Failures{});
  // the rates of the terms are not those of the pairs
  CHECK(sequence_laws(RatedSeries(pairs.terms(), s.rates), far) != Failures{});

  const auto alternating = paired(series([](std::int64_t k) { return power(-0.5, k); }, geometric_terms(-0.5)));
  CHECK(alternating.rates.variance_decay == 4);
  CHECK(sequence_laws(alternating, terms_up_to(8)) == Failures{});
  CHECK(paired(series(factorials, factorial_terms)).rates.variance_decay == Rates::faster_than_any);
}

TEST_CASE("the noise of random terms does not cancel in pairs", "[series][law]") {
  const auto noisy = [](std::int64_t k, Stream& rng) { return leibniz(k) * (0.5 + rng.uniform()); };
  const auto s = series(noisy, polynomial_terms(1));
  const auto pairs = paired(s);
  CHECK(pairs.rates.variance_decay == 2);
  SequenceLawOptions far = terms_up_to(24);
  far.rates_from = 8;
  CHECK(sequence_laws(pairs, far) == Failures{});
  CHECK(sequence_laws(RatedSeries(pairs.terms(), polynomial_terms(2)), far) != Failures{});
  for (std::int64_t k = 0; k <= 10; ++k) {
    Stream rng(4, 2);
    auto cursor = pairs(rng);
    for (std::int64_t n = 0; n < k; ++n) cursor();
    CHECK(cursor().value == pairs.difference_at(k, rng).value);
  }
}

TEST_CASE("a pair beyond the last countable term throws", "[series][exact]") {
  const auto pairs = paired(series(leibniz));
  const std::int64_t last = std::numeric_limits<std::int64_t>::max();
  CHECK_NOTHROW(pairs.difference_at(last / 2, unused));
  CHECK_THROWS_AS(pairs.difference_at(last / 2 + 1, unused), std::length_error);
  CHECK(series(squares).difference_at(last - 1, unused).value == Approx(0x1p-126));
}

TEST_CASE("terms may be vectors", "[series][exact]") {
  const auto s = series([](std::int64_t k) { return Eigen::Array2d(halves(k), squares(k)); });
  const Draw<Eigen::Array2d> draw = s(3, unused);
  CHECK(draw.value[0] == 1.875);
  CHECK(draw.value[1] == Approx(1 + 0.25 + 1.0 / 9 + 0.0625));
  CHECK(draw.difference[1] == 0.0625);
  CHECK(sequence_laws(s) == Failures{});
  CHECK(paired(s).difference_at(1, unused).value[0] == 0.375);
}

TEST_CASE("a series is levels and terms at once, with rates only if they were declared", "[series][compile]") {
  using Plain = decltype(series(halves));
  using Rated = decltype(series(halves, geometric_terms(0.5)));
  using Random = decltype(series(noisy_halves));
  STATIC_REQUIRE(BiasedSequence<Plain>);
  STATIC_REQUIRE(TermSequence<Plain>);
  STATIC_REQUIRE(OffersDifferenceAt<Plain>);
  STATIC_REQUIRE(OffersValueAt<Plain>);
  STATIC_REQUIRE_FALSE(DeclaresRates<Plain>);
  STATIC_REQUIRE(DeclaresRates<Rated>);
  STATIC_REQUIRE(TermSequence<Rated>);
  STATIC_REQUIRE(BiasedSequence<Random>);
  STATIC_REQUIRE(TermSequence<Random>);
  STATIC_REQUIRE(BiasedSequence<decltype(paired(series(noisy_halves)))>);
  STATIC_REQUIRE_FALSE(DeclaresRates<decltype(paired(series(halves)))>);
  STATIC_REQUIRE(DeclaresRates<decltype(paired(series(halves, geometric_terms(0.5))))>);
}

TEST_CASE("dyadic blocks hold the terms 2^(k-1) ... 2^k - 1, for as much work", "[series][exact]") {
  const auto s = blocks(series(squares, polynomial_terms(2)));
  std::int64_t first = 0;
  for (std::int64_t k = 0; k <= 12; ++k) {
    const std::int64_t end = std::int64_t{1} << k;
    double block = 0;
    for (std::int64_t i = first; i < end; ++i) block += squares(i);
    CHECK(s.difference_at(k, unused).value == Approx(block).epsilon(1e-13));
    CHECK(s.difference_at(k, unused).work == static_cast<double>(end - first));
    CHECK(s.value_at(k, unused).value == Approx(series(squares).value_at(end - 1, unused).value).epsilon(1e-13));
    CHECK(s.value_at(k, unused).work == static_cast<double>(end));
    CHECK(s(k, unused).difference == s.difference_at(k, unused).value);
    first = end;
  }
  CHECK_THROWS_AS(s.difference_at(63, unused), std::length_error);
  CHECK(sequence_laws(s, {.last = 10, .rates_from = 4}) == Failures{});
  CHECK(sequence_laws(blocks(series(noisy_halves, geometric_terms(0.5))), {.last = 4}) == Failures{});
  CHECK(sequence_laws(blocks(series(squares), {4, 1}), {.last = 10, .rates_from = 4}) != Failures{});
}

TEST_CASE("unit blocks of a polynomial decay under a geometric PMF have infinite variance, dyadic ones have not",
          "[series][statistical]") {
  const auto units = series(squares, polynomial_terms(2));
  const auto dyadic = blocks(units);
  const TailExponent geometric = Geometric::with_exponent(1.5).tail_exponent();
  // from the declared rates, and from measured ones
  CHECK_FALSE(judge(units.rates, geometric).finite_variance);
  CHECK(judge(dyadic.rates, geometric).finite_variance);
  CHECK(judge(dyadic.rates, geometric).finite_work);
  const Survey seen_units = survey(units, 24, {.samples = 64, .threads = 1});
  const Survey seen_blocks = survey(dyadic, 14, {.samples = 64, .threads = 1});
  INFO(seen_units << seen_blocks);
  CHECK(seen_units.rates.kind == RateKind::polynomial);
  CHECK(std::abs(seen_units.rates.variance_decay.value - 4) < 0.15);
  CHECK(judge(seen_units.rates, geometric).variance == Finiteness::infinite);
  CHECK(seen_blocks.rates.kind == RateKind::geometric);
  CHECK(std::abs(seen_blocks.rates.variance_decay.value - 2) < 0.15);
  CHECK(judge(seen_blocks.rates, geometric).variance == Finiteness::finite);
  // both are unbiased under a PMF of their own
  const double truth = pi * pi / 6;
  const auto by_units = estimate(single_term(units, Zeta(2.0)), {.samples = 1 << 14});
  const auto by_blocks = estimate(single_term(dyadic), {.samples = 1 << 14});
  CHECK(std::abs(by_units.mean - truth) < 4.5 * by_units.standard_error);
  CHECK(std::abs(by_blocks.mean - truth) < 4.5 * by_blocks.standard_error);
}

TEST_CASE("D14: truncation of the path depth, debiased by roulette, is classical Russian roulette",
          "[series][statistical]") {
  // A light path in a furnace whose walls emit: the albedo is 0.8 everywhere, the emission depends on where
  // it is.
  constexpr double albedo = 0.8;
  struct Vertex {
    double position;
    double throughput;
  };
  const auto emission = [](double position) { return 2 * position; };  // 1 on average
  const auto start = [](Stream& rng) { return Vertex{rng.uniform(), 1}; };
  const auto bounce = [](const Vertex& v, Stream& rng) { return Vertex{rng.uniform(), albedo * v.throughput}; };
  const auto radiance = [&emission](const Vertex& v) { return v.throughput * emission(v.position); };
  const auto path = path_series(start, bounce, radiance, geometric_terms(albedo));
  const Geometric survival(1 - albedo);
  const auto debiased = roulette(path, survival);

  for (std::uint64_t i = 0; i < 1000; ++i) {
    const Stream sample(6, i);
    Stream one(sample);
    NullRecord unused_record;
    const double value = debiased(one, unused_record).value;
    // the loop of a path tracer: go on with probability albedo, by which the throughput is divided
    Stream decisions = split(sample, Branch::pmf);
    Stream vertices = split_level(sample, 0);
    const double u = decisions.uniform();
    double classical = emission(vertices.uniform());
    double alive = albedo;
    while (u < alive) {  // one number decides all steps: the k-th is survived where u < albedo^k
      classical += emission(vertices.uniform());
      alive *= albedo;
    }
    CHECK(value == Approx(classical).epsilon(1e-12));
  }
  const auto r = estimate(debiased, {.samples = 1 << 16});
  CHECK(std::abs(r.mean - 5) < 4.5 * r.standard_error);
  // classical roulette: N + 1 emissions of mean 1, variance 1/3; var = E(N + 1) / 3 + Var N
  CHECK(r.moments.variance() == Approx(5.0 / 3 + 20).epsilon(0.05));
  // maximal depth 5 alone is biased by albedo^6 / (1 - albedo)
  const auto cut = estimate(truncated(levels_of(path), 5), {.samples = 1 << 16});
  CHECK(std::abs(cut.mean - 5 + std::pow(albedo, 6) * 5) < 4.5 * cut.standard_error);
}

TEST_CASE("a deterministic prefix before the random tail leaves the mean and takes the variance",
          "[series][statistical]") {
  const auto s = series([](std::int64_t k) { return power(0.8, k); }, geometric_terms(0.8));
  const auto plain = estimate(roulette(s), {.samples = 1 << 14});
  const auto prefixed = estimate(roulette(s, {.base_level = 10}), {.samples = 1 << 14});
  CHECK(std::abs(plain.mean - 5) < 4.5 * plain.standard_error);
  CHECK(std::abs(prefixed.mean - 5) < 4.5 * prefixed.standard_error);
  // the tail is the series itself times 0.8^11, but for its first term
  CHECK(prefixed.moments.variance() == Approx(plain.moments.variance() * power(0.64, 10)).epsilon(0.1));
  CHECK(prefixed.work_per_sample() == Approx(plain.work_per_sample() + 10).epsilon(0.02));
}

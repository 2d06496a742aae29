#include <cmath>
#include <complex>
#include <cstdint>

#include "catch_shim.hpp"

#include <debias/core/estimator.hpp>
#include <debias/core/sequence.hpp>

using namespace debias;

namespace {

struct Plain {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    return {static_cast<double>(level) + rng.uniform(), 0.5, 3};
  }
};

struct WithShortcuts : Plain {
  Term<double> value_at(std::int64_t level, Stream&) const { return {100.0 + static_cast<double>(level), 1}; }
  Term<double> difference_at(std::int64_t level, Stream&) const { return {-static_cast<double>(level), 2}; }
  SharedDraw<double> shared(std::int64_t, std::int64_t, Stream&) const { return {1, 2, 3}; }
  static constexpr Rates rates{2, 1};
};

/// 1, 1/2, 1/4, ... with one uniform for the whole path, and work k + 1 for term k.
struct Halves {
  auto operator()(Stream& rng) const {
    return [scale = rng.uniform(), k = 0]() mutable {
      const double term = std::ldexp(scale, -k);
      ++k;
      return Term<double>{term, static_cast<double>(k)};
    };
  }
};

struct RatedHalves : Halves {
  static constexpr Rates rates{2, 0};
};

struct RatedSquares : Halves {  // a declaration is all that counts here
  static constexpr Rates rates{4, 0, Decay::polynomial};
};

}  // namespace

TEST_CASE("a const callable of level and stream that returns a Draw is a sequence, a lambda too",
          "[core][sequence][compile]") {
  const auto lambda = [](int level, Stream& rng) { return base(rng.uniform() + level); };
  const auto by_int64 = [](std::int64_t, Stream&) { return base(1.0); };
  const auto complex_valued = [](std::int64_t, Stream&) { return base(std::complex<double>(1, 2)); };
  STATIC_REQUIRE(BiasedSequence<decltype(lambda)>);
  STATIC_REQUIRE(BiasedSequence<decltype(by_int64)>);
  STATIC_REQUIRE(BiasedSequence<decltype(complex_valued)>);
  STATIC_REQUIRE(BiasedSequence<Plain>);
  STATIC_REQUIRE(std::same_as<sequence_value_t<decltype(complex_valued)>, std::complex<double>>);
  STATIC_REQUIRE(std::same_as<sequence_value_t<Halves>, double>);
}

TEST_CASE("a mutable callable, one that copies its stream, or one that returns something else, is no sequence",
          "[core][sequence][compile]") {
  auto counting = [n = 0](std::int64_t, Stream&) mutable { return base(static_cast<double>(++n)); };
  auto number = [](std::int64_t, Stream&) { return 1.0; };
  auto no_stream = [](std::int64_t) { return base(1.0); };
  auto by_value = [](std::int64_t, Stream) { return base(1.0); };
  auto any_by_value = [](auto, auto rng) { return base(rng.uniform()); };
  auto changes_level = [](std::int64_t& level, Stream&) { return base(static_cast<double>(++level)); };
  STATIC_REQUIRE_FALSE(BiasedSequence<decltype(counting)>);
  STATIC_REQUIRE_FALSE(BiasedSequence<decltype(number)>);
  STATIC_REQUIRE_FALSE(BiasedSequence<decltype(no_stream)>);
  STATIC_REQUIRE_FALSE(BiasedSequence<decltype(by_value)>);
  STATIC_REQUIRE_FALSE(BiasedSequence<decltype(any_by_value)>);
  STATIC_REQUIRE_FALSE(BiasedSequence<decltype(changes_level)>);
  auto counting_terms = [n = 0](Stream&) mutable { return [m = ++n] { return Term<double>{static_cast<double>(m)}; }; };
  auto terms_by_value = [](auto rng) { return [u = rng.uniform()] { return Term<double>{u}; }; };
  STATIC_REQUIRE_FALSE(TermSequence<decltype(counting_terms)>);
  STATIC_REQUIRE_FALSE(TermSequence<decltype(terms_by_value)>);
  STATIC_REQUIRE(TermSequence<Halves>);
  STATIC_REQUIRE_FALSE(TermSequence<Plain>);
  STATIC_REQUIRE_FALSE(BiasedSequence<Halves>);
}

TEST_CASE("a random variable is a const callable of a stream that returns a value", "[core][sequence][compile]") {
  const auto x = [](Stream& rng) { return rng.uniform(); };
  auto counting = [n = 0](Stream&) mutable { return static_cast<double>(++n); };
  const auto integer = [](Stream&) { return 1; };
  const auto by_value = [](Stream rng) { return rng.uniform(); };
  const auto any_by_value = [](auto rng) { return rng.uniform(); };
  const auto records_by_value = [](Stream rng, auto&) { return Sample<double>{rng.uniform()}; };
  STATIC_REQUIRE(RandomVariable<decltype(x)>);
  STATIC_REQUIRE(std::same_as<draw_t<decltype(x)>, double>);
  STATIC_REQUIRE_FALSE(RandomVariable<decltype(counting)>);
  STATIC_REQUIRE_FALSE(RandomVariable<decltype(integer)>);
  STATIC_REQUIRE_FALSE(RandomVariable<decltype(by_value)>);
  STATIC_REQUIRE_FALSE(RandomVariable<decltype(any_by_value)>);
  STATIC_REQUIRE_FALSE(Estimator<decltype(by_value)>);
  STATIC_REQUIRE_FALSE(Estimator<decltype(any_by_value)>);
  STATIC_REQUIRE_FALSE(Estimator<decltype(records_by_value)>);
  STATIC_REQUIRE(Estimator<decltype(x)>);
  STATIC_REQUIRE_FALSE(Estimator<decltype(counting)>);
}

TEST_CASE("optional members are found by their signatures", "[core][sequence][compile]") {
  STATIC_REQUIRE(OffersValueAt<WithShortcuts>);
  STATIC_REQUIRE(OffersDifferenceAt<WithShortcuts>);
  STATIC_REQUIRE(OffersSharedBase<WithShortcuts>);
  STATIC_REQUIRE(DeclaresRates<WithShortcuts>);
  STATIC_REQUIRE_FALSE(OffersValueAt<Plain>);
  STATIC_REQUIRE_FALSE(OffersDifferenceAt<Plain>);
  STATIC_REQUIRE_FALSE(OffersSharedBase<Plain>);
  STATIC_REQUIRE_FALSE(DeclaresRates<Plain>);
}

TEST_CASE("base and coupled keep the signs", "[core][sequence][exact]") {
  const Draw<double> b = base(3.0, 7);
  CHECK(b.value == 3);
  CHECK(b.difference == 3);
  CHECK(b.work == 7);
  const Draw<double> c = coupled(5.0, 3.0, 2);
  CHECK(c.value == 5);
  CHECK(c.difference == 2);
  CHECK(c.work == 2);
  CHECK(base(1.0).work == 1);
}

TEST_CASE("value_of and difference_of take the shortcut that a sequence offers", "[core][sequence][exact]") {
  Stream one(1, 0);
  Stream two(1, 0);
  const auto value = value_of(Plain{}, 4, one);
  CHECK(value.value == 4 + two.uniform());
  CHECK(value.work == 3);
  CHECK(difference_of(Plain{}, 4, one).value == 0.5);
  CHECK(difference_of(Plain{}, 4, one).work == 3);
  CHECK(value_of(WithShortcuts{}, 4, one).value == 104);
  CHECK(value_of(WithShortcuts{}, 4, one).work == 1);
  CHECK(difference_of(WithShortcuts{}, 4, one).value == -4);
  CHECK(difference_of(WithShortcuts{}, 4, one).work == 2);
}

TEST_CASE("levels_of sums the terms of one path and pays for all of them", "[core][sequence][exact]") {
  const auto levels = levels_of(Halves{});
  STATIC_REQUIRE(BiasedSequence<decltype(levels)>);
  STATIC_REQUIRE_FALSE(DeclaresRates<decltype(levels)>);
  for (std::int64_t k = 0; k < 6; ++k) {
    Stream rng(8, 1);
    Stream copy(rng);
    const double scale = copy.uniform();
    const Draw<double> draw = levels(k, rng);
    const double unit = std::ldexp(1.0, -static_cast<int>(k));
    CHECK(draw.difference == scale * unit);
    CHECK(std::abs(draw.value - scale * (2 - unit)) < 1e-15);
    CHECK(draw.work == static_cast<double>((k + 1) * (k + 2) / 2));
  }
  Stream rng(8, 1);
  const Draw<double> first = levels(0, rng);
  CHECK(first.value == first.difference);
}

TEST_CASE("levels_of declares the rates of the terms, the walk counted where the decay is polynomial",
          "[core][sequence][exact]") {
  const auto geometric = levels_of(RatedHalves{});
  STATIC_REQUIRE(DeclaresRates<decltype(geometric)>);
  CHECK(geometric.rates.variance_decay == 2);
  CHECK(geometric.rates.work_growth == 0);
  CHECK(geometric.rates.decay == Decay::geometric);
  const auto polynomial = levels_of(RatedSquares{});
  CHECK(polynomial.rates.variance_decay == 4);
  CHECK(polynomial.rates.work_growth == 1);
  CHECK(polynomial.rates.decay == Decay::polynomial);
}

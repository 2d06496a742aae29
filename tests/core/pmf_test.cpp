#include <debias/core/pmf.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include "catch_shim.hpp"
#include "laws/pmf_laws.hpp"

namespace {

/// P(J >= j) = 2^-j, written by hand. Each PMF below goes wrong in one place.
struct Half {
  double mass(std::int64_t j) const { return std::ldexp(0.5, -static_cast<int>(j)); }
  double tail(std::int64_t j) const { return j > 1100 ? 0.0 : std::ldexp(1.0, -static_cast<int>(j)); }
  std::int64_t sample(double u) const {
    return debias::invert_tail([this](std::int64_t j) { return tail(j); }, u, 3);
  }
};

struct MassOfTheNextLevel : Half {
  double mass(std::int64_t j) const { return Half::mass(j + 1); }
};
struct MassesOnly1PerMilleTooLarge : Half {
  double mass(std::int64_t j) const { return 1.001 * Half::mass(j); }
};
struct NotNormalised : Half {
  double mass(std::int64_t j) const { return 1.001 * Half::mass(j); }
  double tail(std::int64_t j) const { return 1.001 * Half::tail(j); }
};
struct TailByComplement : Half {  // loses deep levels to cancellation
  double tail(std::int64_t j) const {
    double cdf = 0;
    for (std::int64_t i = 0; i < j; ++i) cdf += mass(i) * (1 + 1e-16);
    return 1 - cdf * (1 - 1e-16);
  }
};
struct TailAbove : Half {  // P(J > j)
  double tail(std::int64_t j) const { return Half::tail(j + 1); }
};
struct SampleOneTooDeep : Half {
  std::int64_t sample(double u) const { return Half::sample(u) + 1; }
};
struct SampleByTheOtherEnd : Half {  // the right frequencies, but deep levels at large u
  std::int64_t sample(double u) const { return Half::sample(1 - u); }
};
struct SampleOfTheCumulative : Half {  // inverts P(J <= j) where the PMF has P(J >= j)
  std::int64_t sample(double u) const {
    std::int64_t j = 0;
    while (u > tail(j + 1) && j < 60) ++j;
    return j;
  }
};
struct SampleWithStrictInequality : Half {  // wrong only on the jumps themselves
  std::int64_t sample(double u) const {
    const std::int64_t j = Half::sample(u);
    return j > 0 && u == tail(j) ? j - 1 : j;
  }
};
struct SampleCapped : Half {  // wrong for one uniform in 2^40
  std::int64_t sample(double u) const { return std::min<std::int64_t>(Half::sample(u), 40); }
};
struct SampleOfAnotherRate : Half {
  std::int64_t sample(double u) const { return Half::sample(std::pow(u, 1.02)); }
};

struct NoTail {
  double mass(std::int64_t) const { return 0.5; }
  std::int64_t sample(double) const { return 0; }
};
struct SamplesAStream : Half {
  std::int64_t sample(debias::Stream& rng) const { return Half::sample(rng.uniform()); }
};

static_assert(debias::Pmf<Half>);
static_assert(!debias::DescribedPmf<Half>);
static_assert(!debias::Pmf<NoTail>);
static_assert(!debias::Pmf<SamplesAStream>);

template <class P>
bool fails(const std::string& kind) {
  return debias::laws::names(debias::laws::pmf_laws(P{}), kind);
}

}  // namespace

TEST_CASE("The law suite accepts a right PMF", "[core][law]") {
  CHECK(debias::laws::pmf_laws(Half{}) == debias::laws::Failures{});
}

TEST_CASE("The law suite rejects each wrong PMF by the claim that it breaks", "[core][law]") {
  CHECK(fails<MassOfTheNextLevel>("masses"));
  CHECK(fails<MassOfTheNextLevel>("frequencies"));
  CHECK(fails<MassesOnly1PerMilleTooLarge>("masses"));
  CHECK(fails<NotNormalised>("masses"));
  CHECK(fails<TailByComplement>("masses"));
  CHECK(fails<TailAbove>("masses"));
  CHECK(fails<TailAbove>("inverse"));
  CHECK(fails<SampleOneTooDeep>("inverse"));
  CHECK(fails<SampleOneTooDeep>("frequencies"));
  CHECK(fails<SampleByTheOtherEnd>("inverse"));
  CHECK(fails<SampleOfTheCumulative>("inverse"));
  CHECK(fails<SampleOfTheCumulative>("frequencies"));
  CHECK(fails<SampleWithStrictInequality>("inverse"));
  CHECK(fails<SampleCapped>("inverse"));
  CHECK(fails<SampleOfAnotherRate>("inverse"));
  CHECK(fails<SampleOfAnotherRate>("frequencies"));
}

TEST_CASE("A tail is inverted from any guess", "[core][exact]") {
  const auto tail = [](std::int64_t j) { return 1.0 / static_cast<double>(j + 1); };
  for (const std::int64_t guess : {-5, 0, 3, 9, 10, 1000}) {
    CAPTURE(guess);
    CHECK(debias::invert_tail(tail, 0.1, guess) == 9);  // u <= tail(9) = 0.1
    CHECK(debias::invert_tail(tail, std::nextafter(0.1, 1.0), guess) == 8);
    CHECK(debias::invert_tail(tail, 1.0, guess) == 0);
  }
}

TEST_CASE("A weight of a probability that underflowed is refused with level and probability", "[core][exact]") {
  constexpr double smallest = std::numeric_limits<double>::min();
  CHECK(debias::inverse_weight(0.25, 3) == 4.0);
  CHECK(std::isfinite(debias::inverse_weight(smallest, 1022)));
  CHECK_THROWS_AS(debias::inverse_weight(0.0, 7), std::length_error);
  CHECK_THROWS_AS(debias::inverse_weight(std::numeric_limits<double>::quiet_NaN(), 7), std::length_error);
  CHECK_THROWS_WITH(debias::inverse_weight(smallest / 2, 1023),
                    Catch::Contains("level 1023") && Catch::Contains("1.1125369292536007e-308"));
}

#include "laws/sequence_laws.hpp"

#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <string>

#include "catch_shim.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

/// I_k = 1 - 2^-k plus noise of the same size at all levels, D_k with noise 2^-k; and what may be broken.
struct Toy {
  double scale = 1;         // of D_k
  double work_of_draw = 1;  // must be positive
  double value_shift = 0;   // of value_at
  double base_shift = 0;    // of shared
  bool base_differs = false;
  Rates rates{2, 0};

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double unit = std::ldexp(1.0, -static_cast<int>(level));
    const double u = rng.uniform();
    const double fine = u * (2 - 2 * unit);
    if (level == 0) return {fine, base_differs ? 1.0 : fine, work_of_draw};
    return {fine, scale * u * 2 * unit, work_of_draw};
  }
  Term<double> value_at(std::int64_t level, Stream& rng) const {
    return {(*this)(level, rng).value + value_shift, work_of_draw};
  }
  Term<double> difference_at(std::int64_t level, Stream& rng) const {
    return {(*this)(level, rng).difference, work_of_draw};
  }
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    Stream other = rng.split(1);
    return {(*this)(base_level, other).value + base_shift, (*this)(level, rng).difference, work_of_draw};
  }
};

/// Deterministic, D_k = 2^(-k^2), with any declaration.
struct Steep {
  Rates rates{Rates::faster_than_any, 0};
  Draw<double> operator()(std::int64_t level, Stream&) const {
    double sum = 1;
    double term = 1;
    for (std::int64_t k = 1; k <= level; ++k) sum += term = std::exp2(-static_cast<double>(k * k));
    return {sum, term, 1};
  }
};

/// Deterministic, D_k = k^-2, work k + 1.
struct InverseSquares {
  Rates rates{4, 1, Decay::polynomial};
  Draw<double> operator()(std::int64_t level, Stream&) const {
    double sum = 0;
    double term = 0;
    for (std::int64_t k = 1; k <= level; ++k) sum += term = 1 / static_cast<double>(k * k);
    return {sum, term, static_cast<double>(level + 1)};
  }
};

}  // namespace

TEST_CASE("the sequence laws accept right sequences, random and deterministic", "[sequence_laws][law]") {
  CHECK(sequence_laws(Toy{}) == Failures{});
  CHECK(sequence_laws(Steep{}, {.last = 8}) == Failures{});
  CHECK(sequence_laws(InverseSquares{}, {.last = 40, .rates_from = 20}) == Failures{});
  const auto constant = [](std::int64_t k, Stream&) { return k == 0 ? base(2.0) : coupled(2.0, 2.0); };
  CHECK(sequence_laws(constant, {.samples = 4}) == Failures{});
}

TEST_CASE("the sequence laws name what is broken", "[sequence_laws][law]") {
  const auto breaks = [](const auto& s, const std::string& pmf, const laws::SequenceLawOptions& options = {}) {
    const Failures failures = sequence_laws(s, options);
    CAPTURE(failures, pmf);
    bool named = false;
    for (const std::string& failure : failures) named = named || failure.find(pmf) != std::string::npos;
    CHECK(named);
  };
  breaks(Toy{.scale = 1.5}, "E I_1 = E I_0 + E D_1");
  breaks(Toy{.scale = std::nan("")}, "E I_1 = E I_0 + E D_1");
  breaks(Toy{.work_of_draw = 0}, "work is not positive");
  breaks(Toy{.work_of_draw = std::numeric_limits<double>::infinity()}, "work is not positive");
  breaks(Toy{.value_shift = 0.1}, "E value_at(3)");
  breaks(Toy{.base_shift = 0.1}, "E base of shared(2, 1)");
  breaks(Toy{.base_differs = true}, "the difference is not the value");
  breaks(Toy{.rates = {1.5, 0}}, "E D_k^2");
  breaks(Toy{.rates = {2.5, 0}}, "E D_k^2");
  breaks(Toy{.rates = {2, 1}}, "work has exponent");
  breaks(Toy{.rates = {Rates::faster_than_any, 0}}, "does not accelerate");
  breaks(InverseSquares{{4, 1}}, "E D_k^2", {.last = 40, .rates_from = 20});
  breaks(InverseSquares{{3, 1, Decay::polynomial}}, "E D_k^2", {.last = 40, .rates_from = 20});

  const auto every_level_a_base = [](std::int64_t, Stream&) { return base(1.0); };
  breaks(every_level_a_base, "E I_1 = E I_0 + E D_1", {.samples = 4});

  double count = 0;
  const auto remembers = [&count](std::int64_t, Stream&) { return base(count += 1); };
  breaks(remembers, "gives other bits");
  const auto draws_more_each_time = [&count](std::int64_t, Stream& rng) {
    count += 1;
    for (double i = 0; i < count; ++i) rng.bits();
    return base(1.0);
  };
  breaks(draws_more_each_time, "another number of random numbers", {.last = 1, .samples = 2});

  const auto second_component = [](std::int64_t k, Stream& rng) {
    const std::complex<double> v(rng.uniform(), k == 0 ? 0.0 : 1.0);
    return k == 0 ? base(v) : Draw<std::complex<double>>{v, {0.0, 0.0}};
  };
  breaks(second_component, "in component 1");
}

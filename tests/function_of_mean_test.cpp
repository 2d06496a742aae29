#include <debias/function_of_mean.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include <Eigen/Core>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/functions.hpp>
#include <debias/survey.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

namespace {

const auto exponential = [](Stream& rng) { return rng.exponential(); };
const auto uniform = [](Stream& rng) { return rng.uniform(); };
const auto twice = [](double x) { return 2 * x; };
const auto wave = [](double x) { return 1 + std::sin(2 * std::numbers::pi * x); };

/// |tau - 1|, with its gap.
struct DistanceToOne {
  double operator()(double m) const { return std::abs(m - 1); }
  double gap(double m, double d) const { return functions::Absolute{}.gap(m - 1, d); }
};

/// g without its gap.
template <class G>
auto plain(const G& g) {
  return [g](double m) { return g(m); };
}

struct LevelMoments {
  double mean;
  double square;
};

/// The largest |z| of E D_k and E D_k^2, levels `first` ... `last` of a survey, against closed forms.
double worst_z(const Survey& survey, const std::function<LevelMoments(std::int64_t)>& exact, std::size_t first = 1,
               std::size_t last = 6) {
  double worst = 0;
  for (std::size_t k = first; k <= last; ++k) {
    const SurveyRow& row = survey.rows.at(k);
    const LevelMoments truth = exact(row.level);
    worst = std::max({worst, std::abs(row.difference - truth.mean) / row.difference_error,
                      std::abs(row.second_moment - truth.square) / row.second_moment_error});
  }
  return worst;
}

LevelMoments square_of_exponential(std::int64_t level) {  // A10
  const double n = std::ldexp(1.0, static_cast<int>(level) - 1);
  return {-1 / (2 * n), 0.75 * (n + 1) / (n * n * n)};
}

LevelMoments linear_medium(std::int64_t level) {  // B02
  const double n = std::ldexp(1.0, static_cast<int>(level));
  const double f = -2 * std::sinh(0.5 / n) * std::sinh(0.5 / n);  // 1 - cosh(1 / n)
  return {std::exp(-1) * f * n * std::sinh(1 / n), std::exp(-2) * f * f * 0.5 * n * std::sinh(2 / n)};
}

LevelMoments kink_on_a_comb(std::int64_t level) {  // B18
  const double n = std::ldexp(1.0, static_cast<int>(level));
  return {-1 / (2 * n), 1 / (3 * n * n)};
}

}  // namespace

TEST_CASE("a survey finds the closed-form mean and second moment of the differences of each level",
          "[function_of_mean][statistical]") {
  const auto a10 = survey(function_of_mean(exponential, functions::Square{}), 7, {.samples = 60000});
  const auto b02 = survey(function_of_integral(twice, functions::ExpMinus{}), 7, {.samples = 20000});
  const auto b02_plain = survey(function_of_integral(twice, plain(functions::ExpMinus{})), 7, {.samples = 20000});
  const auto b04 = survey(function_of_integral(wave, functions::ExpMinus{}), 2, {.samples = 100000});
  const auto b18 = survey(function_of_integral(twice, DistanceToOne{}, {.rates = {2, 1}}), 7, {.samples = 20000});
  const auto periodic = [](std::int64_t) { return LevelMoments{-0.097880166422198114906, 0.014570317808197142875}; };
  CHECK(worst_z(a10, square_of_exponential) < 4.5);
  CHECK(worst_z(b02, linear_medium) < 4.5);
  CHECK(worst_z(b02_plain, linear_medium) < 4.5);
  CHECK(worst_z(b04, periodic, 1, 1) < 4.5);
  CHECK(worst_z(b18, kink_on_a_comb) < 4.5);

  // Power check: the moments of another level, and second moments off by three times what can be seen, 4.5
  // standard errors: 30 % with draws (relative standard error 2 %), 5 % on the comb (below 1 %).
  const auto level_below = [](const auto& exact) { return [exact](std::int64_t k) { return exact(k - 1); }; };
  CHECK(worst_z(a10, level_below(square_of_exponential), 3, 3) > 4.5);
  CHECK(worst_z(b02, level_below(linear_medium), 3, 3) > 4.5);
  CHECK(worst_z(b18, level_below(kink_on_a_comb), 3, 3) > 4.5);
  const auto off = [](const auto& exact, double factor) {
    return [exact, factor](std::int64_t k) { return LevelMoments{exact(k).mean, factor * exact(k).square}; };
  };
  CHECK(worst_z(a10, off(square_of_exponential, 1.3), 3, 3) > 4.5);
  CHECK(worst_z(b02, off(linear_medium, 1.05), 3, 3) > 4.5);
  CHECK(worst_z(b04, off(periodic, 1.05), 1, 1) > 4.5);
}

TEST_CASE("doublings keep the laws of a sequence and their declared rates", "[function_of_mean][law]") {
  CHECK(sequence_laws(function_of_mean(uniform, functions::ExpMinus{})) == Failures{});
  CHECK(sequence_laws(function_of_mean(uniform, [](double m) { return std::exp(-m); })) == Failures{});
  CHECK(sequence_laws(function_of_mean(exponential, functions::Sqrt{})) == Failures{});
  CHECK(sequence_laws(function_of_integral(twice, functions::ExpMinus{}, {.to = 2})) == Failures{});
  CHECK(sequence_laws(function_of_integral([](double x) { return std::exp(x); }, functions::Davis{0.5},
                                           {.from = -1, .to = 1})) == Failures{});
  CHECK(sequence_laws(function_of_integral(twice, DistanceToOne{}, {.rates = {2, 1}})) == Failures{});
  // x^(-1/4), B15 with its singularity at the end: min(4 * 3/4, (3/4) / (1/4)) = 3, here with a logarithm
  CHECK(sequence_laws(
            function_of_integral([](double x) { return std::pow(x, -0.25); }, functions::ExpMinus{}, {.rates = {3, 1}}),
            {.last = 9, .rates_from = 4, .variance_tolerance = 0.4}) == Failures{});

  // Power check: rates that are half a power off.
  CHECK(sequence_laws(function_of_mean(uniform, functions::ExpMinus{}, {2.5, 1})) != Failures{});
  CHECK(sequence_laws(function_of_mean(uniform, functions::ExpMinus{}, {2, 0.5})) != Failures{});
  CHECK(sequence_laws(function_of_integral(twice, DistanceToOne{})) != Failures{});
}

TEST_CASE("a kink at the solution needs its own rates, independent draws {1, 1}", "[function_of_mean][law]") {
  const auto draw = [](Stream& rng) { return rng.normal() + 1; };
  CHECK(sequence_laws(function_of_mean(draw, DistanceToOne{}, {1, 1})) == Failures{});
  CHECK(sequence_laws(function_of_mean(draw, DistanceToOne{})) != Failures{});
}

// ---- deliberately wrong sequences

namespace {

/// A comb whose base is taken from one residue only.
struct OneResidue {
  std::int64_t residue;
  Rates rates{4, 1};

  Draw<double> operator()(std::int64_t level, Stream& rng) const { return right()(level, rng); }
  SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const {
    Stream replay(rng);
    SharedDraw<double> draw = right().shared(level, base_level, rng);
    const double offset = replay.uniform();
    const std::int64_t count = doubled_draws(level);
    const std::int64_t groups = doubled_draws(level - base_level);
    double total = 0;
    for (std::int64_t i = residue % groups; i < count; i += groups) {
      total += 2 * (static_cast<double>(i) + offset) / static_cast<double>(count);
    }
    draw.base = std::exp(-total / static_cast<double>(count / groups));
    return draw;
  }
  static auto right() -> decltype(function_of_integral(twice, functions::ExpMinus{})) {
    return function_of_integral(twice, functions::ExpMinus{});
  }
};

/// The coarse estimate from the even draws alone: unbiased, but the linear part of g no longer cancels.
struct OneHalf {
  Rates rates{2, 1};

  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    double even = 0;
    double odd = 0;
    const std::int64_t count = doubled_draws(level);
    for (std::int64_t i = 0; i < count; ++i) ((i & 1) == 0 ? even : odd) += rng.uniform();
    const double n = static_cast<double>(count);
    const double fine = std::exp(-(even + odd) / n);
    if (level == 0) return base(fine, n);
    return coupled(fine, std::exp(-2 * even / n), n);
  }
};

/// The halves are averaged before g: the coarse estimate is the fine one, and no bias is ever removed.
struct MeanOfHalves {
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    double total = 0;
    const std::int64_t count = doubled_draws(level);
    for (std::int64_t i = 0; i < count; ++i) total += rng.exponential();
    const double n = static_cast<double>(count);
    const double fine = total * total / (n * n);
    return level == 0 ? base(fine) : coupled(fine, fine, n);
  }
};

/// Coarse minus fine.
template <class S>
struct WrongSign {
  S right;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    Draw<double> draw = right(level, rng);
    if (level > 0) draw.difference = -draw.difference;
    return draw;
  }
};

}  // namespace

TEST_CASE("the laws reject one residue as base, one half as coarse, and a wrong sign", "[function_of_mean][law]") {
  CHECK(sequence_laws(OneResidue::right()) == Failures{});
  CHECK(sequence_laws(OneResidue{0}) != Failures{});
  CHECK(sequence_laws(OneResidue{1}) != Failures{});

  const Failures one_half = sequence_laws(OneHalf{});
  REQUIRE(one_half.size() == 1);  // its means are right: only the rate gives it away
  CHECK(one_half.front().rfind("E D_k^2", 0) == 0);

  CHECK(sequence_laws(MeanOfHalves{}) != Failures{});
  const auto right = function_of_mean(exponential, functions::Square{});
  CHECK(sequence_laws(right) == Failures{});
  CHECK(sequence_laws(WrongSign<decltype(right)>{right}) != Failures{});
}

TEST_CASE("the base level above a pole is the least whose halves have the moments", "[function_of_mean][exact]") {
  CHECK(base_level_for_pole(1) == 3);
  CHECK(base_level_for_pole(1, 2) == 2);
  CHECK(base_level_for_pole(1.5) == 3);
  CHECK(base_level_for_pole(0) == 0);          // a logarithm
  CHECK(base_level_for_pole(1, 4, 0.5) == 4);  // a density like 1 / sqrt(x)
  CHECK_THROWS_AS(base_level_for_pole(-1), std::invalid_argument);
  CHECK_THROWS_AS(base_level_for_pole(1, 0), std::invalid_argument);
  CHECK_THROWS_AS(base_level_for_pole(1, 4, std::nan("")), std::invalid_argument);

  // Means of n exponentials have a Gamma law: E (mean)^-q = n^q Gamma(n - q) / Gamma(n), finite for n > q
  // only. Below that base level the second moment of the differences is carried by a few samples, from it on
  // it is not.
  const auto s = function_of_mean(exponential, functions::Reciprocal{});
  const auto share_of_largest = [&s](std::int64_t level) {
    double total = 0;
    double largest = 0;
    for (std::uint64_t i = 0; i < 20000; ++i) {
      Stream rng(93, i);
      const double square = std::pow(s(level, rng).difference, 2);
      total += square;
      largest = std::max(largest, square);
    }
    return largest / total;
  };
  CHECK(share_of_largest(base_level_for_pole(1, 2)) > 0.1);
  CHECK(share_of_largest(base_level_for_pole(1) + 1) < 0.02);
}

TEST_CASE("the gap and the subtraction are the same difference", "[function_of_mean][exact]") {
  const auto check = [](const auto& g, double tolerance) {
    const auto with_gap = function_of_mean(exponential, g);
    const auto without = function_of_mean(exponential, plain(g));
    for (std::int64_t k = 1; k <= 8; ++k) {
      Stream one(87, static_cast<std::uint64_t>(k));
      Stream two(one);
      const auto a = with_gap(k, one);
      const auto b = without(k, two);
      CHECK(a.value == b.value);
      CHECK(a.difference == Approx(b.difference).margin(tolerance).epsilon(1e-12));
    }
  };
  check(functions::Exp{}, 1e-13);
  check(functions::ExpMinus{}, 1e-14);
  check(functions::Reciprocal{}, 1e-13);
  check(functions::Square{}, 1e-13);
  check(functions::Log{}, 1e-14);
  check(functions::Sqrt{}, 1e-14);
  check(functions::Power{-0.7}, 1e-13);
  check(functions::Davis{0.8}, 1e-14);
  check(functions::Logistic{}, 1e-14);
  check(functions::PositivePart{}, 1e-14);
  check(DistanceToOne{}, 1e-14);
}

TEST_CASE("an interval is followed with its length and its sign", "[function_of_mean][exact]") {
  const auto identity = [](double m) { return m; };
  const auto one = [](double) { return 1.0; };
  Stream rng(88, 0);
  CHECK(function_of_integral(one, identity, {.from = 1, .to = 3.5})(4, rng).value == 2.5);
  CHECK(function_of_integral(one, identity, {.from = 3.5, .to = 1})(4, rng).value == -2.5);
  CHECK(function_of_integral(one, identity, {.from = 2, .to = 2})(4, rng).value == 0);
}

// ---- values

TEST_CASE("a vector-valued X is its components one by one, fixed and dynamic", "[function_of_mean][exact]") {
  const auto fixed = [](Stream& rng) {
    const double u = rng.uniform();
    return Eigen::Array3d(u, u * u, 1 - u);
  };
  const auto dynamic = [&fixed](Stream& rng) -> Eigen::ArrayXd { return fixed(rng); };
  const auto fixed_sequence = function_of_mean(fixed, functions::componentwise(functions::ExpMinus{}));
  const auto dynamic_sequence = function_of_mean(dynamic, functions::componentwise(functions::ExpMinus{}));
  const auto first = function_of_mean(uniform, functions::ExpMinus{});
  const auto last = function_of_mean([](Stream& rng) { return 1 - rng.uniform(); }, functions::ExpMinus{});
  for (std::int64_t k = 0; k <= 5; ++k) {
    std::vector<Stream> rngs(4, Stream(89, static_cast<std::uint64_t>(k)));
    const Draw<Eigen::Array3d> a = fixed_sequence(k, rngs[0]);
    const Draw<Eigen::ArrayXd> b = dynamic_sequence(k, rngs[1]);
    const Draw<double> c = first(k, rngs[2]);
    const Draw<double> d = last(k, rngs[3]);
    CHECK((a.value == b.value).all());
    CHECK((a.difference == b.difference).all());
    CHECK(a.value[0] == c.value);
    CHECK(a.difference[0] == c.difference);
    CHECK(a.difference[2] == d.difference);
  }
  CHECK(sequence_laws(fixed_sequence) == Failures{});
  CHECK(sequence_laws(dynamic_sequence) == Failures{});
}

TEST_CASE("means of many components give one number, complex ones too", "[function_of_mean][law]") {
  // A09: a ratio of two means
  const auto weighted = [](Stream& rng) {
    const double u = rng.uniform();
    return Eigen::Array2d(u * std::exp(u), std::exp(u));
  };
  CHECK(sequence_laws(function_of_mean(weighted, [](const Eigen::Array2d& m) { return m[0] / m[1]; })) == Failures{});

  const auto phase = [](Stream& rng) { return std::polar(1.0, rng.uniform()); };
  CHECK(sequence_laws(function_of_mean(phase, [](const std::complex<double>& m) { return m * m; })) == Failures{});
  CHECK(sequence_laws(function_of_integral([](double x) { return std::polar(1.0, x); },
                                           [](const std::complex<double>& m) { return 1.0 / m; })) == Failures{});
}

TEST_CASE("means of float draws are double: the sum does not stop at 2^24", "[function_of_mean][exact]") {
  const auto tenth = [](Stream&) { return 0.1F; };
  const auto s = function_of_mean(tenth, [](auto m) {
    static_assert(std::is_same_v<decltype(m), double>);
    return m;
  });
  Stream rng(90, 0);
  CHECK(s(22, rng).value == Approx(0.1F).epsilon(1e-9));

  const auto to_float = function_of_mean(uniform, [](double m) { return static_cast<float>(m * m); });
  static_assert(std::is_same_v<decltype(to_float)::value_type, float>);
  CHECK(sequence_laws(to_float, {.last = 5, .rounding = 1e-7}) == Failures{});
}

// ---- errors

TEST_CASE("a level beyond int64 or below zero throws before anything is drawn", "[function_of_mean][exact]") {
  const auto untouched = [](Stream&) -> double { throw std::logic_error("drawn"); };
  const auto s = function_of_mean(untouched, functions::Square{});
  Stream rng(91, 0);
  CHECK_THROWS_AS(s(63, rng), std::length_error);
  CHECK_THROWS_AS(s.value_at(63, rng), std::length_error);
  CHECK_THROWS_AS(s.shared(63, 1, rng), std::length_error);
  CHECK_THROWS_AS(s.shared(64, 63, rng), std::length_error);
  CHECK_THROWS_AS(s(-1, rng), std::invalid_argument);
  CHECK_THROWS_AS(s.value_at(-1, rng), std::invalid_argument);
  CHECK_THROWS_AS(s.shared(3, -1, rng), std::invalid_argument);
  CHECK_THROWS_AS(s.shared(3, 3, rng), std::invalid_argument);
  CHECK_THROWS_AS(s(62, rng), std::logic_error);  // legal, so it starts to draw

  const auto comb =
      function_of_integral([](double) -> double { throw std::logic_error("drawn"); }, functions::Square{});
  CHECK_THROWS_AS(comb(63, rng), std::length_error);
  CHECK_THROWS_WITH(comb(63, rng),
                    "doubling: level 63 needs 2^level draws (beyond int64); choose a PMF with a lighter tail");
}

TEST_CASE("an interval that is not finite throws and says what to do", "[function_of_mean][exact]") {
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(function_of_integral(twice, functions::Square{}, {.to = infinity}), std::invalid_argument);
  CHECK_THROWS_AS(function_of_integral(twice, functions::Square{}, {.from = std::nan("")}), std::invalid_argument);
}

TEST_CASE("what is no random variable or no function of its mean does not fit", "[function_of_mean][compile]") {
  const auto mutable_draw = [n = 0.0](Stream&) mutable { return ++n; };
  static_assert(!RandomVariable<decltype(mutable_draw)>);
  const auto expression = [](const Eigen::ArrayXd& m) { return m + m; };
  static_assert(!FunctionOfMean<decltype(expression), Eigen::ArrayXd>);
  static_assert(OffersGap<functions::ExpMinus, double>);
  static_assert(!OffersGap<functions::Componentwise<double (*)(double)>, Eigen::Array3d>);
  static_assert(OffersGap<functions::Componentwise<functions::Log>, Eigen::Array3d>);
  SUCCEED();
}

// ---- several means

TEST_CASE("ratios, self-normalised weights and log-sum-exp of several means keep the laws of a sequence",
          "[function_of_mean][law]") {
  const auto weighted = [](Stream& rng) {  // A11: posterior mean 1/2
    const double theta = rng.normal();
    const double weight = std::exp(-(1 - theta) * (1 - theta) / 2);
    return Eigen::Array2d(theta * weight, weight);
  };
  CHECK(sequence_laws(function_of_mean(weighted, functions::Ratio{}),
                      {.first = 3, .last = 8, .variance_tolerance = 0.4}) == Failures{});
  const auto three = [](Stream& rng) {
    const double u = rng.uniform();
    const double v = rng.uniform();
    return Eigen::Array3d(u, 2 * v, u * v);
  };
  CHECK(sequence_laws(function_of_mean(three, functions::LogSumExp{})) == Failures{});

  // The gaps are those of the functions, to rounding; exactly zero where the halves agree.
  const Eigen::Array3d m(0.3, 1.2, -0.5);
  const Eigen::Array3d d(0.1, -0.2, 0.05);
  const functions::LogSumExp lse;
  CHECK(lse.gap(m, d) == Approx(lse(m) - 0.5 * (lse((m + d).eval()) + lse((m - d).eval()))).epsilon(1e-13));
  CHECK(lse.gap(m, Eigen::Array3d::Zero().eval()) == 0);
  CHECK(lse(Eigen::Array2d(1000, 1000)) == Approx(1000 + std::log(2.0)));
  const Eigen::Array2d q(0.7, 1.3);
  const Eigen::Array2d e(0.1, 0.2);
  const functions::Ratio ratio;
  CHECK(ratio.gap(q, e) == Approx(ratio(q) - 0.5 * (ratio((q + e).eval()) + ratio((q - e).eval()))).epsilon(1e-13));
  CHECK(ratio.gap(q, Eigen::Array2d::Zero().eval()) == 0);
}

TEST_CASE("differences of 1e-12 of exp(-30) and exp(-100) keep their relative accuracy", "[function_of_mean][exact]") {
  for (const double tau : {30.0, 100.0}) {
    for (const double d : {1e-3, 1e-7, 1e-12}) {
      const double exact = -2 * std::exp(-tau) * std::pow(std::sinh(d / 2), 2);  // e^-tau (1 - cosh d)
      CHECK(functions::ExpMinus{}.gap(tau, d) == Approx(exact).epsilon(1e-13));
    }
  }
}

TEST_CASE("thick media and colours by combs and jittered points are unbiased, component by component",
          "[function_of_mean][statistical]") {
  for (const double tau : {30.0, 100.0}) {
    CAPTURE(tau);
    const auto medium = [tau](double x) { return 2 * tau * x; };
    const double truth = std::exp(-tau);
    const auto check = [truth](const auto& e) {
      const auto r = estimate(e, {.samples = 1 << 14});
      CHECK(std::abs(r.mean - truth) < 4.5 * r.standard_error);
      CHECK(r.standard_error < 0.01 * truth);
    };
    check(single_term(function_of_integral(medium, functions::ExpMinus{}), {.base_level = 7}));
    check(single_term(function_of_jittered_integral(medium, functions::ExpMinus{}), {.base_level = 7}));
  }
  const auto rgb = [](double x) { return Eigen::Array3d(2 * x, 3 * x * x, 1 + x); };
  const auto g = functions::componentwise(functions::ExpMinus{});
  const Eigen::Array3d truth = Eigen::Array3d(-1, -1, -1.5).exp();
  const auto pmfs = [](const auto& e, const Eigen::Array3d& exact) {
    return debias::laws::estimator_laws(e, exact, {.repeats = 0});
  };
  const auto comb = single_term(function_of_integral(rgb, g));
  CHECK(pmfs(comb, truth) == Failures{});
  CHECK(pmfs(single_term(function_of_jittered_integral(rgb, g)), truth) == Failures{});
  CHECK(pmfs(comb, truth * Eigen::Array3d(1, 1.01, 1)) != Failures{});
}

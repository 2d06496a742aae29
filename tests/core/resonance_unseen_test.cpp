// Integrands that were written after the rule of core/resonance.hpp was fixed, and drawn: other periods, phases, intervals,
// shapes and g than those of resonance_test.cpp. The doors are those of the program and of Python.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "catch_shim.hpp"

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/multilevel.hpp>
#include <debias/recipe.hpp>

#include "catalog/make.hpp"
#include "catalog/run_by.hpp"

using namespace debias;

namespace {

constexpr double two_pi = 2 * std::numbers::pi;

enum class Shape { cosine, harmonics, slats, ramps };

// Of mean `mean`, between -1 and 1, once a period.
struct Pattern {
  Shape shape = Shape::cosine;
  double duty = 0.5;
  double phase = 0;

  double operator()(double t) const {
    t += phase;
    t -= std::floor(t);
    switch (shape) {
      case Shape::cosine:
        return std::cos(two_pi * t);
      case Shape::harmonics:
        return 0.6 * std::cos(two_pi * t) + 0.4 * std::sin(2 * two_pi * t);
      case Shape::slats:
        return t < duty ? 1 : -1;
      case Shape::ramps:
        return t < duty ? 1 - 2 * t / duty : -1;
    }
    return 0;
  }
  [[nodiscard]] double mean() const {
    switch (shape) {
      case Shape::slats:
        return 2 * duty - 1;
      case Shape::ramps:
        return duty - 1;
      default:
        return 0;
    }
  }
};

// On [from, from + width]: (smooth + patterns) / width, positive.
struct Integrand {
  double from = 0;
  double width = 1;
  std::array<double, 3> smooth{};
  std::array<Pattern, 2> patterns{};
  std::array<double, 2> periods{};
  std::array<double, 2> amplitudes{};
  std::optional<double> whole{};  ///< the integral, where periods are cut

  double operator()(double x) const {
    const double t = (x - from) / width;
    double f = smooth[0] + t * (smooth[1] + t * smooth[2]);
    for (std::size_t i = 0; i < 2; ++i) f += amplitudes[i] * patterns[i](periods[i] * t);
    return f / width;
  }
  [[nodiscard]] double integral() const {
    if (whole) return *whole;
    double m = smooth[0] + smooth[1] / 2 + smooth[2] / 3;
    for (std::size_t i = 0; i < 2; ++i) m += amplitudes[i] * patterns[i].mean();
    return m;
  }
};

struct G {
  int kind = 0;

  template <class Use>
  double with(const Use& use) const {
    switch (kind) {
      case 0:
        return use(functions::ExpMinus{});
      case 1:
        return use(functions::Reciprocal{});
      case 2:
        return use(functions::Log{});
      default:
        return use(functions::Square{});
    }
  }
  double operator()(double m) const {
    return with([&](const auto& g) { return g(m); });
  }
  double gap(double m, double d) const {
    return with([&](const auto& g) { return g.gap(m, d); });
  }
};

catalog::Problem problem_of(const Integrand& f, G g) {
  return catalog::make({.name = "unseen", .truth = g(f.integral())},
                       function_of_integral(f, g, {.from = f.from, .to = f.from + f.width}));
}

double between(Stream& rng, double low, double high) { return low + (high - low) * rng.uniform(); }
std::int64_t one_of(Stream& rng, std::int64_t n) {
  return static_cast<std::int64_t>(rng.uniform() * static_cast<double>(n));
}

// In step with combs of up to 2^12 points, alone, in pairs, or beside a smooth part.
Integrand in_step(Stream& rng) {
  Integrand f;
  f.from = between(rng, -2, 2);
  f.width = between(rng, 0.5, 4);
  const bool alone = rng.uniform() < 0.3;
  const bool two = rng.uniform() < 0.4;
  double size = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    constexpr std::array<double, 8> odd = {1, 3, 5, 11, 13, 15, 21, 27};
    f.periods[i] = odd[static_cast<std::size_t>(one_of(rng, 8))] * std::exp2(static_cast<double>(one_of(rng, 13)));
    f.patterns[i] = {static_cast<Shape>(one_of(rng, 4)), between(rng, 0.08, 0.92), rng.uniform()};
    f.amplitudes[i] = between(rng, 0.1, 2);
    if (i == 1 && !two) f.amplitudes[i] = 0;
    size += f.amplitudes[i];
  }
  f.smooth = {size * between(rng, 1.02, 1.5), 0, 0};
  if (!alone) f.smooth = {f.smooth[0], between(rng, 0, 1), between(rng, 0, 1)};
  return f;
}

// What combs can do: a few periods, and not whole numbers of them.
Integrand out_of_step(Stream& rng) {
  Integrand f = in_step(rng);
  for (double& p : f.periods) p = between(rng, 0.3, 6);
  constexpr int points = 100003;
  double total = 0;
  for (int i = 0; i < points; ++i) total += f(f.from + f.width * (i + 0.5) / points);
  f.whole = total * f.width / points;
  return f;
}

bool is_warned(const std::vector<Warning>& warnings) {
  return std::any_of(warnings.begin(), warnings.end(),
                     [](const Warning& w) { return w.code == WarningCode::aliased_differences; });
}

struct Answer {
  double z = 0;  ///< error in standard errors, beyond rounding
  bool warned = false;
};

Answer answer_of(const ComponentEstimate& e, double error, const std::vector<Warning>& warnings, double truth) {
  const double off = std::max(std::abs(e.mean - truth) - 1e-13 * std::abs(truth), 0.0);
  return {off / std::max(error, 1e-300), is_warned(warnings)};
}

enum class Door { single_term, stratified, independent_sum, recipe, multilevel };
constexpr std::array doors = {Door::single_term, Door::stratified, Door::independent_sum, Door::recipe,
                              Door::multilevel};

Answer ask(Door door, const catalog::Problem& p, std::int64_t base_level, const Plan& plan) {
  catalog::Choice choice;
  if (door == Door::multilevel) {
    const MultilevelStatistics m = multilevel(p.levels, 1e-2 * std::abs(p.truth), {.seed = plan.seed, .threads = 1});
    return answer_of(m.components.front(), m.error(), m.warnings, p.truth);
  }
  if (door == Door::recipe) {
    const Advice advice = advise(p.levels, plan, RecipeOptions{});
    if (!advice.usable()) return {0, true};
    Statistics s = testing::run_by(advice, p, plan);
    detail::follow(s, advice, {});
    return answer_of(s.components.front(), s.components.front().standard_error, s.warnings, p.truth);
  }
  choice.method = door == Door::independent_sum ? catalog::Method::independent_sum : catalog::Method::single_term;
  choice.pmf = catalog::default_pmf(p, choice.method);
  choice.base_level = base_level;
  choice.block = door == Door::stratified ? 64 : 1;
  const Statistics s = p.run(choice, plan);
  return answer_of(s.components.front(), s.components.front().standard_error, s.warnings, p.truth);
}

struct Counts {
  int runs = 0;
  int wrong = 0;  ///< more than five standard errors off
  int silent = 0;
  int warned = 0;
};

// `integrands` of them, each by all doors.
template <class Draw>
Counts counts_of(const Draw& draw, std::uint64_t family, std::uint64_t integrands, std::uint64_t seeds) {
  Counts n;
  for (std::uint64_t i = 0; i < integrands; ++i) {
    Stream rng(family, i);
    const Integrand f = draw(rng);
    const G g{static_cast<int>(one_of(rng, 4))};
    const std::int64_t base_level = one_of(rng, 7);
    const catalog::Problem p = problem_of(f, g);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      for (const Door door : doors) {
        const Answer a = ask(door, p, base_level, {.samples = 1 << 13, .seed = 1000 * seed + i, .threads = 1});
        ++n.runs;
        n.wrong += a.z > 5;
        n.warned += a.warned;
        if (!(a.z > 5) || a.warned) continue;
        ++n.silent;
        UNSCOPED_INFO("silent: family " << family << ", integrand " << i << ", seed " << seed << ", door "
                                        << static_cast<int>(door) << ", g " << g.kind << ", z " << a.z);
      }
    }
  }
  return n;
}

}  // namespace

TEST_CASE("unseen integrands in step with combs are not five standard errors off without a warning",
          "[resonance][unseen][stat]") {
  const Counts n = counts_of(in_step, 22001, 120, 1);
  UNSCOPED_INFO("runs " << n.runs << ", wrong " << n.wrong << ", warned " << n.warned);
  CHECK(n.silent == 0);
  CHECK(n.wrong > n.runs / 5);  // there is something to be warned of
}

TEST_CASE("of unseen integrands that combs resolve at most one run in a hundred is warned of",
          "[resonance][unseen][stat]") {
  const Counts n = counts_of(out_of_step, 22002, 120, 1);
  UNSCOPED_INFO("runs " << n.runs << ", wrong " << n.wrong << ", warned " << n.warned);
  CHECK(n.warned <= n.runs / 100);
}

TEST_CASE("unseen integrands over 20 seeds by all doors", "[resonance][unseen][.long]") {
  const Counts steps = counts_of(in_step, 22003, 60, 20);
  WARN("in step: runs " << steps.runs << ", wrong " << steps.wrong << ", warned " << steps.warned << ", silent "
                        << steps.silent);
  CHECK(steps.silent == 0);
  const Counts resolved = counts_of(out_of_step, 22004, 60, 20);
  WARN("resolved: runs " << resolved.runs << ", wrong " << resolved.wrong << ", warned " << resolved.warned);
  CHECK(resolved.warned <= resolved.runs / 100);
}

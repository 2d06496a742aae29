// Estimators that are wrong on purpose beside the right ones, and values that no estimator wants to meet.

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/derivative.hpp>
#include <debias/estimators/independent_sum.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/estimators/truncated.hpp>
#include <debias/reciprocal.hpp>
#include <debias/series.hpp>

#include "reliability.hpp"
#include "wrong.hpp"

namespace debias::validation {
namespace {

template <Estimator E>
std::function<Statistics(const Plan&)> erased(const E& estimator) {
  return [estimator](const Plan& plan) -> Statistics { return estimate(estimator, plan); };
}

// Every way to be wrong that a sequence of levels has.
template <BiasedSequence S>
void add_levels(std::vector<Suspect>& all, const std::string& of, double truth, const S& sequence,
                const Geometric& pmf) {
  const auto add = [&](const std::string& what, bool wrong, const auto& estimator) {
    all.push_back({what + ", " + of, wrong, truth, erased(estimator)});
  };
  add("single term", false, single_term(sequence, pmf));
  add("independent sum", false, independent_sum(sequence, pmf));
  add("weights of the next level", true, single_term(sequence, trial::PmfOffByOne{pmf}));
  add("no weights", true, single_term(sequence, trial::NoReweighting{pmf}));
  add("survival of the next level", true, independent_sum(sequence, trial::PmfOffByOne{pmf}));
  add("cut after level 3 and renormalised", true, single_term(sequence, trial::Renormalised{pmf, 2}));
  add("weights cut at 8", true, single_term(sequence, trial::WeightsCapped{pmf, 8}));
  add("base left out", true, single_term(trial::BaseDropped<S>{sequence}, pmf));
  add("one level, called unbiased", true, truncated(sequence, 3));
  add("a hundredth too large", true,
      trial::Scaled<decltype(single_term(sequence, pmf))>{single_term(sequence, pmf), 1.01});
}

}  // namespace

const std::vector<Suspect>& suspects() {
  static const std::vector<Suspect> list = [] {
    std::vector<Suspect> all;
    const auto x = [](Stream& rng) {
      const double u = rng.uniform();
      return 1 + u * u;
    };
    const auto inverse = reciprocal(x);
    const auto slope = finite_difference([](double at) { return std::exp(at); }, 0.0);
    const auto sum = series([](std::int64_t k) { return std::exp2(-static_cast<double>(k)); }, geometric_terms(0.5));
    add_levels(all, "1 / E X", 0.75, inverse, Geometric::with_exponent(1.5));
    add_levels(all, "derivative", 1, slope, Geometric::with_exponent(1.5));
    const Geometric pmf(0.5);
    all.push_back({"roulette, series", false, 2, erased(roulette(sum, Geometric(0.6)))});
    all.push_back({"survival of the next term, series", true, 2, erased(roulette(sum, trial::PmfOffByOne{pmf}))});
    all.push_back({"no survival weights, series", true, 2, erased(roulette(sum, trial::NoReweighting{pmf}))});
    using Terms = std::remove_cvref_t<decltype(sum)>;
    all.push_back({"first term left out, series", true, 2, erased(roulette(trial::FirstTermDropped<Terms>{sum}, pmf))});
    const auto y = reciprocal([](Stream& rng) { return 0.25 + rng.exponential(); });
    using Inverse = std::remove_cvref_t<decltype(y)>;
    all.push_back({"level drawn from the numbers of its difference, 1 / E Y", true, 0.8,
                   erased(trial::LevelFromItsOwnDraws<Inverse>{y, Geometric::with_exponent(1.5)})});
    return all;
  }();
  return list;
}

namespace {

enum class Bad { nan, infinity, denormal, thrown };

// I_k = 1 - 2^-k, but for one sample in a thousand, whose levels all are bad.
struct BadValues {
  Bad kind;
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const double fine = 1 - std::exp2(-static_cast<double>(level));
    const double work = std::exp2(static_cast<double>(level));
    if (rng.index() % 1000 != 7) return level == 0 ? base(fine, work) : coupled(fine, 2 * fine - 1, work);
    switch (kind) {
      case Bad::nan:
        return base(std::numeric_limits<double>::quiet_NaN(), work);
      case Bad::infinity:
        return base(std::numeric_limits<double>::infinity(), work);
      case Bad::denormal:
        return base(std::numeric_limits<double>::denorm_min(), work);
      case Bad::thrown:
        break;
    }
    throw std::domain_error("no value here");
  }
};

}  // namespace

std::vector<std::string> failures_on_nonfinite_values() {
  std::vector<std::string> failures;
  constexpr std::int64_t samples = 5000;
  const auto judge_one = [&](const std::string& name, Bad kind, const auto& estimator) {
    const auto fail = [&](const std::string& why) { failures.push_back(name + ": " + why); };
    try {
      const Statistics s = estimate(estimator, {.samples = samples});
      const double mean = s.components.front().mean;
      if (kind == Bad::thrown) return fail("an exception was swallowed");
      if (kind == Bad::denormal) {
        if (s.nonfinite != 0 || !std::isfinite(mean)) fail("a denormal value made the mean useless");
        return;
      }
      if (s.nonfinite == 0) return fail("values that are not finite were not counted");
      if (!std::isnan(mean)) return fail("the mean hides values that are not finite");
      if (s.warnings.empty()) return fail("no warning");
    } catch (const SampleError& e) {
      if (kind != Bad::thrown) return fail("thrown: " + std::string(e.what()));
      if (e.index() != 7) return fail("the sample that threw first is 7, not " + std::to_string(e.index()));
    }
  };
  constexpr std::array names = {"NaN", "infinity", "denormal", "exception"};
  for (const Bad kind : {Bad::nan, Bad::infinity, Bad::denormal, Bad::thrown}) {
    const BadValues sequence{kind};
    const Geometric pmf = Geometric::with_exponent(1.5);
    const std::string what = std::string(" on ") + names[static_cast<std::size_t>(kind)];
    judge_one("single_term" + what, kind, single_term(sequence, pmf));
    judge_one("single_term_outcome" + what, kind, single_term(sequence, pmf, {.base = Base::one_outcome}));
    judge_one("independent_sum" + what, kind, independent_sum(sequence, pmf));
    judge_one("truncated" + what, kind, truncated(sequence, 2));
    const auto terms = series([kind](std::int64_t k) {
      Stream none(0, k == 0 ? 7 : 0);
      return BadValues{kind}(k, none).difference;
    });
    if (kind != Bad::thrown) judge_one("roulette" + what, kind, roulette(terms, pmf));
  }
  return failures;
}

}  // namespace debias::validation

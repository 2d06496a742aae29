#include "hard.hpp"

#include <math.h>  // lgamma_r

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <debias/derivative.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/estimators/single_term.hpp>
#include <debias/reciprocal.hpp>
#include <debias/series.hpp>
#include <debias/transmittance.hpp>

#include "core/text.hpp"
#include "validation.hpp"

namespace debias::validation {
namespace {

template <Estimator E>
HardCase hard_case(std::string group, std::string parameter, double truth, const E& e) {
  return {std::move(group), std::move(parameter), truth,
          [e](const Plan& plan) -> Statistics { return estimate(e, plan); }};
}

std::string equals(const std::string& name, double x) { return name + " = " + to_text(x); }

// exp(-tau) along a ray of extinction 2 tau t.
void add_thick_media(std::vector<HardCase>& cases) {
  const auto ray = [](double tau) { return Ray([tau](double t) { return 2 * tau * t; }, RayBounds{1, 2 * tau}); };
  for (const double tau : {1.0, 100.0}) {
    cases.push_back(hard_case("delta tracking", equals("tau", tau), std::exp(-tau), delta_tracking(ray(tau))));
  }
  for (const double tau : {1.0, 10.0, 100.0}) {
    cases.push_back(hard_case("ratio tracking", equals("tau", tau), std::exp(-tau), ratio_tracking(ray(tau))));
  }
  for (const double tau : {1.0, 10.0, 100.0}) {
    cases.push_back(hard_case("telescoping, 16 points", equals("tau", tau), std::exp(-tau),
                              single_term(jittered_telescoping(ray(tau)), {.base_level = 4})));
  }
}

// The derivative of sin at 1 under an offset that cancels.
void add_cancellation(std::vector<HardCase>& cases) {
  for (const double offset : {1.0, 1e4, 1e8, 1e12}) {
    const auto f = [offset](double x) { return offset + std::sin(x); };
    cases.push_back(hard_case("central difference", equals("offset", offset), std::cos(1.0),
                              single_term(finite_difference(f, 1.0, {.kind = Difference::central}))));
  }
}

// e = sum 1 / k!, its index drawn from a Poisson law of mean lambda: E Z^2 = exp(lambda + 1 / lambda).
void add_lambda(std::vector<HardCase>& cases) {
  const auto terms =
      series([](std::int64_t k) { return 1 / std::tgamma(static_cast<double>(k) + 1); }, factorial_terms);
  for (const double lambda : {2.0, 60.0}) {
    cases.push_back(hard_case("sum 1/k!, Poisson law", equals("lambda", lambda), std::exp(1.0),
                              single_term(terms, Poisson(lambda), {.base = Base::one_outcome})));
  }
}

// sqrt(1 + 4^-k) -> 1, differences with and without cancellation.
void add_depth(std::vector<HardCase>& cases) {
  const auto value = [](std::int64_t k) { return std::sqrt(1 + std::ldexp(1.0, static_cast<int>(-2 * k))); };
  const auto subtracted = [value](std::int64_t k, Stream&) -> Draw<double> {
    return k == 0 ? base(value(0)) : coupled(value(k), value(k - 1));
  };
  const auto exact = [value](std::int64_t k, Stream&) -> Draw<double> {
    if (k == 0) return base(value(0));
    return {value(k), -3 * std::ldexp(1.0, static_cast<int>(-2 * k)) / (value(k) + value(k - 1))};
  };
  for (const std::int64_t level : {0, 60}) {
    cases.push_back(hard_case("sqrt(1 + 4^-k), subtracted", equals("base level", static_cast<double>(level)), 1,
                              single_term(subtracted, Geometric(0.5), {.base_level = level})));
  }
  for (const std::int64_t level : {0, 60}) {
    cases.push_back(hard_case("sqrt(1 + 4^-k), exact", equals("base level", static_cast<double>(level)), 1,
                              single_term(exact, Geometric(0.5), {.base_level = level})));
  }
  for (const std::int64_t level : {0, 60}) {
    const auto f = [](double x) { return std::sin(x); };
    cases.push_back(hard_case("forward difference", equals("base level", static_cast<double>(level)), std::cos(1.0),
                              single_term(finite_difference(f, 1.0), {.base_level = level})));
  }
}

// 1 / E X.
void add_reciprocals(std::vector<HardCase>& cases) {
  for (const double mean : {1.0, 0.3, 0.03}) {
    const auto x = [mean](Stream& rng) { return mean + rng.uniform() - 0.5; };
    cases.push_back(hard_case("1 / E X, doubling", equals("E X", mean), 1 / mean, single_term(reciprocal(x))));
  }
  for (const double mean : {0.5, 1e-4}) {
    const auto x = [mean](Stream& rng) { return rng.uniform() < mean ? 1.0 : 0.0; };
    cases.push_back(hard_case("1 / E X, trials", equals("E X", mean), 1 / mean, reciprocal_trials(x, 1)));
  }
}

// e^-x by its power series: the terms grow up to k = x.
void add_alternating(std::vector<HardCase>& cases) {
  const auto terms = [](double x) {
    return series(
        [x](std::int64_t k) {
          const auto n = static_cast<double>(k);
          int sign = 0;  // std::lgamma writes it to a global, in every thread
          return (k % 2 == 0 ? 1 : -1) * std::exp(n * std::log(x) - ::lgamma_r(n + 1, &sign));
        },
        factorial_terms);
  };
  for (const double x : {1.0, 10.0, 40.0}) {
    cases.push_back(hard_case("e^-x, Poisson law", equals("x", x), std::exp(-x),
                              single_term(terms(x), Poisson(x), {.base = Base::one_outcome})));
  }
  for (const double x : {1.0, 10.0, 40.0}) {
    cases.push_back(
        hard_case("e^-x, geometric PMF", equals("x", x), std::exp(-x), single_term(terms(x), Geometric(0.5))));
  }
}

void add_scales(std::vector<HardCase>& cases) {
  for (const double scale : {1.0, 1e-200, 1e-310, 1e150, 1e200, 1e308}) {
    const auto terms = series([scale](std::int64_t k) { return scale * std::pow(0.5, static_cast<double>(k) + 2); },
                              geometric_terms(0.5));
    cases.push_back(hard_case("sum 2^-k", equals("scale", scale), 0.5 * scale, single_term(terms, Geometric(0.4))));
  }
}

template <class T>
void add_precision(std::vector<HardCase>& cases, const std::string& name) {
  const auto terms = series([](std::int64_t k) { return static_cast<T>(std::pow(0.95, static_cast<double>(k))); },
                            geometric_terms(0.95));
  cases.push_back(hard_case("sum 0.95^k", name, 20, single_term(terms)));
  const auto f = [](double x) { return static_cast<T>(std::sin(x)); };
  cases.push_back(hard_case("derivative of sin", name, std::cos(1.0),
                            single_term(finite_difference(f, 1.0, {.kind = Difference::central}))));
  const auto g = [](double x, Stream& rng) { return static_cast<T>(std::exp(x * rng.uniform())); };
  cases.push_back(hard_case("derivative of E e^(x U)", name, 1.0, single_term(finite_difference(g, 1.0))));
}

// "a, b; c" -> "a": enough to find the sentence by.
std::string first_clause(const std::string& sentence) { return sentence.substr(0, sentence.find_first_of(",;.")); }

double relative_error(const HardCell& cell) {
  return std::max(std::abs(cell.error), believed_error(cell.statistics, cell.truth)) / std::abs(cell.truth);
}

HardStatus judge_cell(const HardCell& cell, double threshold) {
  const Statistics& s = cell.statistics;
  const double error = believed_error(s, cell.truth);
  // Neither a NaN nor an infinite error passes.
  if (std::isfinite(error) && std::abs(cell.error) <= threshold * error + s.bias_bound.size) return HardStatus::pass;
  return cell.says.empty() ? HardStatus::fail : HardStatus::said;
}

}  // namespace

std::string_view name_of(HardStatus status) {
  switch (status) {
    case HardStatus::pass:
      return "pass";
    case HardStatus::said:
      return "said";
    case HardStatus::refused:
      return "refused";
    case HardStatus::fail:
      break;
  }
  return "fail";
}

std::string doubts_of(const Statistics& s) {
  std::string all;
  const auto add = [&all](const std::string& doubt) { all += (all.empty() ? "" : "; ") + doubt; };
  if (s.bias_bound.size > 0) {
    add("bias at most " + format("%.2g", s.bias_bound.size));
  }
  for (const Warning& warning : s.warnings) add(first_clause(warning.text));
  if (s.nonfinite > 0 || s.moments.count < 2) return all;
  const RunVerdict verdict = s.verdict();
  if (verdict.variance != Finiteness::finite) {
    add(std::string("variance ") + name_of(verdict.variance));
  } else if (!verdict.interval_reliable()) {
    add("interval unreliable");
  }
  return all;
}

const std::vector<HardCase>& hard_cases() {
  static const std::vector<HardCase> all = [] {
    std::vector<HardCase> cases;
    add_thick_media(cases);
    add_cancellation(cases);
    add_lambda(cases);
    add_depth(cases);
    add_reciprocals(cases);
    add_alternating(cases);
    add_scales(cases);
    add_precision<double>(cases, "double");
    add_precision<float>(cases, "float");
    return cases;
  }();
  return all;
}

HardReport validate(const std::vector<HardCase>& cases, const Plan& plan,
                    const std::function<void(const HardCell&)>& progress) {
  HardReport report;
  report.threshold = family_threshold(static_cast<std::int64_t>(cases.size()));
  for (const HardCase& c : cases) {
    HardCell cell{.group = c.group, .parameter = c.parameter, .truth = c.truth, .statistics = {}, .says = {}};
    try {
      cell.statistics = c.run(plan);
      cell.has_run = true;
      cell.error = cell.statistics.components.front().mean - c.truth;
      cell.says = doubts_of(cell.statistics);
      cell.status = judge_cell(cell, report.threshold);
      const auto mildest = std::find_if(report.cells.begin(), report.cells.end(),
                                        [&c](const HardCell& other) { return other.group == c.group; });
      if (mildest != report.cells.end()) cell.digits_lost = std::log10(relative_error(cell) / relative_error(*mildest));
    } catch (const Interrupted&) {
      throw;
    } catch (const std::exception& e) {
      cell.says = e.what();
    }
    report.failed += cell.status == HardStatus::fail;
    report.cells.push_back(std::move(cell));
    if (progress) progress(report.cells.back());
  }
  return report;
}

}  // namespace debias::validation

#include "compiled.hpp"

#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include <debias/function_of_mean.hpp>

#include "../catalog/make.hpp"
#include "named_function.hpp"

namespace debias::python {
namespace {

constexpr std::size_t most_on_stack = 64;

struct Draws {
  CIntegrand f;
  std::size_t dimension;

  double operator()(Stream& rng) const {
    std::array<double, most_on_stack> x;
    const auto u = std::span(x).first(dimension);
    if (dimension == 1) {
      x[0] = rng.uniform();
    } else {
      rng.fill(u);
    }
    return f(static_cast<int>(dimension), x.data());
  }
};

struct PointFunction {
  CIntegrand f;
  double operator()(double x) const { return f(1, &x); }
};

struct CompiledLevels {
  CLevels f;
  std::shared_ptr<const std::vector<Lookups::Size>> sizes;

  [[nodiscard]] std::int64_t deepest_level() const { return static_cast<std::int64_t>(sizes->size()) - 1; }
  Draw<double> operator()(std::int64_t level, Stream& rng) const {
    const Lookups::Size& size = sizes->at(static_cast<std::size_t>(level));
    std::array<double, most_on_stack> few;
    std::vector<double> many(size.width > most_on_stack ? size.width : 0);
    const std::span<double> u = many.empty() ? std::span(few).first(size.width) : std::span(many);
    rng.fill(u);
    std::array<double, 2> out{};
    f(level, static_cast<std::int64_t>(u.size()), u.data(), out.data());
    return level == 0 ? base(out[0], size.work) : coupled(out[0], out[1], size.work);
  }
};

template <class S>
UserProblem compiled_problem(const Facts& facts, const S& sequence, const Rates& rates) {
  UserProblem user = problem_of(facts);
  const catalog::Problem made = catalog::make({}, sequence, rates);
  user.problem.rates = rates;
  user.problem.methods = made.methods;
  user.problem.run = made.run;
  user.problem.trace = made.trace;
  user.problem.pilot = made.pilot;
  user.problem.levels = made.levels;
  user.problem.levels.facts.declared.reset();
  if (!std::isnan(rates.variance_decay)) user.problem.levels.facts.declared = rates;
  user.compiled = std::make_shared<const catalog::Problem>(user.problem);
  return user;
}

Rates or_usual(const Rates& rates, const Rates& usual) { return std::isnan(rates.variance_decay) ? usual : rates; }

}  // namespace

UserProblem compiled_mean(const Facts& facts, const CIntegrand& f, std::size_t dimension, const std::string& g,
                          const std::string& points, double from, double to) {
  const NamedFunction function = function_of(g);
  if (points == "independent") {
    if (dimension > most_on_stack) {
      throw std::invalid_argument("dimension = " + std::to_string(dimension) +
                                  " (of a compiled integrand at most 64); write the levels");
    }
    const Rates rates = or_usual(facts.rates, {2, 1});
    return compiled_problem(facts, function_of_mean(Draws{f, dimension}, function, rates), rates);
  }
  const PointFunction at{f};
  if (points == "comb") {
    const Rates rates = or_usual(facts.rates, IntegralOptions{}.rates);
    return compiled_problem(facts, function_of_integral(at, function, {from, to, rates}), rates);
  }
  if (points == "jittered") {
    const Rates rates = or_usual(facts.rates, JitteredOptions{}.rates);
    return compiled_problem(facts, function_of_jittered_integral(at, function, {from, to, rates}), rates);
  }
  throw std::invalid_argument("points = '" + points + "' (must be comb or jittered)");
}

UserProblem compiled_levels(const Facts& facts, const CLevels& f, std::vector<Lookups::Size> sizes) {
  const auto kept = std::make_shared<const std::vector<Lookups::Size>>(std::move(sizes));
  return compiled_problem(facts, CompiledLevels{f, kept}, facts.rates);
}

}  // namespace debias::python

#include "problem.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <Eigen/Core>

#include "../catalog/with_estimator.hpp"
#include "../core/text.hpp"
#include "user_runs.hpp"

namespace debias::python {
namespace {

using catalog::Choice;

template <BiasedSequence S>
LevelRuns gathered_levels(const S& sequence, const std::shared_ptr<Lookups>& lookups) {
  LevelRuns runs;
  runs.deepest_level = deepest_level_of(sequence);
  runs.facts = debias::facts_of(sequence);
  runs.draw = [sequence, lookups](std::int64_t level, const Plan& plan) -> Statistics {
    return estimate_collected(*lookups, debias::detail::LevelDraw<S>{sequence, level}, plan);
  };
  runs.work = [sequence, lookups](std::int64_t level, const Plan& plan) {
    const auto mean_work = [&] { return debias::detail::mean_work(sequence, level, plan); };
    lookups->collect_queries(mean_work);
    return mean_work();
  };
  runs.nets = [sequence, lookups](std::int64_t level, bool as_base, int octaves, const Plan& plan) {
    return debias::detail::net_moments(
        estimate_collected(*lookups, debias::detail::NetDraw<S>{sequence, level, as_base, octaves}, plan), octaves);
  };
  if constexpr (ChecksPoints<S>) {
    runs.missed = [sequence, lookups](std::int64_t level, std::int64_t draws, std::uint64_t seed) {
      const auto missed = [&] { return debias::detail::missed_of(sequence, level, draws, seed); };
      lookups->collect_queries(missed);
      return missed();
    };
  }
  if constexpr (OffersSharedBase<S>) {
    runs.shared = [sequence, lookups](std::int64_t level, std::int64_t base_level, const Plan& plan) {
      return debias::detail::shared_moments(
          estimate_collected(*lookups, debias::detail::SharedLevelDraw<S>{sequence, level, base_level}, plan));
    };
  }
  return runs;
}

template <BiasedSequence S>
UserProblem make_problem(const Facts& facts, const S& sequence, const std::shared_ptr<Lookups>& lookups) {
  using catalog::Method;
  const auto with = [sequence](const Choice& choice, const auto& use) {
    return catalog::detail::with_estimator(sequence, choice, use);
  };
  UserProblem user = problem_of(facts);
  catalog::Problem& p = user.problem;
  p.methods = {Method::single_term, Method::single_term_outcome, Method::independent_sum, Method::truncated};
  set_runs(user, with, lookups);
  p.levels = gathered_levels(sequence, lookups);
  if (!std::isnan(facts.rates.variance_decay)) p.levels.facts.declared = facts.rates;
  return user;
}

// ---- levels

template <Value V>
struct Levels {
  std::shared_ptr<Lookups> lookups;
  std::size_t components;
  std::int64_t deepest;

  [[nodiscard]] std::int64_t deepest_level() const { return deepest; }
  Draw<V> operator()(std::int64_t level, Stream& rng) const {
    const auto [numbers, work] = look_up(level, rng);
    return {value_in(numbers, level), difference_in(numbers), work};
  }
  Term<V> value_at(std::int64_t level, Stream& rng) const {
    const auto [numbers, work] = look_up(level, rng);
    return {value_in(numbers, level), work};
  }
  Term<V> difference_at(std::int64_t level, Stream& rng) const {
    return difference_at(level, rng, [](const V&, const V&) {});
  }
  /// Reports I_k and D_k where both are there.
  Term<V> difference_at(std::int64_t level, Stream& rng, const auto& report) const {
    const auto [numbers, work] = look_up(level, rng);
    if (numbers.size() > components) report(value_in(numbers, level), difference_in(numbers));
    return {difference_in(numbers), work};
  }

 private:
  // No numbers in the first pass.
  [[nodiscard]] std::pair<std::span<const double>, double> look_up(std::int64_t level, Stream& rng) const {
    const double work = lookups->size(level).work;
    if (!lookups->collecting()) return {lookups->next(level), work};
    rng.fill(lookups->ask(level));
    return {{}, work};
  }
  // I_k and D_k, or D_k alone, which is I_0 at level 0.
  [[nodiscard]] V value_in(std::span<const double> numbers, std::int64_t level) const {
    if (numbers.size() == components && level > 0) {
      throw std::invalid_argument("differences: the differences alone at level " + std::to_string(level) +
                                  " (the estimates are needed too); return (fine, coarse)");
    }
    return as_value(numbers.first(std::min(numbers.size(), components)));
  }
  [[nodiscard]] V difference_in(std::span<const double> numbers) const {
    return as_value(numbers.last(std::min(numbers.size(), components)));
  }
  [[nodiscard]] V as_value(std::span<const double> numbers) const {
    if constexpr (RealValue<V>) {
      return numbers.empty() ? 0.0 : numbers.front();
    } else {
      V v = V::Zero(static_cast<Eigen::Index>(components));
      for (std::size_t i = 0; i < numbers.size(); ++i) set_component(v, i, numbers[i]);
      return v;
    }
  }
};

// ---- functions of a mean

/// One of functions.hpp, chosen by name: both forms behind a pointer.
struct NamedFunction {
  double parameter;
  double (*value)(double m, double parameter);
  double (*gap_form)(double m, double d, double parameter);

  double operator()(double m) const { return value(m, parameter); }
  [[nodiscard]] double gap(double m, double d) const { return gap_form(m, d, parameter); }
};

template <class G>
G with_parameter([[maybe_unused]] double parameter) {
  if constexpr (std::is_empty_v<G>) {
    return G{};
  } else {
    return G{parameter};
  }
}

template <class G>
NamedFunction named(double parameter) {
  return {parameter, [](double m, double a) { return with_parameter<G>(a)(m); },
          [](double m, double d, double a) { return with_parameter<G>(a).gap(m, d); }};
}

struct FunctionName {
  std::string_view name;
  bool takes_parameter;
  NamedFunction (*make)(double parameter);
};
constexpr std::array<FunctionName, 11> function_names{{{"exp", false, named<functions::Exp>},
                                                       {"exp-minus", false, named<functions::ExpMinus>},
                                                       {"reciprocal", false, named<functions::Reciprocal>},
                                                       {"square", false, named<functions::Square>},
                                                       {"log", false, named<functions::Log>},
                                                       {"sqrt", false, named<functions::Sqrt>},
                                                       {"power", true, named<functions::Power>},
                                                       {"davis", true, named<functions::Davis>},
                                                       {"logistic", false, named<functions::Logistic>},
                                                       {"absolute", false, named<functions::Absolute>},
                                                       {"positive-part", false, named<functions::PositivePart>}}};

// "log", or "power:1.5".
NamedFunction function_of(const std::string& text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::string name = text.substr(0, colon);
  std::vector<std::string_view> names;
  for (const FunctionName& f : function_names) {
    names.push_back(f.name);
    if (f.name != name) continue;
    if (f.takes_parameter != (colon < text.size())) {
      throw std::invalid_argument(
          "g = '" + text + "' (" +
          (f.takes_parameter ? "needs its parameter); write " + name + ":1.5" : "takes no parameter); write " + name));
    }
    return f.make(f.takes_parameter ? parse_double(text.substr(colon + 1), "g") : 0.0);
  }
  std::string all;
  for (const std::string_view n : names) all += (all.empty() ? "" : ", ") + std::string(n);
  throw std::invalid_argument("g = '" + text +
                              "' (not a function that has a form without cancellation); it is one of " + all +
                              suggestion(name, names) + ". For another one write the levels yourself");
}

/// An integrand that Python evaluates: at a number, at the coordinates of a point, or at a draw from the unit cube.
struct Integrand {
  std::shared_ptr<Lookups> lookups;

  double operator()(double x) const {
    if (!lookups->collecting()) return lookups->next(0).front();
    lookups->ask(0).front() = x;
    return 0;
  }
  double operator()(std::span<const double> x) const {
    if (!lookups->collecting()) return lookups->next(0).front();
    std::copy(x.begin(), x.end(), lookups->ask(0).begin());
    return 0;
  }
  double operator()(Stream& rng) const {
    if (!lookups->collecting()) return lookups->next(0).front();
    rng.fill(lookups->ask(0));
    return 0;
  }
};

/// The same as a random variable only.
struct CubeDraw {
  Integrand f;
  double operator()(Stream& rng) const { return f(rng); }
};

Rates or_default(const Rates& rates, const Rates& usual) { return std::isnan(rates.variance_decay) ? usual : rates; }

}  // namespace

UserProblem problem_of(const Facts& facts) {
  UserProblem user;
  catalog::Problem& p = user.problem;
  p.name = facts.name;
  p.module = "python";
  p.truth = facts.truth;
  p.formula = facts.formula;
  p.rates = facts.rates;
  p.lowest_base = facts.lowest_base;
  return user;
}

UserProblem levels_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, std::size_t components) {
  const std::int64_t deepest = std::min(facts.deepest_level, lookups->deepest_level());
  if (components == 0) return make_problem(facts, Levels<double>{lookups, 1, deepest}, lookups);
  UserProblem user = make_problem(facts, Levels<Eigen::ArrayXd>{lookups, components, deepest}, lookups);
  user.components = components;
  return user;
}

UserProblem mean_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, const std::string& g,
                         const std::string& points, double from, double to) {
  const NamedFunction function = function_of(g);
  const Integrand f{lookups};
  Facts known = facts;
  // One draw of level k looks 2^k numbers up, and they are all there at once.
  const auto make = [&](auto sequence) {
    return make_problem(known, with_deepest_level(std::move(sequence), Lookups::deepest_doubling), lookups);
  };
  if (points == "comb") {
    known.rates = or_default(facts.rates, IntegralOptions{}.rates);
    return make(function_of_integral(f, function, {from, to, known.rates}));
  }
  if (points == "jittered") {
    known.rates = or_default(facts.rates, JitteredOptions{}.rates);
    return make(function_of_jittered_integral(f, function, {from, to, known.rates}));
  }
  if (points == "nets") {
    auto sequence = function_of_integral(f, Cube(static_cast<std::int64_t>(lookups->size(0).width)), function);
    sequence.rates = known.rates = or_default(facts.rates, sequence.rates);
    return make(std::move(sequence));
  }
  constexpr std::array<std::string_view, 4> names = {"independent", "comb", "jittered", "nets"};
  if (points != names[0]) {
    throw std::invalid_argument("points = '" + points + "' (must be independent, comb, jittered or nets)" +
                                suggestion(points, names));
  }
  known.rates = or_default(facts.rates, {2, 1});
  return make(function_of_mean(CubeDraw{f}, function, known.rates));
}

}  // namespace debias::python

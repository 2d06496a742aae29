#include "problem.hpp"

#include <algorithm>
#include <array>
#include <cmath>
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

/// What a draw of a level gave: I_k, where it has one, and D_k.
template <Value V>
struct Answer {
  V value;
  V difference;
  double work;
  bool has_value = true;
};

/// Levels that Python answers, of any kind: one virtual call a draw, and the estimators are compiled once.
template <Value V>
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;

  [[nodiscard]] virtual Answer<V> draw(std::int64_t level, Stream& rng) const = 0;
  /// I_level. Throws std::invalid_argument where there is none.
  [[nodiscard]] virtual Term<V> value(std::int64_t level, Stream& rng) const = 0;
  /// Only of sources that share a base.
  [[nodiscard]] virtual SharedDraw<V> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const = 0;
  [[nodiscard]] virtual std::int64_t deepest_level() const = 0;
  [[nodiscard]] virtual SequenceFacts facts() const { return {}; }
};

template <Value V, bool shares>
class Erased {
 public:
  explicit Erased(std::shared_ptr<const Source<V>> source)
      : source_(std::move(source)), deepest_(source_->deepest_level()) {}

  [[nodiscard]] std::int64_t deepest_level() const { return deepest_; }
  [[nodiscard]] SequenceFacts facts() const { return source_->facts(); }
  Draw<V> operator()(std::int64_t level, Stream& rng) const {
    Answer<V> a = source_->draw(level, rng);
    if (!a.has_value) refuse_value(level);
    return {std::move(a.value), std::move(a.difference), a.work};
  }
  Term<V> value_at(std::int64_t level, Stream& rng) const { return source_->value(level, rng); }
  Term<V> difference_at(std::int64_t level, Stream& rng) const {
    Answer<V> a = source_->draw(level, rng);
    return {std::move(a.difference), a.work};
  }
  /// Reports I_k and D_k where both are there.
  Term<V> difference_at(std::int64_t level, Stream& rng, const auto& report) const {
    Answer<V> a = source_->draw(level, rng);
    if (a.has_value) report(a.value, a.difference);
    return {std::move(a.difference), a.work};
  }
  SharedDraw<V> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const requires(shares) {
    return source_->shared(level, base_level, rng);
  }

  [[noreturn]] static void refuse_value(std::int64_t level) {
    throw std::invalid_argument("differences: the differences alone at level " + std::to_string(level) +
                                " (the estimates are needed too); return (fine, coarse)");
  }

 private:
  std::shared_ptr<const Source<V>> source_;
  std::int64_t deepest_;
};

template <Value V>
class Levels : public Source<V> {
 public:
  Levels(std::shared_ptr<Lookups> lookups, std::size_t components, std::int64_t deepest)
      : lookups_(std::move(lookups)), components_(components), deepest_(deepest) {}

  [[nodiscard]] std::int64_t deepest_level() const override { return deepest_; }
  [[nodiscard]] Answer<V> draw(std::int64_t level, Stream& rng) const override {
    const auto [numbers, work] = look_up(level, rng);
    const bool has_value = numbers.size() != components_ || level == 0;
    return {as_value(numbers.first(std::min(numbers.size(), components_))),
            as_value(numbers.last(std::min(numbers.size(), components_))), work, has_value};
  }
  [[nodiscard]] Term<V> value(std::int64_t level, Stream& rng) const override {
    Answer<V> a = draw(level, rng);
    if (!a.has_value) Erased<V, false>::refuse_value(level);
    return {std::move(a.value), a.work};
  }
  [[nodiscard]] SharedDraw<V> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const override {
    const auto [numbers, work] = look_up(shared_key(level, base_level), rng);
    return {as_value(numbers.first(std::min(numbers.size(), components_))),
            as_value(numbers.last(std::min(numbers.size(), components_))), work};
  }

 private:
  // No numbers in the first pass.
  [[nodiscard]] std::pair<std::span<const double>, double> look_up(std::int64_t key, Stream& rng) const {
    const double work = lookups_->size(key).work;
    if (!lookups_->collecting()) return {lookups_->next(key), work};
    lookups_->ask(key, 1, rng);
    return {{}, work};
  }
  [[nodiscard]] V as_value(std::span<const double> numbers) const {
    if constexpr (RealValue<V>) {
      return numbers.empty() ? 0.0 : numbers.front();
    } else {
      V v = V::Zero(static_cast<Eigen::Index>(components_));
      for (std::size_t i = 0; i < numbers.size(); ++i) set_component(v, i, numbers[i]);
      return v;
    }
  }

  std::shared_ptr<Lookups> lookups_;
  std::size_t components_;
  std::int64_t deepest_;
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

/// An integrand that Python evaluates at a number.
struct Integrand {
  std::shared_ptr<Lookups> lookups;

  double operator()(double x) const {
    if (!lookups->collecting()) return lookups->next(0).front();
    lookups->ask(0).front() = x;
    return 0;
  }
};

/// Draws from the unit cube that Python has answered, all of a level at once, summed in the order in which C++ draws them.
struct AnsweredDraws {
  std::shared_ptr<Lookups> lookups;
  static constexpr double scale = 1;
  static constexpr double extra_work = 0;

  auto points(std::int64_t level, std::int64_t group_level, Stream& /*rng*/) const {
    const double* at = lookups->next(0, static_cast<std::size_t>(doubled_draws(level))).data();
    const std::int64_t size = doubled_draws(group_level);
    return debias::detail::GroupSums{
        size, [at, size]() mutable { return [next = std::exchange(at, at + size)]() mutable { return *next++; }; }};
  }
};

/// A doubling whose points Python answers. Independent draws are asked for without a look at the sequence.
template <class D, bool independent>
class Means : public Source<double> {
 public:
  Means(std::shared_ptr<Lookups> lookups, D sequence) : lookups_(std::move(lookups)), sequence_(std::move(sequence)) {}

  // One draw of level k looks 2^k numbers up, and they are all there at once.
  [[nodiscard]] std::int64_t deepest_level() const override { return Lookups::deepest_doubling; }
  [[nodiscard]] SequenceFacts facts() const override { return debias::facts_of(sequence_); }
  [[nodiscard]] Answer<double> draw(std::int64_t level, Stream& rng) const override {
    if (asks(level, rng)) return {0, 0, 1};
    const Draw<double> d = debias::detail::whole_draw(sequence_, level, rng);
    return {d.value, d.difference, d.work};
  }
  [[nodiscard]] Term<double> value(std::int64_t level, Stream& rng) const override {
    if (asks(level, rng)) return {0, 1};
    return debias::value_of(sequence_, level, rng);
  }
  [[nodiscard]] SharedDraw<double> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const override {
    if (asks(level, rng)) return {0, 0, 1};
    return sequence_.shared(level, base_level, rng);
  }

 private:
  bool asks(std::int64_t level, Stream& rng) const {
    if (!independent || !lookups_->collecting()) return false;
    lookups_->ask(0, doubled_draws(level), rng);
    return true;
  }

  std::shared_ptr<Lookups> lookups_;
  D sequence_;
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

UserProblem levels_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, std::size_t components, bool shares) {
  const std::int64_t deepest = std::min(facts.deepest_level, lookups->deepest_level());
  const auto make = [&]<Value V>(std::shared_ptr<const Source<V>> source) {
    return shares ? make_problem(facts, Erased<V, true>(source), lookups)
                  : make_problem(facts, Erased<V, false>(source), lookups);
  };
  if (components == 0) {
    return make(std::shared_ptr<const Source<double>>(std::make_shared<Levels<double>>(lookups, 1, deepest)));
  }
  using Array = Eigen::ArrayXd;
  UserProblem user =
      make(std::shared_ptr<const Source<Array>>(std::make_shared<Levels<Array>>(lookups, components, deepest)));
  user.components = components;
  return user;
}

UserProblem mean_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, const std::string& g,
                         const std::string& points, double from, double to) {
  const NamedFunction function = function_of(g);
  const Integrand f{lookups};
  Facts known = facts;
  const auto make = [&]<bool independent>(auto sequence, std::bool_constant<independent>) {
    using D = decltype(sequence);
    return make_problem(known, Erased<double, true>(std::make_shared<Means<D, independent>>(lookups, sequence)),
                        lookups);
  };
  if (points == "comb") {
    known.rates = or_default(facts.rates, IntegralOptions{}.rates);
    return make(function_of_integral(f, function, {from, to, known.rates}), std::false_type{});
  }
  if (points == "jittered") {
    known.rates = or_default(facts.rates, JitteredOptions{}.rates);
    return make(function_of_jittered_integral(f, function, {from, to, known.rates}), std::false_type{});
  }
  constexpr std::array<std::string_view, 3> names = {"independent", "comb", "jittered"};
  if (points != names[0]) {
    throw std::invalid_argument("points = '" + points + "' (must be independent, comb or jittered)" +
                                suggestion(points, names));
  }
  known.rates = or_default(facts.rates, {2, 1});
  return make(Doubling<AnsweredDraws, NamedFunction>({lookups}, function, known.rates), std::true_type{});
}

}  // namespace debias::python

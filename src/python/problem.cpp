#include "problem.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <span>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <debias/derivative.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/function_of_mean.hpp>
#include <Eigen/Core>

#include "../catalog/with_estimator.hpp"
#include "../core/text.hpp"
#include "named_function.hpp"
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
    return lookups->unanswered([&] { return debias::detail::mean_work(sequence, level, plan); });
  };
  runs.nets = [sequence, lookups](std::int64_t level, bool as_base, int octaves, const Plan& plan) {
    return debias::detail::net_moments(
        estimate_collected(*lookups, debias::detail::NetDraw<S>{sequence, level, as_base, octaves}, plan), octaves);
  };
  if constexpr (ChecksPoints<S>) {
    runs.missed = [sequence, lookups](std::int64_t level, std::int64_t draws, debias::detail::Batches which,
                                      std::uint64_t seed) {
      const auto missed = [&] { return debias::detail::missed_of(sequence, level, draws, which, seed); };
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

struct NoTerms {};

template <BiasedSequence S, class T = NoTerms>
UserProblem make_problem(const Facts& facts, const S& sequence, const std::shared_ptr<Lookups>& lookups,
                         const std::shared_ptr<const T>& terms = {}) {
  using catalog::Method;
  const auto with = [sequence, terms](const Choice& choice, const auto& use) {
    static_cast<void>(terms);  // of levels there are none
    if constexpr (TermSequence<T>) {
      if (terms && choice.method == Method::roulette) {
        return use(roulette(*terms, choice.pmf, {.base_level = choice.base_level}));
      }
    }
    return catalog::detail::with_estimator(sequence, choice, use);
  };
  UserProblem user = problem_of(facts);
  catalog::Problem& p = user.problem;
  p.methods = {Method::single_term, Method::single_term_outcome, Method::independent_sum, Method::truncated};
  if (terms) p.methods.insert(p.methods.end() - 1, Method::roulette);
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
  /// D_level, and I_level where it costs nothing more.
  [[nodiscard]] virtual Answer<V> difference(std::int64_t level, Stream& rng) const { return draw(level, rng); }
  /// I_level. Throws std::invalid_argument where there is none.
  [[nodiscard]] virtual Term<V> value(std::int64_t level, Stream& rng) const = 0;
  /// Only of sources that share a base.
  [[nodiscard]] virtual SharedDraw<V> shared(std::int64_t /*level*/, std::int64_t /*base_level*/,
                                             Stream& /*rng*/) const {
    throw std::logic_error("shared: not by these levels");
  }
  /// Only of sources whose points may be in step with the integrand.
  [[nodiscard]] virtual V missed(std::int64_t /*level*/, std::int64_t /*draws*/, Stream& /*rng*/) const {
    throw std::logic_error("missed: not by these levels");
  }
  [[nodiscard]] virtual std::int64_t deepest_level() const = 0;
  [[nodiscard]] virtual SequenceFacts facts() const { return {}; }
  [[nodiscard]] virtual BiasBound bias_bound(const LevelTable& /*levels*/) const { return {}; }
};

template <Value V, bool shares, bool checks_points = false>
class Erased {
 public:
  explicit Erased(std::shared_ptr<const Source<V>> source)
      : source_(std::move(source)), deepest_(source_->deepest_level()) {}

  [[nodiscard]] std::int64_t deepest_level() const { return deepest_; }
  [[nodiscard]] SequenceFacts facts() const { return source_->facts(); }
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const { return source_->bias_bound(levels); }
  Draw<V> operator()(std::int64_t level, Stream& rng) const {
    Answer<V> a = source_->draw(level, rng);
    if (!a.has_value) refuse_value(level);
    return {std::move(a.value), std::move(a.difference), a.work};
  }
  Term<V> value_at(std::int64_t level, Stream& rng) const { return source_->value(level, rng); }
  Term<V> difference_at(std::int64_t level, Stream& rng) const {
    Answer<V> a = source_->difference(level, rng);
    return {std::move(a.difference), a.work};
  }
  /// Reports I_k and D_k where both are there.
  Term<V> difference_at(std::int64_t level, Stream& rng, const auto& report) const {
    Answer<V> a = source_->difference(level, rng);
    if (a.has_value) report(a.value, a.difference);
    return {std::move(a.difference), a.work};
  }
  SharedDraw<V> shared(std::int64_t level, std::int64_t base_level, Stream& rng) const requires(shares) {
    return source_->shared(level, base_level, rng);
  }
  [[nodiscard]] V missed(std::int64_t level, std::int64_t draws, Stream& rng) const requires(checks_points) {
    return source_->missed(level, draws, rng);
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
  Levels(std::shared_ptr<Lookups> lookups, std::size_t components, std::int64_t deepest, const Facts& facts)
      : lookups_(std::move(lookups)), components_(components), deepest_(deepest), facts_(facts) {}

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
  [[nodiscard]] BiasBound bias_bound(const LevelTable& levels) const override {
    if (facts_.last_level < 0) return {};
    auto seen = debias::detail::see_differences(levels, facts_.last_level, facts_.rates);
    // Rounding alone says nothing; it doubles with the level at least.
    std::erase_if(seen.moments, [this](const debias::detail::DifferenceMoment& m) {
      const double rounding = facts_.rounding * std::exp2(static_cast<double>(m.level - facts_.last_level));
      return m.log_square < 2 * std::log(rounding);
    });
    return debias::detail::bound_of_differences(seen, debias::detail::doubt_of_draws(seen.moments, facts_.rates),
                                                facts_.last_level, facts_.rates, facts_.rounding);
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
  Facts facts_;
};

// ---- terms in order

/// The terms of a series: each from a stream of its own, or all of one path from one stream, where an answer to level k is
/// the terms 0 ... k.
class Terms {
 public:
  Terms(std::shared_ptr<Lookups> lookups, bool path)
      : lookups_(std::move(lookups)), state_(std::make_shared<State>()), path_(path) {}

  /// Term k alone, of a series.
  [[nodiscard]] double term(std::int64_t k, const Stream& rng) const {
    if (!lookups_->collecting()) return lookups_->next(k).front();
    const auto branch = static_cast<std::uint64_t>(k);
    Stream own = rng.split(branch, branch);
    lookups_->ask(k, 1, own);
    return 0;
  }
  /// The terms 0 ... k of a path; none in the first pass.
  [[nodiscard]] std::span<const double> terms(std::int64_t k, Stream& rng) const {
    if (!lookups_->collecting()) return lookups_->next(k);
    lookups_->ask(k, 1, rng);
    return {};
  }
  [[nodiscard]] bool path() const { return path_; }
  [[nodiscard]] double work(std::int64_t level) const { return lookups_->size(level).work; }

  class Cursor {
   public:
    Cursor(const Terms& terms, const Stream& rng) : terms_(&terms), rng_(rng) {
      if (terms.path_ && !terms.lookups_->collecting()) read_ = terms.lookups_->next(terms.state_->taken());
    }
    Cursor(const Cursor&) = delete;
    Cursor& operator=(const Cursor&) = delete;
    // How many terms were wanted is known at the end only.
    ~Cursor() noexcept(false) {
      if (!terms_->path_ || !terms_->lookups_->collecting() || k_ == 0) return;
      terms_->state_->add(k_ - 1, terms_->lookups_->pass());
      if (std::uncaught_exceptions() == 0) terms_->lookups_->ask(k_ - 1, 1, rng_);
    }
    Term<double> operator()() {
      const std::int64_t k = k_++;
      if (!terms_->path_) return {terms_->term(k, rng_)};
      return {k < static_cast<std::int64_t>(read_.size()) ? read_[static_cast<std::size_t>(k)] : 0.0};
    }

   private:
    const Terms* terms_;
    Stream rng_;
    std::span<const double> read_;
    std::int64_t k_ = 0;
  };
  Cursor operator()(const Stream& rng) const { return {*this, rng}; }

 private:
  // The last terms of the paths of a first pass, in order.
  struct State {
    std::vector<std::int64_t> last;
    std::size_t read = 0;
    std::uint64_t pass = 0;
    void add(std::int64_t k, std::uint64_t of_pass) {
      if (of_pass != pass) {
        last.clear();
        read = 0;
        pass = of_pass;
      }
      last.push_back(k);
    }
    std::int64_t taken() { return last.at(read++); }
  };

  std::shared_ptr<Lookups> lookups_;
  std::shared_ptr<State> state_;
  bool path_;
};

class TermLevels : public Source<double> {
 public:
  TermLevels(Terms terms, std::int64_t deepest) : terms_(std::move(terms)), deepest_(deepest) {}

  [[nodiscard]] std::int64_t deepest_level() const override { return deepest_; }
  [[nodiscard]] Answer<double> draw(std::int64_t level, Stream& rng) const override {
    double partial = 0;
    double term = 0;
    if (terms_.path()) {
      for (const double t : terms_.terms(level, rng)) partial += term = t;
      return {partial, term, terms_.work(level)};
    }
    for (std::int64_t k = 0; k <= level; ++k) partial += term = terms_.term(k, rng);
    return {partial, term, static_cast<double>(level) + 1};
  }
  [[nodiscard]] Answer<double> difference(std::int64_t level, Stream& rng) const override {
    if (terms_.path()) return draw(level, rng);
    const double term = terms_.term(level, rng);
    return {term, term, 1, level == 0};
  }
  [[nodiscard]] Term<double> value(std::int64_t level, Stream& rng) const override {
    const Answer<double> a = draw(level, rng);
    return {a.value, a.work};
  }

 private:
  Terms terms_;
  std::int64_t deepest_;
};

// ---- functions of a mean

/// An integrand that Python evaluates: at a number, or at the coordinates of a point.
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
  [[nodiscard]] double missed(std::int64_t level, std::int64_t draws, Stream& rng) const override {
    if constexpr (ChecksPoints<D>) return sequence_.missed(level, draws, rng);
    return Source<double>::missed(level, draws, rng);
  }

 private:
  bool asks(std::int64_t level, Stream& rng) const {
    if (!independent || !lookups_->collecting() || lookups_->answers_with_zeros()) return false;
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

namespace {
// All levels of numbers that share no base: one type, compiled once.
UserProblem plain_problem(const Facts& facts, std::shared_ptr<const Source<double>> source,
                          const std::shared_ptr<Lookups>& lookups, const std::shared_ptr<const Terms>& terms = {}) {
  return make_problem(facts, Erased<double, false>(std::move(source)), lookups, terms);
}
}  // namespace

UserProblem levels_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, std::size_t components, bool shares) {
  const std::int64_t deepest = std::min(facts.deepest_level, lookups->deepest_level());
  if (components == 0) {
    const auto source = std::make_shared<Levels<double>>(lookups, 1, deepest, facts);
    return shares ? make_problem(facts, Erased<double, true>(source), lookups) : plain_problem(facts, source, lookups);
  }
  using Array = Eigen::ArrayXd;
  const auto source = std::make_shared<Levels<Array>>(lookups, components, deepest, facts);
  UserProblem user = shares ? make_problem(facts, Erased<Array, true>(source), lookups)
                            : make_problem(facts, Erased<Array, false>(source), lookups);
  user.components = components;
  return user;
}

UserProblem terms_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, bool path) {
  const auto terms = std::make_shared<const Terms>(lookups, path);
  const std::int64_t deepest = std::min(facts.deepest_level, lookups->deepest_level());
  return plain_problem(facts, std::make_shared<TermLevels>(*terms, deepest), lookups, terms);
}

UserProblem mean_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, const std::string& g,
                         const std::string& points, double from, double to) {
  const NamedFunction function = function_of(g);
  lookups->set_ahead(1 << 13);
  const Integrand f{lookups};
  Facts known = facts;
  const auto make = [&]<bool independent>(auto sequence, std::bool_constant<independent>) {
    using D = decltype(sequence);
    return make_problem(
        known, Erased<double, true, ChecksPoints<D>>(std::make_shared<Means<D, independent>>(lookups, sequence)),
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
  if (points == "nets") {
    auto sequence = function_of_integral(f, Cube(static_cast<std::int64_t>(lookups->size(0).width)), function);
    sequence.rates = known.rates = or_default(facts.rates, sequence.rates);
    return make(std::move(sequence), std::false_type{});
  }
  constexpr std::array<std::string_view, 4> names = {"independent", "comb", "jittered", "nets"};
  if (points != names[0]) {
    throw std::invalid_argument("points = '" + points + "' (must be independent, comb, jittered or nets)" +
                                suggestion(points, names));
  }
  known.rates = or_default(facts.rates, {2, 1});
  return make(Doubling<AnsweredDraws, NamedFunction>({lookups}, function, known.rates), std::true_type{});
}

}  // namespace debias::python

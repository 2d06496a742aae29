// A value type of a user's own, in a namespace of its own, through every front door.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <type_traits>
#include <utility>

#include "catch_shim.hpp"

#include <debias/debias.hpp>

namespace lab {

/// Two numbers, as awkward as a Value may be: no default constructor, nothing converts to it or from it, its address
/// and the comma beside it are not to be had.
class Pair {
 public:
  explicit Pair(double first, double second) : first_(first), second_(second) {}

  friend Pair operator+(const Pair& a, const Pair& b) { return Pair(a.first_ + b.first_, a.second_ + b.second_); }
  friend Pair operator-(const Pair& a, const Pair& b) { return Pair(a.first_ - b.first_, a.second_ - b.second_); }

  Pair* operator&() = delete;
  const Pair* operator&() const = delete;
  template <class T>
  void operator,(T&&) const = delete;

  [[nodiscard]] double first() const { return first_; }
  [[nodiscard]] double second() const { return second_; }
  void set(std::size_t i, double x) { (i == 0 ? first_ : second_) = x; }

 private:
  double first_;
  double second_;
};

// What a Value needs, found by argument-dependent lookup alone.
std::size_t component_count(const Pair& /*p*/) { return 2; }
double component(const Pair& p, std::size_t i) { return i == 0 ? p.first() : p.second(); }
void set_component(Pair& p, std::size_t i, double x) { p.set(i, x); }

// Names that debias has too: a call of its own that finds these by the same lookup does not compile.
template <class... T>
void sum(T&&...) = delete;
template <class... T>
void difference(T&&...) = delete;
template <class... T>
void scaled(T&&...) = delete;
template <class... T>
void zero_like(T&&...) = delete;
template <class... T>
void as_scalar(T&&...) = delete;
template <class... T>
void base(T&&...) = delete;
template <class... T>
void coupled(T&&...) = delete;
template <class... T>
void value_of(T&&...) = delete;
template <class... T>
void difference_of(T&&...) = delete;
template <class... T>
void draw_sample(T&&...) = delete;
template <class... T>
void description(T&&...) = delete;
template <class... T>
void estimate(T&&...) = delete;
template <class... T>
void merge(T&&...) = delete;
template <class... T>
void extend(T&&...) = delete;
template <class... T>
void single_term(T&&...) = delete;
template <class... T>
void stratified(T&&...) = delete;
template <class... T>
void estimator_of(T&&...) = delete;
template <class... T>
void level_runs(T&&...) = delete;
template <class... T>
void survey(T&&...) = delete;
template <class... T>
void multilevel(T&&...) = delete;
template <class... T>
void function_of_mean(T&&...) = delete;
template <class... T>
void evaluate(T&&...) = delete;
template <class... T>
void evaluate_term(T&&...) = delete;
template <class... T>
void value_at(T&&...) = delete;
template <class... T>
void path_series(T&&...) = delete;
template <class... T>
void describe(T&&...) = delete;
template <class... T>
void pay(T&&...) = delete;

// All types are of this namespace, so that those of sequences and estimators are looked up here as well.

/// I_k = U + 2^-k, and its negative.
struct Sequence {
  debias::Draw<Pair> operator()(std::int64_t level, debias::Stream& rng) const {
    const double u = rng.uniform();
    const auto at = [u](std::int64_t k) {
      const double x = u + std::ldexp(1 - u, -static_cast<int>(k));
      return Pair(x, -x);
    };
    return level == 0 ? debias::base(at(0))
                      : debias::coupled(at(level), at(level - 1), std::exp2(0.5 * static_cast<double>(level)));
  }
};

struct Rated : Sequence {
  static constexpr debias::Rates rates{2, 0.5};
};

struct Sharing : Rated {
  debias::SharedDraw<Pair> shared(std::int64_t level, std::int64_t base_level, debias::Stream& rng) const {
    debias::Stream same(rng);
    const debias::Draw<Pair> deep = (*this)(level, rng);
    return {(*this)(base_level, same).value, deep.difference, deep.work};
  }
};

/// Terms U^k.
struct Terms {
  class Cursor {
   public:
    explicit Cursor(double u) : u_(u) {}
    debias::Term<Pair> operator()() {
      const double now = std::exchange(next_, next_ * u_);
      return {Pair(now, -now)};
    }

   private:
    double u_;
    double next_ = 1;
  };
  static constexpr debias::Rates rates{2, 0};
  Cursor operator()(debias::Stream& rng) const { return Cursor(0.5 * rng.uniform()); }
};

struct Variable {
  Pair operator()(debias::Stream& rng) const {
    const double u = 1 + rng.uniform();
    return Pair(u, 2 * u);
  }
};

/// A value again, and one that is a number.
struct Squares {
  Pair operator()(const Pair& m) const { return Pair(m.first() * m.first(), m.second() * m.second()); }
};
struct WithGap : Squares {
  Pair gap(const Pair& m, const Pair& d) const {
    static_cast<void>(m);
    return Pair(-d.first() * d.first(), -d.second() * d.second());
  }
};
struct Product {
  double operator()(const Pair& m) const { return m.first() * m.second(); }
};

struct Recording {
  template <debias::Record R>
  debias::Sample<Pair> operator()(debias::Stream& rng, R& record) const {
    const double u = rng.uniform();
    record.base(0, u, 1);
    return {Pair(u, -u), 1, 0};
  }
};

/// Functions of a parameter, terms of a series, steps of a chain.
struct Curve {
  Pair operator()(double x, debias::Stream& rng) const {
    const double u = rng.uniform();
    return Pair(std::exp(u * x), x * x);
  }
};
struct PlainCurve {
  Pair operator()(double x) const { return Pair(std::exp(x), x * x); }
};
struct PlainTerms {
  Pair operator()(std::int64_t k) const {
    return Pair(std::ldexp(1.0, -static_cast<int>(k)), 1.0 / static_cast<double>((k + 1) * (k + 1)));
  }
};
struct RandomTerms {
  Pair operator()(std::int64_t k, debias::Stream& rng) const {
    const double x = std::ldexp(2 * rng.uniform(), -static_cast<int>(k));
    return Pair(x, -x);
  }
};
struct Step {
  Pair operator()(const Pair& x, debias::Stream& rng) const {
    const double z = rng.normal();
    return Pair(0.5 * x.first() + z, 0.25 * x.second() + z);
  }
};
/// A fresh draw of Variable now and then; of two chains the same one.
struct Refresh {
  Pair operator()(const Pair& x, debias::Stream& rng) const { return rng.uniform() < 0.5 ? Variable{}(rng) : x; }
};
struct RefreshBoth {
  std::pair<Pair, Pair> operator()(const Pair& x, const Pair& y, debias::Stream& rng) const {
    if (!(rng.uniform() < 0.5)) return {x, y};
    const Pair fresh = Variable{}(rng);
    return {fresh, fresh};
  }
};
struct Start {
  Pair operator()(debias::Stream& rng) const { return Variable{}(rng); }
};
struct Halve {
  Pair operator()(const Pair& x, debias::Stream& /*rng*/) const { return Pair(x.first() / 2, x.second() / 2); }
};
struct Read {
  Pair operator()(const Pair& x) const { return x; }
};
struct Inner {
  Pair operator()(const Pair& y, debias::Stream& rng) const {
    const double u = rng.uniform();
    return Pair(y.first() + u, y.second() - u);
  }
};
struct Make {
  Recording operator()(const Pair& /*y*/) const { return {}; }
};
struct Payoff {
  Pair operator()(double x) const { return Pair(x, x * x); }
};
struct PathPayoff {
  Pair operator()(const debias::Minimum& path) const { return Pair(path.minimum, path.terminal); }
};

}  // namespace lab

using debias::Geometric;

namespace {

const debias::Plan plan{.samples = 2048, .seed = 3, .threads = 2};

/// Whether both components of a mean are within 4.5 standard errors of the truth.
template <class R>
bool agrees(const R& result, double first, double second) {
  const auto one = [&](std::size_t i, double truth) {
    const auto& c = result.components[i];
    return std::abs(c.mean - truth) <= 4.5 * c.standard_error + 1e-12;
  };
  return one(0, first) && one(1, second);
}

}  // namespace

TEST_CASE("an awkward value type goes through every estimator of a sequence", "[doors][compile]") {
  STATIC_REQUIRE(debias::Value<lab::Pair>);
  STATIC_REQUIRE_FALSE(std::is_default_constructible_v<lab::Pair>);
  const lab::Sequence s;
  const Geometric pmf(0.4);
  CHECK(agrees(debias::estimate(debias::single_term(s, pmf), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::single_term(s, pmf, {.base = debias::Base::one_outcome}), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::single_term(lab::Rated{}), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::single_term(lab::Sharing{}), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::independent_sum(s, pmf), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::progressive(s, pmf), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::biased_progressive(s, {.base_level = 30}), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::truncated(s, 30), plan), 0.5, -0.5));
  CHECK_FALSE(agrees(debias::estimate(debias::truncated(s, 1), plan), 0.5, -0.5));  // 0.75: a bias would be seen
  CHECK(agrees(debias::estimate(debias::stratified(debias::single_term(lab::Sharing{}, pmf), 4), plan), 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::stratified(debias::single_term(s, pmf), 4, debias::Strata::residual), plan),
               0.5, -0.5));
  // 1 / (1 - U / 2) has the mean 2 log 2.
  const double truth = 2 * std::log(2.0);
  CHECK(agrees(debias::estimate(debias::roulette(lab::Terms{}, pmf), plan), truth, -truth));
  CHECK(agrees(debias::estimate(debias::roulette(lab::Terms{}), plan), truth, -truth));
  CHECK(agrees(debias::estimate(debias::roulette(lab::Terms{}, debias::RunningWeight(1.0)), plan), truth, -truth));
  CHECK(agrees(debias::estimate(debias::roulette(lab::Terms{}, debias::IndexRoulette(3)), plan), truth, -truth));
  CHECK(agrees(debias::estimate(debias::single_term(debias::levels_of(lab::Terms{})), plan), truth, -truth));
}

TEST_CASE("an awkward value type goes through recipe, survey and multilevel", "[doors][compile]") {
  const auto result = debias::estimate(debias::recipe(lab::Sharing{}), plan);
  CHECK(agrees(result, 0.5, -0.5));
  CHECK(agrees(debias::estimate(debias::recipe(lab::Sequence{}), plan), 0.5, -0.5));
  const debias::Survey survey = debias::survey(lab::Sequence{}, 5, {.samples = 1024});
  CHECK(survey.rows[0].values.size() == 2);
  CHECK(std::abs(survey.rates.variance_decay.value - 2) < 0.1);
  CHECK(agrees(debias::multilevel(lab::Sequence{}, 0.02), 0.5, -0.5));
  std::ostringstream out;
  out << result << survey;
  CHECK(!out.str().empty());
}

TEST_CASE("an awkward value type is merged, extended and traced", "[doors][compile]") {
  const auto e = debias::single_term(lab::Sequence{}, Geometric(0.4));
  const auto whole = debias::estimate(e, {.samples = 2048, .seed = 3});
  const auto first = debias::estimate(e, {.samples = 1024, .seed = 3});
  const auto second = debias::estimate(e, {.samples = 1024, .seed = 3, .first = 1024});
  for (const auto& same : {debias::merge(first, second), debias::extend(e, first, {.samples = 2048})}) {
    CHECK(same.components[0].mean == whole.components[0].mean);
    CHECK(same.mean.second() == whole.mean.second());
  }
  const auto trace = debias::trace(e, 3, 7);
  CHECK(trace.levels.size() == 2);
  CHECK(trace.sample.value.first() == -trace.sample.value.second());
  CHECK(agrees(debias::estimate(lab::Recording{}, {.samples = 1024}), 0.5, -0.5));
  CHECK(agrees(debias::estimate(lab::Variable{}, {.samples = 1024}), 1.5, 3));
}

TEST_CASE("an awkward value type goes through every module that makes a sequence of it", "[doors][compile]") {
  const auto unbiased = [](const auto& s) { return debias::estimate(debias::single_term(s), plan); };
  CHECK(agrees(unbiased(debias::function_of_mean(lab::Variable{}, lab::Squares{})), 2.25, 9));
  CHECK(agrees(unbiased(debias::function_of_mean(lab::Variable{}, lab::WithGap{})), 2.25, 9));
  CHECK(std::abs(unbiased(debias::function_of_mean(lab::Variable{}, lab::Product{})).mean - 4.5) < 0.2);
  CHECK(agrees(debias::estimate(debias::recipe(debias::function_of_mean(lab::Variable{}, lab::WithGap{})), plan), 2.25,
               9));
  CHECK(agrees(unbiased(debias::function_of_integral(lab::Payoff{}, lab::Squares{})), 0.25, 1.0 / 9));
  CHECK(agrees(unbiased(debias::function_of_jittered_integral(lab::Payoff{}, lab::Squares{})), 0.25, 1.0 / 9));
  CHECK(agrees(debias::estimate(debias::comb_mean(lab::Payoff{}, 8), plan), 0.5, 1.0 / 3));
  // E (Y + 1/2)^2 for Y uniform in (1, 2), and E (2 Y - 1/2)^2
  CHECK(agrees(unbiased(debias::nested(lab::Start{}, lab::Inner{}, lab::Squares{})), 49.0 / 12, 79.0 / 12));
  CHECK(agrees(unbiased(debias::nested(lab::Start{}, debias::estimated(lab::Make{}), lab::Squares{})), 0.25, 0.25));
  CHECK(agrees(unbiased(debias::finite_difference(lab::PlainCurve{}, 1.0)), std::exp(1.0), 2));
  CHECK(agrees(unbiased(debias::finite_difference(lab::Curve{}, 1.0, {.kind = debias::Difference::central})), 1, 2));
  CHECK(agrees(
      unbiased(debias::finite_difference(lab::Curve{}, 1.0, {.kind = debias::Difference::second, .extrapolations = 1})),
      std::exp(1.0) - 2, 2));
  CHECK(
      agrees(debias::estimate(debias::roulette(debias::series(lab::RandomTerms{}, debias::geometric_terms(0.5))), plan),
             2, -2));
  CHECK(agrees(unbiased(debias::series(lab::RandomTerms{}, debias::geometric_terms(0.5))), 2, -2));
  CHECK(agrees(unbiased(debias::paired(debias::series(lab::RandomTerms{}, debias::geometric_terms(0.5)))), 2, -2));
  CHECK(agrees(unbiased(debias::blocks(debias::series(lab::PlainTerms{}, debias::polynomial_terms(2)))), 2,
               1.6449340668482264));
  CHECK(agrees(debias::estimate(debias::roulette(debias::path_series(lab::Start{}, lab::Halve{}, lab::Read{},
                                                                     debias::geometric_terms(0.5))),
                                plan),
               3, 6));
  CHECK(agrees(unbiased(debias::steady_state(lab::Step{}, lab::Pair(0, 0), lab::Squares{}, debias::contraction(0.5))),
               4.0 / 3, 16.0 / 15));
  CHECK(agrees(debias::estimate(debias::coupled_chain(debias::kernel_of(lab::Refresh{}, lab::RefreshBoth{}),
                                                      lab::Pair(0, 0), lab::Read{}, {.burn_in = 2, .length = 8}),
                                plan),
               1.5, 3));
  const debias::OrnsteinUhlenbeck model{.start = 1, .volatility = 0.1};
  CHECK(agrees(unbiased(debias::milstein(model, lab::Payoff{})), std::exp(-1.0),
               std::exp(-2.0) + 0.005 * (1 - std::exp(-2.0))));
  CHECK(debias::estimate(debias::recipe(debias::euler(model, debias::Minimum{}, lab::PathPayoff{}, {2, 1})), plan)
            .components.size() == 2);
}

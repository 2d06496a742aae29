// NaN and infinity from series, linear operators, PMFs, policies, and through recipe, survey and multilevel.

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include "faults.hpp"

#include <debias/core/estimate.hpp>
#include <debias/diagnostics.hpp>
#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/linear_operators.hpp>
#include <debias/multilevel.hpp>
#include <debias/operators.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/pmf/poisson.hpp>
#include <debias/pmf/radius.hpp>
#include <debias/pmf/tabulated.hpp>
#include <debias/pmf/zeta.hpp>
#include <debias/recipe.hpp>
#include <debias/series.hpp>
#include <debias/survey.hpp>

using namespace debias;
using namespace debias::faults;

namespace {

double power_of_half(std::int64_t k) { return bad(std::exp2(-static_cast<double>(k))); }

// A PMF whose probabilities may be none.
struct BadPmf {
  Geometric pmf{0.5};
  [[nodiscard]] double mass(std::int64_t j) const { return bad(pmf.mass(j)); }
  [[nodiscard]] double tail(std::int64_t j) const { return bad(pmf.tail(j)); }
  [[nodiscard]] std::int64_t sample(double u) const { return pmf.sample(u); }
};

// A diagonal operator.
struct BadOperator {
  [[nodiscard]] Eigen::Index rows() const { return 3; }
  [[nodiscard]] Eigen::VectorXd apply(const Eigen::VectorXd& x) const {
    Eigen::VectorXd y = 0.5 * x;
    y[1] = bad(y[1]);
    return y;
  }
};

const auto coupled_draw = [](std::int64_t level, Stream& rng) {
  const double u = rng.uniform();
  const auto at = [u](std::int64_t k) { return u + std::exp2(-static_cast<double>(k)) * (1 + u); };
  if (level == 0) return base(bad(at(0)));
  const double work = std::exp2(static_cast<double>(level) / 2);
  const double fine = bad(at(level));
  return coupled(fine, bad(at(level - 1)), work);
};

// A whole run: a finite answer from callables of which one in a hundred returned no number is a silent one.
template <class Run>
void check_run(const std::string& factory, const std::string& callable, const Run& run) {
  covers(factory, callable);
  for (const double poison : poisons) {
    INFO(factory << ", " << callable << " returns " << poison);
    bool shows = false;
    faults::faults.begin(poison);
    try {
      shows = !std::isfinite(run());
    } catch (const std::exception&) {
      shows = true;
    }
    CHECK(faults::faults.end() > 0);
    CHECK(shows);
  }
}

}  // namespace

TEST_CASE("no series hides a NaN or an infinity of its terms", "[nan][exact]") {
  const auto plain = [](std::int64_t k) { return power_of_half(k); };
  const auto random = [](std::int64_t k, Stream& rng) { return power_of_half(k) * rng.uniform(); };
  check_terms("series", "term(k)", series(plain, geometric_terms(0.5)));
  check_sequence("series", "term(k)", series(plain));
  check_terms("series", "term(k, rng)", series(random));
  check_sequence("series", "term(k, rng)", series(random, geometric_terms(0.5)));
  check_sequence("paired", "term", paired(series(plain)));
  check_terms("paired", "term", paired(series(random, geometric_terms(0.5))));
  check_sequence("blocks", "term", blocks(series(plain), {3, 1}));
  check_sequence("blocks", "term", blocks(series(random, polynomial_terms(3))));

  const auto start = [](Stream& rng) { return rng.uniform(); };
  const auto advance = [](double x, Stream& rng) { return 0.5 * x * rng.uniform(); };
  const auto read = [](double x) { return std::max(0.0, x); };  // hides a NaN
  check_terms("path_series", "start",
              path_series([](Stream& rng) { return bad(rng.uniform()); }, advance, read, geometric_terms(0.3)));
  check_terms("path_series", "advance",
              path_series(
                  start, [](double x, Stream& rng) { return bad(0.5 * std::max(0.0, x) * rng.uniform()); }, read,
                  geometric_terms(0.3)));
  check_terms("path_series", "read",
              path_series(
                  start, advance, [](double x) { return bad(x); }, geometric_terms(0.3)));
  check_sequence("levels_of", "terms", levels_of(series(plain)));
}

TEST_CASE("no series of an operator hides a NaN or an infinity of it", "[nan][exact]") {
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(3);
  const Eigen::VectorXd c = Eigen::VectorXd::Unit(3, 0);  // <c, x> does not see the component that is wrong
  check_terms("neumann", "apply", neumann(BadOperator{}, b));
  check_terms("neumann", "apply", neumann(BadOperator{}, b, c));
  check_terms("trace_of_function", "apply",
              trace_of_function(
                  BadOperator{}, [](std::int64_t) { return 0.5; }, 1.0));
  const Eigen::MatrixXd a = 0.3 * Eigen::MatrixXd::Identity(3, 3);
  check_terms("trace_of_function", "coefficient", trace_of_function(a, power_of_half, 2.0));
  check_terms("log_determinant", "apply", log_determinant(BadOperator{}));
  check_run("spectral_radius", "apply", [] { return spectral_radius(BadOperator{}); });
  covers("neumann_walk", "matrix and vectors");
  for (const double poison : poisons) {
    Eigen::VectorXd wrong = b;
    wrong[2] = poison;
    Eigen::MatrixXd matrix = a;
    matrix(2, 1) = poison;
    CHECK_THROWS_AS(neumann(a, wrong), std::invalid_argument);
    CHECK_THROWS_AS(neumann(a, b, wrong), std::invalid_argument);
    CHECK_THROWS_AS(neumann_walk(a, wrong, c), std::invalid_argument);
    CHECK_THROWS_AS(neumann_walk(a, b, wrong), std::invalid_argument);
    CHECK_THROWS_AS(neumann(matrix, b), std::invalid_argument);
    CHECK_THROWS_AS(neumann_walk(matrix, b, c), std::invalid_argument);
    CHECK_THROWS_AS(log_determinant(matrix), std::invalid_argument);
    CHECK_THROWS_AS(trace_of_function(a, power_of_half, poison == poisons[1] ? -1.0 : poison), std::invalid_argument);
  }
}

TEST_CASE("no series of a symmetric operator hides a NaN or an infinity of it", "[nan][exact]") {
  const auto bad_operator = symmetric_operator(3, [](std::span<const double> x, std::span<double> y) {
    for (std::size_t i = 0; i < 3; ++i) y[i] = 0.5 * x[i];
    y[1] = bad(y[1]);
  });
  const SpectrumBounds bounds{.lower = 0.4, .upper = 0.6};
  const Eigen::VectorXd b = Eigen::VectorXd::Ones(3);
  const Eigen::VectorXd c = Eigen::VectorXd::Unit(3, 0);  // does not see the component that is wrong
  const auto mine = [](double x) { return std::cos(x) / (x + 1); };
  covers("symmetric_operator", "f(x, y)");
  check_terms("log_determinant_spd", "apply", log_determinant_spd(bad_operator, bounds));
  check_terms("log_determinant_spd", "apply", log_determinant_spd(bad_operator, bounds, HutchPlusPlus{.vectors = 1}));
  check_terms("trace_of_function", "apply",
              trace_of_function(bad_operator, functions::Sqrt{}, bounds, Colours{{0, 1, 0}}));
  check_terms("trace_of_function", "apply", trace_of_function(bad_operator, mine, bounds));
  check_terms("quadratic_form", "apply", quadratic_form(bad_operator, functions::Exp{}, c, bounds));
  check_terms("solve", "apply", solve(bad_operator, b, c, bounds));
  const auto gradient = log_determinant_gradient(bad_operator, bounds, RandomSigns{}, bad_operator);
  check("log_determinant_gradient", "apply", roulette(gradient, Geometric(0.4)));
  check("log_determinant_gradient", "apply", roulette(gradient, Geometric(0.4), {.base_level = 2}));
  check_run("split_work", "apply",
            [&] { return split_work(log_determinant_spd(bad_operator, bounds), {.paths = 64}).stopping_variance; });
  for (const double poison : poisons) {
    const auto f = [poison](double x) { return x < 0.5 ? poison : x; };
    CHECK_THROWS_AS(trace_of_function(bad_operator, f, bounds), std::invalid_argument);
    CHECK_THROWS_AS(quadratic_form(bad_operator, f, b, bounds), std::invalid_argument);
    const auto wrong = symmetric_operator(3, [poison](std::span<const double> x, std::span<double> y) {
      for (std::size_t i = 0; i < 3; ++i) y[i] = i == 1 ? poison : 0.5 * x[i];
    });
    CHECK_THROWS_AS(spectrum_of_spd(wrong, bounds), std::invalid_argument);
    CHECK_THROWS_AS(log_determinant_spd(wrong, bounds), std::invalid_argument);
    CHECK_THROWS_AS(solve(wrong, b, c, bounds), std::invalid_argument);
  }
  covers("spectrum_of_spd", "operator");
}

TEST_CASE("no estimator hides a NaN or an infinity of its PMF, its policy or its sequence", "[nan][exact]") {
  const auto terms = series([](std::int64_t k) { return std::exp2(-static_cast<double>(k)); });
  check("single_term", "masses of the PMF", single_term(terms, BadPmf{}));
  check("single_term", "masses of the PMF", single_term(terms, BadPmf{}, {.base = Base::one_outcome}));
  check("independent_sum", "tails of the PMF", independent_sum(terms, BadPmf{}));
  check("roulette", "tails of the PMF", roulette(terms, BadPmf{}));
  check("progressive", "masses of the PMF", progressive(terms, BadPmf{}));
  check("stratified", "masses of the PMF", stratified(single_term(terms, BadPmf{}), 4));
  check("roulette", "early policy", roulette(terms, [](std::int64_t) { return bad(0.6); }));
  check("roulette", "late policy", roulette(terms, [](std::int64_t, double) { return bad(0.6); }));
  CHECK(std::isnan(RunningWeight(1)(1, poisons[0])));
  const auto negative = roulette(terms, [](std::int64_t) { return -0.5; });
  Stream first(1, 0);
  NullRecord record;
  CHECK_THROWS_AS(draw_sample(negative, first, record), std::domain_error);
  check_sequence("single_term", "sequence", coupled_draw);
  check_sequence("coupled", "fine and coarse", coupled_draw);
  covers("truncated", "sequence");
  covers("biased_progressive", "sequence");
  covers("base", "value");
  check("draw_sample", "random variable", [](Stream& rng) { return bad(rng.uniform()); });
  covers("extend", "see estimate");
  covers("trace", "see estimate");

  // A PMF that is wrong before a run starts.
  faults::faults.begin(poisons[0]);
  int refused = 0;
  for (int i = 0; i < 200; ++i) {
    try {
      (void)stratified(single_term(terms, BadPmf{}), 16, Strata::residual);
    } catch (const std::invalid_argument&) {
      ++refused;
    }
  }
  CHECK(faults::faults.end() > 0);
  CHECK(refused > 0);

  // Power check: an estimator that hides a NaN is found, and one that passes it on is not.
  const Outcome hiding = outcome_of([](Stream& rng) { return std::max(0.0, bad(rng.uniform())); }, poisons[0]);
  CHECK(hiding.silent == hiding.faulty);
  CHECK(hiding.faulty >= 20);
  const Outcome honest = outcome_of([](Stream& rng) { return bad(rng.uniform()); }, poisons[0]);
  CHECK(honest.silent == 0);
}

TEST_CASE("no whole run ends in a number beside callables that returned none", "[nan][exact]") {
  const Plan one_thread{.samples = 4096, .threads = 1};
  const auto draws = [](Stream& rng) { return bad(1 + rng.uniform()); };
  check_run("estimate", "sequence",
            [&] { return estimate(single_term(coupled_draw, Geometric(0.6)), one_thread).mean; });
  check_run("estimate", "x", [&] {
    return estimate(stratified(single_term(function_of_mean(draws, functions::Log{})), 16),
                    {.samples = 16 * 256, .threads = 1})
        .mean;
  });
  check_run("recipe", "sequence", [&] { return estimate(recipe(coupled_draw), one_thread).mean; });
  check_run("recipe", "x",
            [&] { return estimate(recipe(function_of_mean(draws, functions::Log{})), one_thread).mean; });
  check_run("multilevel", "sequence", [&] {
    const MultilevelStatistics s = multilevel(coupled_draw, 0.01, one_thread);
    return s.converged ? s.components[0].mean : poisons[0];
  });
  check_run("survey", "sequence", [&] {
    double total = 0;
    for (const SurveyRow& row : survey(coupled_draw, 5, one_thread).rows) total += row.second_moment + row.mean;
    return total;
  });
  for (const Goal& goal : {Goal{.error = 1e-3}, Goal{.relative_error = 1e-3}}) {
    check_run("estimate", "x with a goal",
              [&] { return estimate(draws, {.samples = 4096, .threads = 1, .goal = goal}).mean; });
  }
}

TEST_CASE("PMFs and statistics refuse or keep a NaN", "[nan][exact]") {
  const double nan = poisons[0];
  CHECK_THROWS(RadiusPmf(0.5).sample(nan));
#ifdef NDEBUG  // else an assertion says so
  CHECK_THROWS(Geometric(0.5).sample(nan));
  CHECK_THROWS(Tabulated({1, 2}, 0.5).sample(nan));
  CHECK_THROWS(Zeta(2.5).sample(nan));
  CHECK_THROWS(BhanotKennedy(0.5, 2, 2).sample(nan));
  CHECK_THROWS(Poisson(3).sample(nan));
#endif
  for (const double wrong : {nan, 0.0, -1.0}) {
    CHECK_THROWS_AS(invert_tail([](std::int64_t j) { return std::exp2(-static_cast<double>(j)); }, wrong, 3),
                    std::invalid_argument);
  }
  for (const double wrong : {poisons[1], 1.5}) CHECK_THROWS_AS(inverse_weight(wrong, 3), std::domain_error);
  for (const double wrong : {nan, poisons[2], -0.5, 0.0}) CHECK_THROWS_AS(inverse_weight(wrong, 3), std::length_error);
  CHECK_THROWS(default_exponent(Rates{nan, 1}));
  CHECK_THROWS(default_exponent(Rates{2, nan}));

  std::vector<double> values(1000, 1);
  CHECK(median_of_means(values).value == 1);
  for (const double poison : poisons) {
    for (const std::size_t at : {0, 500, 999}) {
      values[at] = poison;
      CHECK_FALSE(std::isfinite(median_of_means(values).value));
      values[at] = 1;
    }
  }
}

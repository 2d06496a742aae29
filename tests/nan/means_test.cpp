// NaN and infinity from the callables of functions of means, power series, reciprocals and nested expectations.

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "faults.hpp"

#include <debias/function_of_mean.hpp>
#include <debias/functions.hpp>
#include <debias/nested.hpp>
#include <debias/pmf/bhanot_kennedy.hpp>
#include <debias/reciprocal.hpp>
#include <debias/taylor.hpp>
#include <debias/taylor/autodiff.hpp>

using namespace debias;
using namespace debias::faults;

namespace {

double draw(Stream& rng) { return bad(1 + 0.5 * rng.uniform()); }
double integrand(double x) { return bad(1.5 + std::sin(3 * x)); }

// The same by batches.
struct BatchedDraw {
  double operator()(Stream& rng) const { return draw(rng); }
  void draws(Stream& rng, std::span<double> out) const {
    for (double& x : out) x = draw(rng);
  }
};
struct DrawOfMembers {
  double operator()(Stream& rng) const { return draw(rng); }
  void draws(StreamBatch& batch, std::span<double> out) const {
    batch.uniforms(out);
    for (double& x : out) x = bad(1 + 0.5 * x);
  }
};
struct BatchedIntegrandOfTest {
  double operator()(double x) const { return integrand(x); }
  void operator()(std::span<const double> at, std::span<double> out) const {
    for (std::size_t i = 0; i < at.size(); ++i) out[i] = integrand(at[i]);
  }
};

// A function of the mean that hides a NaN behind a comparison.
const auto hides = [](double m) { return std::max(0.0, m) * m; };
const auto floors = [](double m) { return std::max(0.5, m); };

// exp with coefficients that may be none.
struct BadSeries {
  double operator()() {
    const double now = next_;
    next_ /= ++k_;
    return bad(now);
  }
  static constexpr double scale = 1;
  static constexpr double radius = std::numeric_limits<double>::infinity();

 private:
  double next_ = 1;
  double k_ = 0;
};
struct BadExpandable {
  BadSeries expand(double /*a*/) const { return {}; }
};
struct BadScale {
  double scale;
  double radius = 1;
  double operator()() { return 1; }
};
struct BadScaleExpandable {
  double scale;
  BadScale expand(double /*a*/) const { return {scale}; }
};

}  // namespace

TEST_CASE("no function of a mean hides a NaN or an infinity of its callables", "[nan][exact]") {
  using Infinity::has_a_limit;
  const auto x = [](Stream& rng) { return draw(rng); };
  const auto f = [](double at) { return integrand(at); };

  check_sequence("function_of_mean", "x", function_of_mean(x, functions::Log{}));
  check_sequence("function_of_mean", "x under Davis", function_of_mean(x, functions::Davis{0.5}), has_a_limit);
  check_sequence("function_of_mean", "x under a g that hides it", function_of_mean(x, floors), has_a_limit);
  check_sequence("function_of_mean", "x under Power{0}", function_of_mean(x, functions::Power{0}), has_a_limit);
  check_sequence("function_of_mean", "g",
                 function_of_mean([](Stream& rng) { return rng.uniform(); }, [](double m) { return bad(m * m); }));
  check_sequence("function_of_mean", "x.draws", function_of_mean(BatchedDraw{}, functions::Log{}));
  check_sequence("function_of_mean", "x.draws of members", function_of_mean(DrawOfMembers{}, functions::Log{}));
  const auto pair = [](Stream& rng) {
    const double w = 1 + rng.uniform();
    return Eigen::Array2d(bad(w * w), w);
  };
  check_sequence("function_of_mean", "array x", function_of_mean(pair, functions::Ratio{}));
  check_sequence("function_of_mean", "a component that g does not use",
                 function_of_mean([](Stream& rng) { return Eigen::Array2d(rng.uniform(), bad(1)); },
                                  [](const Eigen::Array2d& m) { return m[0] * m[0]; }),
                 has_a_limit);
  check_sequence("componentwise", "g",
                 function_of_mean([](Stream& rng) { return Eigen::Array2d(1, rng.uniform()); },
                                  functions::componentwise([](double m) { return bad(m * m); })));

  check_sequence("function_of_integral", "f", function_of_integral(f, functions::Log{}));
  check_sequence("function_of_integral", "f under ExpMinus", function_of_integral(f, functions::ExpMinus{}),
                 has_a_limit);
  check_sequence("function_of_integral", "f(at, out)",
                 function_of_integral(BatchedIntegrandOfTest{}, functions::Log{}));
  check_sequence("function_of_integral", "g",
                 function_of_integral([](double at) { return at; }, [](double m) { return bad(std::exp(m)); }));
  check_sequence("function_of_jittered_integral", "f", function_of_jittered_integral(f, functions::Log{}));
  check_sequence("function_of_jittered_integral", "f under a g that hides it", function_of_jittered_integral(f, hides),
                 has_a_limit);

  check("comb_mean", "f", comb_mean(f, 5));
  check("comb_mean", "f in a sum", taylor_sum(comb_mean(f, 3), functions::Exp{}, 1.5, Geometric(0.5)));
  const auto at_point = [](std::span<const double> at) { return bad(1 + at[0] * at[1]); };
  check("net_mean", "f in a sum", taylor_sum(net_mean(at_point, Cube(2), 4), functions::Exp{}, 1.5, Geometric(0.5)));
  const auto on_line = [](std::span<const double> at) { return bad(std::exp(-at[0] * at[0] - at[1] * at[1])); };
  check_sequence("integral_over", "f",
                 function_of_integral(integral_over(densities::Normal{}, on_line), Cube(2), functions::Log{}));
  check_sequence("expectation_under", "f",
                 function_of_integral(expectation_under(densities::Normal{}, on_line), Cube(2), functions::Log{}));

  const auto y = [](Stream& rng) { return bad(rng.uniform()); };
  const auto inner = [](double given, Stream& rng) { return given + rng.normal(); };
  check_sequence("nested", "outer", nested(y, inner, [](double m) { return std::max(0.0, m) + m; }), has_a_limit);
  check_sequence("nested", "inner",
                 nested([](Stream& rng) { return rng.uniform(); },
                        [](double given, Stream& rng) { return bad(given + rng.normal()); }, floors),
                 has_a_limit);
  check_sequence("nested", "f",
                 nested([](Stream& rng) { return rng.uniform(); }, inner, [](double m) { return bad(m * m); }));
  const auto make = [](double given) { return [given](Stream& rng) { return bad(given + rng.normal()); }; };
  check_sequence("estimated", "what it makes",
                 nested([](Stream& rng) { return rng.uniform(); }, estimated(make), [](double m) { return m * m; }));
}

TEST_CASE("no reciprocal hides a NaN or an infinity of its callables", "[nan][exact]") {
  using Infinity::has_a_limit;
  const auto x = [](Stream& rng) { return draw(rng); };
  const auto f = [](double at) { return integrand(at); };
  check_sequence("reciprocal", "x", reciprocal(x), has_a_limit);
  check_sequence("reciprocal", "array x",
                 reciprocal([](Stream& rng) { return Eigen::Array2d(bad(1 + rng.uniform()), 2); }), has_a_limit);
  check_sequence("reciprocal_of_integral", "f", reciprocal_of_integral(f), has_a_limit);
  check_sequence("clamped_reciprocal", "x", clamped_reciprocal(x, 0.1), has_a_limit);
  check_sequence("clamped_reciprocal_of_integral", "f", clamped_reciprocal_of_integral(f, 0.1), has_a_limit);
  check_terms("reciprocal_series", "x", reciprocal_series(x, 1.5));
  check_terms("reciprocal_series", "x", reciprocal_series(x, centre_between(1, 1.5)));
  check("reciprocal_trials", "x", reciprocal_trials(x, 2));
  check("reciprocal_product", "x", ReciprocalProduct(x, 0.8, 0.5));
  check("reciprocal_product", "x", reciprocal_product(x, 0.8, Moments{1000, 1.25, 20, 0, 1}));
  check("reciprocal_residual", "x", reciprocal_residual(x, 0.5, 2));
}

TEST_CASE("no power series hides a NaN or an infinity of its callables", "[nan][exact]") {
  const auto x = [](Stream& rng) { return draw(rng); };
  const auto good = [](Stream& rng) { return rng.uniform(); };
  check_terms("taylor", "x", taylor(x, functions::Exp{}, 1.0));
  check_sequence("taylor", "x", taylor(x, functions::Exp{}, 1.0));
  check_terms("taylor", "x about a centre", taylor(x, functions::Log{}, centre_between(1, 1.5)));
  check_terms("taylor", "coefficients of g", taylor(good, BadExpandable{}, 0.0));
  check_sequence("taylor", "coefficients of g", taylor(good, BadExpandable{}, 0.0));
  for (const Products products : {Products::simple, Products::cyclic, Products::symmetric}) {
    const TaylorSumOptions options{products, 1, products == Products::simple ? 0 : 3};
    check("taylor_sum", "x", taylor_sum(x, functions::Exp{}, 1.0, Geometric(0.5), options));
    check("taylor_sum", "x about a drawn pivot",
          taylor_sum(x, functions::ExpMinus{}, drawn_pivot, BhanotKennedy(0.5, 2, 2), options));
    check("taylor_sum", "coefficients of g", taylor_sum(good, BadExpandable{}, 0.0, Geometric(0.5), options));
    check("taylor_sum", "coefficients of g", taylor_sum(good, BadExpandable{}, drawn_pivot, Geometric(0.5), options));
  }
  const double nan = poisons[0];
  const double infinity = poisons[1];
  for (const double scale : {nan, infinity, 0.0}) {
    CHECK_THROWS_AS(taylor(good, BadScaleExpandable{scale}, 1.0), std::domain_error);
    NullRecord record;
    Stream rng(1, 0);
    const auto sum = taylor_sum(good, BadScaleExpandable{scale}, 1.0, Geometric(1e-3));
    CHECK_THROWS_AS(draw_sample(sum, rng, record), std::domain_error);
  }
  for (const double square : {nan, infinity, -1.0}) {
    CHECK_THROWS_AS(taylor(good, functions::Exp{}, Centre{0, square}), std::invalid_argument);
    CHECK_THROWS_AS(taylor(good, functions::Log{}, Centre{1, square}), std::invalid_argument);
    CHECK_THROWS_AS(taylor_sum(good, functions::Exp{}, Centre{0, square}, Geometric(0.5)), std::invalid_argument);
  }
  // The function is evaluated before a run: what is not finite there is refused.
  covers("autodiff", "g");
  const auto g = autodiff<4>([](const auto& at) { return at * at; });
  for (const double at : poisons) CHECK_THROWS_AS(taylor(good, g, at), std::invalid_argument);
  CHECK_THROWS_AS(taylor(good, autodiff<4>([](const auto& at) { return at * poisons[0]; }), 1.0),
                  std::invalid_argument);
}

TEST_CASE("no function of functions.hpp makes a number of a NaN", "[nan][exact]") {
  const double nan = poisons[0];
  const auto check_function = [nan](const auto& g) {
    CHECK(std::isnan(g(nan)));
    CHECK(std::isnan(g.gap(nan, 0)));
    CHECK(std::isnan(g.gap(nan, 0.25)));
    CHECK(std::isnan(g.gap(0.5, nan)));
    CHECK(std::isnan(g.gap(0, nan)));
    // An infinite draw leaves a mean that is infinite, and a half difference that is, too.
    CHECK_FALSE(std::isfinite(g.gap(poisons[1], poisons[1])));
    CHECK_FALSE(std::isfinite(g.gap(poisons[1], poisons[2])));
  };
  check_function(functions::Exp{});
  check_function(functions::ExpMinus{});
  check_function(functions::Reciprocal{});
  check_function(functions::Square{});
  check_function(functions::Log{});
  check_function(functions::Sqrt{});
  for (const double p : {-1.0, 0.0, 0.5, 1.0, 3.0}) check_function(functions::Power{p});
  check_function(functions::Davis{0.5});
  check_function(functions::Logistic{});
  check_function(functions::Absolute{});
  check_function(functions::PositivePart{});
  CHECK(std::isnan(functions::Power{nan}(1)));
  for (const double poison : poisons) {
    CHECK_FALSE(std::isfinite(functions::Ratio{}.gap(Eigen::Array2d(1, poison), Eigen::Array2d(0.5, poison))));
    CHECK_FALSE(std::isfinite(functions::Ratio{}.gap(Eigen::Array2d(poison, 1), Eigen::Array2d(poison, 0.5))));
    CHECK_FALSE(std::isfinite(functions::LogSumExp{}.gap(Eigen::Array2d(1, poison), Eigen::Array2d(0.5, poison))));
  }
  CHECK(std::isnan(functions::Ratio{}(Eigen::Array2d(1, nan))));
  CHECK(std::isnan(functions::LogSumExp{}(Eigen::Array2d(1, nan))));
  CHECK(std::isnan(functions::LogSumExp{}(Eigen::Array2d(nan, 1))));
}

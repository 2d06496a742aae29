#include <debias/taylor/autodiff.hpp>

#include <cmath>
#include <stdexcept>

#include <debias/core/estimate.hpp>
#include <debias/estimators/roulette.hpp>
#include <debias/functions.hpp>
#include <debias/pmf/geometric.hpp>
#include <debias/taylor.hpp>

#include "catch_shim.hpp"
#include "laws/estimator_laws.hpp"

using namespace debias;

namespace {

const auto near_one = [](Stream& rng) { return 0.5 + rng.uniform(); };
const auto reciprocal_of = [](const auto& x) { return 1 / x; };
const auto entire = [](const auto& x) { return exp(-x) * x; };
const auto x_log_x = [](const auto& x) { return x * log(x); };

}  // namespace

TEST_CASE("automatic differentiation gives the coefficients of the closed forms, and their radius", "[taylor][exact]") {
  auto ours = autodiff<32>(reciprocal_of).expand(1.5);
  auto closed = functions::Reciprocal{}.expand(1.5);
  CHECK(ours.radius == Approx(1.5).epsilon(0.05));
  double power = 1;
  for (int k = 0; k <= 32; ++k) {
    CHECK(ours() * power == Approx(closed()).epsilon(1e-12));
    power *= closed.scale / ours.scale;
  }
  CHECK(std::isinf(autodiff<32>(entire).expand(2).radius));
  CHECK(autodiff<8>(x_log_x)(2) == Approx(2 * std::log(2.0)));
}

TEST_CASE("a function of one's own is estimated without bias by its own series", "[taylor][statistical]") {
  const auto terms = taylor(near_one, autodiff<48>(x_log_x), centre_between(0.5, 1.5));
  CHECK(laws::estimator_laws(roulette(terms, Geometric(0.5)), 0) == laws::Failures{});
  const auto shifted = [](const auto& x) { return x * log(x) + 0.01; };
  const auto wrong = taylor(near_one, autodiff<48>(shifted), centre_between(0.5, 1.5));
  CHECK(laws::estimator_laws(roulette(wrong, Geometric(0.5)), 0, {.repeats = 0}) != laws::Failures{});
}

TEST_CASE("an order beyond those asked for throws, and so does a centre without a series", "[taylor][exact]") {
  auto series = autodiff<4>(x_log_x).expand(1);
  for (int k = 0; k <= 4; ++k) series();
  CHECK_THROWS_WITH(series(), Catch::Contains("order 5"));
  CHECK_THROWS_AS(autodiff<4>(x_log_x).expand(0), std::invalid_argument);
  CHECK_THROWS_AS(taylor(near_one, autodiff<16>(reciprocal_of), centre_between(-1, 2)), std::invalid_argument);
}

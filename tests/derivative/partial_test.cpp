#include <debias/derivative/partial.hpp>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include <Eigen/Core>

#include <debias/core/estimate.hpp>
#include <debias/estimators/single_term.hpp>

#include "catch_shim.hpp"
#include "laws/sequence_laws.hpp"

using namespace debias;
using laws::Failures;
using laws::sequence_laws;

TEST_CASE("gradient and Jacobian have the partial derivatives, each from the same random numbers",
          "[derivative][exact]") {
  const auto f = [](const Eigen::Vector2d& x) { return std::sin(x[0]) * std::exp(x[1]); };
  const Eigen::Vector2d at(0.3, -0.2);
  const auto g = gradient(f, at, {.kind = Difference::central});
  const auto r = estimate(single_term(g), {.samples = 1 << 14});
  CHECK(std::abs(r.mean[0] - std::cos(0.3) * std::exp(-0.2)) < 4.5 * r.standard_error[0] + r.bias_bound.size);
  CHECK(std::abs(r.mean[1] - std::sin(0.3) * std::exp(-0.2)) < 4.5 * r.standard_error[1] + r.bias_bound.size);
  CHECK(sequence_laws(g, {.last = 8}) == Failures{});

  const auto noisy = [](const Eigen::VectorXd& x, Stream& rng) {
    const double u = rng.uniform();
    return Eigen::Vector2d(x[0] * x[1] + u * x[2], u * std::sin(x[0]));
  };
  Eigen::VectorXd point(3);
  point << 1, 2, 3;
  const auto j = jacobian(noisy, point, Eigen::Matrix<double, 2, 3>(), {.kind = Difference::central});
  for (std::uint64_t i = 0; i < 10; ++i) {
    const double u = Stream(5, i).uniform();
    const auto m = j.value_at(12, Stream(5, i)).value;
    CHECK(m(0, 0) == Approx(2).epsilon(1e-7));
    CHECK(m(0, 1) == Approx(1).epsilon(1e-7));
    CHECK(m(0, 2) == Approx(u).epsilon(1e-7));
    CHECK(m(1, 0) == Approx(u * std::cos(1.0)).epsilon(1e-6));
    CHECK(std::abs(m(1, 1)) < 1e-10);
  }
  CHECK_THROWS_AS(jacobian(noisy, point, Eigen::Matrix2d()), std::invalid_argument);
}

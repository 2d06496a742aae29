#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "catch_shim.hpp"

#include <debias/core/stream.hpp>
#include <debias/sde/vector.hpp>

using namespace debias;

namespace {

/// Two Brownian motions, in vectors of fixed or of any size.
template <class Vector, class Matrix>
struct Motions {
  Vector start = Vector::Zero(2);
  double horizon = 2;

  Vector drift(const Vector& /*x*/, double /*t*/) const { return Vector::Zero(2); }
  Matrix diffusion(const Vector& /*x*/, double /*t*/) const { return Matrix::Identity(2, 2); }
  Matrix diffusion_along(const Vector& /*x*/, double /*t*/, const Vector& /*v*/) const { return Matrix::Zero(2, 2); }
};

template <class Levels>
void check_numbers(const Levels& sequence) {
  for (const std::int64_t level : {0, 1, 3, 8}) {
    Stream point = Stream(2, 3).point(9);
    Stream numbers(point);
    const double first = numbers.normal();
    const double second = numbers.normal();
    CAPTURE(level);
    CHECK(sequence(level, point).value == Approx(std::sqrt(2.0) * (first + 10 * second)).epsilon(1e-12));
    for (std::int64_t t = 2; t < 2 << level; ++t) numbers.bits();
    CHECK(point.bits() == numbers.bits());
    // A plain stream has them in time.
    Stream plain = Stream(2, 3).split(9);
    Stream in_time(plain);
    double sum = 0;
    for (std::int64_t i = 0; i < std::int64_t{1} << level; ++i) {
      const double a = in_time.normal();
      sum += a + 10 * in_time.normal();
    }
    CHECK(sequence(level, plain).value == Approx(sum * std::sqrt(2 * std::ldexp(1.0, static_cast<int>(-level)))));
  }
}

}  // namespace

TEST_CASE("a vector path of a point has the ends of all motions first, then all of a midpoint",
          "[sde][vector][exact]") {
  using Fixed = Motions<Eigen::Vector2d, Eigen::Matrix2d>;
  using Dynamic = Motions<Eigen::VectorXd, Eigen::MatrixXd>;
  check_numbers(euler(Fixed{}, [](const Eigen::Vector2d& x) { return x[0] + 10 * x[1]; }));
  check_numbers(euler(Dynamic{}, [](const Eigen::VectorXd& x) { return x[0] + 10 * x[1]; }));
  check_numbers(antithetic_milstein(Fixed{}, [](const Eigen::Vector2d& x) { return x[0] + 10 * x[1]; }));
}

#include <debias/core/result.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/student.hpp"
#include "core/text.hpp"

namespace debias {

namespace {

// How many standard errors an interval reaches out: a quantile of Student's law, since the error comes from
// as many values (or blocks of `stratified`) as the mean, and is known no better than its largest parts.
double error_quantile(double tail, std::int64_t values, double degrees) {
  if (values < 2) return -normal_quantile(tail);
  const double fewest = std::min(static_cast<double>(values - 1), degrees);
  return -student_quantile(fewest, tail);
}

}  // namespace

Interval Statistics::interval(const RunVerdict& v, double confidence, std::size_t component) const {
  if (!(confidence > 0 && confidence < 1)) {
    throw std::invalid_argument("interval: confidence = " + format("%f", confidence) +
                                " (must lie in (0, 1)); 0.95 is usual");
  }
  const ComponentEstimate& c = components.at(component);
  double error = c.standard_error;
  double degrees = std::numeric_limits<double>::infinity();
  if (!masses.empty() && nonfinite == 0 && moments.count > 1) {
    degrees = v.degrees;
    if (v.unseen_variance > 0) {
      double all = 0;
      for (const ComponentEstimate& other : components) all += other.variance;
      const double share = all > 0 ? c.variance / all : 1 / static_cast<double>(components.size());
      error = std::sqrt(error * error + share * v.unseen_variance);
    }
  }
  double half_width = error_quantile((1 - confidence) / 2, moments.count, degrees) * error;
  // An error below the rounding of the values says nothing of theirs.
  constexpr double rounding = 4 * std::numeric_limits<double>::epsilon();
  if (error > 0) half_width = std::max(half_width, rounding * std::abs(c.mean));
  return {c.mean - half_width, c.mean + half_width, confidence};
}

double Statistics::total_error() const {
  double square = 0;
  for (const ComponentEstimate& c : components) square += c.standard_error * c.standard_error;
  return std::sqrt(square);
}

double Statistics::norm() const {
  double square = 0;
  for (const ComponentEstimate& c : components) square += c.mean * c.mean;
  return std::sqrt(square);
}

bool Statistics::has_wrong_mean() const {
  return std::any_of(warnings.begin(), warnings.end(), [](const Warning& warning) {
    return warning.code == WarningCode::coupling || warning.code == WarningCode::wrong_masses;
  });
}

double Statistics::goal_error() const { return std::hypot(total_error(), bias_bound.size); }

bool Statistics::goal_met() const {
  if (!goal.asked()) return true;
  if (nonfinite > 0) return false;  // no answer, and NaN compares false below
  if (has_wrong_mean()) return false;
  if (goal.error > 0) return goal_error() <= goal.error;
  if (goal.relative_error > 0) return norm() > 0 && goal_error() <= goal.relative_error * norm();
  return seconds <= goal.seconds;
}

double Statistics::efficiency() const {
  double variance = 0;
  for (const ComponentEstimate& c : components) variance += c.variance;
  return static_cast<double>(samples) / (variance * seconds);
}

}  // namespace debias

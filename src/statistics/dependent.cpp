#include <debias/statistics/dependent.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/student.hpp"

namespace debias {

Dependence dependence_of(std::span<const double> block_means, std::int64_t block_length, const Moments& values) {
  constexpr std::size_t fewest_blocks = 32;
  constexpr double window = 6;
  constexpr double least_time = 0.05;
  const auto n = static_cast<double>(values.count);
  Dependence d;
  d.effective = n;
  d.standard_error = values.standard_error();
  d.degrees = n - 1;
  const std::size_t blocks = block_means.size();
  if (blocks < fewest_blocks || !(values.m2 > 0)) return d;
  double mean = 0;
  for (const double x : block_means) mean += x / static_cast<double>(blocks);
  const auto correlation = [&](std::size_t lag) {
    double sum = 0;
    for (std::size_t i = 0; i + lag < blocks; ++i) sum += (block_means[i] - mean) * (block_means[i + lag] - mean);
    return sum / static_cast<double>(blocks);
  };
  const double variance = correlation(0);
  if (!(variance > 0)) return d;
  double tau = 1;
  std::size_t k = 1;
  for (; k < blocks / 2; ++k) {
    tau += 2 * correlation(k) / variance;
    if (static_cast<double>(k) >= window * std::max(tau, 1.0)) break;
  }
  tau = std::max(tau, least_time);
  const auto count = static_cast<double>(blocks);
  const bool is_long = tau > 1;  // what blocks have taken in needs no sum
  if (is_long) d.time_error = std::sqrt(2 * (2 * static_cast<double>(k) + 1) / count);
  // As many values as the blocks hold; what is left over is like them.
  const double square = variance * count / (count - 1) * tau / count;
  const double held = count * static_cast<double>(block_length);
  d.standard_error = std::sqrt(square * held / n);
  d.time = square * held / values.variance();
  d.effective = n / std::max(d.time, least_time);
  d.degrees = std::clamp(count / (2 * std::max(tau, 1.0)), 1.0, n - 1);
  return d;
}

Interval interval_with(double mean, double standard_error, double degrees, double confidence) {
  const double half_width = -student_quantile(std::min(degrees, 1e9), (1 - confidence) / 2) * standard_error;
  return {mean - half_width, mean + half_width, confidence};
}

}  // namespace debias

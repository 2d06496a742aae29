#include <debias/pmf/zeta.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/text.hpp"

namespace debias {
namespace {

/// zeta(s, a) for s > 1, a >= 1. Terms are added up to x = a + n >= 16 + s, the rest is
///   x^(1-s) / (s-1) + x^-s / 2 + sum_k B_2k / (2k)! s (s+1) ... (s+2k-2) x^(1-s-2k)     [DLMF 2.10.1]
/// whose terms fall about as fast as (2 pi)^-2k, so that ten of them reach 1e-17.
double hurwitz_zeta(double s, double a) {
  double sum = 0;
  double x = a;
  for (; x < 16 + s; ++x) {
    const double term = std::pow(x, -s);
    sum += term;
    if (term <= 0x1p-70 * sum) return sum;  // a large s: what follows is less than a few such terms
  }
  static constexpr double b[] = {1.0 / 12,
                                 -1.0 / 720,
                                 1.0 / 30240,
                                 -1.0 / 1209600,
                                 1.0 / 47900160,
                                 -691.0 / 1307674368000,
                                 1.0 / 74724249600,
                                 -3617.0 / 10670622842880000,
                                 43867.0 / 5109094217170944000,
                                 -174611.0 / 802857662698291200000.0};  // B_2k / (2k)!
  double corrections = 0;
  double factor = s / x;  // s (s+1) ... (s+2k-2) x^(1-2k)
  for (int k = 1; k <= 10; ++k) {
    corrections += b[k - 1] * factor;
    factor *= (s + 2 * k - 1) / x * ((s + 2 * k) / x);
  }
  return sum + std::pow(x, -s) * (x / (s - 1) + 0.5 + corrections);
}

double argument(std::int64_t j) { return static_cast<double>(j) + 1; }

constexpr std::int64_t level_end = std::int64_t{1} << 62;

}  // namespace

Zeta::Zeta(double s) : s_(s), zeta_(1) {
  if (!(s > 1 && std::isfinite(s))) {
    throw std::invalid_argument("Zeta: s = " + to_text(s) +
                                " (must be greater than 1, or the masses have no finite sum); "
                                "the mean level is finite from s > 2");
  }
  // Upward from the smallest, so that tail(j) - tail(j+1) = mass(j) to rounding.
  double tail = hurwitz_zeta(s, argument(table_size));
  for (std::size_t j = table_size; j-- > 0;) {
    masses_[j] = std::pow(argument(static_cast<std::int64_t>(j)), -s);
    tail += masses_[j];
    tails_[j] = tail;
  }
  zeta_ = tail;
  for (double& mass : masses_) mass /= zeta_;
  for (double& t : tails_) t /= zeta_;
}

double Zeta::deep_mass(std::int64_t j) const { return j < 0 ? 0.0 : std::pow(argument(j), -s_) / zeta_; }

double Zeta::deep_tail(std::int64_t j) const { return j < 0 ? 1.0 : hurwitz_zeta(s_, argument(j)) / zeta_; }

std::int64_t Zeta::deep_sample(double u) const {
  std::int64_t low = table_size - 1;  // u <= tail(low)
  std::int64_t high = level_end;      // u > tail(high)
  if (!(u > tail(high))) {
    throw std::length_error("Zeta: s = " + to_text(s_) + ": the level at u = " + to_text(u) +
                            " is 2^62 or more and does not fit 64 bits; take a larger s");
  }
  // tail(j) is about (j + 1/2)^(1-s) / ((s-1) zeta(s)). Around that guess the bracket opens by doubling,
  // since at deep levels many neighbouring tails are one double.
  const double guess = std::pow(u * (s_ - 1) * zeta_, -1 / (s_ - 1)) - 0.5;
  const double inside = std::clamp(guess, static_cast<double>(low), 0x1p61);
  const auto start = static_cast<std::int64_t>(inside);
  std::int64_t step = 1;
  if (u <= tail(start)) {
    low = start;
    for (; high - low > step && u <= tail(low + step); step *= 2) low += step;
    high = std::min(high, low + step);
  } else {
    high = start;
    for (; high - low > step && u > tail(high - step); step *= 2) high -= step;
    low = std::max(low, high - step);
  }
  while (high - low > 1) {
    const std::int64_t middle = low + (high - low) / 2;
    (u <= tail(middle) ? low : high) = middle;
  }
  return low;
}

std::string Zeta::spec() const { return "zeta:s=" + to_text(s_); }

}  // namespace debias

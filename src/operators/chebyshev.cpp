#include <debias/operators/chebyshev.hpp>

#include <algorithm>
#include <complex>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>

namespace debias {
namespace {

constexpr double pi = std::numbers::pi;
constexpr std::size_t most_points = std::size_t{1} << 17;
constexpr double most_coefficients = 1 << 24;

std::string interval(double a, double b) {
  return "[" + detail::format("%g", a) + ", " + detail::format("%g", b) + "]";
}

void require(bool holds, const std::string& problem) {
  if (!holds) throw std::invalid_argument("chebyshev: " + problem);
}

void check_positive(double a, double b) {
  require(0 < a && a < b && b <= std::numeric_limits<double>::max(),
          "the interval " + interval(a, b) + " (must have 0 < a < b for a function that is singular at 0)");
}

// ln q = 2 artanh sqrt(a / b)
double log_q_of(double a, double b) { return 2 * std::atanh(std::sqrt(a / b)); }

// In place, of 2^m numbers; exp(-2 pi i j k / n).
void fourier(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; (j & bit) != 0; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  std::vector<std::complex<double>> roots(n / 2 + 1);
  for (std::size_t k = 0; k < roots.size(); ++k) {
    const double angle = -2 * pi * static_cast<double>(k) / static_cast<double>(n);
    roots[k] = {std::cos(angle), std::sin(angle)};
  }
  for (std::size_t length = 2; length <= n; length *= 2) {
    for (std::size_t first = 0; first < n; first += length) {
      for (std::size_t k = 0; k < length / 2; ++k) {
        const std::complex<double> one = x[first + k];
        const std::complex<double> two = x[first + k + length / 2] * roots[k * (n / length)];
        x[first + k] = one + two;
        x[first + k + length / 2] = one - two;
      }
    }
  }
}

// c_k = 2/n sum_j f(x_j) cos(k pi (j + 1/2) / n) by one Fourier transform of the points, even ones up, odd ones down.
std::vector<double> coefficients(const std::function<double(double)>& f, double a, double b, std::size_t n) {
  std::vector<std::complex<double>> v(n);
  for (std::size_t j = 0; j < n; ++j) {
    const double t = std::cos(pi * (static_cast<double>(j) + 0.5) / static_cast<double>(n));
    const double x = (a + b) / 2 + (b - a) / 2 * t;
    const double y = f(x);
    require(std::isfinite(y), "f(" + detail::format("%.10g", x) + ") = " + detail::format("%g", y) +
                                  " (must be finite on the whole interval " + interval(a, b) + ")");
    v[j % 2 == 0 ? j / 2 : n - 1 - j / 2] = y;
  }
  fourier(v);
  std::vector<double> c(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double angle = -pi * static_cast<double>(k) / (2 * static_cast<double>(n));
    c[k] = (std::complex<double>(std::cos(angle), std::sin(angle)) * v[k]).real() * (k == 0 ? 1.0 : 2.0) /
           static_cast<double>(n);
  }
  return c;
}

// Cumulative products of ratios c_k / c_(k-1), k = 1, 2, ..., from 1 until they are zero.
std::vector<double> products(const std::vector<double>& ratios) {
  std::vector<double> c{1};
  for (std::size_t k = 1; k < ratios.size(); ++k) {
    const double next = c.back() * ratios[k];
    if (std::abs(next) < std::numeric_limits<double>::min()) break;
    c.push_back(next);
  }
  return c;
}

}  // namespace

ChebyshevSeries ChebyshevSeries::log(double a, double b) {
  check_positive(a, b);
  ChebyshevSeries s(a, b);
  s.log_q_ = log_q_of(a, b);
  s.first_ = 2 * std::log((std::sqrt(a) + std::sqrt(b)) / 2);
  s.scale_ = 2;
  s.logarithmic_ = true;
  return s;
}

ChebyshevSeries ChebyshevSeries::inverse(double a, double b) {
  check_positive(a, b);
  ChebyshevSeries s(a, b);
  s.log_q_ = log_q_of(a, b);
  s.first_ = 1 / (std::sqrt(a) * std::sqrt(b));
  s.scale_ = 2 * s.first_;
  s.even_positive_ = true;
  return s;
}

ChebyshevSeries ChebyshevSeries::sqrt(double a, double b) {
  check_positive(a, b);
  ChebyshevSeries s(a, b);
  s.log_q_ = log_q_of(a, b);
  const double longest = 750 / s.log_q_ + 16;  // all that a double holds
  require(longest <= most_coefficients, "the condition " + detail::format("%g", b / a) +
                                            " (the square root takes as many terms as its root, too many here); "
                                            "precondition, or raise the lower bound by a shift");
  const auto n = static_cast<std::size_t>(longest);
  std::vector<double> ratios(n + 1);
  double next = -std::exp(-s.log_q_);
  for (std::size_t i = n; i > 0; --i) {
    const auto k = static_cast<double>(i);
    next = -(2 * k - 3) / (4 * k * (a + b) / (b - a) + (2 * k + 3) * next);
    ratios[i] = next;
  }
  std::vector<double> c = products(ratios);
  c[0] = 0.5;  // the recurrence is that of c_0 twice
  double sum = 0;
  for (std::size_t k = c.size(); k-- > 0;) sum += c[k];
  const double scale = std::sqrt(b) / sum;  // t = 1
  for (double& x : c) x *= scale;
  s.table_ = std::make_shared<const std::vector<double>>(std::move(c));
  return s;
}

ChebyshevSeries ChebyshevSeries::exp(double a, double b) {
  require(a < b && std::isfinite(a) && std::exp(b) <= std::numeric_limits<double>::max(),
          "the interval " + interval(a, b) + " (must have a < b, and e^b be finite)");
  ChebyshevSeries s(a, b);
  s.log_q_ = std::numeric_limits<double>::infinity();
  const double h = (b - a) / 2;
  const double longest = 400 + std::min(2 * h, 60 * std::sqrt(h));
  require(longest <= most_coefficients, "the interval " + interval(a, b) +
                                            " (e^x takes too many terms over so many powers of e); scale the operator");
  const auto n = static_cast<std::size_t>(longest);
  std::vector<double> ratios(n + 1);
  double next = 0;
  for (std::size_t i = n; i > 0; --i) {
    next = 1 / (2 * static_cast<double>(i) / h + next);
    ratios[i] = next;
  }
  std::vector<double> c = products(ratios);
  c[0] = 0.5;
  double sum = 0;
  for (std::size_t k = c.size(); k-- > 0;) sum += c[k];
  const double scale = std::exp(b) / sum;
  for (double& x : c) x *= scale;
  s.table_ = std::make_shared<const std::vector<double>>(std::move(c));
  return s;
}

ChebyshevSeries ChebyshevSeries::of(const std::function<double(double)>& f, double a, double b) {
  require(a < b && std::isfinite(a) && std::isfinite(b), "the interval " + interval(a, b) + " (must have a < b)");
  constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();
  ChebyshevSeries s(a, b);
  for (std::size_t n = 32;; n *= 2) {
    std::vector<double> c = coefficients(f, a, b, n);
    double largest = 0;
    for (const double x : c) largest = std::max(largest, std::abs(x));
    std::size_t end = c.size();
    while (end > 1 && std::abs(c[end - 1]) <= rounding * largest) --end;
    if (end > 3 * n / 4) {
      require(n < most_points, "f is not analytic on " + interval(a, b) + ", as far as " + std::to_string(n) +
                                   " points show (coefficient " + std::to_string(end - 1) + " is still " +
                                   detail::format("%.2g", std::abs(c[end - 1]) / largest) +
                                   " of the largest); narrow the interval to where it is");
      continue;
    }
    c.resize(end);
    s.last_ = static_cast<std::int64_t>(end) - 1;
    // The fall of the largest coefficients that follow, over the second half of them.
    const auto following = [&c](std::size_t k) {
      double size = 0;
      for (; k < c.size(); ++k) size = std::max(size, std::abs(c[k]));
      return size;
    };
    const std::size_t half = (end - 1) / 2;
    s.log_q_ = end <= 8 ? std::numeric_limits<double>::infinity()
                        : std::log(following(half) / following(end - 1)) / static_cast<double>(end - 1 - half);
    s.table_ = std::make_shared<const std::vector<double>>(std::move(c));
    return s;
  }
}

Rates ChebyshevSeries::rates(double degrees) const {
  if (std::isinf(log_q_)) return {Rates::faster_than_any, 0};
  return {2 * degrees * log_q_ / std::numbers::ln2, 0};
}

std::int64_t ChebyshevSeries::degree_below(double share) const {
  double largest = 0;
  if (table_) {
    for (std::size_t k = 1; k < table_->size(); ++k) largest = std::max(largest, std::abs((*table_)[k]));
    std::size_t end = table_->size();
    while (end > 1 && std::abs((*table_)[end - 1]) <= share * largest) --end;
    return static_cast<std::int64_t>(end);
  }
  // of closed form, and monotone
  const double bound = share * std::abs((*this)(1));
  std::int64_t low = 1;
  std::int64_t high = 2;
  while (std::abs((*this)(high)) > bound) high *= 2;
  while (high - low > 1) {
    const std::int64_t middle = low + (high - low) / 2;
    (std::abs((*this)(middle)) > bound ? low : high) = middle;
  }
  return high;
}

}  // namespace debias

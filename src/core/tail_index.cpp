#include <debias/core/tail_index.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

namespace debias {
namespace {

constexpr std::size_t fewest_values = 5;
// A single step above the most common values has no shape. So many values on it, and none beyond, are a bound
// unless the next step is a hundred times as rare.
constexpr std::size_t bounded_step = 100;

// The mean of log(1 - theta x). One logarithm for many factors, which is where the time of a fit goes, as far as their
// product is a double; x ascends, and beside a small theta x the factors would have lost its digits.
double shape(std::span<const double> x, double theta) {
  constexpr double narrow = 1e-6;
  constexpr double large = 1e150;
  double sum = 0;
  if (!(std::abs(theta * x.back()) > narrow)) {
    for (const double v : x) sum += std::log1p(-theta * v);
    return sum / static_cast<double>(x.size());
  }
  double product = 1;
  for (const double v : x) {
    const double factor = 1 - theta * v;
    if (!(factor > 1 / large && factor < large)) {
      sum += std::log(factor);
      continue;
    }
    product *= factor;
    if (product > 1 / large && product < large) continue;
    sum += std::log(product);
    product = 1;
  }
  return (sum + std::log(product)) / static_cast<double>(x.size());
}

double first_quartile(std::span<const double> x) {
  return x[static_cast<std::size_t>(static_cast<double>(x.size()) / 4 + 0.5) - 1];
}

double with_weak_prior(double k, std::size_t n) {
  const auto count = static_cast<double>(n);
  return (count * k + 5) / (count + 10);
}

// The fit where its reciprocals are doubles; for a tail wider than these the mean of log(x / smallest), Hill's.
double shape_of(std::span<const double> x) {
  constexpr double widest = 1e290;
  if (x.size() >= fewest_values && x.back() < 1 / widest && x.back() > 0) {
    std::vector<double> larger(x.begin(), x.end());
    for (double& v : larger) v = std::ldexp(v, 1000);
    return shape_of(larger);
  }
  if (x.size() < fewest_values || first_quartile(x) > x.back() / widest) return fit_pareto(x).k;
  const double low = x.back() / widest;
  double sum = 0;
  for (const double v : x) sum += std::log(std::max(v, low) / low);
  return sum / static_cast<double>(x.size());
}

// Values that differ by rounding only are one value of a lattice.
bool same(double a, double b) { return a - b <= 1e-13 * std::max(std::abs(a), std::abs(b)); }

struct Step {
  double value;
  std::size_t count;
};

std::vector<Step> steps_of(std::span<const double> descending) {
  std::vector<Step> steps;
  for (const double x : descending) {
    if (!steps.empty() && same(steps.back().value, x)) {
      ++steps.back().count;
    } else {
      steps.push_back({x, 1});
    }
  }
  return steps;
}

// All values of the steps but the last, whose number is not known: it is the edge of the one before. The c
// values at v lie between v and the next value w as ranks `above` to above + c of a Pareto law would, with
// the growth that the lattice itself has from gap to gap: no origin needs to be known.
std::vector<double> spread(const std::vector<Step>& steps) {
  std::vector<double> values;
  const auto gap = [&](std::size_t i) { return steps[i].value - steps[i + 1].value; };
  for (std::size_t i = 0; i + 1 < steps.size(); ++i) {
    values.push_back(steps[i].value);
    if (steps[i].count == 1) continue;
    const auto above = static_cast<double>(values.size() - 1);
    const auto count = static_cast<double>(steps[i].count);
    double growth = 1;
    if (i > 0) growth = gap(i - 1) / gap(i);
    if (i == 0 && steps.size() > 2) growth = gap(0) / gap(1);
    growth = std::clamp(growth, 1 + 1e-6, 1e300);
    for (std::size_t j = 1; j < steps[i].count; ++j) {
      const auto rank = static_cast<double>(j);
      const double t = above > 0 ? std::log1p(rank / above) / std::log1p(count / above) : rank / count;
      const double height = std::expm1((1 - t) * std::log(growth)) / (growth - 1);
      values.push_back(steps[i + 1].value + gap(i) * height);
    }
  }
  return values;
}

void add_classic(TailIndex& index, std::span<const double> descending, double center) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto n = static_cast<std::size_t>(index.values);
  const double base = index.cutoff - center;
  index.hill = index.moment = index.pickands = nan;
  if (base > 0) {
    double first = 0;
    double second = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double excess = std::log((descending[i] - center) / base);
      first += excess;
      second += excess * excess;
    }
    first /= static_cast<double>(n);
    second /= static_cast<double>(n);
    index.hill = first;
    index.moment = first + 1 - 0.5 / (1 - first * first / second);
  }
  const std::size_t quarter = n / 4;
  if (quarter > 0) {
    const double a = descending[quarter - 1];
    const double b = descending[2 * quarter - 1];
    const double c = descending[4 * quarter - 1];
    if (a > b && b > c) index.pickands = std::log2((a - b) / (b - c));
  }
}

// The k of the values as they are; they cannot be fitted when a quarter of them sit at the lowest.
double plain_shape(std::span<const double> descending, std::size_t size) {
  if (size < fewest_values || descending.size() <= size) return -std::numeric_limits<double>::infinity();
  std::size_t below = size;
  while (below < descending.size() && !(descending[below] < descending[size - 1])) ++below;
  if (below == descending.size()) return -std::numeric_limits<double>::infinity();
  std::vector<double> x;
  for (std::size_t i = size; i-- > 0;) x.push_back(descending[i] - descending[below]);
  return with_weak_prior(shape_of(x), size);
}

double shape_above(std::span<const double> descending, std::size_t size, double cutoff) {
  std::vector<double> x;
  for (std::size_t i = size; i-- > 0;) x.push_back(descending[i] - cutoff);
  return with_weak_prior(shape_of(x), size);
}

// The standard error of a Pareto law, and how far the k of a half and a quarter of the tail lie from k beyond
// what their own errors explain: where values come in clusters, the fit depends on where the tail begins.
double error_of(std::span<const double> values, std::size_t size, double k) {
  const auto variance = [k](std::size_t n) {
    const double spread = std::max(0.5, 1 + k);
    return spread * spread / static_cast<double>(n);
  };
  double excess = 0;
  for (std::size_t part = size / 2; part >= std::max(size / 4, 2 * fewest_values); part /= 2) {
    if (!(values[part - 1] - values[part] > 0)) continue;
    const double d = shape_above(values, part, values[part]) - k;
    excess = std::max(excess, d * d - 4 * (variance(part) - variance(size)));
  }
  return std::sqrt(variance(size) + excess);
}

}  // namespace

ParetoFit fit_pareto(std::span<const double> x) {
  if (x.size() < fewest_values || !(first_quartile(x) > 0)) {
    throw std::invalid_argument("fit_pareto: " + std::to_string(x.size()) +
                                " exceedances (must be at least 5, in ascending order, the first quartile positive)");
  }
  const auto n = static_cast<double>(x.size());
  const double points = 30 + std::floor(std::sqrt(n));
  const double largest = x.back();
  const double quartile = first_quartile(x);
  std::vector<double> theta;
  std::vector<double> likelihood;
  for (double j = 1; j <= points; ++j) {
    const double t = 1 / largest + (1 - std::sqrt(points / (j - 0.5))) / (3 * quartile);
    const double k = shape(x, t);
    theta.push_back(t);
    likelihood.push_back(n * (std::log(-t / k) - k - 1));
  }
  double best = -std::numeric_limits<double>::infinity();
  for (const double l : likelihood) best = l > best ? l : best;
  double weight = 0;
  double sum = 0;
  for (std::size_t j = 0; j < theta.size(); ++j) {
    if (std::isnan(likelihood[j])) continue;  // theta = 0 exactly: 0 / 0
    const double w = std::exp(likelihood[j] - best);
    weight += w;
    sum += w * theta[j];
  }
  const double mean = sum / weight;
  const double k = shape(x, mean);
  return {k, -k / mean};
}

std::int64_t tail_size(std::int64_t samples) {
  const auto n = static_cast<double>(samples);
  const auto size = static_cast<std::int64_t>(samples > 225 ? 3 * std::sqrt(n) : n / 5);
  return std::min(std::max<std::int64_t>(size, 5), samples / 2);
}

TailIndex tail_index(std::span<const double> descending, std::int64_t samples, double center) {
  TailIndex index;
  if (descending.empty()) return index;
  const auto wanted = static_cast<std::size_t>(tail_size(samples));
  const std::vector<Step> steps = steps_of(descending);
  const std::vector<double> values = spread(steps);
  const std::size_t size = std::min(wanted, values.size());
  index.values = static_cast<std::int64_t>(size);
  const bool no_step = steps.size() == 1 && descending.size() > fewest_values;
  const bool one_step = steps.size() == 2 && steps.front().count >= bounded_step;
  if (size < fewest_values || steps.size() == 2) {
    index.state = no_step || one_step ? TailState::bounded : TailState::too_few;
    return index;
  }
  index.cutoff = size < values.size() ? values[size] : steps.back().value;
  for (const Step& s : steps) index.ties = index.ties || (&s != &steps.back() && s.count > 1);
  std::vector<double> x;
  for (std::size_t i = size; i-- > 0;) x.push_back(values[i] - index.cutoff);
  if (!(first_quartile(x) > 0)) {  // a lattice as fine as rounding: no tail that doubles could show
    index.state = TailState::bounded;
    return index;
  }
  index.state = TailState::fitted;
  index.k = with_weak_prior(shape_of(x), size);
  index.error = error_of(values, size, index.k);
  index.plain = index.ties ? plain_shape(descending, wanted) : index.k;
  add_classic(index, values, center);
  return index;
}

double samples_for_mean(double k) {
  return k < 1 ? std::pow(10.0, 1 / (1 - std::max(0.0, k))) : std::numeric_limits<double>::infinity();
}

double usable_tail_index(std::int64_t samples) {
  return std::min(1 - 1 / std::log10(static_cast<double>(std::max<std::int64_t>(samples, 2))), 0.7);
}

double convergence_rate(double k, std::int64_t samples) {
  if (k >= 1 || samples < 2) return 0;
  if (k <= 0) return 1;
  const auto n = static_cast<double>(samples);
  const double a = 2 * k - 1;
  const double last = std::abs(a) < 1e-9 ? 1 / std::log(n) : -a / std::expm1(-a * std::log(n));
  return n / (n - 1) - last;
}

}  // namespace debias

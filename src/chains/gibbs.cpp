#include <debias/chains/gibbs.hpp>

#include <math.h>  // lgamma_r

#include <cmath>
#include <stdexcept>
#include <string>

#include <debias/core/text.hpp>

namespace debias {
namespace {

void require(bool holds, const char* law, const char* what, double x, const char* domain) {
  if (holds) [[likely]]
    return;
  throw std::domain_error(std::string(law) + ": " + what + " = " + detail::format("%g", x) + " (must " + domain + ")");
}

void check(const NormalLaw& p) {
  require(std::isfinite(p.mean), "NormalLaw", "mean", p.mean, "be finite");
  require(p.deviation > 0 && std::isfinite(p.deviation), "NormalLaw", "deviation", p.deviation,
          "be positive and finite");
}
void check(const BernoulliLaw& p) {
  require(p.probability >= 0 && p.probability <= 1, "BernoulliLaw", "probability", p.probability, "lie in [0, 1]");
}
void check(const GammaLaw& p) {
  require(p.shape > 0 && std::isfinite(p.shape), "GammaLaw", "shape", p.shape, "be positive and finite");
  require(p.rate > 0 && std::isfinite(p.rate), "GammaLaw", "rate", p.rate, "be positive and finite");
}

// Equal as often as may be. -log U is an exponential.
template <class Law>
std::pair<double, double> by_rejection(const Law& p, const Law& q, Stream& rng) {
  const double x = p.draw(rng);
  if (p == q) return {x, x};  // also where the density is not finite
  if (rng.exponential() >= p.log_density(x) - q.log_density(x)) return {x, x};
  for (;;) {
    const double y = q.draw(rng);
    if (rng.exponential() < q.log_density(y) - p.log_density(y)) return {x, y};
  }
}

// Of shape >= 1 and rate 1 [Marsaglia & Tsang 2000].
double gamma_of(double shape, Stream& rng) {
  const double d = shape - 1.0 / 3;
  const double c = 1 / std::sqrt(9 * d);
  for (;;) {
    const double z = rng.normal();
    const double root = 1 + c * z;
    if (root <= 0) continue;
    const double v = root * root * root;
    if (rng.exponential() > -(0.5 * z * z + d - d * v + d * std::log(v))) return d * v;
  }
}

}  // namespace

double NormalLaw::draw(Stream& rng) const {
  check(*this);
  return mean + deviation * rng.normal();
}

double NormalLaw::log_density(double x) const {
  const double z = (x - mean) / deviation;
  return -0.5 * z * z - std::log(deviation);
}

std::pair<double, double> NormalLaw::couple(const NormalLaw& p, const NormalLaw& q, Stream& rng) {
  check(p);
  check(q);
  if (p.deviation != q.deviation) return by_rejection(p, q, rng);
  const double z = (p.mean - q.mean) / p.deviation;
  const double w = rng.normal();
  const double x = p.mean + p.deviation * w;
  if (rng.exponential() >= z * (w + 0.5 * z)) return {x, x};  // log U <= log phi(w + z) - log phi(w)
  return {x, q.mean - q.deviation * w};
}

double BernoulliLaw::draw(Stream& rng) const {
  check(*this);
  return rng.uniform() < probability ? 1 : 0;
}

std::pair<double, double> BernoulliLaw::couple(const BernoulliLaw& p, const BernoulliLaw& q, Stream& rng) {
  check(p);
  check(q);
  const double u = rng.uniform();
  return {u < p.probability ? 1 : 0, u < q.probability ? 1 : 0};
}

double GammaLaw::draw(Stream& rng) const {
  check(*this);
  if (shape >= 1) return gamma_of(shape, rng) / rate;
  const double boosted = gamma_of(shape + 1, rng);
  return boosted * std::exp(-rng.exponential() / shape) / rate;  // times U^(1 / shape)
}

double GammaLaw::log_density(double x) const {
  int sign = 1;  // std::lgamma writes it to a global, which other threads share
  return shape * std::log(rate) - ::lgamma_r(shape, &sign) + (shape - 1) * std::log(x) - rate * x;
}

std::pair<double, double> GammaLaw::couple(const GammaLaw& p, const GammaLaw& q, Stream& rng) {
  check(p);
  check(q);
  return by_rejection(p, q, rng);
}

void detail::refuse_laws() {
  throw std::domain_error(
      "gibbs: two chains have laws of two families at one site (they cannot be coupled); a site needs one family");
}

}  // namespace debias

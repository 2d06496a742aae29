#include <debias/diagnostics.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/student.hpp"
#include "core/text.hpp"
#include "core/words.hpp"

namespace debias {
namespace {

// The rho of the PMF in the unit in which the rates count: a PMF that falls geometrically is infinitely steep
// on a polynomial scale, a power law infinitely flat on a geometric one.
double exponent_beside(const Rates& rates, const TailExponent& pmf) {
  if (rates.decay == pmf.decay || std::isinf(pmf.exponent)) return pmf.exponent;
  return pmf.decay == Decay::geometric ? std::numeric_limits<double>::infinity() : 0.0;
}

// E|Z|^q = sum p E|D|^q p^(-q) is finite iff q < 1 / xi.
double tail_index(const Rates& rates, double rho) {
  if (std::isnan(rates.variance_decay)) return rates.variance_decay;
  if (std::isinf(rates.variance_decay)) return 0;
  const double half = rates.variance_decay / 2;
  if (std::isinf(rho)) {  // the limit of both formulas, from below where sum E|D_k| converges: then the mean is finite
    return half > (rates.decay == Decay::geometric ? 0 : 1) ? std::nextafter(1.0, 0.0) : 1;
  }
  const double xi = rates.decay == Decay::geometric ? 1 - half / rho : (rho - half) / (rho - 1);
  return rho > 0 ? std::max(0.0, xi) : 0.0;
}

// P(work > t) ~ t^(-1/index).
double work_tail_index(const Rates& rates, double rho) {
  if (rates.work_growth <= 0 || std::isinf(rho)) return 0;
  const double steepness = rates.decay == Decay::geometric ? rho : rho - 1;
  return steepness > 0 ? rates.work_growth / steepness : std::numeric_limits<double>::infinity();
}

constexpr double confidence_of_rates = 2;  // standard errors

// Is rho below the border?
Finiteness finite_below(double rho, double border, double error) {
  if (std::isinf(border) && border > 0) return Finiteness::finite;
  if (rho + confidence_of_rates * error < border) return Finiteness::finite;
  if (rho - confidence_of_rates * error >= border) return Finiteness::infinite;
  return Finiteness::undecided;
}

Finiteness opposite(Finiteness f) {
  if (f == Finiteness::undecided) return f;
  return f == Finiteness::finite ? Finiteness::infinite : Finiteness::finite;
}

// Nothing that falls faster than any rate can be told from another such thing by rates.
constexpr const char* beyond_rates =
    "differences and PMF both fall faster than any rate: it is finite iff sum E D_k^2 / p_k converges, which "
    "the "
    "levels of a run show";

std::string exponent_text(double x) { return std::isinf(x) ? "faster than any" : format("%.3g", x); }

// Of an infinite variance.
const char* consequence(double tail_index) {
  return tail_index >= 1 ? ": even the mean is infinite" : ": the standard error is too small most of the time";
}

std::string with_error_of(const FittedRate& rate) {
  if (std::isinf(rate.value)) return exponent_text(rate.value);
  return exponent_text(rate.value) + " +- " + exponent_text(rate.error);
}

}  // namespace

MeasuredFiniteness judge(const MeasuredRates& measured, const TailExponent& pmf) {
  const Rates rates = rates_of(measured);
  const double rho = exponent_beside(rates, pmf);
  const bool polynomial = rates.decay == Decay::polynomial;
  const double step = polynomial ? 1 : 0;
  MeasuredFiniteness v;
  v.variance = finite_below(rho, measured.variance_decay.value - step, measured.variance_decay.error);
  v.fourth_moment = finite_below(3 * rho, measured.fourth_decay.value - step, measured.fourth_decay.error);
  const bool decided = measured.kind != RateKind::super_exponential || std::isfinite(rho);
  if (!decided) v.variance = Finiteness::undecided;
  if (v.variance != Finiteness::finite) v.fourth_moment = v.variance;
  // A power law beside work that does not grow: every depth is paid for.
  const bool flat = !polynomial && measured.work_growth.value <= confidence_of_rates * measured.work_growth.error;
  v.work = flat && pmf.decay == Decay::polynomial
               ? Finiteness::finite
               : opposite(finite_below(rho, measured.work_growth.value + step, measured.work_growth.error));
  v.tail_index = tail_index(rates, rho);
  if (std::isfinite(rates.variance_decay) && std::isfinite(rho) && rho > step) {
    v.error = measured.variance_decay.error / 2 / (rho - step);
  }

  const auto threshold = [](const FittedRate& rate) {
    return std::isnan(rate.value) ? std::string("unknown") : with_error_of(rate);
  };
  std::string text = std::string("variance ") + name_of(v.variance) + " (PMF exponent " + exponent_text(rho) +
                     ", threshold " + threshold({measured.variance_decay.value - step, measured.variance_decay.error}) +
                     "), work " + name_of(v.work) + " (threshold " +
                     threshold({measured.work_growth.value + step, measured.work_growth.error}) + ")";
  if (!std::isnan(v.tail_index)) text += ", tail index " + with_error_of({v.tail_index, v.error});
  if (v.variance == Finiteness::infinite) {
    text += consequence(v.tail_index - confidence_of_rates * v.error);
    const FittedRate& decay = measured.variance_decay;
    text += decay.value - step > 0 && !is_flat(decay)
                ? "; take a PMF with a smaller exponent"
                : "; " + decay_words("E D_k^2", decay, rates.decay) +
                      (polynomial && decay.value > 0 ? ", too slowly for any PMF" : ", which no PMF mends");
  } else if (v.work == Finiteness::infinite) {
    text += ": no run ends its expected work; take a PMF with a larger exponent";
  } else if (!decided) {
    text += std::string(": ") + beyond_rates;
  } else if (v.variance == Finiteness::undecided || v.work == Finiteness::undecided) {
    text +=
        ": the rates are not known well enough; survey with more draws or deeper levels, or move the exponent away "
        "from the threshold";
  } else if (v.fourth_moment != Finiteness::finite) {
    text +=
        std::string(": the fourth moment is ") + name_of(v.fourth_moment) + ", so the standard error converges slowly";
  }
  v.sentence = text;
  return v;
}

void BlockMeans::close() {
  constexpr std::size_t capacity = 1024;
  means_.push_back(sum_ / static_cast<double>(length_));
  sum_ = 0;
  filled_ = 0;
  if (means_.size() < capacity) return;
  for (std::size_t i = 0; i < capacity / 2; ++i) means_[i] = (means_[2 * i] + means_[2 * i + 1]) / 2;
  means_.resize(capacity / 2);
  length_ *= 2;
}

void BlockMeans::scale(int exponent) {
  for (double& m : means_) m = std::ldexp(m, exponent);
  sum_ = std::ldexp(sum_, exponent);
}

BiasedEstimate median_of_means(std::span<const double> values, double delta) {
  if (!(delta > 0 && delta < 1)) {
    throw std::invalid_argument("median_of_means: delta = " + format("%f", delta) +
                                " (must lie in (0, 1)); 0.05 is usual");
  }
  const auto groups = static_cast<std::size_t>(std::ceil(-8 * std::log(delta)));
  if (values.size() < groups) {
    throw std::invalid_argument("median_of_means: " + std::to_string(values.size()) + " values (must be at least " +
                                std::to_string(groups) + " for this delta)");
  }
  // A median would leave them out without a word.
  for (const double x : values) {
    if (!std::isfinite(x)) {
      return {std::numeric_limits<double>::quiet_NaN(), static_cast<std::int64_t>(groups)};
    }
  }
  const std::size_t length = values.size() / groups;
  std::vector<double> means;
  for (std::size_t g = 0; g < groups; ++g) means.push_back(Moments::of(values.subspan(g * length, length)).mean);
  std::sort(means.begin(), means.end());
  return {(means[(groups - 1) / 2] + means[groups / 2]) / 2, static_cast<std::int64_t>(groups)};
}

Interval interval_of(const Moments& moments, double confidence) {
  if (!(confidence > 0 && confidence < 1)) {
    throw std::invalid_argument("interval: confidence = " + format("%f", confidence) +
                                " (must lie in (0, 1)); 0.95 is usual");
  }
  if (moments.count < 2) {
    throw std::invalid_argument("interval: " + std::to_string(moments.count) +
                                " values (must be at least 2); of batches 20 to 100 are usual");
  }
  const double quantile = -student_quantile(static_cast<double>(moments.count - 1), (1 - confidence) / 2);
  const double half_width = quantile * moments.standard_error();
  return {moments.mean - half_width, moments.mean + half_width, confidence};
}

Interval batch_interval(std::span<const double> batch_means, double confidence) {
  Moments moments;
  for (std::size_t i = 0; i < batch_means.size(); i += 256) {
    moments.merge(Moments::of(batch_means.subspan(i, std::min<std::size_t>(256, batch_means.size() - i))));
  }
  return interval_of(moments, confidence);
}

DeclaredFiniteness judge(const Rates& rates, const TailExponent& pmf) {
  const ExponentRange range = finite_exponents(rates);
  const double rho = exponent_beside(rates, pmf);
  DeclaredFiniteness v;
  v.finite_variance = std::isinf(rates.variance_decay) || rho < range.high;
  // Beside geometric rates a power law reaches every depth too often, unless the work does not grow.
  v.finite_work = rho > range.low || (rates.decay == Decay::geometric && rates.work_growth <= 0);
  v.tail_index = tail_index(rates, rho);
  v.work_tail_index = work_tail_index(rates, rho);

  const bool known = !std::isnan(rates.variance_decay) && !std::isnan(rates.work_growth);
  v.decided = known && (std::isfinite(rates.variance_decay) || std::isfinite(rho));
  if (!known) {
    v.finite_variance = v.finite_work = false;
    v.tail_index = v.work_tail_index = std::numeric_limits<double>::quiet_NaN();
    v.sentence = "variance undecided: the rates are not known; survey the levels, or state them";
    return v;
  }

  std::string text;
  const std::string exponent = exponent_text(rho);
  if (v.decided) {
    text += std::string(v.finite_variance ? "variance finite" : "variance INFINITE") + " (PMF exponent " + exponent +
            (v.finite_variance ? " < " : " >= ") + exponent_text(range.high) + "), ";
  } else {
    text += std::string("variance undecided by rates (") + beyond_rates + "), ";
  }
  text += std::string(v.finite_work ? "work finite" : "work INFINITE") + " (" + exponent +
          (v.finite_work ? " > " : " <= ") + format("%.3g", range.low) + ")";
  if (v.decided) text += ", tail index " + format("%.3g", v.tail_index);
  if (!v.finite_variance || !v.finite_work) {
    text += v.finite_variance ? ": no run ends its expected work" : consequence(v.tail_index);
    if (std::isinf(range.high)) {
      text += "; take a PMF with an exponent above " + format("%.3g", range.low);
    } else if (range.low < range.high) {
      text += "; take a PMF with exponent between " + format("%.3g", range.low) + " and " + format("%.3g", range.high);
    } else {
      const FittedRate decay{rates.variance_decay, 0};
      if (!v.finite_variance && rates.variance_decay <= 0) text += "; " + decay_words("E D_k^2", decay, rates.decay);
      text += "; no PMF has both finite";
    }
  } else if (v.tail_index >= 0.25) {
    text += ": the fourth moment is infinite, so the standard error converges slowly";
  }
  v.sentence = text;
  return v;
}

}  // namespace debias

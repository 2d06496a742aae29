#include <debias/chains/check.hpp>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <debias/core/stream.hpp>
#include <debias/core/text.hpp>

namespace debias {

namespace detail {

void StepMoments::add(const std::vector<double>& x) {
  if (sums_.empty()) sums_.resize(x.size());
  if (sums_.size() != x.size()) {
    throw std::invalid_argument("check_coupling: f returns values of several sizes (all must have the same)");
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    Moments& m = sums_[i];
    ++m.count;
    const double delta = x[i] - m.mean;
    m.mean += delta / static_cast<double>(m.count);
    m.m2 += delta * (x[i] - m.mean);
  }
}

double StepMoments::worst_of(const StepMoments& a, const StepMoments& b, std::int64_t& tests) {
  double worst = 0;
  for (std::size_t i = 0; i < a.sums_.size(); ++i) {
    const Moments& p = a.sums_[i];
    const Moments& q = b.sums_[i];
    ++tests;
    const double difference = std::abs(p.mean - q.mean);
    if (std::isnan(difference)) return difference;
    if (difference == 0) continue;
    const double n = static_cast<double>(p.count);
    // What never varied may have been rare: one case in so many.
    const double error = std::hypot(p.standard_error(), q.standard_error());
    const double rounding = 64 * std::numeric_limits<double>::epsilon() * std::abs(p.mean);
    const double z = difference / std::max({error, rounding, difference / n});
    worst = std::max(worst, z);
  }
  return worst;
}

double threshold_of(std::int64_t tests) {
  constexpr double false_alarms = 1e-6;
  return -normal_quantile(false_alarms / (2 * static_cast<double>(std::max<std::int64_t>(tests, 1))));
}

void check_coupling_options(std::size_t states, std::int64_t draws) {
  if (states < 2) {
    throw std::invalid_argument("check_coupling: " + std::to_string(states) +
                                " states (must be two at least, near and far ones are best)");
  }
  if (draws < 100) {
    throw std::invalid_argument("check_coupling: draws = " + std::to_string(draws) + " (must be at least 100)");
  }
}

}  // namespace detail

std::string CouplingCheck::sentence() const {
  std::string text;
  if (keeps_marginals()) {
    text = "the coupling keeps both marginals (" + std::to_string(tests) + " tests, the largest " +
           detail::format("%.2g", worst) + " standard errors)";
  } else {
    text = "the coupling does NOT keep its marginals: at states " + std::to_string(worst_x) + " and " +
           std::to_string(worst_y) + " it moves the " + (first_chain ? "first" : "second") +
           " chain otherwise than a step does, by " + detail::format("%.3g", worst) + " standard errors (threshold " +
           detail::format("%.2g", threshold) + "), so estimates are biased";
  }
  if (stays_together()) return text + (keeps_marginals() ? " and" : "; it") + " stays together";
  return text + "; equal chains do NOT stay together: " + std::to_string(parted) + " of " + std::to_string(met_before) +
         " came apart within 64 steps (one uniform for both acceptances is the usual cure)";
}

}  // namespace debias

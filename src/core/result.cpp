#include <debias/core/result.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <ostream>
#include <string>
#include <string_view>

#include <boost/math/distributions/students_t.hpp>

#include "core/text.hpp"

namespace debias {

namespace {

// How many standard errors an interval reaches out: a quantile of Student's law, since the error comes from
// as many values (or blocks of `stratified`) as the mean, and is known no better than its largest parts.
double error_quantile(double tail, std::int64_t values, double degrees) {
  if (values < 2) return -normal_quantile(tail);
  const double fewest = std::min(static_cast<double>(values - 1), degrees);
  return -boost::math::quantile(boost::math::students_t(fewest), tail);
}

}  // namespace

Interval Statistics::interval(double confidence, std::size_t component) const {
  if (!(confidence > 0 && confidence < 1)) {
    throw std::invalid_argument("interval: confidence = " + format("%f", confidence) +
                                " (must lie in (0, 1)); 0.95 is usual");
  }
  const ComponentEstimate& c = components.at(component);
  double error = c.standard_error;
  double degrees = std::numeric_limits<double>::infinity();
  if (!masses.empty() && nonfinite == 0 && moments.count > 1) {
    const RunVerdict v = verdict();
    degrees = v.degrees;
    if (v.unseen_variance > 0) {
      double all = 0;
      for (const ComponentEstimate& other : components) all += other.variance;
      const double share = all > 0 ? c.variance / all : 1 / static_cast<double>(components.size());
      error = std::sqrt(error * error + share * v.unseen_variance);
    }
  }
  const double half_width = error_quantile((1 - confidence) / 2, moments.count, degrees) * error;
  return {c.mean - half_width, c.mean + half_width, confidence};
}

double Statistics::total_error() const {
  double square = 0;
  for (const ComponentEstimate& c : components) square += c.standard_error * c.standard_error;
  return std::sqrt(square);
}

double Statistics::size() const {
  double square = 0;
  for (const ComponentEstimate& c : components) square += c.mean * c.mean;
  return std::sqrt(square);
}

double Statistics::goal_error() const { return std::hypot(total_error(), bias_bound.size); }

bool Statistics::goal_met() const {
  if (!goal.asked()) return true;
  if (nonfinite > 0) return false;  // no answer, and NaN compares false below
  if (goal.error > 0) return goal_error() <= goal.error;
  if (goal.relative_error > 0) return size() > 0 && goal_error() <= goal.relative_error * size();
  return seconds <= goal.seconds;
}

double Statistics::efficiency() const {
  double variance = 0;
  for (const ComponentEstimate& c : components) variance += c.variance;
  return static_cast<double>(samples) / (variance * seconds);
}

std::string with_error(double mean, double standard_error) {
  if (!std::isfinite(mean)) return "not a number";
  if (!std::isfinite(standard_error)) return format("%.6g", mean) + " (no standard error)";
  if (standard_error <= 0) return format("%.15g", mean) + "(0)";
  // Rounded before anything is decided: 0.0996 has the two digits 1.0e-01. The second one stands for 10^last.
  const std::string error = format("%.1e", standard_error);
  int last = 0;
  const char* exponent = error.data() + error.find('e') + 1;
  std::from_chars(exponent + (*exponent == '+' ? 1 : 0), error.data() + error.size(), last);
  --last;
  if (last < -15 || last > 5 || std::abs(mean) >= 1e15) {
    return format("%.15g", mean) + " +- " + format("%.2g", standard_error);
  }
  const double rounded = parse_double(error, "error");
  if (last >= 0) {
    const double unit = std::pow(10.0, last);
    return format("%.0f", std::round(mean / unit) * unit) + "(" + format("%.0f", rounded) + ")";
  }
  // the error straddles the decimal point and shows it
  if (last == -1) return format("%.1f", mean) + "(" + format("%.1f", rounded) + ")";
  return format({std::chars_format::fixed, -last}, mean) + "(" + error[0] + error[2] + ")";
}

std::ostream& operator<<(std::ostream& out, const Statistics& s) {
  const auto line = [&out](const char* name, const std::string& text) {
    out << name << std::string(14 - std::char_traits<char>::length(name), ' ') << text << '\n';
  };
  const RunVerdict verdict = s.verdict();
  const bool has_verdict = s.nonfinite == 0 && s.moments.count > 1;
  const char* doubt = has_verdict && !verdict.interval_reliable() ? " (unreliable, see verdict)" : "";
  for (std::size_t i = 0; i < s.components.size(); ++i) {
    const ComponentEstimate& c = s.components[i];
    const Interval interval = s.interval(0.95, i);
    const std::string ends =
        std::isfinite(c.mean) && std::isfinite(c.standard_error)
            ? "   95 % interval [" + format("%.8g", interval.low) + ", " + format("%.8g", interval.high) + "]" + doubt
            : "";
    line(i == 0 ? "mean" : "", with_error(c.mean, c.standard_error) + ends);
  }
  if (s.bias_bound.size > 0)
    line("bias", "at most " + format("%.2g", s.bias_bound.size) + ": " + s.bias_bound.sentence);
  if (!s.name.empty()) line("name", s.name);
  line("estimator", s.estimator);
  if (const std::string coupling = text_of(s.coupling); !coupling.empty()) line("coupling", coupling);
  line("samples", std::to_string(s.samples) +
                      (s.block > 1 ? " in " + std::to_string(s.blocks) + " blocks of " + std::to_string(s.block) : "") +
                      ", seed " + std::to_string(s.seed) +
                      (s.first > 0 ? ", from index " + std::to_string(s.first) : ""));
  const bool has_pilot = s.pilot_work > 0 || s.pilot_seconds > 0;
  const auto part = [&](const std::string& pilot) {
    return has_pilot ? ", of that " + pilot + " by the pilot" : std::string();
  };
  line("work", format("%.4g", s.work) + part(format("%.4g", s.pilot_work)) + " (" +
                   format("%.4g", s.work_per_sample()) + (has_pilot ? " per sample of the run)" : " per sample)"));
  line("seconds", format("%.3g", s.seconds) + part(format("%.3g", s.pilot_seconds)));
  line("efficiency", format("%.3g", s.efficiency()) + " = 1 / (variance x seconds per sample" +
                         (has_pilot ? ", the pilot's among them)" : ")"));
  if (s.goal.asked()) {
    const Goal& g = s.goal;
    // A goal is judged by numbers, and without one it is missed.
    const auto outcome = [&](double reached, const std::string& unit) {
      if (s.nonfinite > 0 || std::isnan(reached)) return std::string(": NOT met, there is no error to judge by");
      if (std::isinf(reached)) return ": NOT met, no bound on the error" + unit;
      return (s.goal_met() ? ": met, " : ": NOT met, ") + format("%.3g", reached) + unit;
    };
    const bool biased = s.bias_bound.size > 0;
    const std::string parts = !biased ? ""
                                      : " = sqrt(standard error " + format("%.2g", s.total_error()) + "^2 + bias " +
                                            format("%.2g", s.bias_bound.size) + "^2)";
    const std::string what = biased ? "error " : "standard error ";
    if (g.error > 0) line("goal", what + format("%g", g.error) + outcome(s.goal_error(), parts));
    if (g.relative_error > 0) {
      const double size = s.size();
      const bool told = size > 3 * s.goal_error();
      const std::string of_zero = size == 0 ? " of a mean of 0"
                                  : told
                                      ? ""
                                      : "; the mean is not told from 0, its error is " + format("%.3g", s.goal_error());
      const double reached = size == 0 && s.goal_error() == 0 ? 0 : s.goal_error() / size;
      line("goal", "relative error " + format("%g", g.relative_error) + outcome(reached, of_zero));
    }
    if (g.seconds > 0) line("goal", format("%g", g.seconds) + " seconds" + outcome(s.seconds, ""));
  }
  for (const std::string& warning : s.warnings) line("warning", warning);
  if (!has_verdict) return out;
  const char* name = "verdict";
  for (const std::string& sentence : verdict.sentences()) {
    line(name, sentence);
    name = "";
  }
  return out;
}

}  // namespace debias

#include <debias/core/report.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ostream>
#include <string>

#include <debias/core/result.hpp>

#include "core/text.hpp"
#include "core/words.hpp"

namespace debias {

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

namespace {

constexpr std::size_t largest_shown = 3;

std::string with_digits(double x, int digits) { return format({std::chars_format::general, digits}, x); }

class Printer {
 public:
  Printer(std::ostream& out, const Statistics& s)
      : out_(out), s_(s), verdict_(s.verdict()), has_verdict_(s.nonfinite == 0 && s.moments.count > 1) {}

  void print(bool full) {
    means();
    if (s_.bias_bound.size > 0) {
      line("bias", "at most " + format("%.2g", s_.bias_bound.size) + ": " + s_.bias_bound.sentence);
    }
    if (full) {
      if (!s_.name.empty()) line("name", s_.name);
      line("estimator", s_.estimator);
      if (const std::string coupling = text_of(s_.coupling); !coupling.empty()) line("coupling", coupling);
    }
    line("samples",
         std::to_string(s_.samples) +
             (s_.block > 1 ? " in " + counted(s_.blocks, "block") + " of " + std::to_string(s_.block) : std::string()) +
             ", seed " + std::to_string(s_.seed) + (s_.first > 0 ? ", from index " + std::to_string(s_.first) : ""));
    costs(full);
    goal();
    if (has_verdict_) full ? verdicts() : line("verdict", verdict_.sentence());
    for (const Warning& warning : s_.warnings) line("warning", warning.text);
    if (full) rest();
  }

 private:
  void line(const char* name, const std::string& text) {
    out_ << name << std::string(14 - std::char_traits<char>::length(name), ' ') << text << '\n';
  }

  void means() {
    const char* doubt = s_.has_wrong_mean()                             ? " (BIASED, see warning)"
                        : !(verdict_.bias <= RunVerdict::most_bias)     ? " (without the bias)"
                        : has_verdict_ && !verdict_.interval_reliable() ? " (unreliable, see verdict)"
                                                                        : "";
    detail::print_ends(s_.components.size(), [&](std::size_t i, const std::string& left_out) {
      if (!left_out.empty()) return line("", left_out);
      const ComponentEstimate& c = s_.components[i];
      const Interval interval = s_.interval(verdict_, 0.95, i);
      const int digits = digits_of_ends(interval.low, interval.high);
      const std::string ends = std::isfinite(c.mean) && std::isfinite(c.standard_error)
                                   ? "   95 % interval [" + with_digits(interval.low, digits) + ", " +
                                         with_digits(interval.high, digits) + "]" + doubt
                                   : "";
      line(i == 0 ? "mean" : "", with_error(c.mean, c.standard_error) + ends);
    });
  }

  void costs(bool full) {
    const bool has_pilot = s_.pilot_work > 0 || s_.pilot_seconds > 0;
    const auto part = [&](const std::string& pilot) {
      return has_pilot ? ", of that " + pilot + " by the pilot" : std::string();
    };
    const std::string each =
        " (" + format("%.4g", s_.work_per_sample()) + (has_pilot ? " per sample of the run)" : " per sample)");
    line("work", format("%.4g", s_.work) + part(format("%.4g", s_.pilot_work)) + (full ? each : ""));
    line("seconds", format("%.3g", s_.seconds) + part(format("%.3g", s_.pilot_seconds)));
    if (!full) return;
    line("efficiency", format("%.3g", s_.efficiency()) + " = 1 / (variance x seconds per sample" +
                           (has_pilot ? ", the pilot's among them)" : ")"));
  }

  void goal() {
    if (!s_.goal.asked()) return;
    const Goal& g = s_.goal;
    // A goal is judged by numbers, and without one it is missed.
    const auto outcome = [&](double reached, const std::string& unit) {
      if (s_.nonfinite > 0 || std::isnan(reached)) return std::string(": NOT met, there is no error to judge by");
      if (std::isinf(reached)) return ": NOT met, no bound on the error" + unit;
      if (s_.has_wrong_mean()) return std::string(": NOT met, the mean is biased");
      return (s_.goal_met() ? ": met, " : ": NOT met, ") + format("%.3g", reached) + unit;
    };
    // The goal is one of what was drawn.
    const auto with_unseen = [&](double goal, double size) {
      const double all = std::hypot(s_.goal_error(), std::sqrt(verdict_.unseen_variance)) / size;
      return has_verdict_ && s_.goal_met() && all > goal ? "; " + format("%.3g", all) + " with levels not seen"
                                                         : std::string();
    };
    const bool biased = s_.bias_bound.size > 0;
    const std::string parts = !biased ? ""
                                      : " = sqrt(standard error " + format("%.2g", s_.total_error()) + "^2 + bias " +
                                            format("%.2g", s_.bias_bound.size) + "^2)";
    const std::string what = biased ? "error " : "standard error ";
    if (g.error > 0)
      line("goal", what + format("%g", g.error) + outcome(s_.goal_error(), parts) + with_unseen(g.error, 1));
    if (g.relative_error > 0) {
      const double size = s_.norm();
      const bool told = size > 3 * s_.goal_error();
      const std::string of_zero =
          size == 0 ? " of a mean of 0"
          : told    ? ""
                    : "; the mean is not told from 0, its error is " + format("%.3g", s_.goal_error());
      const double reached = size == 0 && s_.goal_error() == 0 ? 0 : s_.goal_error() / size;
      line("goal", "relative error " + format("%g", g.relative_error) + outcome(reached, of_zero) +
                       with_unseen(g.relative_error, size));
    }
    if (g.seconds > 0) line("goal", format("%g", g.seconds) + " seconds" + outcome(s_.seconds, ""));
  }

  void verdicts() {
    const char* name = "verdict";
    for (const std::string& sentence : verdict_.sentences()) {
      line(name, sentence);
      name = "";
    }
  }

  // What speaks for the verdict.
  void rest() {
    const char* name = "reason";
    for (const Warning& reason : verdict_.reasons) {
      if (std::find(s_.warnings.begin(), s_.warnings.end(), reason) != s_.warnings.end()) continue;  // it is said
      line(name, reason.text);
      name = "";
    }
    if (has_verdict_ && s_.moments.m2 > 0) {
      line("kurtosis", std::isfinite(s_.moments.kurtosis()) ? format("%.4g", s_.moments.kurtosis()) : "-");
      line("upper tail", tail_words(verdict_.upper));
      line("lower tail", tail_words(verdict_.lower));
    }
    name = "largest";
    for (std::size_t i = 0; i < s_.largest.size() && i < largest_shown; ++i) {
      const LargeSample& l = s_.largest[i];
      const std::string block = s_.block > 1 ? ", block " + std::to_string(l.index / s_.block) : "";
      const int digits = digits_of(l.value, std::sqrt(s_.moments.variance()), 6);  // about a mean far from zero
      line(name, with_digits(l.value, digits) + " (sample " + std::to_string(l.index) + block + ", level " +
                     std::to_string(l.level) + ")");
      name = "";
    }
    levels();
  }

  void levels() {
    if (s_.levels.empty()) return;
    const auto row = [this](const std::array<std::string, 8>& cells) {
      constexpr std::array<std::size_t, 7> widths = {11, 12, 11, 11, 9, 9, 10};
      std::string text;
      for (std::size_t i = 0; i < widths.size(); ++i) text += (i > 0 ? " " : "") + right(cells[i], widths[i]);
      out_ << text << (cells.back().empty() ? "" : "  " + cells.back()) << '\n';
    };
    const auto number = [](detail::NumberPattern pattern, double x) {
      return std::isfinite(x) ? format(pattern, x) : std::string("-");
    };
    const auto mean = [](const LevelRow& r) {
      return figure_of(r.mean, std::sqrt(r.second_moment - r.mean * r.mean), 4, 11);
    };
    row({"level", "draws", "E D", "E D^2", "kurtosis", "work", "p", ""});
    for (const LevelRow& r : s_.levels) {
      const double kurtosis = r.second_moment > 0 ? r.kurtosis : std::numeric_limits<double>::quiet_NaN();
      row({std::to_string(r.level) + (r.last_level > r.level ? " - " + std::to_string(r.last_level) : ""),
           std::to_string(r.count), mean(r), number("%.4g", r.second_moment), number("%.3g", kurtosis),
           number("%.4g", r.work), r.probability > 0 ? format("%.3g", r.probability) : "-", r.is_base ? "base" : ""});
    }
  }

  std::ostream& out_;
  const Statistics& s_;
  RunVerdict verdict_;
  bool has_verdict_;
};

}  // namespace

std::ostream& operator<<(std::ostream& out, const Statistics& s) {
  Printer(out, s).print(false);
  return out;
}

void print_full(std::ostream& out, const Statistics& s) { Printer(out, s).print(true); }

}  // namespace debias

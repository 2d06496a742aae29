#include "core/words.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/text.hpp"

namespace debias {
namespace {

constexpr double nothing = 1e-6;       // of an exponent without an error
constexpr double no_growth = 0.005;    // of the work: what a fit leaves
constexpr double most_of_flat = 0.25;  // error of an exponent that is called zero; with more, it is open

bool has_error(const FittedRate& rate) { return rate.error > 0 && std::isfinite(rate.error); }

// " (exponent 0.04 +- 0.05, levels 1 to 9)"
std::string behind(const FittedRate& rate, bool with_value, const std::string& where) {
  std::string text;
  if (has_error(rate))
    text = (with_value ? "exponent " + format("%.2g", rate.value) + " " : "") + "+- " + format("%.2g", rate.error);
  if (!where.empty()) text += (text.empty() ? "" : ", ") + where;
  return text.empty() ? "" : " (" + text + ")";
}

}  // namespace

bool is_flat(const FittedRate& rate) { return std::abs(rate.value) <= (has_error(rate) ? rate.error : nothing); }

std::string power_text(double exponent, Decay unit) {
  if (std::isnan(exponent)) return "an unknown power";
  if (std::isinf(exponent)) return "faster than any power";
  return unit == Decay::polynomial ? "k^" + format("%.3g", exponent) : "2^(" + format("%.3g", exponent) + " k)";
}

std::string decay_words(const std::string& what, const FittedRate& decay, Decay unit, const std::string& where) {
  const double v = decay.value;
  if (std::isnan(v)) return "it is not known how " + what + " falls" + behind({}, false, where);
  if (std::isinf(v)) return what + (v > 0 ? " falls" : " grows") + " faster than any power" + behind({}, false, where);
  if (is_flat(decay)) {
    const bool open = has_error(decay) && decay.error > most_of_flat;
    return (open ? "it is open whether " + what + " falls" : what + " does not fall") + behind(decay, true, where);
  }
  return what + (v > 0 ? " falls like " : " grows like ") + power_text(-v, unit) + behind(decay, false, where);
}

std::string growth_words(const std::string& what, const FittedRate& growth, Decay unit) {
  const double v = growth.value;
  if (std::isnan(v)) return "it is not known how " + what + " grows";
  if (std::isinf(v)) return what + (v > 0 ? " grows" : " falls") + " faster than any power";
  if (std::abs(v) < no_growth || (has_error(growth) && std::abs(v) <= growth.error)) return what + " does not grow";
  return what + (v > 0 ? " grows like " : " falls like ") + power_text(v, unit);
}

std::string moments_words(double highest) {
  if (std::isnan(highest)) return "it is not known which moments are finite";
  if (std::isinf(highest) && highest > 0) return "all moments are finite";
  if (highest <= 1) return "even the mean is infinite";
  std::string order = format("%.3g", highest);
  if (order == "1") order = "a little more than 1";
  if (order == "2" && highest != 2) order = highest < 2 ? "a little less than 2" : "a little more than 2";
  if (highest <= 2) return "the variance is infinite (moments below " + order + " are finite)";
  return "moments below " + order + " are finite";
}

std::string levels_words(std::int64_t first, std::int64_t last) {
  return first == last ? "level " + std::to_string(first)
                       : "levels " + std::to_string(first) + " to " + std::to_string(last);
}

int digits_of(double x, double unit, int least) {
  constexpr int most = 17;  // all of a double
  if (!(std::abs(x) > 0 && std::isfinite(x) && unit > 0 && std::isfinite(unit))) return least;
  const double needed = std::floor(std::log10(std::abs(x))) - std::floor(std::log10(unit)) + 2;
  return static_cast<int>(std::clamp<double>(needed, least, most));
}

int digits_of_ends(double low, double high) {
  return digits_of(std::max(std::abs(low), std::abs(high)), high - low, 8);
}

std::string figure_of(double x, double unit, int least, std::size_t room) {
  if (!std::isfinite(x)) return "-";
  int digits = digits_of(x, unit, least);
  const auto text = [&] { return format({std::chars_format::general, digits}, x); };
  while (digits > least && text().size() > room) --digits;
  return text();
}

void detail::print_ends(std::size_t n, const std::function<void(std::size_t i, const std::string& left_out)>& print) {
  constexpr std::size_t most = 16;
  constexpr std::size_t ends = 3;
  for (std::size_t i = 0; i < n; ++i) {
    if (n > most && i == ends) {
      print(i, "... " + std::to_string(n - 2 * ends) + " of " + std::to_string(n) + " components are left out ...");
      i = n - ends;
    }
    print(i, "");
  }
}

std::string tail_words(const TailIndex& tail) {
  if (tail.state == TailState::too_few) return "no shape: too few values beyond the most common ones";
  if (tail.state == TailState::bounded) return "bounded: the outermost value is too common for a tail";
  const auto figure = [](double x) { return std::isfinite(x) ? format("%.3g", x) : std::string("-"); };
  // Beyond chance only: two errors.
  const double least = tail.k - 2 * tail.error;
  const char* means = least >= 1     ? "even the mean looks infinite; "
                      : least >= 0.5 ? "the variance looks infinite; "
                                     : "";
  return "k = " + figure(tail.k) + " +- " + format("%.2g", tail.error) + " (" + means + std::to_string(tail.values) +
         " values; " + (tail.ties ? "with ties as they are " + figure(tail.plain) + ", " : "") + "Hill " +
         figure(tail.hill) + ", moment " + figure(tail.moment) + ", Pickands " + figure(tail.pickands) + ")";
}

}  // namespace debias

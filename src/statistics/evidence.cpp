#include <debias/statistics/evidence.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "core/text.hpp"
#include "core/words.hpp"
#include "statistics/posterior.hpp"

namespace debias {

using statistics::few;
using statistics::is_finite;
using statistics::is_zero;
using statistics::likely_p;
using statistics::shown_p;

const char* name_of(Answer answer) {
  constexpr std::array names = {"yes", "no", "open"};
  return names[static_cast<std::size_t>(answer)];
}

const char* name_of(Grade grade) {
  constexpr std::array names = {"open", "likely", "shown"};
  return names[static_cast<std::size_t>(grade)];
}

namespace {

constexpr double most_unseen_of_sum = 0.5;  // of S, where the answer is yes
constexpr double hits_promised = 14;        // P(none) = 1e-6
constexpr int declared_levels = 2;          // known ones that rates are worth, where the levels do not contradict them
constexpr double known_error = 0.5;         // octaves
constexpr double drowned = -50;             // octaves of D^2 beside I^2, from which rounding is near
constexpr std::int64_t many_levels = 32;    // that a power has held over, five octaves
constexpr double zeros_of_nothing = 100;    // draws, where no level has shown a difference

// Least squares.
double slope_of(std::span<const double> x, std::span<const double> y) {
  double mx = 0;
  double my = 0;
  const auto n = static_cast<double>(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    mx += x[i] / n;
    my += y[i] / n;
  }
  double xx = 0;
  double xy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mx) * (x[i] - mx);
    xy += (x[i] - mx) * (y[i] - my);
  }
  return xx > 0 ? xy / xx : 0;
}

// The standard error of that slope.
double slope_error_of(std::span<const double> x, std::span<const double> errors) {
  double mx = 0;
  for (const double xi : x) mx += xi / static_cast<double>(x.size());
  double xx = 0;
  double sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mx) * (x[i] - mx);
    sum += std::pow((x[i] - mx) * errors[i], 2);
  }
  return xx > 0 ? std::sqrt(sum) / xx : 0;
}

// Three digits.
std::string short_text(double x) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), x, std::chars_format::general, 3).ptr;
  return {text.data(), end};
}

// Weighs one table.
class Scales {
 public:
  Scales(std::vector<LevelFacts> facts, const SequenceFacts& sequence, bool budget_spent)
      : sequence_(sequence), budget_spent_(budget_spent) {
    e_.facts = std::move(facts);
  }

  Evidence weigh() {
    e_.voices = statistics::voices_of(e_.facts);
    for (std::size_t i = 0; i < e_.voices.size(); ++i) {
      if (!e_.facts[i].is_base) all_.push_back(i);
    }
    bases();
    for (std::size_t i = 0; i < e_.voices.size(); ++i) {
      const LevelVoice& v = e_.voices[i];
      if (e_.facts[i].is_base) {
        base_ = e_.facts[i].level;
        continue;
      }
      if (v.level < e_.lowest_base) continue;  // no part of any estimate
      if (is_finite(v) && !is_zero(v)) live_.push_back(i);
      if (!v.usable()) continue;
      usable_.push_back(i);
      e_.known += v.error <= known_error;
    }
    if (!live_.empty()) e_.last_difference = e_.voices[live_.back()].level;
    if (!usable_.empty()) {
      e_.first_usable = e_.voices[usable_.front()].level;
      e_.last_usable = e_.voices[usable_.back()].level;
    }
    work();
    courses();
    ends();
    if (e_.end != End::none) return std::move(e_);
    if (e_.courses.empty()) {
      e_.reasons.push_back({WarningCode::few_levels, counted(std::ssize(usable_), "level") + are(std::ssize(usable_)) +
                                                         " known, three are needed"});
      return std::move(e_);
    }
    changes();
    unseen();
    answer();
    return std::move(e_);
  }

 private:
  [[nodiscard]] const LevelVoice& voice(std::size_t i) const { return e_.voices[i]; }
  [[nodiscard]] const LevelFacts& fact(std::size_t i) const { return e_.facts[i]; }

  // R6: the first level after the last one without moments, if three above it have 8 hits, or are zero. Moments that are
  // missing are missing from the start: a level that looks so above three light ones shows something rare.
  void bases() {
    constexpr int settled = 3;
    std::int64_t last = -1;
    int light = 0;
    for (const std::size_t i : all_) {
      const LevelVoice& v = voice(i);
      if (v.tail == LevelTail::heavy && light < settled) last = fact(i).level;
      light += v.tail == LevelTail::light && is_finite(v) && v.raw_hits >= few;
    }
    for (std::size_t i = 0; i < e_.facts.size(); ++i) {
      const LevelFacts& f = fact(i);
      if (f.is_base && !std::isfinite(f.second_moment)) last = std::max(last, f.level);
    }
    if (last < 0) return;
    int above = 0;
    for (const std::size_t i : all_) {
      above += fact(i).level > last && is_finite(voice(i)) && (is_zero(voice(i)) || voice(i).raw_hits >= few);
    }
    e_.missing_moments = true;
    if (above >= 3) e_.lowest_base = last + 1;
  }

  void work() {
    std::vector<double> k;
    std::vector<double> log_k;
    std::vector<double> w;
    for (const std::size_t i : all_) {
      if (!(fact(i).work > 0)) continue;
      k.push_back(static_cast<double>(fact(i).level));
      log_k.push_back(std::log2(k.back() + 1));
      w.push_back(std::log2(fact(i).work));
    }
    if (w.size() < 2) return;
    const std::size_t first = w.size() > 5 ? w.size() / 2 : 0;
    const auto deep = [&](const std::vector<double>& v) { return std::span(v).subspan(first); };
    const double g = slope_of(deep(k), deep(w));
    const double p = slope_of(deep(log_k), deep(w));
    double geometric = 0;  // residuals
    double polynomial = 0;
    double mean_k = 0;
    double mean_l = 0;
    double mean_w = 0;
    const auto n = static_cast<double>(w.size() - first);
    for (std::size_t i = first; i < w.size(); ++i) {
      mean_k += k[i] / n;
      mean_l += log_k[i] / n;
      mean_w += w[i] / n;
    }
    for (std::size_t i = first; i < w.size(); ++i) {
      geometric += std::pow(w[i] - mean_w - g * (k[i] - mean_k), 2);
      polynomial += std::pow(w[i] - mean_w - p * (log_k[i] - mean_l), 2);
    }
    constexpr double least_growth = 0.05;  // a level
    e_.exponential_work = g > least_growth && geometric <= polynomial;
    e_.work = {e_.exponential_work ? g : p, 0};
    // A constant beside the power hides a little of it from low levels.
    constexpr double hidden = 0.25;
    const std::optional<Rates>& declared = sequence_.declared;
    if (declared && e_.exponential_work && declared->work_growth > g && declared->work_growth < g + hidden) {
      e_.work.value = declared->work_growth;
    }
  }

  // R2 and R3.
  void courses() {
    std::vector<statistics::Observation> seen;
    for (const std::size_t i : usable_) {
      seen.push_back({static_cast<double>(fact(i).level), voice(i).log2_second, voice(i).error});
    }
    const bool declared = sequence_.declared && std::isfinite(sequence_.declared->variance_decay);
    if (seen.size() < (declared ? 1 : 3)) return;
    statistics::RatedCourses rated = statistics::courses_of(seen, !e_.exponential_work, sequence_.declared);
    e_.courses = std::move(rated.courses);
    e_.unaided = std::move(rated.unaided);
    e_.contradiction = rated.contradiction;
    const bool follows = !e_.unaided.empty();
    if (seen.size() < 3) e_.unaided.clear();
    if (seen.size() < 3 && !follows) e_.courses.clear();
    if (e_.courses.empty()) return;
    if (follows) e_.known_by_rates = declared_levels;
    if (declared && !follows) e_.not_there = sequence_.declared;
    double weight = 0;
    for (const Course& c : e_.courses) weight += c.polynomial;
    polynomial_share_ = weight / static_cast<double>(e_.courses.size());
    e_.polynomial = polynomial_share_ > 0.5;
    double mean = 0;
    double square = 0;
    double n = 0;
    for (const Course& c : e_.courses) {
      if (c.polynomial != e_.polynomial) continue;
      ++n;
      mean += c.limit;
      square += c.limit * c.limit + c.limit_error * c.limit_error;
    }
    mean /= n;
    e_.decay = {mean, std::sqrt(std::max(0.0, square / n - mean * mean))};
    if (e_.contradiction) {
      e_.reasons.push_back(
          {WarningCode::declared_rates, "declared decay " + to_text(e_.contradiction->declared) + "; " +
                                            levels_words(e_.first_usable, e_.last_usable) + " show " +
                                            (e_.contradiction->shown > e_.contradiction->error ? "" : "no fall, ") +
                                            short_text(e_.contradiction->shown) + " +- " +
                                            short_text(e_.contradiction->error) + ": wrong, or not there yet."});
    }
  }

  // R4.
  void ends() {
    std::vector<std::size_t> zeros;
    for (std::size_t j = all_.size(); j-- > 0 && is_finite(voice(all_[j])) && is_zero(voice(all_[j]));) {
      zeros.push_back(all_[j]);
    }
    std::reverse(zeros.begin(), zeros.end());
    const std::optional<std::int64_t>& stated = sequence_.exact_from;
    if (stated && (live_.empty() || e_.last_difference <= *stated)) {
      finish(End::stated, Answer::yes, Grade::shown);
      return;
    }
    if (stated) {
      e_.reasons.push_back(
          {WarningCode::declared_rates, "exact_from = " + std::to_string(*stated) + " is stated, and level " +
                                            std::to_string(e_.last_difference) + " still has differences: wrong."});
    }
    if (zeros.empty()) return;
    if (!promised(zeros)) return;
    if (falls_into_rounding()) {
      finish(End::rounding, Answer::yes, Grade::shown);
      return;
    }
    if (!live_.empty() && beside_value(live_.back()) < drowned) return;  // the decay decides
    // Zeros behind levels that have not shown what they are end nothing.
    if (!live_.empty() && !voice(live_.back()).usable()) return;
    double draws = 0;
    for (const std::size_t i : zeros) draws += static_cast<double>(fact(i).draws);
    if (sequence_.constant_limit && deepest_value() < e_.facts.size()) {
      if (value_has_fallen()) {
        finish(End::zeros, Answer::yes, Grade::shown);
      } else {
        finish(End::aliased, Answer::open, Grade::open);
        e_.reasons.push_back({WarningCode::aliased_differences,
                              "differences vanish but the value still varies: what makes it vary lies between the "
                              "points of the levels."});
      }
      return;
    }
    const bool likely = zeros.size() >= 3;
    finish(End::zeros, likely ? Answer::yes : Answer::open, likely ? Grade::likely : Grade::open);
    e_.reasons.push_back({WarningCode::unstated_end,
                          "zero beyond level " + std::to_string(e_.last_difference) + " in " + to_text(draws) +
                              " draws, and the sequence does not state its end (exact_from): a pause looks the same"});
  }

  void finish(End end, Answer answer, Grade grade) {
    e_.end = end;
    e_.answer = answer;
    e_.grade = e_.missing_moments ? std::min(grade, Grade::likely) : grade;
    e_.diverges = grade == Grade::open ? 0.5 : 0;
    e_.unseen = grade == Grade::open ? Unseen{} : Unseen{0, 0, 0};
  }

  // Should these levels have shown a difference?
  [[nodiscard]] bool promised(const std::vector<std::size_t>& zeros) const {
    double draws = 0;
    for (const std::size_t i : zeros) draws += static_cast<double>(fact(i).draws);
    if (live_.empty()) return draws >= std::max(zeros_of_nothing, hits_promised / nonzero_base());
    std::vector<double> k;
    std::vector<double> share;
    for (const std::size_t i : live_) {
      const double nonzero = nonzero_of(i);
      if (nonzero * static_cast<double>(fact(i).draws) < few) continue;
      k.push_back(static_cast<double>(fact(i).level));
      share.push_back(std::log2(nonzero));
    }
    const std::size_t last_four = k.size() > 4 ? k.size() - 4 : 0;
    double slope = -1;
    double at = static_cast<double>(fact(live_.back()).level);
    double height = std::log2(nonzero_of(live_.back()));
    if (k.size() >= 2) {
      slope = std::min(0.0, slope_of(std::span(k).subspan(last_four), std::span(share).subspan(last_four)));
      at = k.back();
      height = share.back();
    }
    double hits = 0;
    for (const std::size_t i : zeros) {
      const double expected = std::exp2(height + slope * (static_cast<double>(fact(i).level) - at));
      hits += static_cast<double>(fact(i).draws) * std::min(1.0, expected);
    }
    return hits >= hits_promised;
  }

  // Differences need be no more frequent than the values of the base, which zeros alone say nothing of.
  [[nodiscard]] double nonzero_base() const {
    for (const LevelFacts& f : e_.facts) {
      if (!f.is_base) continue;
      const double share = std::isnan(f.nonzero) ? 1 / f.kurtosis : f.nonzero;
      if (share > 0 && share < 1) return share;
    }
    return 1;
  }

  [[nodiscard]] double nonzero_of(std::size_t i) const {
    const LevelFacts& f = fact(i);
    if (!std::isnan(f.nonzero)) return f.nonzero;
    // Of a run: kappa is at least one over the share of draws with a difference.
    return std::min(1.0, std::exp2(-voice(i).log2_rarity));
  }

  // log2 of E D^2 beside E I^2; NaN where that is not known.
  [[nodiscard]] double beside_value(std::size_t i) const {
    return voice(i).log2_second - std::log2(fact(i).value_square);
  }

  [[nodiscard]] bool falls_into_rounding() const {
    if (live_.size() < 3) return false;
    std::array<double, 3> last{};
    for (std::size_t j = 0; j < 3; ++j) last[j] = beside_value(live_[live_.size() - 3 + j]);
    return last[2] < last[1] - 2 && last[1] < last[0] && last[2] < drowned &&
           voice(live_[live_.size() - 1]).hits >= few && voice(live_[live_.size() - 2]).hits >= few;
  }

  // The deepest level of which the variance of the value is known; the end of the table where it is of none.
  [[nodiscard]] std::size_t deepest_value() const {
    for (std::size_t i = e_.facts.size(); i-- > 0;) {
      if (!std::isnan(fact(i).value_variance) && fact(i).value_square > 0) return i;
    }
    return e_.facts.size();
  }

  // What is left of the variance of the value is rounding, or no more than the differences that are left explain.
  [[nodiscard]] bool value_has_fallen() const {
    const LevelFacts& f = fact(deepest_value());
    if (f.value_variance <= std::exp2(-60) * f.value_square) return true;
    if (live_.empty()) return false;
    constexpr double explained = 16;
    const LevelFacts& last = fact(live_.back());
    if (f.level >= last.level && f.value_variance <= explained * last.second_moment) return true;
    const double falls = std::log2(last.value_variance / f.value_variance);
    return f.level > last.level && falls > static_cast<double>(f.level - last.level);
  }

  // What turns a no into open: no trend, but a hump or a start.
  void changes() {
    const double scatter = statistics::scatter_of(e_.courses);
    std::vector<double> k;
    std::vector<double> rarity;
    std::vector<double> absolute;  // b - log2 kappa: of a rare event with E |D| bounded it does not grow
    std::vector<double> absolute_errors;
    for (const std::size_t i : usable_) {
      if (voice(i).hits < few) continue;
      k.push_back(static_cast<double>(fact(i).level));
      rarity.push_back(voice(i).log2_rarity);
      absolute.push_back(voice(i).log2_second - voice(i).log2_rarity);
      absolute_errors.push_back(std::hypot(2 * voice(i).error, scatter));  // both count the same hits
    }
    const auto last = [](const std::vector<double>& v, std::size_t n) {
      return std::span(v).subspan(v.size() > n ? v.size() - n : 0);
    };
    if (k.size() >= 3) {
      const auto x = last(k, 6);
      const auto y = last(rarity, 6);
      const bool falls = slope_of(x, y) * (x.back() - x.front()) < -1 && y.front() > 2;
      const double growth = slope_of(last(k, 5), last(absolute, 5));
      const bool grows =
          growth - slope_error_of(last(k, 5), last(absolute_errors, 5)) > (e_.exponential_work ? 0.25 : 0.025);
      grows_straight_ = grows && grows_straight(scatter);
      e_.changes = falls || (grows && !grows_straight_) || steepens(scatter) || slackens();
    }
  }

  // Of the last n usable levels.
  [[nodiscard]] statistics::Halves halves(std::size_t n, double scatter) const {
    std::vector<statistics::Observation> seen;
    for (const std::size_t i : std::span(usable_).last(n)) {
      seen.push_back({static_cast<double>(fact(i).level), voice(i).log2_second, voice(i).error});
    }
    return statistics::halves_of(seen, scatter);
  }

  [[nodiscard]] bool steepens(double scatter) const {
    constexpr std::size_t many = 6;
    const std::size_t n = std::min(many, usable_.size());
    if (n < 4) return false;
    const statistics::Halves h = halves(n, scatter);
    // Few levels may be all on the near side of a hump: less is enough for a doubt.
    return h.bend() > (e_.exponential_work ? 0.3 : 0.015) && h.bend() > (n < many ? 1 : 2) * h.bend_error();
  }

  // Growth that slows down ends, as that of 2^k zeros of probability 1 - p does where 2^k nears 1 / p: the levels that are
  // known lie on a parabola which bends more than their draws make it.
  [[nodiscard]] bool slackens() const {
    constexpr std::size_t many = 6;
    constexpr std::size_t fewest = 5;
    constexpr double least = 0.3;  // octaves a level, from the first to the last
    if (!e_.exponential_work) return false;
    std::vector<std::size_t> known;
    for (const std::size_t i : usable_) {
      if (voice(i).error <= known_error) known.push_back(i);
    }
    if (known.size() < fewest) return false;
    const std::span<const std::size_t> seen = std::span(known).last(std::min(many, known.size()));
    const auto level = [&](std::size_t i) { return static_cast<double>(fact(i).level); };
    const auto sum = [&](const auto& term) {
      double all = 0;
      for (const std::size_t i : seen) all += term(i) / (voice(i).error * voice(i).error);
      return all;
    };
    const double one = sum([](std::size_t) { return 1.0; });
    const double mean = sum(level) / one;
    const auto line = [&](std::size_t i) { return level(i) - mean; };
    const double square = sum([&](std::size_t i) { return line(i) * line(i); });
    const double offset = square / one;
    const double skew = sum([&](std::size_t i) { return std::pow(line(i), 3); }) / square;
    const auto parabola = [&](std::size_t i) { return line(i) * (line(i) - skew) - offset; };
    const double norm = sum([&](std::size_t i) { return parabola(i) * parabola(i); });
    const double curve = sum([&](std::size_t i) { return parabola(i) * voice(i).log2_second; }) / norm;
    const double growth = voice(seen[1]).log2_second - voice(seen[0]).log2_second;
    const double growth_error = std::hypot(voice(seen[1]).error, voice(seen[0]).error);
    const double bend = -2 * curve * (level(seen.back()) - level(seen.front()));
    return growth > 2.6 * growth_error && bend > least && -curve > 2.6 / std::sqrt(norm);
  }

  // A hump bends. What has grown for six levels by as much each is a trend.
  [[nodiscard]] bool grows_straight(double scatter) const {
    constexpr std::size_t n = 6;
    constexpr double least = 0.5;  // octaves a level
    constexpr double most_bend = 0.2;
    if (usable_.size() < n) return false;
    const statistics::Halves h = halves(n, scatter);
    const double bend = std::abs(h.bend());
    return h.early.value < -least && h.late.value < -least && bend < std::max(most_bend, 3 * h.bend_error()) &&
           h.bend_error() < least;
  }

  // lambda: the roots of the series fall like 2^(-lambda k), or k^(-lambda - 1).
  [[nodiscard]] double lambda(const Course& c, double slope) const {
    if (c.polynomial) return (slope - e_.work.value) / 2 - 1;
    return (slope - (e_.exponential_work ? e_.work.value : 0)) / 2;
  }

  [[nodiscard]] double diverges(std::span<const Course> courses) const {
    double sum = 0;
    for (const Course& c : courses) {
      sum += statistics::normal_cdf(-lambda(c, c.slope) / std::max(c.limit_error / 2, 1e-12));
    }
    return sum / static_cast<double>(courses.size());
  }

  void unseen() {
    const auto roots_of = [&](std::size_t i) { return (voice(i).log2_second + std::log2(fact(i).work)) / 2; };
    double seen = 0;
    for (std::size_t j = 0; j + 1 < usable_.size(); ++j) {  // the gaps between the usable levels filled in
      const double a = roots_of(usable_[j]);
      const double b = roots_of(usable_[j + 1]);
      const auto steps = static_cast<double>(fact(usable_[j + 1]).level - fact(usable_[j]).level);
      for (double s = 0; s < steps; ++s) seen += std::exp2(a + s / steps * (b - a));
    }
    seen += std::exp2(roots_of(usable_.back()));
    for (std::size_t i = 0; i < e_.facts.size(); ++i) {
      const bool is_first = fact(i).is_base || (base_ < 0 && i == 0);
      if (is_first && fact(i).value_variance > 0) seen += std::sqrt(fact(i).value_variance * fact(i).work);
    }
    const statistics::Horizon horizon = statistics::horizon_of(e_.last_usable);
    std::vector<double> roots;
    for (const statistics::Ahead& ahead : horizon) roots.push_back(log2_work(e_, ahead.level()) / 2);
    std::vector<double> u;
    for (const Course& c : e_.courses) {
      const double l = lambda(c, c.limit);
      if (!(l > 0)) {
        u.push_back(1);
        continue;
      }
      const double rest = statistics::sum_beyond(c, e_.last_usable, horizon, 0.5, roots, l);
      u.push_back(rest / (rest + seen));
    }
    e_.diverges = diverges(e_.courses);
    std::sort(u.begin(), u.end());
    const auto at = [&](double q) { return u[static_cast<std::size_t>(q * static_cast<double>(u.size() - 1) + 0.5)]; };
    e_.unseen = {at(shown_p), at(0.5), at(1 - shown_p)};
  }

  void answer() {
    const double p = e_.diverges;
    std::size_t unclear = 0;
    std::size_t counted = 0;
    for (const std::size_t i : usable_) {
      if (fact(i).level < e_.lowest_base) continue;
      ++counted;
      unclear += voice(i).tail != LevelTail::light;
    }
    // Deeper levels of fewer draws are not to be called fine because they have not shown what shallower ones have.
    const bool doubtful = e_.missing_moments && 3 * unclear > counted;
    // A decay like a power beside work like a power converges late: only many levels tell it from a slow exponential.
    const bool long_power = e_.last_usable >= many_levels && polynomial_share_ >= 1 - shown_p;
    const bool slow = !e_.exponential_work && e_.decay.value > e_.decay.error / 2 && !long_power;
    const bool may_say_no = budget_spent_ && !e_.changes && !slow;
    if (doubtful) {
      e_.reasons.push_back({WarningCode::no_second_moment,
                            "the largest differences of most levels look as if there were no second moment."});
    } else if (p <= shown_p && e_.unseen.high <= most_unseen_of_sum && e_.known >= 4) {
      e_.answer = Answer::yes;
      const bool by_rates = !e_.unaided.empty() && diverges(e_.unaided) > likely_p;
      e_.grade = by_rates ? Grade::likely : Grade::shown;
      if (e_.missing_moments || 3 * unclear > counted) {
        e_.grade = Grade::likely;
        e_.reasons.push_back({WarningCode::no_second_moment,
                              e_.missing_moments ? "some levels may have no second moment."
                                                 : "the draws of many levels do not tell whether these have a second "
                                                   "moment, so the answer is likely and not shown."});
      }
    } else if (p <= likely_p && e_.unseen.median <= most_unseen_of_sum && e_.known + e_.known_by_rates >= 3) {
      e_.answer = Answer::yes;
      e_.grade = Grade::likely;
    } else if (may_say_no && 1 - p <= shown_p && e_.known >= 5) {
      e_.answer = Answer::no;
      const bool grows = e_.decay.value + 2.6 * e_.decay.error < 0;
      const bool certain = (e_.exponential_work || grows) && !e_.missing_moments && !grows_straight_;
      e_.grade = certain ? Grade::shown : Grade::likely;
    } else if (may_say_no && (1 - p <= likely_p || e_.unseen.low >= 0.9) && e_.known + e_.known_by_rates >= 4) {
      e_.answer = Answer::no;
      e_.grade = Grade::likely;
    } else if (e_.changes) {
      e_.reasons.push_back({WarningCode::unsettled_levels,
                            "rarity falls, or the decay still steepens, with the level: not yet a trend"});
    }
  }

  Evidence e_;
  const SequenceFacts& sequence_;
  bool budget_spent_;
  std::int64_t base_ = -1;
  double polynomial_share_ = 0;  // of the courses
  bool grows_straight_ = false;
  std::vector<std::size_t> all_;     // levels with differences
  std::vector<std::size_t> live_;    // of them, those that are not zero
  std::vector<std::size_t> usable_;  // of these
};

}  // namespace

Evidence weigh(std::vector<LevelFacts> facts, const SequenceFacts& sequence, bool budget_spent) {
  return Scales(std::move(facts), sequence, budget_spent).weigh();
}

}  // namespace debias

// From the rows of a survey to what they say: rates, the answer, remarks.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "survey/survey_of.hpp"

#include "core/regression.hpp"
#include "core/text.hpp"
#include "core/words.hpp"
#include "statistics/posterior.hpp"

namespace debias {
namespace {

// What a level may deviate from a pure power without being noticed, in octaves: exact moments bend a little.
constexpr double octave_floor = 0.03;
// Below these sizes beside I_k a difference is: too small to matter, or rounding, or zero in exact arithmetic.
constexpr double negligible = 1e-10;
constexpr double rounding_size = 1e-13;
constexpr double chi_square_z = 3.1;  // a right fit fails once in a thousand
constexpr double drift_z = 1.0;       // how far a slope may move when the shallowest level leaves
constexpr std::size_t fewest_levels = 3;
constexpr std::size_t fewest_scattered = 4;

// A fit of log2 y over the levels, from the shallowest on from which it is a line.
struct RateFit {
  Line line;
  std::size_t first = 0;  // index of the first point that takes part
  std::size_t count = 0;
  double error = 0;  // of the slope, with what the scatter adds
};

// Wilson and Hilferty: chi-square as a normal deviate.
double chi_square_deviate(double chi_square, int degrees) {
  const double v = 2.0 / (9.0 * degrees);
  return (std::cbrt(chi_square / degrees) - (1 - v)) / std::sqrt(v);
}

std::optional<RateFit> fit_tail(std::span<const double> x, std::span<const double> y, std::span<const double> errors) {
  const auto fit_from = [&](std::size_t first) {
    return fit_line(x.subspan(first), y.subspan(first), errors.subspan(first));
  };
  for (std::size_t first = 0; first + fewest_levels <= x.size(); ++first) {
    const Line line = fit_from(first);
    if (!(chi_square_deviate(line.chi_square, line.degrees) < chi_square_z)) continue;
    if (first + fewest_levels < x.size()) {
      // Without the shallowest level the slope moves by less than noise when the power law is exact [Hausman].
      const Line next = fit_from(first + 1);
      const double spread = std::sqrt(next.slope_error * next.slope_error - line.slope_error * line.slope_error);
      if (std::abs(next.slope - line.slope) > drift_z * spread) continue;
    }
    const double excess = std::max(1.0, line.chi_square / std::max(line.degrees, 1));
    return RateFit{line, first, x.size() - first, line.slope_error * std::sqrt(excess)};
  }
  return std::nullopt;
}

struct Points {
  std::vector<double> x, y, errors;
  std::vector<std::size_t> rows;
  void add(double at, double value, double error, std::size_t row) {
    x.push_back(at);
    y.push_back(std::log2(value));
    errors.push_back(std::hypot(error, octave_floor));
    rows.push_back(row);
  }
  [[nodiscard]] std::optional<RateFit> fit() const { return fit_tail(x, y, errors); }
};

double abscissa(const SurveyRow& row, Decay decay) {
  const auto k = static_cast<double>(row.level);
  return decay == Decay::geometric ? k : std::log2(k + 1);
}

double relative_error_in_octaves(double spread, std::int64_t draws) {
  return std::sqrt(std::max(spread - 1, 0.0) / static_cast<double>(draws)) / std::log(2.0);
}

Points second_moments(const std::vector<SurveyRow>& rows, const std::vector<std::size_t>& usable, Decay decay) {
  Points p;
  for (const std::size_t i : usable) {
    p.add(abscissa(rows[i], decay), rows[i].second_moment, relative_error_in_octaves(rows[i].kurtosis, rows[i].draws),
          i);
  }
  return p;
}

std::string text_of(double x) { return format("%.3g", x); }

class Conclusion {
 public:
  Conclusion(std::vector<SurveyRow> rows, std::uint64_t seed, const SequenceFacts& sequence, bool budget_spent,
             const std::vector<LevelFacts>& beyond) {
    survey_.rows = std::move(rows);
    survey_.seed = seed;
    survey_.evidence = weigh(facts_of(survey_.rows), sequence, budget_spent);
    if (!beyond.empty() && survey_.evidence.end == End::none && !survey_.evidence.missing_moments) {
      survey_.evidence = weigh_with(beyond, sequence, budget_spent);
    }
    survey_.pmf_exists = survey_.evidence.answer;
    survey_.grade = survey_.evidence.grade;
  }

  Survey draw() {
    for (const SurveyRow& row : survey_.rows) {
      survey_.work += static_cast<double>(row.draws) * std::max(row.difference_work, row.value_work);
      survey_.seconds += static_cast<double>(row.draws) * row.seconds;
      const double size = std::sqrt(row.mean * row.mean + row.variance);
      if (std::isfinite(size)) scale_ = std::max(scale_, size);
    }
    consistency();
    if (!zeros()) rates();
    survey_.remarks.insert(survey_.remarks.end(), survey_.evidence.reasons.begin(), survey_.evidence.reasons.end());
    slow_draws();
    return std::move(survey_);
  }

 private:
  // The work of more levels tells how it goes on. They have no part in the rest: nothing of them was drawn.
  Evidence weigh_with(const std::vector<LevelFacts>& beyond, const SequenceFacts& sequence, bool budget_spent) const {
    std::vector<LevelFacts> facts = facts_of(survey_.rows);
    const auto drawn = static_cast<std::ptrdiff_t>(facts.size());
    facts.insert(facts.end(), beyond.begin(), beyond.end());
    Evidence e = weigh(std::move(facts), sequence, budget_spent);
    e.facts.erase(e.facts.begin() + drawn, e.facts.end());
    e.voices.erase(e.voices.begin() + drawn, e.voices.end());
    return e;
  }

  static std::vector<LevelFacts> facts_of(const std::vector<SurveyRow>& rows) {
    std::vector<LevelFacts> facts;
    for (const SurveyRow& row : rows) {
      LevelFacts f;
      f.level = row.level;
      f.draws = row.draws;
      f.is_base = row.level == 0;
      f.mean = row.difference;
      f.second_moment = row.second_moment;
      f.kurtosis = row.kurtosis;
      f.nonzero = row.nonzero;
      f.work = row.difference_work;
      f.value_variance = row.variance;
      double square = row.mean * row.mean + row.variance;
      for (const ComponentEstimate& c : row.coarse) square += c.mean * c.mean + c.variance;
      f.value_square = square;
      f.tail_index = row.tail_index;
      f.tail_error = row.tail_error;
      statistics::drop_rounding(f);
      facts.push_back(f);
    }
    return facts;
  }

  // The time of a draw grows and its stated work does not: pilot and PMF would spend what they do not count.
  void slow_draws() {
    constexpr double least_time = 1e-5;   // of a draw: below, the clock tells little
    constexpr double enough_time = 0.01;  // of all draws of a level, of two levels: a busy machine pauses, too
    constexpr std::int64_t span = 4;
    constexpr double factor = 8;
    if (survey_.rows.size() < 2) return;
    const SurveyRow& last = survey_.rows.back();
    const SurveyRow& previous = survey_.rows[survey_.rows.size() - 2];
    for (const SurveyRow* row : {&last, &previous}) {
      if (!(row->seconds > least_time) || !(row->seconds * static_cast<double>(row->draws) > enough_time)) return;
    }
    for (const SurveyRow& row : survey_.rows) {
      if (row.level == 0 || row.level + span > last.level) continue;
      const double work =
          std::max(last.difference_work, last.value_work) / std::max(row.difference_work, row.value_work);
      const double time = last.seconds / std::max(row.seconds, 1e-8);
      if (!(time > factor * work)) continue;
      const double before =
          std::max(previous.difference_work, previous.value_work) / std::max(row.difference_work, row.value_work);
      if (!(previous.seconds / std::max(row.seconds, 1e-8) > factor / 2 * before)) continue;
      remark(WarningCode::unexplained_time, "a draw of level " + std::to_string(last.level) + " takes " +
                                                text_of(time) + " times as long as one of level " +
                                                std::to_string(row.level) + " and states " + text_of(work) +
                                                " times its work: state the work of a draw (`work`, with its value).");
      return;
    }
  }

  void remark(WarningCode code, const std::string& text) { survey_.remarks.push_back({code, text}); }

  void consistency() {
    auto& rows = survey_.rows;
    double worst = 0;
    std::int64_t where = 0;
    std::int64_t unknown = -1;  // the deepest level without a comparison
    const bool squares_vanish = scale_ * scale_ < 1e-290;
    for (std::size_t i = 1; i < rows.size(); ++i) {
      SurveyRow& row = rows[i];
      if (rows[i - 1].level + 1 != row.level || rows[i - 1].level < survey_.evidence.lowest_base) continue;
      for (std::size_t c = 0; c < row.coarse.size(); ++c) {
        const ComponentEstimate& below = rows[i - 1].values[c];
        const double gap = row.coarse[c].mean - below.mean;
        const double rounding = 1e-12 * (scale_ + std::abs(below.mean));
        const double z = gap / std::max(std::hypot(row.coarse[c].standard_error, below.standard_error), rounding);
        if (!std::isfinite(z) || (gap != 0 && squares_vanish)) {  // values that are not finite, or their squares
          unknown = row.level;
          continue;
        }
        if (!(std::abs(z) <= std::abs(row.consistency))) row.consistency = z;
      }
      if (!(std::abs(row.consistency) > worst)) continue;
      worst = std::abs(row.consistency);
      where = row.level;
    }
    if (unknown >= 0) {
      remark(WarningCode::coupling_unchecked, "values of level " + std::to_string(unknown) +
                                                  ", or of the level below, have a mean or a variance that no double "
                                                  "holds: their coupling is not checked.");
    }
    if (worst <= 4.5) return;
    remark(WarningCode::coupling,
           "E[I_k] - E[I_(k-1)] is not E[D_k] at level " + std::to_string(where) + " (z = " + text_of(worst) +
               "): the coarse partner of the coupling is not distributed like the level below, and every estimate "
               "from it is biased.");
  }

  [[nodiscard]] double size(const SurveyRow& row) const { return std::sqrt(row.second_moment) / scale_; }

  // Differences that are zero in every draw from some level on.
  bool zeros() {
    const Evidence& e = survey_.evidence;
    if (e.end == End::none || e.end == End::rounding || e.end == End::aliased) return false;
    if (e.answer != Answer::yes) return false;
    survey_.rates.kind = RateKind::exact_zero;
    faster_than_any();
    work_rate(Decay::geometric);
    remark(WarningCode::exact_end,
           "the differences are zero from level " + std::to_string(e.last_difference + 1) + " on");
    return true;
  }

  void faster_than_any() {
    constexpr double infinity = Rates::faster_than_any;
    survey_.rates.mean_decay = survey_.rates.variance_decay = survey_.rates.fourth_decay = {infinity, 0};
  }

  // Levels whose moments are known, large enough to matter, and not yet drowned in rounding.
  std::vector<std::size_t> usable_rows(double floor) {
    auto& rows = survey_.rows;
    std::vector<std::size_t> usable;
    std::size_t least = rows.size();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const SurveyRow& row = rows[i];
      if (row.level == 0 || !(row.second_moment > 0) || !std::isfinite(row.second_moment)) continue;
      if (size(row) < floor) break;
      if (size(row) < 1e-5 && least < rows.size() && row.second_moment > 2 * rows[least].second_moment) {
        drowned_ = row.level;
        while (!usable.empty() && usable.back() + 1 >= least) usable.pop_back();
        break;
      }
      if (least == rows.size() || row.second_moment < rows[least].second_moment) least = i;
      if (row.usable) usable.push_back(i);
    }
    return usable;
  }

  // What the levels above a floor say.
  struct Fits {
    std::vector<std::size_t> usable;
    std::optional<RateFit> geometric;
    std::optional<RateFit> polynomial;
  };
  Fits fits_above(double floor) {
    Fits f;
    f.usable = usable_rows(floor);
    f.geometric = second_moments(survey_.rows, f.usable, Decay::geometric).fit();
    // Decays like powers of the level beside work like powers of 2 would be new under the sun.
    if (!(survey_.rates.work_growth.value > 0.5)) {
      f.polynomial = second_moments(survey_.rows, f.usable, Decay::polynomial).fit();
    }
    return f;
  }

  void rates() {
    auto& rows = survey_.rows;
    MeasuredRates& r = survey_.rates;
    work_rate(Decay::geometric);
    Fits fits = fits_above(negligible);
    if (super_exponential(fits)) {
      r.kind = RateKind::super_exponential;
      faster_than_any();
      remark(WarningCode::fast_decay, "the differences fall ever faster, beyond any power");
      return;
    }
    if (!fits.geometric && !fits.polynomial) fits = fits_above(rounding_size);
    const std::vector<std::size_t>& usable = fits.usable;
    std::optional<RateFit>& g = fits.geometric;
    const std::optional<RateFit>& p = fits.polynomial;
    if (drowned_ > 0)
      remark(WarningCode::rounding, "rounding drowns the differences from level " + std::to_string(drowned_) + " on");
    if (!g && !p) g = scattered(usable);
    if (!g && !p) {
      constexpr double nan = std::numeric_limits<double>::quiet_NaN();
      r.mean_decay = r.variance_decay = r.fourth_decay = {nan, 0};
      remark(WarningCode::rates_unknown, "cannot tell the rates yet: " + counted(std::ssize(usable), "level") +
                                             " with enough draws for their kurtosis, no " +
                                             std::to_string(fewest_levels) +
                                             " of them on a line; survey more levels, or more draws");
      return;
    }
    // A power of the level only where a power of 2 explains clearly less: few levels look like either.
    const bool is_polynomial = p && (!g || p->count > g->count + 1);
    r.kind = is_polynomial ? RateKind::polynomial : RateKind::geometric;
    const Decay decay = is_polynomial ? Decay::polynomial : Decay::geometric;
    const RateFit& fit = is_polynomial ? *p : *g;
    std::vector<std::size_t> fitted(usable.begin() + static_cast<std::ptrdiff_t>(fit.first), usable.end());
    for (const std::size_t i : fitted) rows[i].fitted = true;
    r.variance_decay = {-fit.line.slope, fit.error};

    Points fourth;
    Points mean;
    const double unit = rows[fitted.front()].second_moment;  // whose square may be no number
    for (const std::size_t i : fitted) {
      const SurveyRow& row = rows[i];
      fourth.add(abscissa(row, decay), row.kurtosis * std::pow(row.second_moment / unit, 2),
                 relative_error_in_octaves(std::pow(row.kurtosis, 2.25), row.draws), i);
      const double share = row.difference_error / std::abs(row.difference);
      if (share < 1.0 / 3) mean.add(abscissa(row, decay), std::abs(row.difference), share / std::log(2.0), i);
    }
    const Line line4 = fit_line(fourth.x, fourth.y, fourth.errors);
    r.fourth_decay = {-line4.slope, line4.slope_error};
    if (const auto m = mean.fit()) {
      r.mean_decay = {-m->line.slope, m->error};
    } else {
      r.mean_decay = {std::numeric_limits<double>::quiet_NaN(), 0};
    }
    work_rate(decay);
    pre_asymptotic(fitted.front());
  }

  // No line, but a trend: the deeper two thirds, and what they scatter around it.
  std::optional<RateFit> scattered(const std::vector<std::size_t>& usable) {
    const Points points = second_moments(survey_.rows, usable, Decay::geometric);
    const std::size_t first = usable.size() / 3;
    if (usable.size() - first < fewest_scattered) return std::nullopt;
    const std::vector<double> equal(usable.size() - first, 1.0);
    const std::span x(points.x);
    const std::span y(points.y);
    const Line line = fit_line(x.subspan(first), y.subspan(first), equal);
    const double scatter = std::sqrt(line.chi_square / line.degrees);
    remark(WarningCode::scattered_moments,
           "the second moments scatter around their decay by " + text_of(scatter) + " octaves");
    return RateFit{line, first, equal.size(), line.slope_error * scatter};
  }

  // Every fall steeper than the one before, down to where nothing is left.
  bool super_exponential(const Fits& fits) const {
    const auto& usable = fits.usable;
    if (usable.size() < 3 || (fits.geometric && fits.geometric->count > 3)) return false;
    const auto& rows = survey_.rows;
    if (usable.back() + 1 == rows.size()) return false;
    double last = 0;
    for (std::size_t i = usable.size() > 5 ? usable.size() - 5 : 0; i + 1 < usable.size(); ++i) {
      const SurveyRow& a = rows[usable[i]];
      const SurveyRow& b = rows[usable[i + 1]];
      const double fall = std::log2(a.second_moment / b.second_moment) / static_cast<double>(b.level - a.level);
      if (!(fall > 1.03 * last)) return false;
      last = fall;
    }
    return last > 4;
  }

  void work_rate(Decay decay) {
    Points geometric;
    Points polynomial;
    for (std::size_t i = 0; i < survey_.rows.size(); ++i) {
      const SurveyRow& row = survey_.rows[i];
      if (row.level == 0 || !(row.difference_work > 0)) continue;
      geometric.add(abscissa(row, Decay::geometric), row.difference_work, 0, i);
      polynomial.add(abscissa(row, Decay::polynomial), row.difference_work, 0, i);
    }
    const auto g = geometric.fit();
    const auto p = polynomial.fit();
    const auto quality = [](const std::optional<RateFit>& f) {
      return f ? f->line.chi_square / f->line.degrees : std::numeric_limits<double>::infinity();
    };
    const bool is_polynomial = p && (!g || p->count > g->count || (p->count == g->count && quality(p) < quality(g)));
    if (!g && !p && stepwise(decay == Decay::geometric ? geometric : polynomial)) return;
    if (decay == Decay::geometric && is_polynomial) {
      survey_.rates.work_growth = {0, 0};  // no power of 2 at all
    } else if (decay == Decay::polynomial && is_polynomial) {
      survey_.rates.work_growth = {p->line.slope, p->error};
    } else if (g) {
      survey_.rates.work_growth = {g->line.slope, g->error};
    } else {
      survey_.rates.work_growth = {std::numeric_limits<double>::quiet_NaN(), 0};
    }
  }

  // Work that grows in steps lies on no line: its trend, with what it scatters around it.
  bool stepwise(const Points& points) {
    if (points.x.size() < fewest_scattered) return false;
    const std::vector<double> equal(points.x.size(), 1.0);
    const Line line = fit_line(points.x, points.y, equal);
    survey_.rates.work_growth = {line.slope, line.slope_error * std::sqrt(line.chi_square / line.degrees)};
    return true;
  }

  void pre_asymptotic(std::size_t first_fitted) {
    const auto& rows = survey_.rows;
    std::int64_t first = -1;
    std::int64_t last = -1;
    for (std::size_t i = 0; i < first_fitted; ++i) {
      if (rows[i].level == 0) continue;
      if (first < 0) first = rows[i].level;
      last = rows[i].level;
    }
    if (first >= 0)
      remark(WarningCode::shallow_levels, levels_words(first, last) + " not yet asymptotic: left out of the fit");
    first = -1;
    for (std::size_t i = first_fitted; i < rows.size(); ++i) {
      if (rows[i].usable || rows[i].second_moment == 0) continue;
      if (first < 0) first = rows[i].level;
      last = rows[i].level;
    }
    if (first >= 0) {
      remark(WarningCode::few_draws,
             levels_words(first, last) + " with fewer draws than 10 times their kurtosis: not usable in the fit");
    }
  }

  Survey survey_;
  double scale_ = 0;
  std::int64_t drowned_ = 0;  // the first level below which rounding is what is left
};

}  // namespace

Survey survey_of(std::vector<SurveyRow> rows, std::uint64_t seed, const SequenceFacts& sequence, bool budget_spent) {
  return survey_of(std::move(rows), seed, sequence, budget_spent, {});
}

Survey survey_of(std::vector<SurveyRow> rows, std::uint64_t seed, const SequenceFacts& sequence, bool budget_spent,
                 const std::vector<LevelFacts>& beyond) {
  return Conclusion(std::move(rows), seed, sequence, budget_spent, beyond).draw();
}

}  // namespace debias

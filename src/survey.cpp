#include <debias/survey.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <functional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>

#include "core/text.hpp"
#include "core/words.hpp"
#include "survey/pilot.hpp"
#include "survey/resonance.hpp"

namespace debias {
namespace {

constexpr double draws_per_kurtosis = 10;
constexpr std::int64_t deepest_within = 23;  // finite differences end behind it: zeros say nothing of a decay
constexpr std::int64_t fewest_for_tail = 64;

double signed_norm(const detail::Part& part) {
  return part.means.size() == 1 ? part.means[0] : std::sqrt(part.square_of_mean);
}

}  // namespace

const char* name_of(RateKind kind) {
  constexpr std::array names = {"geometric", "polynomial", "exact zero", "super-exponential"};
  return names[static_cast<std::size_t>(kind)];
}

const SurveyRow* Survey::row_at(std::int64_t level) const {
  const auto found = std::lower_bound(rows.begin(), rows.end(), level,
                                      [](const SurveyRow& row, std::int64_t k) { return row.level < k; });
  return found != rows.end() && found->level == level ? &*found : nullptr;
}

SurveyRow survey_level(const LevelRuns& runs, std::int64_t level, const Plan& plan) {
  Plan draws = plan;  // no part of what a plan keeps
  draws.save = {};
  draws.earlier = {};
  draws.pilot = {};
  const Statistics s = runs.draw(level, draws);
  return row_of(s, level, runs.work(level, plan));
}

namespace {

// The largest |x| of both tails, in descending order, as many as speak for the tail.
std::vector<double> largest_of(const Statistics& s) {
  std::vector<double> all;
  for (const double x : s.upper_tail) {
    if (x > 0) all.push_back(x);
  }
  for (const double x : s.lower_tail) {
    if (x < 0) all.push_back(-x);
  }
  std::sort(all.begin(), all.end(), std::greater<>());
  // Where a tail was cut, what lies below its end may be missing.
  const auto size = static_cast<std::size_t>(tail_size(s.samples)) + 1;
  if (all.size() > size) all.resize(size);
  return all;
}

}  // namespace

SurveyRow row_of(const Statistics& s, std::int64_t level, const std::pair<double, double>& work) {
  const detail::Part value = detail::part_of(s, 0);
  const detail::Part difference = detail::part_of(s, 2);
  const auto n = static_cast<double>(s.samples);
  SurveyRow row;
  row.level = level;
  row.draws = s.samples;
  row.mean = signed_norm(value);
  row.variance = value.variance;
  row.mean_error = std::sqrt(value.variance / n);
  row.difference = signed_norm(difference);
  row.difference_error = std::sqrt(difference.variance / n);
  row.difference_variance = difference.variance;
  for (const LevelRow& l : s.levels) {
    if (l.is_base) continue;
    row.second_moment = l.second_moment;
    row.kurtosis = l.kurtosis;
  }
  row.second_moment_error = row.second_moment * std::sqrt(std::max(row.kurtosis - 1, 0.0) / n);
  row.nonzero = s.components.back().mean;
  if (s.nonfinite > 0) row.nonzero = 1;
  if (level > 0 && s.nonfinite == 0 && s.samples >= fewest_for_tail) {
    const std::vector<double> largest = largest_of(s);
    if (!largest.empty()) {
      const TailIndex tail = tail_index(largest, s.samples, 0);
      if (tail.state == TailState::fitted) {
        row.tail_index = tail.k;
        row.tail_error = tail.error;
      }
    }
  }
  row.usable = row.kurtosis > 0 && n >= draws_per_kurtosis * row.kurtosis;
  row.seconds = s.seconds / n;
  row.fewer_threads = s.fewer_threads;
  std::tie(row.value_work, row.difference_work) = work;
  const auto each = static_cast<std::ptrdiff_t>(value.means.size());
  row.values.assign(s.components.begin(), s.components.begin() + each);
  row.coarse.assign(s.components.begin() + each, s.components.begin() + 2 * each);
  return row;
}

Survey survey(const LevelRuns& runs, std::int64_t levels, const Plan& plan, std::int64_t first) {
  if (first < 0) {
    throw std::invalid_argument("survey: first = " + std::to_string(first) + " (levels start at 0)");
  }
  if (levels < 2) {
    throw std::invalid_argument("survey: levels = " + std::to_string(levels) +
                                " (a decay needs at least two, a rate four); 8 is a good start");
  }
  if (plan.samples < 2) {
    throw std::invalid_argument("survey: samples = " + std::to_string(plan.samples) +
                                " (a variance needs two draws of each level); 4096 is a good start");
  }
  if (first >= runs.deepest_level) {
    throw std::invalid_argument("survey: first = " + std::to_string(first) +
                                " (the deepest that can be drawn is level " + std::to_string(runs.deepest_level) +
                                ", and a decay needs two); take a lower one");
  }
  if (runs.deepest_level - first < levels - 1) {
    const std::string from = first == 0 ? "" : " from level " + std::to_string(first) + " on";
    throw std::invalid_argument("survey: levels = " + std::to_string(levels) + from +
                                " (the deepest that can be drawn is level " + std::to_string(runs.deepest_level) +
                                "); ask for at most " + std::to_string(runs.deepest_level - first + 1));
  }
  std::vector<SurveyRow> rows;
  bool interrupted = false;
  try {
    for (std::int64_t k = 0; k < levels; ++k) {
      Plan part = plan;
      if (plan.progress) {
        part.progress = [&plan, k](std::int64_t done) { return plan.progress(k * plan.samples + done); };
      }
      rows.push_back(survey_level(runs, first + k, part));
    }
  } catch (const Interrupted&) {
    if (rows.empty()) throw;
    interrupted = true;
  }
  const std::size_t complete = rows.size();
  const int fewer_threads = rows.front().fewer_threads;
  const SequenceFacts facts = facts_beside(runs, rows, plan.seed);
  Survey result = survey_of(std::move(rows), plan.seed, facts);
  judge_points(result, runs);
  if (fewer_threads > 0) result.remarks.push_back(detail::fewer_threads_warning(fewer_threads));
  if (interrupted) {
    result.remarks.push_back({WarningCode::interrupted, "interrupted: " + std::to_string(complete) + " of " +
                                                            std::to_string(levels) + " levels."});
  }
  return result;
}

Survey survey_within(const LevelRuns& runs, double work, const Plan& plan) {
  Pilot pilot(runs, plan);
  pilot.grow(work, deepest_within);
  Survey result = pilot.survey(true);
  judge_points(result, runs);
  return result;
}

namespace {

// A decay or a growth; what is none, or goes the other way, is said.
std::string rate_text(const FittedRate& r, const char* other_way) {
  if (std::isinf(r.value)) return "faster than any";
  if (std::isnan(r.value)) return "unknown";
  const std::string figures = format("%.2f", r.value) + " +- " + format("%.2f", r.error);
  if (is_flat(r)) return "none (" + figures + ")";
  return r.value < 0 ? figures + " (" + other_way + ")" : figures;
}

void print_table(std::ostream& out, const std::vector<std::vector<std::string>>& rows,
                 const std::vector<std::size_t>& widths) {
  for (const std::vector<std::string>& cells : rows) {
    std::string text;
    for (std::size_t i = 0; i < widths.size(); ++i) text += (i > 0 ? " " : "") + right(cells[i], widths[i]);
    out << text << (cells.back().empty() ? "" : "  " + cells.back()) << '\n';
  }
}

std::string number(detail::NumberPattern pattern, double x) {
  return std::isfinite(x) ? format(pattern, x) : std::string("-");
}

std::string mark_of(const SurveyRow& r) {
  if (r.fitted) return "*";
  return r.second_moment == 0 ? "zeros" : r.usable ? "" : "few draws";
}

void print_answer(std::ostream& out, const Survey& survey) {
  out << "a PMF with finite variance and finite work exists: " << name_of(survey.pmf_exists);
  if (survey.pmf_exists != Answer::open) out << " (" << name_of(survey.grade) << ')';
}

// The rates in words, as far as they are known.
std::string rates_text(const MeasuredRates& m) {
  const Decay unit = m.kind == RateKind::polynomial ? Decay::polynomial : Decay::geometric;
  const std::string fall = m.kind == RateKind::exact_zero ? std::string("the differences end")
                                                          : decay_words("E D_k^2", m.variance_decay, unit);
  return fall + ", " + growth_words("work", m.work_growth, unit);
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const Survey& survey) {
  std::vector<std::vector<std::string>> rows = {{"level", "draws", "E I", "E D", "+-", "E D^2", "work", ""}};
  for (const SurveyRow& r : survey.rows) {
    rows.push_back({std::to_string(r.level), std::to_string(r.draws), figure_of(r.mean, std::sqrt(r.variance), 5, 11),
                    figure_of(r.difference, std::sqrt(r.difference_variance), 4, 11),
                    number("%.2g", r.difference_error), number("%.3g", r.second_moment),
                    number("%.4g", r.difference_work), mark_of(r)});
  }
  print_table(out, rows, {5, 9, 11, 11, 9, 9, 9});
  print_answer(out, survey);
  out << "; " << rates_text(survey.rates) << '\n';
  for (const Warning& remark : survey.remarks) {
    if (!is_note(remark.code)) out << "warning: " << remark.text << '\n';
  }
  return out;
}

void print_full(std::ostream& out, const Survey& survey) {
  std::vector<std::vector<std::string>> rows = {
      {"level", "draws", "E I", "Var I", "E D", "+-", "E D^2", "kurtosis", "z", "work", "us", ""}};
  for (const SurveyRow& r : survey.rows) {
    rows.push_back({std::to_string(r.level), std::to_string(r.draws), figure_of(r.mean, std::sqrt(r.variance), 5, 11),
                    number("%.3g", r.variance), figure_of(r.difference, std::sqrt(r.difference_variance), 4, 11),
                    number("%.2g", r.difference_error), number("%.3g", r.second_moment), number("%.3g", r.kurtosis),
                    number("%.2f", r.consistency), number("%.4g", r.difference_work), number("%.3g", 1e6 * r.seconds),
                    mark_of(r)});
  }
  print_table(out, rows, {5, 9, 11, 9, 11, 9, 9, 8, 6, 9, 9});
  const MeasuredRates& m = survey.rates;
  const char* unit = m.kind == RateKind::polynomial ? "k^-" : "2^-k";
  out << "rates (levels *, in powers " << unit << "): mean " << rate_text(m.mean_decay, "grows") << ", variance "
      << rate_text(m.variance_decay, "grows") << ", fourth moment " << rate_text(m.fourth_decay, "grows") << ", work "
      << rate_text(m.work_growth, "falls") << '\n';
  print_answer(out, survey);
  out << '\n';
  for (const Warning& remark : survey.remarks) {
    out << (is_note(remark.code) ? "remark: " : "warning: ") << remark.text << '\n';
  }
}

}  // namespace debias

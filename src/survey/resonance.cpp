#include "survey/resonance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace debias {
namespace {

constexpr double share_of_survey = 1.0 / 16;  // of its look-ups
constexpr double least_lookups = 8192;
constexpr double explained = 8;  // times the largest root mean square of the last differences: sum 2^(-k/4) is less
constexpr double rounding = 1e-12;

// The largest E D^2 from two levels before row i on.
double last_square(const std::vector<SurveyRow>& rows, std::size_t i) {
  double largest = 0;
  for (std::size_t j = i < 2 ? 0 : i - 2; j < rows.size(); ++j) {
    if (rows[j].level > 0) largest = std::max(largest, rows[j].second_moment);
  }
  return largest;
}

}  // namespace

void judge_points(Survey& survey, const LevelRuns& runs) {
  if (!runs.missed || survey.rows.size() < 2) return;
  const std::vector<SurveyRow>& rows = survey.rows;
  std::vector<std::size_t> places;  // that nothing was drawn beyond, or next to
  for (std::size_t i = 0; i + 1 < rows.size() && places.empty(); ++i) {
    if (rows[i + 1].level > rows[i].level + 1) places.push_back(i);
  }
  places.push_back(rows.size() - 1);
  const double budget = std::max(share_of_survey * survey.work, least_lookups);
  for (const std::size_t place : places) {
    // The last level that can be paid for.
    std::size_t i = place;
    const auto draws_at = [&](std::size_t j) {
      return detail::draws_of_missed(rows[j].level, budget / static_cast<double>(places.size()));
    };
    while (i > 0 && draws_at(i) == 0) --i;
    const std::int64_t draws = draws_at(i);
    if (draws == 0) continue;
    survey.work += detail::work_of_missed(rows[i].level, draws);
    const detail::MissedBatches batches = runs.missed(rows[i].level, draws, survey.seed);
    double size = 0;
    double error = 0;
    for (std::size_t c = 0; c < batches.size(); ++c) {
      const detail::LeftOut missed = detail::left_out(batches[c], draws, 0);
      const double of_mean = c < rows[i].values.size() ? rows[i].values[c].standard_error : rows[i].mean_error;
      const double scale = c < rows[i].values.size() ? std::abs(rows[i].values[c].mean) : std::abs(rows[i].mean);
      const double allowed = explained * std::sqrt(last_square(rows, i)) + rounding * scale;
      if (!missed.is_seen(of_mean) || !(std::abs(missed.size) > std::max(allowed, std::abs(size)))) continue;
      size = missed.size;
      error = std::max(of_mean, rounding * scale);
    }
    if (size == 0) continue;
    survey.pmf_exists = Answer::open;
    survey.grade = Grade::open;
    survey.evidence.end = End::aliased;
    survey.evidence.answer = Answer::open;
    survey.evidence.grade = Grade::open;
    survey.remarks.push_back(
        {WarningCode::aliased_differences, detail::resonance_words(rows[i].level, size, std::abs(size) / error) + "."});
    return;
  }
}

}  // namespace debias

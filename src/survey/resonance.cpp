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

SequenceFacts facts_beside(const LevelRuns& runs, const std::vector<SurveyRow>& rows, std::uint64_t seed) {
  SequenceFacts facts = runs.facts;
  if (!facts.constant_limit || !runs.missed || rows.empty() || rows.front().values.empty()) return facts;
  std::vector<double> sizes;
  for (const ComponentEstimate& e : rows.front().values) sizes.push_back(std::max(std::abs(e.mean), e.standard_error));
  double square = 0;
  for (const double size : sizes) square += size * size;
  const bool vanish = std::all_of(rows.begin(), rows.end(), [&](const SurveyRow& row) {
    return row.level == 0 || row.second_moment <= rounding * rounding * square;
  });
  const detail::Missed missed = [&](std::int64_t level, std::int64_t n, detail::Batches which) {
    return runs.missed(level, n, which, seed);
  };
  if (vanish && detail::is_linear(missed, rows.front().level, sizes)) facts.exact_from = rows.front().level;
  return facts;
}

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
    const detail::Missed missed = [&](std::int64_t level, std::int64_t n, detail::Batches which) {
      return runs.missed(level, n, which, survey.seed);
    };
    const bool has_values = !rows[i].values.empty();
    std::vector<detail::Answered> answer;
    std::vector<double> scales;
    for (const ComponentEstimate& e : rows[i].values) {
      answer.push_back({.error = e.standard_error});
      scales.push_back(std::abs(e.mean));
    }
    if (!has_values) {
      answer.push_back({.error = rows[i].mean_error});
      scales.push_back(std::abs(rows[i].mean));
    }
    const std::vector<double> seen = detail::seen_beyond(missed, rows[i].level, draws, answer, survey.work);
    double size = 0;
    double error = 0;
    for (std::size_t c = 0; c < seen.size(); ++c) {
      const double allowed = explained * std::sqrt(last_square(rows, i)) + rounding * scales[c];
      if (!(std::abs(seen[c]) > std::max(allowed, std::abs(size)))) continue;
      size = seen[c];
      error = std::max(answer[c].error, rounding * scales[c]);
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

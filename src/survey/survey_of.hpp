#pragma once

// A survey from rows, and from the work of levels behind them that are too dear to be drawn often.

#include <cstdint>
#include <vector>

#include <debias/survey.hpp>

namespace debias {

/// `survey_of` of survey.hpp; `beyond` has the level and the work of such levels, in order, and says nothing else.
Survey survey_of(std::vector<SurveyRow> rows, std::uint64_t seed, const SequenceFacts& sequence, bool budget_spent,
                 const std::vector<LevelFacts>& beyond);

}  // namespace debias

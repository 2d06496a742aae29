#pragma once

// Does a survey miss what none of its levels can show? The check of core/resonance.hpp, on its last levels.

#include <debias/survey.hpp>

namespace debias {

/// Makes the answer open, with a remark, where the limit lies farther from the last level, or from one before a gap, than the
/// differences that were seen can explain.
void judge_points(Survey& survey, const LevelRuns& runs);

/// What the sequence states, and that it ends at the first level where all differences vanish because g is linear. Some look-ups,
/// which count nowhere.
SequenceFacts facts_beside(const LevelRuns& runs, const std::vector<SurveyRow>& rows, std::uint64_t seed);

}  // namespace debias

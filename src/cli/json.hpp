#pragma once

// The results as JSON, in the fewest digits that read back as the same double. There is no NaN and no
// infinity in it: such a number is null, and `status` says why.

#include <string>

#include "../catalog/hard.hpp"
#include "../catalog/reliability.hpp"
#include "commands.hpp"

namespace debias::cli {

/// Changes whenever a key changes its meaning or goes.
inline constexpr int json_schema = 1;

std::string problems_json();
std::string estimators_json();
std::string laws_json();
std::string run_json(const Run& run);
std::string replay_json(const Replay& replay);
std::string multilevel_json(const MultilevelRun& run);
std::string advice_json(const AdviceOn& advice);
std::string tradeoff_json(const Tradeoff& tradeoff);
std::string survey_json(const SurveyOf& survey);
std::string diagnose_json(const Diagnosis& diagnosis);
std::string render_json(const Pictures& pictures);
/// One line each.
std::string cell_json(const catalog::Cell& cell);
std::string summary_json(const Validation& validation);
std::string hard_cell_json(const catalog::HardCell& cell);
std::string hard_summary_json(const catalog::HardReport& report, const Plan& plan);

/// The facts of machine and build as pairs of a name and a text.
std::string report_json(const std::vector<catalog::Figure>& figures,
                        const std::vector<std::pair<std::string, std::string>>& facts);

}  // namespace debias::cli

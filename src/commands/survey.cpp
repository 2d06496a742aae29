#include "survey.hpp"

#include <cmath>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "describe.hpp"
#include "store.hpp"
#include "text.hpp"

namespace debias::commands {

SurveyReport survey(const SurveyRequest& request, const Watch& watch) {
  const catalog::Problem& problem = *request.problem;
  const Caller caller{watch};
  Plan plan{.samples = request.samples, .seed = request.seed, .threads = request.threads};
  const double total = static_cast<double>(request.levels) * static_cast<double>(plan.samples);
  plan.progress = [&](std::int64_t done) {
    return caller.goes_on(problem.id + ": level " + std::to_string(request.first + done / plan.samples) + " of " +
                              std::to_string(request.first) + " to " +
                              std::to_string(request.first + request.levels - 1),
                          static_cast<double>(done), total);
  };
  return {&problem, plan.samples, debias::survey(levels_of(problem), request.levels, plan, request.first)};
}

void print(std::ostream& out, const SurveyReport& s, bool full) {
  print_line(out, "problem", title(*s.problem));
  full ? print_full(out, s.survey) : void(out << s.survey);
}

namespace {

struct BelievedRow {
  std::int64_t level;
  double log2_second;
  double error;
};

// E D_k^2 as the evidence has it: the levels drawn, and half as many beyond them.
std::vector<BelievedRow> believed_rows(const Survey& survey) {
  const std::int64_t last = survey.rows.back().level;
  const std::vector<Believed> all = believed(survey.evidence, last + (last + 1) / 2);
  std::vector<BelievedRow> rows;
  for (std::size_t k = 1; k < all.size(); ++k) {
    if (std::isfinite(all[k].log2_second)) {
      rows.push_back({static_cast<std::int64_t>(k), all[k].log2_second, all[k].error});
    }
  }
  return rows;
}

}  // namespace

Fields fields(const SurveyReport& s) {
  const Survey& survey = s.survey;
  std::vector<Warning> warnings;
  for (const Warning& remark : survey.remarks) {
    if (!is_note(remark.code)) warnings.push_back(remark);
  }
  Fields f = describe(*s.problem);
  append(f, {{"samples", s.samples},
             {"seed", survey.seed},
             {"rates", describe(survey.rates)},
             {"pmf_exists", name_of(survey.pmf_exists)},
             {"grade", name_of(survey.grade)},
             {"warnings", warnings},
             {"remarks", survey.remarks},
             {"believed",
              list_of(believed_rows(survey),
                      [](const BelievedRow& b) {
                        return Fields{{"level", b.level}, {"log2_second_moment", b.log2_second}, {"error", b.error}};
                      })},
             {"work", survey.work},
             {"seconds", survey.seconds},
             {"levels", list_of(survey.rows, [](const SurveyRow& r) {
                return Fields{{"level", r.level},
                              {"draws", r.draws},
                              {"mean", r.mean},
                              {"mean_error", r.mean_error},
                              {"variance", r.variance},
                              {"difference", r.difference},
                              {"difference_error", r.difference_error},
                              {"difference_variance", r.difference_variance},
                              {"second_moment", r.second_moment},
                              {"second_moment_error", r.second_moment_error},
                              {"kurtosis", r.kurtosis},
                              {"nonzero", r.nonzero},
                              {"consistency", r.consistency},
                              {"value_work", r.value_work},
                              {"difference_work", r.difference_work},
                              {"seconds", r.seconds},
                              {"usable", r.usable},
                              {"fitted", r.fitted}};
              })}});
  append(f, versions());
  return f;
}

}  // namespace debias::commands

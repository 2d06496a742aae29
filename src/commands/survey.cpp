#include "survey.hpp"

#include <ostream>
#include <string>

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
  return {&problem, plan.samples, debias::survey(problem.levels, request.levels, plan, request.first)};
}

void print(std::ostream& out, const SurveyReport& s) {
  print_line(out, "problem", title(*s.problem));
  out << s.survey;
}

Fields fields(const SurveyReport& s) {
  const Survey& survey = s.survey;
  Fields f = describe(*s.problem);
  append(f, {{"samples", s.samples},
             {"seed", survey.seed},
             {"rates", describe(survey.rates)},
             {"pmf_exists", name_of(survey.pmf_exists)},
             {"grade", name_of(survey.grade)},
             {"remarks", survey.remarks},
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
                              {"votes", r.votes},
                              {"fitted", r.fitted}};
              })}});
  append(f, versions());
  return f;
}

}  // namespace debias::commands

#include <debias/survey.hpp>

#include <ostream>
#include <string>

#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {

SurveyOf survey_of(const catalog::Problem& problem, const Arguments& arguments, const Watch& watch) {
  const std::int64_t levels = read_levels(arguments.levels);
  Plan plan = read_plan(arguments);
  const double total = static_cast<double>(levels) * static_cast<double>(plan.samples);
  plan.progress = [&](std::int64_t finished) {
    return watch(problem.id + ": level " + std::to_string(finished / plan.samples) + " of " + std::to_string(levels),
                 static_cast<double>(finished), total);
  };
  return {&problem, plan.samples, debias::survey(problem.levels, levels, plan)};
}

void print(std::ostream& out, const SurveyOf& s) {
  print_line(out, "problem", title(*s.problem));
  out << s.survey;
}

int survey(const Arguments& arguments) {
  Output out(arguments.output);
  Progress progress(arguments.quiet);
  const SurveyOf result = survey_of(catalog::find(arguments.problem), arguments, watch_on(progress));
  progress.erase();
  if (arguments.json) {
    out.stream() << survey_json(result) << '\n';
  } else {
    print(out.stream(), result);
  }
  out.flush();
  if (!interrupted()) return done;
  complain("interrupted; what is complete is printed");
  return interrupted_by_signal;
}

}  // namespace debias::cli

#include <debias/survey.hpp>

#include <ostream>
#include <string>

#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {

int survey(const Arguments& arguments) {
  const catalog::Problem& problem = catalog::find(arguments.problem);
  const std::int64_t levels = read_levels(arguments.levels);
  Plan plan = read_plan(arguments);
  Output out(arguments.output);
  Progress progress(arguments.quiet);
  plan.progress = [&](std::int64_t finished) {
    if (progress.due()) {
      progress.show(problem.id + ": level " + std::to_string(finished / plan.samples) + " of " +
                    std::to_string(levels) + ", " + rounded(static_cast<double>(finished)) + " draws");
    }
    return !interrupted();
  };
  const SurveyOf result{&problem, plan.samples, debias::survey(problem.levels, levels, plan)};
  progress.erase();
  if (arguments.json) {
    out.stream() << survey_json(result) << '\n';
  } else {
    print_line(out.stream(), "problem", problem.id + " " + problem.name + ": " + problem.formula);
    out.stream() << result.survey;
  }
  out.flush();
  if (!interrupted()) return done;
  complain("interrupted; what is complete is printed");
  return interrupted_by_signal;
}

}  // namespace debias::cli

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "../core/text.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {

int replay(const Arguments& arguments) {
  const catalog::Problem& problem = catalog::find(arguments.problem);
  if (wants_recipe(arguments)) {
    throw std::invalid_argument(
        "--law auto (a replay needs the law itself); give the one that the run has printed");
  }
  const catalog::Choice choice = read_choice(arguments, problem);
  const std::uint64_t seed = read_seed(arguments.seed);
  const std::int64_t index = read_sample(arguments.sample);
  const Replay result{&problem, choice, seed, index, problem.trace(choice, seed, index)};

  Output output;
  std::ostream& out = output.stream();
  const Sample<double>& sample = result.trace.sample;
  if (arguments.json) {
    out << replay_json(result) << '\n';
  } else {
    print_line(out, "problem", problem.id + " " + problem.name);
    print_line(out, "estimator", std::string(catalog::name_of(choice)) + " " + law_text(choice));
    print_line(out, "sample", std::to_string(index) + ", seed " + std::to_string(seed));
    print_line(out, "value", to_text(sample.value));
    print_line(out, "level", std::to_string(sample.level));
    print_line(out, "work", rounded(sample.work, 10));
    std::vector<Row> rows = {{"level", "difference", "work", ""}};
    for (const TracedLevel& l : result.trace.levels) {
      rows.push_back(
          {std::to_string(l.level), to_text(l.difference), rounded(l.work, 10), l.is_base ? "base" : ""});
    }
    print_table(out, rows);
  }
  output.flush();
  if (std::isfinite(sample.value)) return done;
  complain("the sample is not finite");
  return nonfinite_samples;
}

}  // namespace debias::cli

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "../core/text.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {

Replay replay_of(const catalog::Problem& problem, const Arguments& arguments) {
  if (wants_recipe(arguments)) {
    throw std::invalid_argument("--law auto (a replay needs the law itself); give the one that the run has printed");
  }
  const catalog::Choice choice = read_choice(arguments, problem);
  const std::uint64_t seed = read_seed(arguments.seed);
  const std::int64_t index = read_sample(arguments.sample);
  return {&problem, choice, seed, index, problem.trace(choice, seed, index)};
}

void print(std::ostream& out, const Replay& replay) {
  const Sample<double>& sample = replay.trace.sample;
  print_line(out, "problem", title(*replay.problem));
  print_line(out, "estimator", std::string(catalog::name_of(replay.choice)) + " " + law_text(replay.choice));
  print_line(out, "sample", std::to_string(replay.index) + ", seed " + std::to_string(replay.seed));
  print_line(out, "value", to_text(sample.value));
  print_line(out, "level", std::to_string(sample.level));
  print_line(out, "work", rounded(sample.work, 10));
  std::vector<Row> rows = {{"level", "difference", "work", ""}};
  for (const TracedLevel& l : replay.trace.levels) {
    rows.push_back({std::to_string(l.level), to_text(l.difference), rounded(l.work, 10), l.is_base ? "base" : ""});
  }
  print_table(out, rows);
}

int replay(const Arguments& arguments) {
  const Replay result = replay_of(catalog::find(arguments.problem), arguments);
  Output out;
  if (arguments.json) {
    out.stream() << replay_json(result) << '\n';
  } else {
    print(out.stream(), result);
  }
  out.flush();
  if (std::isfinite(result.trace.sample.value)) return done;
  complain("the sample is not finite");
  return nonfinite_samples;
}

}  // namespace debias::cli

#include "replay.hpp"

#include <cmath>
#include <ostream>
#include <string>
#include <vector>

#include "core/text.hpp"
#include "describe.hpp"
#include "text.hpp"

namespace debias::commands {

ReplayReport replay(const ReplayRequest& request) {
  const catalog::Choice choice = choice_of(request.shape, *request.problem);
  return {request.problem, choice, request.seed, request.sample,
          request.problem->trace(choice, request.seed, request.sample)};
}

void print(std::ostream& out, const ReplayReport& replay) {
  const Sample<double>& sample = replay.trace.sample;
  print_line(out, "problem", title(*replay.problem));
  print_line(out, "estimator", std::string(catalog::name_of(replay.choice)) + " " + pmf_text(replay.choice));
  const bool in_block = replay.trace.block > 1;
  print_line(out, "sample", std::to_string(replay.index) + ", seed " + std::to_string(replay.seed));
  if (in_block) {
    const std::int64_t first = replay.trace.first;
    const std::int64_t block = replay.trace.block;
    print_line(out, "block",
               std::to_string(first / block) + ", samples " + std::to_string(first) + " to " +
                   std::to_string(first + block - 1) + "; this one is member " + std::to_string(replay.trace.member) +
                   ", value, level and work are of the block");
  }
  print_line(out, "value", to_text(sample.value));
  print_line(out, "level", std::to_string(sample.level));
  print_line(out, "work", rounded(sample.work, 10));
  std::vector<Row> rows = {{"level", "difference", "work", ""}};
  if (in_block) rows.front().insert(rows.front().begin(), "member");
  for (const TracedLevel& l : replay.trace.levels) {
    rows.push_back({std::to_string(l.level), to_text(l.difference), rounded(l.work, 10), l.is_base ? "base" : ""});
    if (!in_block) continue;
    rows.back().insert(rows.back().begin(), std::to_string(l.member));
    if (l.member == replay.trace.member) rows.back().back() += l.is_base ? ", this sample" : "this sample";
  }
  print_table(out, rows);
}

Fields fields(const ReplayReport& replay) {
  const Sample<double>& sample = replay.trace.sample;
  const std::vector<TracedLevel>& levels = replay.trace.levels;
  Fields f = describe(*replay.problem, replay.choice);
  append(f, {{"seed", replay.seed},
             {"sample", replay.index},
             {"first_of_block", replay.trace.first},
             {"member", replay.trace.member},
             {"level", sample.level},
             {"value", sample.value},
             // Of the deepest level, before its weight; `levels` has all of them.
             {"difference", levels.empty() ? Node(nullptr) : Node(levels.back().difference)},
             {"work", sample.work},
             {"levels", list_of(levels,
                                [](const TracedLevel& l) {
                                  return Fields{{"level", l.level},
                                                {"is_base", l.is_base},
                                                {"difference", l.difference},
                                                {"work", l.work},
                                                {"member", l.member}};
                                })},
             {"status", std::isfinite(sample.value) ? "ok" : "nonfinite"}});
  append(f, versions());
  return f;
}

}  // namespace debias::commands

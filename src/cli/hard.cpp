// debias validate --hard: hard cases, and whether the result says what is wrong with it.

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "../catalog/hard.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

const Row header = {"case", "hard by", "truth", "error", "std error", "lost", "status", "the result says"};

std::string figure(double x) { return std::isnan(x) ? "unknown" : rounded(x, 2); }

Row row_of(const catalog::HardCell& cell) {
  Row row = {cell.group, cell.parameter, rounded(cell.truth, 3)};
  if (cell.has_run) {
    row.push_back(figure(cell.error));
    row.push_back(figure(cell.statistics.components.front().standard_error));
    row.push_back(std::isfinite(cell.digits_lost) ? rounded(cell.digits_lost + 0.0, 2) : "all");
  } else {
    row.insert(row.end(), {"-", "-", "-"});
  }
  row.emplace_back(name_of(cell.status));
  row.push_back(cell.says);
  return row;
}

}  // namespace

int validate_hard(const Arguments& arguments) {
  if (!arguments.checkpoint.empty()) {
    throw std::invalid_argument("--checkpoint: (the hard cases take seconds, and keep nothing); leave it out");
  }
  if (!arguments.problems.empty()) {
    throw std::invalid_argument("--hard ('" + arguments.problems.front() + "' is a problem of its own); leave one out");
  }
  Plan plan = read_validation_plan(arguments);
  Output out(arguments.output);
  Progress progress(arguments.quiet);
  std::size_t cells = 0;
  const std::vector<catalog::HardCase>& cases = catalog::hard_cases();
  const std::size_t total = cases.size();
  plan.progress = [&](std::int64_t) {
    if (progress.due()) progress.show("case " + std::to_string(cells + 1) + " of " + std::to_string(total));
    return !interrupted();
  };
  std::vector<std::size_t> widths = {0, 0, 9, 8, 9, 5, 7, 0};
  for (const catalog::HardCase& c : cases) {
    widths[0] = std::max(widths[0], c.group.size());
    widths[1] = std::max(widths[1], c.parameter.size());
  }
  if (!arguments.json) print_row(out.stream(), header, widths);
  const catalog::HardReport report = catalog::validate(cases, plan, [&](const catalog::HardCell& cell) {
    ++cells;
    progress.erase();
    if (arguments.json) {
      out.stream() << hard_cell_json(cell) << '\n';
    } else {
      print_row(out.stream(), row_of(cell), widths);
    }
    out.flush();
  });
  if (arguments.json) {
    out.stream() << hard_summary_json(report, plan) << '\n';
  } else {
    out.stream() << '\n'
                 << std::to_string(report.cells.size()) << " cases, " << std::to_string(report.failed)
                 << " wrong without a word; " << std::to_string(plan.samples) << " samples each, seed "
                 << std::to_string(plan.seed) << "; threshold " << rounded(report.threshold, 3) << " standard errors\n";
  }
  out.flush();
  if (report.failed == 0) return done;
  complain(std::to_string(report.failed) + " of " + std::to_string(total) + " hard cases are wrong without a word");
  return validation_failed;
}

}  // namespace debias::cli

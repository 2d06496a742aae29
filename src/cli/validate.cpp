#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

const Row header = {"status", "problem", "estimator",   "base",    "law",        "mean",
                    "truth",  "z",       "work/sample", "seconds", "efficiency", "reason"};

Row row_of(const catalog::Cell& cell) {
  const catalog::Problem& p = *cell.problem;
  const std::string law = law_text(cell.choice);
  Row row = {std::string(catalog::name_of(cell.status)), p.id + " " + p.name,
             std::string(catalog::name_of(cell.choice)),
             cell.choice.special.empty() ? std::to_string(cell.choice.base_level) : "-",
             cell.has_run && !law.empty() ? law : "-"};
  if (cell.has_run) {
    const Statistics& s = cell.statistics;
    const ComponentEstimate& c = s.components.front();
    for (const std::string& text : {with_error(c.mean, c.standard_error), rounded(p.truth, 10), rounded(cell.z, 3),
                                    rounded(s.work_per_sample()), rounded(s.seconds, 3), rounded(s.efficiency(), 3)}) {
      row.push_back(text);
    }
  } else {
    row.insert(row.end(), {"-", rounded(p.truth, 10), "-", "-", "-", "-"});
  }
  row.push_back(cell.reason);
  return row;
}

void print_summary(std::ostream& out, const Validation& v) {
  const Counts n = count(v.report);
  const auto whole = [](auto x) { return std::to_string(x); };
  out << whole(v.report.cells.size()) << " cells: " << whole(v.report.passed) << " passed, " << whole(v.report.failed)
      << " failed, " << whole(n.biased) << " biased, " << whole(n.refused) << " refused, " << whole(n.underpowered)
      << " underpowered\n"
      << "max |z| " << rounded(v.report.max_abs_z, 3) << ", threshold " << rounded(v.report.threshold, 3)
      << "; smallest detectable bias " << rounded(v.report.smallest_detectable_bias, 3)
      << " standard deviations of one sample\n"
      << whole(v.samples) << " samples per cell, seed " << whole(v.seed) << ", " << rounded(v.seconds, 3) << " s\n";
}

}  // namespace

Counts count(const catalog::Report& report) {
  Counts n;
  for (const catalog::Cell& cell : report.cells) {
    n.biased += cell.status == catalog::Status::biased;
    n.refused += cell.status == catalog::Status::refused;
    n.underpowered += cell.status == catalog::Status::underpowered;
  }
  return n;
}

int validate(const Arguments& arguments) {
  if (arguments.hard && arguments.report) throw std::invalid_argument("--hard, --report: both (keep one)");
  if (arguments.hard) return validate_hard(arguments);
  if (arguments.report) return validate_report(arguments);
  std::vector<const catalog::Problem*> problems;
  for (const std::string& name : arguments.problems) problems.push_back(&catalog::find(name));
  if (problems.empty()) {
    for (const catalog::Problem& p : catalog::problems()) problems.push_back(&p);
  }
  Plan plan = read_validation_plan(arguments);
  Arguments words = arguments;
  words.seed = std::to_string(plan.seed);
  Session session("validate", words);
  Output out(arguments.output);

  // Rows appear as cells end, so the widths are fixed beforehand.
  std::vector<std::size_t> widths = {12, 0, 17, 4, 0, 20, 13, 6, 11, 7, 10, 0};
  for (const catalog::Problem* p : problems) {
    widths[1] = std::max(widths[1], p->id.size() + 1 + p->name.size());
    for (const catalog::Choice& c : catalog::choices(*p)) {
      widths[2] = std::max(widths[2], catalog::name_of(c).size());
      widths[4] = std::max(widths[4], law_text(c).size());
    }
  }
  if (!arguments.json) {
    print_row(out.stream(), header, widths);
    out.flush();
  }

  Progress progress(arguments.quiet);
  std::int64_t cells = 0;
  std::int64_t total = 0;
  plan.progress = [&](std::int64_t) {
    if (total > 0 && progress.due()) {
      const auto finished = static_cast<double>(cells);
      progress.show("cell " + std::to_string(cells + 1) + " of " + std::to_string(total) + ", " +
                    share_of(finished, static_cast<double>(total), progress.seconds()));
    }
    return !interrupted();
  };
  const auto show = [&](const catalog::Cell& cell, std::int64_t finished, std::int64_t of) {
    cells = finished;
    total = of;
    progress.erase();
    if (arguments.json) {
      out.stream() << cell_json(cell) << '\n';
    } else {
      print_row(out.stream(), row_of(cell), widths);
    }
    out.flush();
  };
  const auto prepare = [&](const catalog::Problem& p, const catalog::Choice& c, Plan& cell) {
    session.attach(
        cell, p.id + " " + std::string(catalog::name_of(c)) + " " + std::to_string(c.base_level) + " " + law_text(c));
  };
  Validation result{{}, plan.samples, plan.seed, 0};
  result.report = session.guard([&] { return catalog::validate(problems, plan, show, prepare); });
  session.flush();
  result.seconds = progress.seconds();

  if (arguments.json) {
    out.stream() << summary_json(result) << '\n';
  } else {
    out.stream() << '\n';
    print_summary(out.stream(), result);
  }
  out.flush();
  if (out.is_file() && !arguments.quiet) {
    Output summary;
    print_summary(summary.stream(), result);
    summary.flush();
  }
  if (result.report.failed == 0) return done;
  complain(std::to_string(result.report.failed) + " of " + std::to_string(result.report.cells.size()) +
           " cells failed");
  return validation_failed;
}

}  // namespace debias::cli

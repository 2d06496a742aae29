#include <ostream>
#include <string>
#include <utility>

#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

Verdict verdict_of(const catalog::Problem& problem, const catalog::Choice& choice) {
  if (const catalog::Special* special = catalog::find_special(problem, choice.special)) {
    Verdict v;
    v.finite_variance = true;
    v.finite_work = true;
    v.sentence = special->reason.empty() ? special->description : special->description + "; " + special->reason;
    return v;
  }
  if (choice.method != catalog::Method::truncated) {
    return judge(rates_of(problem, choice.method), choice.law.tail_exponent());
  }
  Verdict v;
  v.finite_variance = true;
  v.finite_work = true;
  v.sentence = "one level only: its bias is no part of the standard error";
  return v;
}

std::string title(const catalog::Problem& problem) { return problem.id + " " + problem.name; }

void print(std::ostream& out, const Run& run) {
  const Statistics& s = run.statistics;
  print_line(out, "problem", title(*run.problem) + ": " + run.problem->formula);
  out << s;
  if (run.interval.confidence != 0.95) {
    print_line(out, "interval",
               rounded(100 * run.interval.confidence, 10) + " % [" + rounded(run.interval.low, 8) + ", " +
                   rounded(run.interval.high, 8) + "]");
  }
  if (!s.largest.empty()) {
    const LargeSample& l = s.largest.front();
    print_line(out, "largest",
               rounded(l.value, 6) + " (sample " + std::to_string(l.index) + ", level " +
                   std::to_string(l.level) + ")");
  }
  print_line(out, "truth", rounded(run.problem->truth, 15) + ", z = " + rounded(run.z, 3));
  print_line(out, "verdict", run.verdict.sentence);
}

}  // namespace

std::string law_text(const catalog::Choice& choice) {
  return choice.method == catalog::Method::truncated || !choice.special.empty() ? "" : choice.law.spec();
}

int run(const Arguments& arguments) {
  const catalog::Problem& problem = catalog::find(arguments.problem);
  const catalog::Choice choice = read_choice(arguments, problem);
  const double confidence = read_confidence(arguments.confidence);
  Plan plan = read_plan(arguments);
  const Verdict verdict = verdict_of(problem, choice);
  Output out(arguments.output);

  if (!verdict.finite_work && !arguments.quiet) complain("warning: " + verdict.sentence);
  Progress progress(arguments.quiet);
  const auto total = static_cast<double>(plan.samples);
  plan.progress = [&](std::int64_t finished) {
    const auto count = static_cast<double>(finished);
    if (progress.due()) {
      progress.show(problem.id + ": " + rounded(count) + " of " + rounded(total) + " samples, " +
                    share_of(count, total, progress.seconds()));
    }
    return !interrupted();
  };
  Statistics statistics = problem.run(choice, plan);
  progress.erase();
  if (choice.base_level < problem.lowest_base) {
    statistics.warnings.push_back(
        "the base level lies below " + std::to_string(problem.lowest_base) +
        ", where the fourth moment of a level is infinite and the standard error is not to be trusted.");
  }
  const Interval interval = statistics.interval(confidence);
  const double z = (statistics.components.front().mean - problem.truth) /
                   catalog::believed_error(statistics, problem.truth);
  const Run result{&problem, choice, std::move(statistics), interval, verdict, z};

  if (arguments.json) {
    out.stream() << run_json(result) << '\n';
  } else {
    print(out.stream(), result);
  }
  out.flush();
  const Statistics& s = result.statistics;
  if (out.is_file() && !arguments.quiet) {
    Output summary;
    const ComponentEstimate& c = s.components.front();
    summary.stream() << title(problem) << ": " << with_error(c.mean, c.standard_error)
                     << ", z = " << rounded(z, 3) << ", " << s.samples << " samples, seed " << s.seed << '\n';
    summary.flush();
  }
  if (s.nonfinite == 0) return done;
  complain(std::to_string(s.nonfinite) + " of " + std::to_string(s.samples) +
           " samples are not finite; replay the first with --seed " + std::to_string(s.seed) + " --sample " +
           std::to_string(s.first_nonfinite));
  return nonfinite_samples;
}

}  // namespace debias::cli

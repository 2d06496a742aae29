// debias validate --report: one page of every figure that this program can measure of itself.

#include <sys/utsname.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "../catalog/reliability.hpp"
#include "commands.hpp"
#include "json.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

using Facts = std::vector<std::pair<std::string, std::string>>;

std::string today() {
  const std::time_t now = std::time(nullptr);
  std::tm parts = {};
  gmtime_r(&now, &parts);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M UTC", &parts));
  return text;
}

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  }
  return "unknown processor";
}

Facts facts_of(const catalog::ReliabilityPlan& plan) {
  utsname system = {};
  uname(&system);
  std::string build = version_text();
  for (std::size_t at = 0; (at = build.find('\n', at)) != std::string::npos;) build.replace(at, 1, ", ");
  return {{"date", today()},
          {"command", "debias validate --report --samples " + std::to_string(plan.samples) + " --seed " +
                          std::to_string(plan.seed)},
          {"machine", processor() + ", " + std::to_string(std::thread::hardware_concurrency()) + " threads, " +
                          system.sysname + " " + system.release + " " + system.machine},
          {"build", build}};
}

void print_markdown(std::ostream& out, const std::vector<catalog::Figure>& figures, const Facts& facts) {
  out << "# Reliability of debias, measured\n\n";
  for (const auto& [name, text] : facts) out << "- " << name << ": " << text << '\n';
  out << "\n| figure | measured | demanded | |\n|---|---|---|---|\n";
  for (const catalog::Figure& f : figures) {
    out << "| " << f.name << " | " << f.measured << " | " << f.demanded << " | "
        << (f.demanded.empty() ? ""
            : f.holds          ? "holds"
                               : "**FAILS**")
        << " |\n";
  }
}

}  // namespace

int validate_report(const Arguments& arguments) {
  if (!arguments.checkpoint.empty()) {
    throw std::invalid_argument("--checkpoint: (the report measures times, and keeps nothing); leave it out");
  }
  if (!arguments.problems.empty()) {
    throw std::invalid_argument("--report ('" + arguments.problems.front() +
                                "': it is of all problems); leave one out");
  }
  const Plan read = read_validation_plan(arguments);
  catalog::ReliabilityPlan plan;
  plan.samples = read.samples;
  plan.replications = std::clamp<std::int64_t>(read.samples / 100, 100, 10'000);
  plan.seed = read.seed;
  plan.fresh_seed = read_seed_or_random("random");
  plan.threads = read.threads;
  Output out(arguments.output);
  std::optional<Output> json;
  const std::string markdown = ".md";
  const std::string& path = arguments.output;
  if (path.size() > markdown.size() && path.ends_with(markdown)) {
    json.emplace(path.substr(0, path.size() - markdown.size()) + ".json");
  }
  Progress progress(arguments.quiet);
  plan.progress = [&](std::string_view what) {
    if (progress.due()) progress.show(std::string(what));
    return !interrupted();
  };
  const std::vector<catalog::Figure> figures = catalog::reliability(plan);
  progress.erase();
  Facts facts = facts_of(plan);
  facts.emplace_back("duration", rounded(progress.seconds(), 3) + " s");
  if (arguments.json) {
    out.stream() << report_json(figures, facts) << '\n';
  } else {
    print_markdown(out.stream(), figures, facts);
  }
  out.flush();
  if (json) {
    json->stream() << report_json(figures, facts) << '\n';
    json->flush();
  }
  std::string failed;
  for (const catalog::Figure& f : figures) {
    if (!f.holds) failed += (failed.empty() ? "" : ", ") + f.name;
  }
  if (failed.empty()) return done;
  complain("figures that fail: " + failed);
  return validation_failed;
}

}  // namespace debias::cli

#include <sys/utsname.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <ostream>
#include <thread>

#include "text.hpp"
#include "validate.hpp"

namespace debias::commands {
namespace {

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

std::string machine() {
  utsname system = {};
  uname(&system);
  return processor() + ", " + std::to_string(std::thread::hardware_concurrency()) + " threads, " + system.sysname +
         " " + system.release + " " + system.machine;
}

std::string build() {
  std::string text = version_text();
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos;) text.replace(at, 1, ", ");
  return text;
}

}  // namespace

ReliabilityReport reliability(const ReliabilityRequest& request, const Watch& watch) {
  const auto start = std::chrono::steady_clock::now();
  check_judged(request.samples);
  const Caller caller{watch};
  validation::ReliabilityPlan plan;
  plan.samples = request.samples;
  plan.replications = std::clamp<std::int64_t>(request.samples / 100, 100, 10'000);
  plan.seed = request.seed;
  plan.fresh_seed = request.fresh_seed;
  plan.threads = request.threads;
  plan.progress = [&](std::string_view what) { return caller.goes_on(what, 0, 0); };
  ReliabilityReport report;
  report.figures = validation::reliability(plan);
  report.facts = {{"date", today()}, {"command", request.command}, {"machine", machine()}, {"build", build()}};
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  report.facts.emplace_back("duration", rounded(seconds.count(), 3) + " s");
  return report;
}

std::vector<std::string> ReliabilityReport::failed() const {
  std::vector<std::string> names;
  for (const validation::Figure& f : figures) {
    if (!f.holds) names.push_back(f.name);
  }
  return names;
}

void print(std::ostream& out, const ReliabilityReport& report) {
  out << "# Reliability of debias, measured\n\n";
  for (const auto& [name, text] : report.facts) out << "- " << name << ": " << text << '\n';
  out << "\n| figure | measured | demanded | |\n|---|---|---|---|\n";
  for (const validation::Figure& f : report.figures) {
    out << "| " << f.name << " | " << f.measured << " | " << f.demanded << " | "
        << (f.demanded.empty() ? ""
            : f.holds          ? "holds"
                               : "**FAILS**")
        << " |\n";
  }
}

Fields fields(const ReliabilityReport& report) {
  Fields facts;
  for (const auto& [name, text] : report.facts) facts.push_back({name, text});
  Fields f = {{"facts", std::move(facts)}, {"figures", list_of(report.figures, [](const validation::Figure& figure) {
                                              return Fields{{"name", figure.name},
                                                            {"measured", figure.measured},
                                                            {"demanded", figure.demanded},
                                                            {"holds", figure.holds}};
                                            })}};
  append(f, versions());
  return f;
}

}  // namespace debias::commands

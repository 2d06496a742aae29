// validate, and its hard cases and its report: rows as they come, and a summary.

#include <optional>
#include <stdexcept>

#include "core/text.hpp"
#include "execute.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

// Sees each cell as it ends, and writes it at once.
template <class Cell, class Table>
auto rows_to(Output& out, const Delivery& delivery, const Table& table, Progress& progress) {
  if (!delivery.json) table.print_header(out.stream());
  return [&](const Cell& cell) {
    progress.erase();
    if (delivery.json) {
      out.stream() << commands::json_line(commands::fields(cell)) << '\n';
    } else {
      table.print(out.stream(), cell);
    }
    out.flush();
  };
}

template <class Report>
void write_summary(Output& out, const Delivery& delivery, const Report& report) {
  if (delivery.json) {
    out.stream() << commands::json_line(commands::fields(report)) << '\n';
  } else {
    out.stream() << '\n';
    print(out.stream(), report);
  }
  out.flush();
}

}  // namespace

int execute(const commands::ValidateRequest& request, const Delivery& delivery) {
  Session session(saved(request), delivery);
  Output out(delivery.output);
  Progress progress(delivery.quiet);
  const commands::CellTable table(request);
  const auto show = rows_to<validation::Cell>(out, delivery, table, progress);
  out.flush();
  const commands::Caller caller = session.caller(watch_share(progress));
  const commands::ValidateReport report = session.guard([&] { return commands::validate(request, caller, show); });
  session.flush();
  write_summary(out, delivery, report);
  if (out.is_file() && !delivery.quiet) {
    Output summary;
    print(summary.stream(), report);
    summary.flush();
  }
  if (report.report.failed == 0) return done;
  complain(std::to_string(report.report.failed) + " of " + std::to_string(report.report.cells.size()) +
           " cells failed");
  return validation_failed;
}

int execute(const commands::HardRequest& request, const Delivery& delivery) {
  if (!delivery.checkpoint.empty()) {
    throw std::invalid_argument("--checkpoint: (the hard cases take seconds, and keep nothing); leave it out");
  }
  Output out(delivery.output);
  Progress progress(delivery.quiet);
  const commands::HardTable table;
  const auto show = rows_to<validation::HardCell>(out, delivery, table, progress);
  const commands::HardReport report = commands::validate_hard(request, {watch_share(progress)}, show);
  write_summary(out, delivery, report);
  if (report.report.failed == 0) return done;
  complain(std::to_string(report.report.failed) + " of " + std::to_string(report.report.cells.size()) + " hard cases" +
           are(report.report.failed) + " wrong without a word");
  return validation_failed;
}

int execute(const commands::UnseenRequest& request, const Delivery& delivery) {
  if (!delivery.checkpoint.empty()) {
    throw std::invalid_argument("--checkpoint: (unseen problems take minutes, and keep nothing); leave it out");
  }
  Output out(delivery.output);
  Progress progress(delivery.quiet);
  const commands::UnseenReport report = commands::validate_unseen(request, {watch_share(progress)});
  progress.erase();
  deliver(report, delivery, out);
  if (report.report.holds()) return done;
  std::string failed;
  for (const validation::Gate& gate : report.report.gates) {
    if (!gate.holds) failed += (failed.empty() ? "" : ", ") + gate.name;
  }
  complain("figures that fail: " + failed);
  return validation_failed;
}

int execute(const commands::ReliabilityRequest& request, const Delivery& delivery) {
  if (!delivery.checkpoint.empty()) {
    throw std::invalid_argument("--checkpoint: (the report measures times, and keeps nothing); leave it out");
  }
  Output out(delivery.output);
  std::optional<Output> json;
  const std::string markdown = ".md";
  const std::string& path = delivery.output;
  if (path.size() > markdown.size() && path.ends_with(markdown)) {
    json.emplace(path.substr(0, path.size() - markdown.size()) + ".json");
  }
  Progress progress(delivery.quiet);
  const commands::ReliabilityReport report = commands::reliability(request, watch_share(progress));
  progress.erase();
  deliver(report, delivery, out);
  if (json) deliver(report, {.json = true}, *json);
  std::string failed;
  for (const std::string& name : report.failed()) failed += (failed.empty() ? "" : ", ") + name;
  if (failed.empty()) return done;
  complain("figures that fail: " + failed);
  return validation_failed;
}

}  // namespace debias::cli

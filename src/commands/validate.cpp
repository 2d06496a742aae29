#include "validate.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ostream>

#include "core/text.hpp"
#include "describe.hpp"
#include "text.hpp"

namespace debias::commands {
namespace {

using validation::Cell;
using validation::HardCell;

std::vector<const catalog::Problem*> problems_of(const ValidateRequest& request) {
  std::vector<const catalog::Problem*> problems = request.problems;
  if (problems.empty()) {
    for (const catalog::Problem& p : catalog::problems()) problems.push_back(&p);
  }
  return problems;
}

std::string estimator_text(const catalog::Choice& choice) {
  return std::string(catalog::name_of(choice)) + (choice.points == Points::nets ? ", nets" : "");
}

const Row cell_header = {"status", "problem", "estimator",   "base",    "pmf",        "mean",
                         "truth",  "z",       "work/sample", "seconds", "efficiency", "reason"};

Row row_of(const Cell& cell) {
  const catalog::Problem& p = *cell.problem;
  const std::string pmf = pmf_text(cell.choice);
  Row row = {std::string(name_of(cell.status)), p.id + " " + p.name, estimator_text(cell.choice),
             cell.choice.special.empty() ? std::to_string(cell.choice.base_level) : "-",
             cell.has_run && !pmf.empty() ? pmf : "-"};
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

// The cells that were not judged.
std::int64_t count(const validation::Report& report, validation::Status status) {
  return std::count_if(report.cells.begin(), report.cells.end(),
                       [status](const Cell& cell) { return cell.status == status; });
}

const Row hard_header = {"case", "hard by", "truth", "error", "std error", "lost", "status", "the result says"};

std::string figure(double x) { return std::isnan(x) ? "unknown" : rounded(x, 2); }

Row row_of(const HardCell& cell) {
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

void check_judged(std::int64_t samples) {
  if (samples > 1) return;
  throw BadRequest(
      {Field{"samples"}, " = '" + std::to_string(samples) + "' (has no standard error); did you mean '1e5'?"});
}

// ---- cells

ValidateReport validate(const ValidateRequest& request, const Caller& caller,
                        const std::function<void(const Cell&)>& show) {
  check_judged(request.samples);
  const auto start = std::chrono::steady_clock::now();
  Plan plan{.samples = request.samples, .seed = request.seed, .threads = request.threads};
  std::int64_t cells = 0;
  std::int64_t total = 0;
  plan.progress = [&](std::int64_t) {
    const std::string of = total > 0 ? " of " + std::to_string(total) : "";
    return caller.goes_on("cell " + std::to_string(cells + 1) + of, static_cast<double>(cells),
                          static_cast<double>(total));
  };
  const auto see = [&](const Cell& cell, std::int64_t finished, std::int64_t of) {
    cells = finished;
    total = of;
    if (show) show(cell);
  };
  const auto prepare = [&](const catalog::Problem& p, const catalog::Choice& c, Plan& cell) {
    caller.attach(cell, p.id + " " + estimator_text(c) + " " + std::to_string(c.base_level) + " " + pmf_text(c));
  };
  ValidateReport result{{}, plan.samples, plan.seed, 0};
  result.report = validation::validate(problems_of(request), plan, see, prepare);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

CellTable::CellTable(const ValidateRequest& request) : widths_{12, 0, 17, 4, 0, 20, 13, 6, 11, 7, 10, 0} {
  for (const catalog::Problem* p : problems_of(request)) {
    widths_[1] = std::max(widths_[1], p->id.size() + 1 + p->name.size());
    for (const catalog::Choice& c : validation::choices(*p)) {
      widths_[2] = std::max(widths_[2], estimator_text(c).size());
      widths_[4] = std::max(widths_[4], pmf_text(c).size());
    }
  }
}

void CellTable::print_header(std::ostream& out) const { print_row(out, cell_header, widths_); }
void CellTable::print(std::ostream& out, const Cell& cell) const { print_row(out, row_of(cell), widths_); }

Fields fields(const Cell& cell) {
  const Statistics& s = cell.statistics;
  const auto figure = [&cell](double x) { return cell.has_run ? Node(x) : Node(nullptr); };
  const ComponentEstimate c = cell.has_run ? s.components.front() : ComponentEstimate{};
  Fields f = describe(*cell.problem, cell.choice);
  for (Entry& e : f) {
    if (!cell.has_run && e.name == "pmf") e.value = nullptr;
  }
  append(f, {{"truth", cell.problem->truth},
             {"mean", figure(c.mean)},
             {"standard_error", figure(c.standard_error)},
             {"z", figure(cell.z)},
             {"detectable_bias", figure(cell.detectable_bias)},
             {"samples", s.samples},
             {"work", figure(s.work)},
             {"seconds", figure(s.seconds)},
             {"efficiency", figure(s.efficiency())},
             {"status", name_of(cell.status)},
             {"reason", cell.reason}});
  return f;
}

void print(std::ostream& out, const ValidateReport& v) {
  using enum validation::Status;
  const auto whole = [](auto n) { return std::to_string(n); };
  out << counted(std::ssize(v.report.cells), "cell") << ": " << whole(v.report.passed) << " passed, "
      << whole(v.report.failed) << " failed, " << whole(count(v.report, biased)) << " biased, "
      << whole(count(v.report, refused)) << " refused, " << whole(count(v.report, underpowered)) << " underpowered\n"
      << "max |z| " << rounded(v.report.max_abs_z, 3) << ", threshold " << rounded(v.report.threshold, 3)
      << "; smallest detectable bias " << rounded(v.report.smallest_detectable_bias, 3)
      << " standard deviations of one sample\n"
      << counted(v.samples, "sample") << " per cell, seed " << whole(v.seed) << ", " << rounded(v.seconds, 3) << " s\n";
}

Fields fields(const ValidateReport& v) {
  using enum validation::Status;
  Fields f = {{"cells", v.report.cells.size()},
              {"passed", v.report.passed},
              {"failed", v.report.failed},
              {"biased", count(v.report, biased)},
              {"refused", count(v.report, refused)},
              {"underpowered", count(v.report, underpowered)},
              {"max_abs_z", v.report.max_abs_z},
              {"threshold", v.report.threshold},
              {"smallest_detectable_bias", v.report.smallest_detectable_bias},
              {"samples", v.samples},
              {"seed", v.seed},
              {"seconds", v.seconds}};
  append(f, versions());
  return f;
}

// ---- problems that nobody has met

UnseenReport validate_unseen(const UnseenRequest& request, const Caller& caller) {
  check_judged(request.samples);
  Plan plan{.samples = request.samples, .threads = request.threads};
  const double total = static_cast<double>(request.families) * request.seeds;
  plan.progress = [&](std::int64_t done) {
    return caller.goes_on("run " + std::to_string(done), static_cast<double>(done), total);
  };
  return {validation::run_unseen(request.families_seed, request.families, request.seeds, plan)};
}

void print(std::ostream& out, const UnseenReport& u) { out << u.report; }

Fields fields(const UnseenReport& u) {
  const validation::UnseenReport& report = u.report;
  const auto said = [](validation::Said s) {
    return s == validation::Said::yes ? "yes" : (s == validation::Said::no ? "no" : "open");
  };
  const auto family = [](const validation::UnseenFamily& f) {
    return Fields{{"family", f.family.index},       {"kind", name_of(f.family.kind)},
                  {"says", f.family.description()}, {"truth", f.labels.truth},
                  {"exists", f.labels.exists},      {"second_moments", f.labels.second_moments},
                  {"margin", f.labels.margin},      {"reached", f.labels.reached},
                  {"within", f.labels.within()},    {"beyond", f.labels.beyond()}};
  };
  const auto run = [&](const validation::UnseenRun& r) {
    const validation::Opinion& o = r.opinion;
    const auto figure = [&o](double x) { return o.refused ? Node(nullptr) : Node(x); };
    return Fields{{"family", r.family},
                  {"seed", r.seed},
                  {"answer", said(o.answer)},
                  {"grade", name_of(o.grade)},
                  {"refused", o.refused},
                  {"wrong", r.wrong},
                  {"mean", figure(o.mean)},
                  {"low", figure(o.low)},
                  {"high", figure(o.high)},
                  {"reliable", o.reliable},
                  {"covered", r.covered},
                  {"wrong_verdict", r.wrong_verdict},
                  {"width", r.width > 0 ? Node(r.width) : Node(nullptr)}};
  };
  const auto gate = [](const validation::Gate& g) {
    return Fields{{"name", g.name}, {"measured", g.measured}, {"demand", g.demand}, {"of", g.of}, {"holds", g.holds}};
  };
  Fields f = {{"seed", report.seed},
              {"samples", report.samples},
              {"seconds", report.seconds},
              {"gates", list_of(report.gates, gate)},
              {"families", list_of(report.families, family)},
              {"runs", list_of(report.runs, run)}};
  append(f, versions());
  return f;
}

// ---- hard cases

HardReport validate_hard(const HardRequest& request, const Caller& caller,
                         const std::function<void(const HardCell&)>& show) {
  check_judged(request.samples);
  Plan plan{.samples = request.samples, .seed = request.seed, .threads = request.threads};
  const std::vector<validation::HardCase>& cases = validation::hard_cases();
  std::size_t cells = 0;
  plan.progress = [&](std::int64_t) {
    return caller.goes_on("case " + std::to_string(cells + 1) + " of " + std::to_string(cases.size()), 0, 0);
  };
  HardReport result{{}, plan.samples, plan.seed};
  result.report = validation::validate(cases, plan, [&](const HardCell& cell) {
    ++cells;
    if (show) show(cell);
  });
  return result;
}

HardTable::HardTable() : widths_{0, 0, 9, 8, 9, 5, 7, 0} {
  for (const validation::HardCase& c : validation::hard_cases()) {
    widths_[0] = std::max(widths_[0], c.group.size());
    widths_[1] = std::max(widths_[1], c.parameter.size());
  }
}

void HardTable::print_header(std::ostream& out) const { print_row(out, hard_header, widths_); }
void HardTable::print(std::ostream& out, const HardCell& cell) const { print_row(out, row_of(cell), widths_); }

Fields fields(const HardCell& cell) {
  const auto figure = [&cell](double x) { return cell.has_run ? Node(x) : Node(nullptr); };
  const ComponentEstimate c = cell.has_run ? cell.statistics.components.front() : ComponentEstimate{};
  return {{"case", cell.group},
          {"hard_by", cell.parameter},
          {"truth", cell.truth},
          {"mean", figure(c.mean)},
          {"standard_error", figure(c.standard_error)},
          {"error", figure(cell.error)},
          {"digits_lost", figure(cell.digits_lost)},
          {"bias_bound", figure(cell.statistics.bias_bound.size)},
          {"status", name_of(cell.status)},
          {"says", cell.says}};
}

void print(std::ostream& out, const HardReport& h) {
  out << std::to_string(h.report.cells.size()) << " cases, " << std::to_string(h.report.failed)
      << " wrong without a word; " << counted(h.samples, "sample") << " each, seed " << std::to_string(h.seed)
      << "; threshold " << rounded(h.report.threshold, 3) << " standard errors\n";
}

Fields fields(const HardReport& h) {
  Fields f = {{"cells", h.report.cells.size()},
              {"failed", h.report.failed},
              {"threshold", h.report.threshold},
              {"samples", h.samples},
              {"seed", h.seed}};
  append(f, versions());
  return f;
}

}  // namespace debias::commands

#include "json.hpp"

#include <cmath>
#include <string_view>

#include <debias/core/stream.hpp>
#include <nlohmann/json.hpp>

namespace debias::cli {
namespace {

using Json = nlohmann::ordered_json;

Json number(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

Json law_json(const catalog::Choice& choice) {
  const std::string law = law_text(choice);
  return law.empty() ? Json(nullptr) : Json(law);
}

// What a reader of null numbers wants to know.
std::string_view status_of(const Statistics& s) {
  if (s.nonfinite > 0) return "nonfinite";
  if (s.samples < 2) return "one_sample";
  return s.moments.m2 > 0 ? "ok" : "zero_variance";
}

Json chosen(const catalog::Problem& problem, const catalog::Choice& choice) {
  return {{"problem", problem.name},
          {"id", problem.id},
          {"estimator", catalog::name_of(choice)},
          {"law", law_json(choice)},
          {"base_level", choice.base_level}};
}

void add_versions(Json& json) {
  json["stream_version"] = Stream::layout_version;
  json["version"] = DEBIAS_VERSION;
  json["schema"] = json_schema;
}

Json level_json(const LevelRow& row) {
  return {{"level", row.level},
          {"last_level", row.last_level},
          {"is_base", row.is_base},
          {"count", row.count},
          {"mean", number(row.mean)},
          {"second_moment", number(row.second_moment)},
          {"fourth_moment", number(row.fourth_moment)},
          {"work", number(row.work)}};
}

// For people and for diff: one line per entry of a list.
std::string pretty(const Json& json) { return json.dump(2); }

}  // namespace

std::string problems_json() {
  Json list = Json::array();
  for (const catalog::Problem& p : catalog::problems()) {
    const bool faster = std::isinf(p.rates.variance);
    list.push_back({{"id", p.id},
                    {"name", p.name},
                    {"module", p.module},
                    {"truth", p.truth},
                    {"variance_rate", number(p.rates.variance)},
                    {"variance_decay", faster                              ? "faster"
                                       : p.rates.decay == Decay::geometric ? "geometric"
                                                                           : "polynomial"},
                    {"work_rate", p.rates.work},
                    {"law_exists", law_exists(p.rates)},
                    {"source", p.formula}});
  }
  return pretty(list);
}

std::string estimators_json() {
  Json list = Json::array();
  for (const catalog::Method m : catalog::methods()) {
    list.push_back({{"name", catalog::name_of(m)}, {"description", catalog::describe(m)}});
  }
  for (const catalog::Special& s : catalog::specials()) {
    list.push_back({{"name", s.name}, {"description", s.description}});
  }
  return pretty(list);
}

std::string laws_json() {
  Json list = Json::array();
  for (const AnyPmf::Form& form : AnyPmf::forms()) {
    list.push_back({{"name", form.name}, {"example", form.example}, {"formula", form.formula}});
  }
  return pretty(list);
}

std::string run_json(const Run& run) {
  const Statistics& s = run.statistics;
  const ComponentEstimate& c = s.components.front();
  Json json = chosen(*run.problem, run.choice);
  json["mean"] = number(c.mean);
  json["standard_error"] = number(c.standard_error);
  json["interval"] = {{"low", number(run.interval.low)},
                      {"high", number(run.interval.high)},
                      {"confidence", run.interval.confidence}};
  json["bias_bound"] = {{"size", number(s.bias_bound.size)}, {"sentence", s.bias_bound.sentence}};
  json["samples"] = s.samples;
  json["work"] = number(s.work);
  json["seconds"] = s.seconds;
  json["efficiency"] = number(s.efficiency());
  json["seed"] = s.seed;
  json["truth"] = run.problem->truth;
  json["z"] = number(run.z);
  json["verdict"] = {{"finite_variance", run.verdict.finite_variance},
                     {"finite_work", run.verdict.finite_work},
                     {"tail_index", number(run.verdict.tail_index)},
                     {"sentence", run.verdict.sentence}};
  json["warnings"] = s.warnings;
  json["nonfinite"] = s.nonfinite;
  json["goal"] = "samples";
  json["status"] = status_of(s);
  json["levels"] = Json::array();
  for (const LevelRow& row : s.levels) json["levels"].push_back(level_json(row));
  json["largest"] = Json::array();
  for (const LargeSample& l : s.largest) {
    json["largest"].push_back({{"index", l.index}, {"level", l.level}, {"value", number(l.value)}});
  }
  add_versions(json);
  return pretty(json);
}

std::string replay_json(const Replay& replay) {
  const Sample<double>& sample = replay.trace.sample;
  Json json = chosen(*replay.problem, replay.choice);
  json["seed"] = replay.seed;
  json["sample"] = replay.index;
  json["level"] = sample.level;
  json["value"] = number(sample.value);
  // Of the deepest level, before its weight; `levels` has all of them.
  json["difference"] =
      replay.trace.levels.empty() ? Json(nullptr) : number(replay.trace.levels.back().difference);
  json["work"] = number(sample.work);
  json["levels"] = Json::array();
  for (const TracedLevel& l : replay.trace.levels) {
    json["levels"].push_back({{"level", l.level},
                              {"is_base", l.is_base},
                              {"difference", number(l.difference)},
                              {"work", number(l.work)}});
  }
  json["status"] = std::isfinite(sample.value) ? "ok" : "nonfinite";
  add_versions(json);
  return pretty(json);
}

std::string cell_json(const catalog::Cell& cell) {
  Json json = chosen(*cell.problem, cell.choice);
  if (!cell.has_run) json["law"] = nullptr;
  json["truth"] = cell.problem->truth;
  const Statistics& s = cell.statistics;
  const auto figure = [&cell](double x) { return cell.has_run ? number(x) : Json(nullptr); };
  const ComponentEstimate c = cell.has_run ? s.components.front() : ComponentEstimate{};
  json["mean"] = figure(c.mean);
  json["standard_error"] = figure(c.standard_error);
  json["z"] = figure(cell.z);
  json["detectable_bias"] = figure(cell.detectable_bias);
  json["samples"] = s.samples;
  json["work"] = figure(s.work);
  json["seconds"] = figure(s.seconds);
  json["efficiency"] = figure(s.efficiency());
  json["status"] = catalog::name_of(cell.status);
  json["reason"] = cell.reason;
  return json.dump();
}

std::string summary_json(const Validation& v) {
  const Counts n = count(v.report);
  Json json = {{"cells", v.report.cells.size()},
               {"passed", v.report.passed},
               {"failed", v.report.failed},
               {"biased", n.biased},
               {"refused", n.refused},
               {"underpowered", n.underpowered},
               {"max_abs_z", number(v.report.max_abs_z)},
               {"threshold", v.report.threshold},
               {"smallest_detectable_bias", number(v.report.smallest_detectable_bias)},
               {"samples", v.samples},
               {"seed", v.seed},
               {"seconds", v.seconds}};
  add_versions(json);
  return json.dump();
}

}  // namespace debias::cli

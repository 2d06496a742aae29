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

// The user's own problem has none.
Json id_json(const catalog::Problem& problem) { return problem.id.empty() ? Json(nullptr) : Json(problem.id); }

// What a reader of null numbers wants to know.
std::string_view status_of(const Statistics& s) {
  if (s.nonfinite > 0) return "nonfinite";
  if (s.samples < 2) return "one_sample";
  return s.moments.m2 > 0 ? "ok" : "zero_variance";
}

Json chosen(const catalog::Problem& problem, const catalog::Choice& choice) {
  return {{"problem", problem.name}, {"id", id_json(problem)},          {"estimator", catalog::name_of(choice)},
          {"law", law_json(choice)}, {"base_level", choice.base_level}, {"block", choice.block}};
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
          {"work", number(row.work)},
          {"probability", row.probability > 0 ? Json(row.probability) : Json(nullptr)}};
}

Json rate_json(const FittedRate& r) { return {{"value", number(r.value)}, {"error", number(r.error)}}; }

// A null value: faster than any rate, as `kind` says, or not known.
Json rates_json(const MeasuredRates& r) {
  return {{"kind", name_of(r.kind)},
          {"mean", rate_json(r.mean)},
          {"variance", rate_json(r.variance)},
          {"fourth", rate_json(r.fourth)},
          {"work", rate_json(r.work)}};
}

Json goal_json(const Statistics& s) {
  const Goal& g = s.goal;
  if (!g.asked()) return "samples";
  const char* name = g.error > 0 ? "error" : (g.relative_error > 0 ? "relative_error" : "seconds");
  return {{name, g.error + g.relative_error + g.seconds}, {"met", s.goal_met()}};
}

Json advice_json(const Advice& a) {
  return {{"members", a.members},
          {"shares_base", a.shares_base},
          {"predicted_variance", number(a.predicted.variance)},
          {"predicted_work", number(a.predicted.work)},
          {"bound", number(a.bound)},
          {"highest_moment", number(a.highest_moment)},
          {"pilot_work", number(a.pilot_work)},
          {"price", number(a.price)},
          {"law_exists", name_of(a.survey.law_exists)},
          {"grade", name_of(a.survey.grade)},
          {"rates", rates_json(a.survey.rates)},
          {"sentences", a.sentences},
          {"remarks", a.survey.remarks}};
}

Json tail_json(const TailIndex& tail) {
  const char* state = tail.state == TailState::fitted    ? "fitted"
                      : tail.state == TailState::bounded ? "bounded"
                                                         : "too_few";
  const bool fitted = tail.state == TailState::fitted;
  const auto figure = [fitted](double x) { return fitted ? number(x) : Json(nullptr); };
  return {{"state", state},
          {"k", figure(tail.k)},
          {"error", figure(tail.error)},
          {"plain_k", figure(tail.plain)},
          {"values", tail.values},
          {"cutoff", figure(tail.cutoff)},
          {"ties", tail.ties},
          {"hill", figure(tail.hill)},
          {"moment", figure(tail.moment)},
          {"pickands", figure(tail.pickands)}};
}

Json interval_json(const Interval& interval) {
  return {{"low", number(interval.low)}, {"high", number(interval.high)}, {"confidence", interval.confidence}};
}

Json evidence_json(const RunVerdict& v) {
  return {{"variance", name_of(v.variance)},
          {"grade", name_of(v.grade)},
          {"fourth_moment", name_of(v.fourth_moment)},
          {"work", name_of(v.work)},
          {"interval_reliable", v.interval_reliable()},
          {"tail_index", number(v.tail_index)},
          {"error", number(v.error)},
          {"levels",
           {{"available", v.levels.available},
            {"votes", v.levels.votes},
            {"first", v.levels.first_level},
            {"last", v.levels.last_level},
            {"tail_index", number(v.levels.tail_index)},
            {"error", number(v.levels.error)},
            {"beta", number(v.levels.beta)},
            {"beta_error", number(v.levels.beta_error)},
            {"rho", number(v.levels.rho)},
            {"diverges", number(v.levels.diverges)},
            {"growth", number(v.levels.growth)},
            {"polynomial", v.levels.polynomial}}},
          {"upper_tail", tail_json(v.upper)},
          {"lower_tail", tail_json(v.lower)},
          {"kurtosis", number(v.kurtosis)},
          {"unseen_share", number(v.unseen_share)},
          {"degrees", number(v.degrees)},
          {"largest_share", number(v.largest_share)},
          {"deepest_level", v.deepest_level},
          {"samples_needed", number(v.samples_needed)},
          {"rate", number(v.rate)},
          {"sentences", v.sentences()}};
}

Json coupling_json(const Coupling& c) {
  const bool compared = c.state == Coupling::State::right || c.state == Coupling::State::wrong;
  const auto level = [compared](std::int64_t k) { return compared ? Json(k) : Json(nullptr); };
  const auto figure = [compared](double x) { return compared ? number(x) : Json(nullptr); };
  return {{"state", name_of(c.state)},
          {"first_level", level(c.first_level)},
          {"last_level", level(c.last_level)},
          {"level", level(c.level)},
          {"z", figure(c.z)},
          {"threshold", figure(c.threshold)}};
}

// For people and for diff: one line per entry of a list.
// Bytes of a file that are no UTF-8 are replaced.
std::string pretty(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace); }

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
  json["interval"] = interval_json(run.interval);
  if (s.components.size() > 1) {
    json["components"] = Json::array();
    for (std::size_t i = 0; i < s.components.size(); ++i) {
      const Interval interval = s.interval(run.interval.confidence, i);
      json["components"].push_back({{"mean", number(s.components[i].mean)},
                                    {"standard_error", number(s.components[i].standard_error)},
                                    {"low", number(interval.low)},
                                    {"high", number(interval.high)}});
    }
  }
  if (!s.name.empty()) json["name"] = s.name;
  json["bias_bound"] = {{"size", number(s.bias_bound.size)}, {"sentence", s.bias_bound.sentence}};
  json["samples"] = s.samples;
  json["work"] = number(s.work);
  json["seconds"] = s.seconds;
  json["pilot_work"] = number(s.pilot_work);
  json["pilot_seconds"] = s.pilot_seconds;
  json["efficiency"] = number(s.efficiency());
  json["seed"] = s.seed;
  json["truth"] = number(run.problem->truth);
  json["z"] = number(run.z);
  json["verdict"] = {{"finite_variance", run.verdict.finite_variance},
                     {"finite_work", run.verdict.finite_work},
                     {"tail_index", number(run.verdict.tail_index)},
                     {"sentence", run.verdict.sentence}};
  if (s.nonfinite == 0 && s.samples > 1) json["evidence"] = evidence_json(s.verdict());
  json["coupling"] = coupling_json(s.coupling);
  json["warnings"] = s.warnings;
  json["nonfinite"] = s.nonfinite;
  json["goal"] = goal_json(s);
  json["recipe"] = run.advice ? advice_json(*run.advice) : Json(nullptr);
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
  json["difference"] = replay.trace.levels.empty() ? Json(nullptr) : number(replay.trace.levels.back().difference);
  json["work"] = number(sample.work);
  json["levels"] = Json::array();
  for (const TracedLevel& l : replay.trace.levels) {
    json["levels"].push_back(
        {{"level", l.level}, {"is_base", l.is_base}, {"difference", number(l.difference)}, {"work", number(l.work)}});
  }
  json["status"] = std::isfinite(sample.value) ? "ok" : "nonfinite";
  add_versions(json);
  return pretty(json);
}

std::string multilevel_json(const MultilevelRun& run) {
  const MultilevelStatistics& s = run.statistics;
  Json json = {{"problem", run.problem->name},
               {"id", id_json(*run.problem)},
               {"estimator", "multilevel"},
               {"mean", number(s.components.front().mean)},
               {"standard_error", number(s.components.front().standard_error)},
               {"bias", number(s.bias)},
               {"goal", {{"error", s.goal}, {"met", s.goal_met()}}},
               {"alpha", number(s.alpha)},
               {"beta", number(s.beta)},
               {"work", number(s.work)},
               {"seconds", s.seconds},
               {"pilot_work", number(s.pilot_work)},
               {"pilot_seconds", s.pilot_seconds},
               {"warnings", s.warnings},
               {"seed", s.seed},
               {"truth", number(run.problem->truth)}};
  json["levels"] = Json::array();
  for (const MultilevelRow& r : s.rows) {
    json["levels"].push_back({{"level", r.level},
                              {"count", r.draws},
                              {"mean", number(r.difference)},
                              {"variance", number(r.variance)},
                              {"work", number(r.work)}});
  }
  add_versions(json);
  return pretty(json);
}

std::string advice_json(const AdviceOn& on) {
  const Advice& a = on.advice;
  Json json = {{"problem", on.problem->name},
               {"id", id_json(*on.problem)},
               {"seed", a.survey.seed},
               {"law", a.law.spec()},
               {"base_level", a.base_level},
               {"base", a.base == Base::drawn ? "drawn" : "always"},
               {"block", a.block}};
  json.update(advice_json(a));
  add_versions(json);
  return pretty(json);
}

std::string tradeoff_json(const Tradeoff& t) {
  Json json = {{"problem", t.problem->name},
               {"id", id_json(*t.problem)},
               {"samples", t.samples},
               {"seed", t.survey.seed},
               {"base_level", t.setup.base_level},
               {"base", t.setup.base == Base::drawn ? "drawn" : "always"},
               {"block", t.setup.block},
               {"rates", rates_json(t.survey.rates)},
               {"law_exists", name_of(t.survey.law_exists)},
               {"optimum", t.survey.law_exists == Answer::no ? Json(nullptr) : number(t.optimum)},
               {"bound", t.survey.law_exists == Answer::no ? Json(nullptr) : number(t.bound)},
               {"best", t.best < t.points.size() ? Json(t.points[t.best].law.spec()) : Json(nullptr)}};
  json["points"] = Json::array();
  for (const TradeoffPoint& p : t.points) {
    const bool finite_variance = p.verdict.variance != Finiteness::infinite;
    const bool finite_work = p.verdict.work != Finiteness::infinite;
    const auto figure = [](bool known, double x) { return known ? number(x) : Json(nullptr); };
    json["points"].push_back({{"law", p.law.spec()},
                              {"exponent", number(p.law.tail_exponent().exponent)},
                              {"predicted_variance", figure(finite_variance, p.predicted.variance)},
                              {"measured_variance", figure(p.measured, p.variance)},
                              {"predicted_work", figure(finite_work, p.predicted.work)},
                              {"measured_work", figure(p.measured, p.work)},
                              {"efficiency", figure(p.measured, p.efficiency)},
                              {"tail_index", number(p.verdict.tail_index)},
                              {"variance", name_of(p.verdict.variance)},
                              {"work", name_of(p.verdict.work)},
                              {"fourth_moment", name_of(p.verdict.fourth_moment)}});
  }
  add_versions(json);
  return pretty(json);
}

std::string survey_json(const SurveyOf& s) {
  const Survey& survey = s.survey;
  Json json = {
      {"problem", s.problem->name}, {"id", id_json(*s.problem)}, {"samples", s.samples}, {"seed", survey.seed}};
  json["rates"] = rates_json(survey.rates);
  json["law_exists"] = name_of(survey.law_exists);
  json["grade"] = name_of(survey.grade);
  json["remarks"] = survey.remarks;
  json["work"] = number(survey.work);
  json["seconds"] = survey.seconds;
  json["levels"] = Json::array();
  for (const SurveyRow& r : survey.rows) {
    json["levels"].push_back({{"level", r.level},
                              {"draws", r.draws},
                              {"mean", number(r.mean)},
                              {"mean_error", number(r.mean_error)},
                              {"variance", number(r.variance)},
                              {"difference", number(r.difference)},
                              {"difference_error", number(r.difference_error)},
                              {"difference_variance", number(r.difference_variance)},
                              {"second_moment", number(r.second_moment)},
                              {"second_moment_error", number(r.second_moment_error)},
                              {"kurtosis", number(r.kurtosis)},
                              {"nonzero", number(r.nonzero)},
                              {"consistency", number(r.consistency)},
                              {"value_work", number(r.value_work)},
                              {"difference_work", number(r.difference_work)},
                              {"seconds", r.seconds},
                              {"votes", r.votes},
                              {"fitted", r.fitted}});
  }
  add_versions(json);
  return pretty(json);
}

namespace {

// What was taken for what.
Json read_json(const numbers::Report& r) {
  using numbers::Format;
  const bool text = r.format == Format::text;
  const auto of_text = [text](Json value) { return text ? value : Json(nullptr); };
  const char* separator = r.separator == '\t' ? "tab" : r.separator == ' ' ? "space" : nullptr;
  const char* order = r.order == numbers::ByteOrder::big ? "big" : "little";
  return {{"format", text                      ? "text"
                     : r.format == Format::npy ? "npy"
                     : r.format == Format::f32 ? "f32"
                                               : "f64"},
          {"byte_order", text ? Json(nullptr) : Json(order)},
          {"type", r.type.empty() ? Json(nullptr) : Json(r.type)},
          {"separator", r.separator == 0       ? Json(nullptr)
                        : separator != nullptr ? Json(separator)
                                               : Json(std::string(1, r.separator))},
          {"separator_guessed", of_text(r.separator_guessed)},
          {"columns", r.columns},
          {"column", r.column_number},
          {"header", r.header},
          {"header_guessed", of_text(r.header_guessed)},
          {"first_row", of_text(r.first_row)},
          {"comments", r.comments}};
}

}  // namespace

std::string diagnose_json(const Diagnosis& d) {
  const bool has_mean = d.nonfinite == 0;
  const bool has_error = has_mean && d.moments.count > 1;
  const bool varies = has_error && d.moments.m2 > 0;
  Json json = {{"file", d.file}, {"column", d.read.column.empty() ? Json(nullptr) : Json(d.read.column)}};
  json["bad_rows"] = d.read.bad_rows;
  json["first_bad_rows"] = Json::array();
  for (const numbers::BadRow& bad : d.read.first_bad_rows) {
    json["first_bad_rows"].push_back({{"row", bad.row}, {"reason", bad.reason}});
  }
  json["read"] = read_json(d.read);
  json["values"] = d.moments.count;
  json["nonfinite"] = d.nonfinite;
  json["first_nonfinite"] = d.nonfinite > 0 ? Json(d.first_nonfinite) : Json(nullptr);
  json["mean"] = has_mean ? number(d.mean) : Json(nullptr);
  json["standard_error"] = has_error ? number(d.standard_error) : Json(nullptr);
  json["interval"] = has_error ? interval_json(d.interval) : Json(nullptr);
  json["block_interval"] = varies ? interval_json(d.block_interval) : Json(nullptr);
  json["blocks"] = d.block_means.size();
  json["block_length"] = d.block_length;
  json["biased_median_of_means"] = varies && d.robust.groups > 0 ? number(d.robust.value) : Json(nullptr);
  json["verdict"] = varies ? evidence_json(d.verdict) : Json(nullptr);
  json["largest"] = Json::array();
  for (const LargeSample& l : d.largest) {
    json["largest"].push_back({{"row", l.index},
                               {"value", number(l.value)},
                               {"share", varies ? number(square_share(d, l.value)) : Json(nullptr)}});
  }
  json["running"] = Json::array();
  for (const RunningMean& r : d.running) {
    if (!has_mean) break;
    json["running"].push_back(
        {{"values", r.count}, {"mean", number(r.mean)}, {"standard_error", number(r.standard_error)}});
  }
  json["warnings"] = d.warnings;
  json["status"] = d.nonfinite > 0       ? "nonfinite"
                   : d.read.bad_rows > 0 ? "bad_rows"
                   : !has_error          ? "one_sample"
                   : !varies             ? "zero_variance"
                                         : "ok";
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

std::string render_json(const Pictures& all) {
  Json list = Json::array();
  for (const Picture& p : all.pictures) {
    list.push_back({{"name", p.name},
                    {"description", p.description},
                    {"biased", p.biased},
                    {"samples", p.samples},
                    {all.work_unit, number(p.work)},
                    {"mean", number(p.mean)},
                    {"error", number(p.error)},
                    {"verdict", p.verdict},
                    {"seconds", p.seconds}});
  }
  Json json = {{"scene", all.scene}, {"width", all.width},       {"height", all.height},
               {"seed", all.seed},   {"complete", all.complete}, {"pictures", std::move(list)}};
  add_versions(json);
  return pretty(json);
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

std::string hard_cell_json(const catalog::HardCell& cell) {
  const auto figure = [&cell](double x) { return cell.has_run ? number(x) : Json(nullptr); };
  const ComponentEstimate c = cell.has_run ? cell.statistics.components.front() : ComponentEstimate{};
  const Json json = {{"case", cell.group},
                     {"hard_by", cell.parameter},
                     {"truth", cell.truth},
                     {"mean", figure(c.mean)},
                     {"standard_error", figure(c.standard_error)},
                     {"error", figure(cell.error)},
                     {"digits_lost", figure(cell.digits_lost)},
                     {"bias_bound", figure(cell.statistics.bias_bound.size)},
                     {"status", name_of(cell.status)},
                     {"says", cell.says}};
  return json.dump();
}

std::string hard_summary_json(const catalog::HardReport& report, const Plan& plan) {
  Json json = {{"cells", report.cells.size()},
               {"failed", report.failed},
               {"threshold", report.threshold},
               {"samples", plan.samples},
               {"seed", plan.seed}};
  add_versions(json);
  return json.dump();
}

std::string report_json(const std::vector<catalog::Figure>& figures,
                        const std::vector<std::pair<std::string, std::string>>& facts) {
  Json json;
  for (const auto& [name, text] : facts) json["facts"][name] = text;
  json["figures"] = Json::array();
  for (const catalog::Figure& f : figures) {
    json["figures"].push_back(
        {{"name", f.name}, {"measured", f.measured}, {"demanded", f.demanded}, {"holds", f.holds}});
  }
  add_versions(json);
  return pretty(json);
}

}  // namespace debias::cli

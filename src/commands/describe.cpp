#include "describe.hpp"

#include <limits>

#include "text.hpp"

namespace debias::commands {
namespace {

Fields describe(const FittedRate& r) { return {{"value", r.value}, {"error", r.error}}; }

Fields describe(const TailIndex& tail) {
  const char* state = tail.state == TailState::fitted    ? "fitted"
                      : tail.state == TailState::bounded ? "bounded"
                                                         : "too_few";
  const bool fitted = tail.state == TailState::fitted;
  const auto figure = [fitted](double x) { return fitted ? Node(x) : Node(nullptr); };
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

}  // namespace

Fields describe(const catalog::Problem& problem) {
  return {{"problem", problem.name}, {"id", problem.id.empty() ? Node(nullptr) : Node(problem.id)}};
}

Fields describe(const catalog::Problem& problem, const catalog::Choice& choice) {
  Fields f = describe(problem);
  const std::string pmf = pmf_text(choice);
  append(f, {{"estimator", catalog::name_of(choice)},
             {"pmf", pmf.empty() ? Node(nullptr) : Node(pmf)},
             {"base_level", choice.base_level},
             {"block", choice.block},
             {"points", name_of(choice.points)}});
  return f;
}

Fields describe(const Interval& interval) {
  return {{"low", interval.low}, {"high", interval.high}, {"confidence", interval.confidence}};
}

Fields describe(const LevelRow& row) {
  return {{"level", row.level},
          {"last_level", row.last_level},
          {"is_base", row.is_base},
          {"count", row.count},
          {"mean", row.mean},
          {"second_moment", row.second_moment},
          {"kurtosis", row.kurtosis},
          {"work", row.work},
          {"probability", row.probability > 0 ? Node(row.probability) : Node(nullptr)}};
}

Fields describe(const RunVerdict& v) {
  return {{"variance", name_of(v.variance)},
          {"grade", name_of(v.grade)},
          {"fourth_moment", name_of(v.fourth_moment)},
          {"work", name_of(v.work)},
          {"interval_reliable", v.interval_reliable()},
          {"tail_index", v.tail_index},
          {"error", v.error},
          {"levels", Fields{{"available", v.levels.available},
                            {"usable_levels", v.levels.usable_levels},
                            {"first", v.levels.first_level},
                            {"last", v.levels.last_level},
                            {"tail_index", v.levels.tail_index},
                            {"error", v.levels.error},
                            {"beta", v.levels.beta},
                            {"beta_error", v.levels.beta_error},
                            {"rho", v.levels.rho},
                            {"diverges", v.levels.diverges},
                            {"growth", v.levels.growth},
                            {"polynomial", v.levels.polynomial}}},
          {"upper_tail", describe(v.upper)},
          {"lower_tail", describe(v.lower)},
          {"kurtosis", v.kurtosis},
          {"unseen_share", v.unseen_share},
          {"degrees", v.degrees},
          {"largest_share", v.largest_share},
          {"deepest_level", v.deepest_level},
          {"samples_needed", v.samples_needed},
          {"rate", v.rate},
          {"sentence", v.sentence()},
          {"sentences", v.sentences()},
          {"reasons", v.reasons}};
}

Fields describe(const Coupling& c) {
  const bool compared = c.state == Coupling::State::right || c.state == Coupling::State::wrong;
  const auto known = [compared](Node x) { return compared ? std::move(x) : Node(nullptr); };
  return {{"state", name_of(c.state)},
          {"first_level", known(c.first_level)},
          {"last_level", known(c.last_level)},
          {"level", known(c.level)},
          {"z", known(c.z)},
          {"threshold", known(c.threshold)}};
}

Fields describe(const MeasuredRates& r) {
  return {{"kind", name_of(r.kind)},
          {"mean_decay", describe(r.mean_decay)},
          {"variance_decay", describe(r.variance_decay)},
          {"fourth_decay", describe(r.fourth_decay)},
          {"work_growth", describe(r.work_growth)}};
}

Fields describe(const Advice& a) {
  return {{"members", a.members},
          {"points", name_of(a.points)},
          {"why_points", a.why_points},
          {"shares_base", a.shares_base},
          {"predicted_variance", a.predicted.variance},
          {"predicted_work", a.predicted.work},
          {"bound", a.bound},
          {"highest_moment", a.highest_moment},
          {"pilot_work", a.pilot_work},
          {"price", a.price},
          {"pmf_exists", name_of(a.survey.pmf_exists)},
          {"grade", name_of(a.survey.grade)},
          {"rates", describe(a.survey.rates)},
          {"sentences", a.sentences},
          {"warnings", a.warnings},
          {"remarks", a.survey.remarks}};
}

Fields describe(const NoPmfError& e) {
  return {{"variance_decay", e.variance_decay().value},
          {"variance_decay_error", e.variance_decay().error},
          {"work_growth", e.work_growth().value},
          {"work_growth_error", e.work_growth().error},
          {"decay", e.decay() == Decay::polynomial ? "polynomial" : "geometric"},
          {"grade", name_of(e.grade())},
          {"reason", e.reason()},
          {"help", e.help()}};
}

}  // namespace debias::commands

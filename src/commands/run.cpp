#include "run.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string_view>
#include <vector>

#include <debias/core/estimator.hpp>

#include "core/text.hpp"
#include "core/words.hpp"
#include "describe.hpp"
#include "recipe/prose.hpp"
#include "store.hpp"
#include "text.hpp"
#include "validation/validation.hpp"

namespace debias::commands {
namespace {

DeclaredFiniteness verdict_of(const catalog::Problem& problem, const catalog::Choice& choice) {
  DeclaredFiniteness v;
  v.finite_variance = true;
  v.finite_work = true;
  if (const catalog::Special* special = catalog::find_special(problem, choice.special)) {
    v.sentence = special->description;
    if (!special->reason.empty()) v.sentence += "; " + special->reason;
    if (special->kurtosis > 0 && std::isfinite(special->kurtosis)) {
      v.sentence += " a kurtosis of " + rounded(special->kurtosis, 3);
    }
    return v;
  }
  if (std::isnan(problem.rates.variance_decay)) return v;  // nothing is declared
  if (choice.method != catalog::Method::truncated) {
    return judge(rates_of(problem, choice.method), choice.pmf.tail_exponent());
  }
  v.sentence = "one level only: its bias is no part of the standard error";
  return v;
}

// What a reader of numbers that are not finite wants to know.
std::string_view status_of(const Statistics& s) {
  if (s.nonfinite > 0) return "nonfinite";
  if (s.blocks < 2) return "one_sample";
  return s.moments.m2 > 0 ? "ok" : "zero_variance";
}

Node describe_goal(const Statistics& s) {
  const Goal& g = s.goal;
  if (!g.asked()) return "samples";
  const char* name = g.error > 0 ? "error" : (g.relative_error > 0 ? "relative_error" : "seconds");
  return Fields{{name, g.error + g.relative_error + g.seconds}, {"met", s.goal_met()}};
}

std::string text_of(const Shard& shard) {
  return "'" + std::to_string(shard.index) + "/" + std::to_string(shard.of) + "'";
}

// Before anything is drawn: is there such a part, and of samples that are known?
void check_shard(const RunRequest& r) {
  if (!r.shard) return;
  const auto [i, n] = *r.shard;
  if (n < 1 || n > Shard::most || i < 1 || i > n) {
    throw BadRequest({Field{"shard"}, " = " + text_of(*r.shard) +
                                          " (must be one of 1/n, 2/n, ... n/n, with n from 1 to " +
                                          std::to_string(Shard::most) + "); 1/4 is the first of four"});
  }
  if (r.sampling.goal.asked()) {
    throw BadRequest(
        {Field{"shard"}, " (a goal fixes the samples late, and shards share them); write ", Field{"samples"}});
  }
}

std::int64_t chunk_of(std::int64_t block) { return block > 1 ? debias::detail::chunk_of_blocks(block) : default_chunk; }

// Empty where there are more shards than chunks.
RunState::Range part_of(const Shard& shard, std::int64_t samples, std::int64_t chunk) {
  const std::int64_t chunks = (samples - 1) / chunk + 1;
  const auto [i, n] = shard;
  const auto cut = [&, n = n](std::int64_t k) {
    return k == n ? samples : (chunks / n * k + std::min(chunks % n, k)) * chunk;
  };
  return {cut(i - 1), cut(i)};
}

RunState::Range range_of(const std::optional<Shard>& shard, std::int64_t asked, std::int64_t block) {
  const std::int64_t samples = debias::detail::whole_blocks(asked, block);
  if (!shard) return {0, samples};
  const std::int64_t chunk = chunk_of(block);
  const RunState::Range part = part_of(*shard, samples, chunk);
  if (part.first < part.second) return part;
  const std::int64_t chunks = (samples - 1) / chunk + 1;
  throw BadRequest({Field{"shard"}, " = " + text_of(*shard) + " (" + counted(samples, "sample") + are(samples) +
                                        " only " + counted(chunks, "chunk") + " of " + std::to_string(chunk) +
                                        "); take fewer shards"});
}

using NamedShards = std::vector<std::pair<std::string, KeptRun>>;

// A sample in two of the files, which is most often one file twice.
void refuse_twice(const NamedShards& shards, std::size_t at) {
  const auto& [name, kept] = shards[at];
  for (std::size_t i = 0; i < at; ++i) {
    const auto& [before, other] = shards[i];
    if (!kept.sums || !other.sums) continue;
    const std::int64_t first = std::max(kept.sums->first(), other.sums->first());
    if (first >= std::min(kept.sums->last(), other.sums->last())) continue;
    throw BadPart("'" + name + "': " + (name == before ? "given twice" : "holds samples of '" + before + "'") +
                  ", so that both results hold sample " + std::to_string(first) +
                  " (a sample may count once only); give each shard once");
  }
}

// The shards behind some gaps: those that no file is of, and the files that are not finished. Nothing where the files are
// of several splits.
std::string behind(const std::vector<RunState::Range>& gaps, const NamedShards& shards, const RunRequest& whole) {
  const std::optional<Shard>& split = shards.front().second.request.shard;
  if (!split) return "";
  std::vector<std::string> names(static_cast<std::size_t>(split->of));
  for (const auto& [name, kept] : shards) {
    const std::optional<Shard>& shard = kept.request.shard;
    if (!shard || shard->of != split->of) return "";
    names[static_cast<std::size_t>(shard->index - 1)] = "unfinished '" + name + "'";
  }
  const std::int64_t block = whole.shape.block;
  const std::int64_t samples = debias::detail::whole_blocks(*whole.sampling.samples, block);
  constexpr std::int64_t most_named = 4;
  std::int64_t found = 0;
  std::string text;
  for (std::int64_t i = 1; i <= split->of; ++i) {
    const RunState::Range part = part_of({i, split->of}, samples, chunk_of(block));
    const bool has_gap = std::any_of(gaps.begin(), gaps.end(), [&part](const RunState::Range& gap) {
      return gap.first < part.second && part.first < gap.second;
    });
    if (!has_gap || ++found > most_named) continue;
    const std::string& name = names[static_cast<std::size_t>(i - 1)];
    text += (text.empty() ? ": " : ", ") +
            (name.empty() ? "shard " + std::to_string(i) + "/" + std::to_string(split->of) : name);
  }
  return text + (found > most_named ? " and more" : "");
}

// The shape that names a choice, with nothing left to what is declared or to a pilot.
Shape shape_of(const catalog::Choice& choice) {
  if (!choice.special.empty()) return {.estimator = Estimator{.special = choice.special}};
  Shape shape{.estimator = Estimator{choice.method}, .base_level = choice.base_level, .block = choice.block};
  if (choice.points == Points::nets) shape.points = choice.points;
  if (choice.method != catalog::Method::truncated) shape.pmf = choice.pmf;
  return shape;
}

}  // namespace

RunRequest settled(const RunRequest& request) {
  RunRequest r = request;
  check_shard(r);
  const Plan plan = plan_of(r.sampling);
  if (!plan.goal.asked()) check_block(r.shape, plan.samples);
  if (r.shape.by_recipe()) {
    recipe_of(r.shape, *r.problem);
  } else {
    r.shape = shape_of(choice_of(r.shape, *r.problem));
  }
  if (!plan.goal.asked()) r.sampling.samples = std::max(plan.samples, r.shape.block);
  range_of(r.shard, plan.samples, r.shape.block);
  return r;
}

RunReport run(const RunRequest& request, const Watch& watch, const Earlier& earlier, const SaveRun& save) {
  check_shard(request);
  const catalog::Problem& problem = *request.problem;
  const bool by_recipe = request.shape.by_recipe();
  catalog::Choice choice;
  RecipeOptions options;
  by_recipe ? void(options = recipe_of(request.shape, problem)) : void(choice = choice_of(request.shape, problem));
  Plan plan = plan_of(request.sampling);
  const Goal goal = plan.goal;
  if (!goal.asked() && !by_recipe && !earlier.sums) check_block(request.shape, plan.samples);
  const Caller caller{watch};
  double total = 0;
  plan.progress = [&](std::int64_t done) { return caller.goes_on(problem.id, static_cast<double>(done), total); };
  std::optional<Advice> advice;
  if (by_recipe) {
    advice = advise(levels_of(problem), plan, options);
    choice = {advice->base == Base::every_sample ? catalog::Method::single_term : catalog::Method::single_term_outcome,
              advice->pmf,
              advice->base_level,
              "",
              advice->block,
              advice->points};
    plan = debias::detail::plan_of(plan, *advice);
  }

  RunRequest now = request;
  if (advice) {
    now.shape = shape_of(choice);
    now.doubts = advice->warnings;
  }
  if (earlier.sums) {
    plan.earlier = earlier.sums;
    if (goal.asked()) plan.samples = earlier.samples;
  }
  if (!goal.asked()) {
    plan.samples = std::max(plan.samples, choice.block);  // one block at least, where the request names none
    now.sampling.samples = plan.samples;
    const auto [first, last] = range_of(request.shard, plan.samples, choice.block);
    plan.whole = plan.samples;
    plan.first = first;
    plan.samples = last - first;
  }
  if (save) {
    plan.save = [&](const RunState& sums, const Plan& drawn) {
      if (goal.asked()) {
        now.sampling.samples = drawn.samples;
        now.sampling.goal = {};
        now.served = goal;
      }
      save(now, sums);
    };
  }
  total = plan.goal.asked() ? 0 : static_cast<double>(plan.samples);
  const DeclaredFiniteness verdict = verdict_of(problem, choice);
  Statistics statistics = problem.run(choice, plan);
  if (advice) statistics.goal = goal;
  debias::detail::add_new(statistics.warnings, now.doubts);
  if (choice.base_level < problem.lowest_base) {
    statistics.warnings.push_back(
        {WarningCode::base_level,
         "the base level lies below " + std::to_string(problem.lowest_base) +
             ", where the fourth moment of a level is infinite and the standard error is not to be trusted."});
  }
  if (request.served.asked()) statistics.goal = request.served;
  RunVerdict evidence = statistics.verdict();
  drop_answered(statistics, evidence);
  const Interval interval = statistics.interval(evidence, request.confidence);
  const double z =
      (statistics.components.front().mean - problem.truth) / validation::believed_error(statistics, problem.truth);
  return {&problem, choice, std::move(advice), std::move(statistics), std::move(evidence), interval, verdict, z};
}

std::pair<RunRequest, Earlier> extended(const ResumeRequest& request) {
  const Field samples_field{"samples"};
  RunRequest r = request.kept.request;
  const bool longer = request.goal.asked() || request.samples;
  if (longer && r.shard) {
    throw BadRequest({"resume: a shard ends where the next one begins; merge the shards, then extend the union"});
  }
  plan_of({.samples = request.samples, .goal = request.goal});  // says what is wrong
  const Earlier earlier{request.kept.sums, r.sampling.samples.value_or(0)};
  if (request.goal.asked()) {
    r.sampling.goal = request.goal;
    r.sampling.samples.reset();
    r.served = {};
  } else if (request.samples) {
    const std::int64_t held = earlier.sums ? earlier.sums->last() : 0;
    if (debias::detail::whole_blocks(*request.samples, earlier.sums ? earlier.sums->block() : 1) < held) {
      throw BadRequest({samples_field, " = '" + std::to_string(*request.samples) + "' (the file holds " +
                                           counted(held, "sample") +
                                           " already, and none is thrown away); ask for more"});
    }
    r.sampling.goal = {};
    r.sampling.samples = request.samples;
    r.served = {};
  }
  r.sampling.threads = request.threads;
  r.sampling.ranks = request.ranks;
  return {r, earlier};
}

KeptRun merged(const MergeRequest& request) {
  KeptRun whole;
  RunState sums;
  std::vector<Warning> doubts;
  bool any = false;
  for (std::size_t at = 0; at < request.shards.size(); ++at) {
    const auto& [name, kept] = request.shards[at];
    RunRequest shard = kept.request;
    try {
      check_shard(shard);
    } catch (const BadRequest& e) {
      throw BadPart("'" + name + "': " + e.what());
    }
    shard.shard.reset();
    // A doubt of a pilot's seconds is not in every shard.
    debias::detail::add_new(doubts, std::exchange(shard.doubts, {}));
    if (whole.request.problem == nullptr) {
      whole.request = shard;
    } else if (!request.same(whole.request, shard)) {
      throw BadPart("'" + name + "': of another run than '" + request.shards.front().first +
                    "': problem, options, seed and samples must be the same");
    }
    if (!kept.sums) continue;
    refuse_twice(request.shards, at);
    try {
      any ? sums.merge(*kept.sums) : void(sums = *kept.sums);
    } catch (const std::invalid_argument& e) {
      throw BadPart("'" + name + "': " + e.what());
    }
    any = true;
  }
  if (!whole.request.sampling.samples || !any) throw BadPart("merge: none of the files has a finished sample");
  const std::int64_t samples = *whole.request.sampling.samples;
  const auto gaps = sums.missing({0, samples});
  if (!gaps.empty()) {
    std::string missing;
    for (std::size_t i = 0; i < gaps.size() && i < 4; ++i) {
      missing += (i > 0 ? ", [" : "[") + std::to_string(gaps[i].first) + ", " + std::to_string(gaps[i].second) + ")";
    }
    throw BadPart("merge: of " + counted(samples, "sample") + " " + missing + (gaps.size() > 4 ? " and more" : "") +
                  " are missing" + behind(gaps, request.shards, whole.request) +
                  "; add the other shards, or finish them with `debias resume`");
  }
  whole.sums = std::make_shared<RunState>(std::move(sums));
  whole.request.doubts = std::move(doubts);
  return whole;
}

void print(std::ostream& out, const RunReport& run, bool full) {
  const Statistics& s = run.statistics;
  print_line(out, "problem", title(*run.problem));
  full ? print_full(out, s) : void(out << s);
  if (run.interval.confidence != 0.95) {
    const int digits = digits_of_ends(run.interval.low, run.interval.high);
    print_line(out, "interval",
               rounded(100 * run.interval.confidence, 10) + " % [" + rounded(run.interval.low, digits) + ", " +
                   rounded(run.interval.high, digits) + "]");
  }
  if (!std::isnan(run.z)) {
    print_line(out, "truth", rounded(run.problem->truth, 15) + ", z = " + rounded(run.z, 3));
  }
  const catalog::Choice& c = run.choice;
  // What the standard error does not hold, or a sample does not have, belongs to any report.
  const bool plain = run.verdict.finite_variance && run.verdict.finite_work && c.method != catalog::Method::truncated &&
                     c.special.empty();
  if ((full || !plain) && !run.verdict.sentence.empty()) print_line(out, "declared", run.verdict.sentence);
  if (!full) {
    if (run.advice) debias::detail::print_points(out, *run.advice);
    return;
  }
  const std::string pmf = pmf_text(c);
  if (run.advice) {
    debias::detail::print_chosen(out, *run.advice);
  } else if (!pmf.empty()) {  // a run that is resumed has the PMF of its recipe
    print_line(out, "pmf", pmf);
  }
  if (run.problem->id.empty()) return;
  const std::string shape = " --base-level " + std::to_string(c.base_level) + " --block " + std::to_string(c.block) +
                            (c.points == Points::nets ? " --points nets" : "");
  print_line(out, "replay",
             "debias replay " + run.problem->id + " --estimator " + std::string(catalog::name_of(c)) +
                 (pmf.empty() ? "" : " --pmf '" + pmf + "'") + (c.special.empty() ? shape : "") + " --seed " +
                 std::to_string(s.seed) + " --sample I");
}

Fields fields(const RunReport& run) {
  const Statistics& s = run.statistics;
  const ComponentEstimate& c = s.components.front();
  Fields f = describe(*run.problem, run.choice);
  append(f, {{"mean", c.mean}, {"standard_error", c.standard_error}, {"interval", describe(run.interval)}});
  if (s.components.size() > 1) {
    List components;
    for (std::size_t i = 0; i < s.components.size(); ++i) {
      const Interval interval = s.interval(run.evidence, run.interval.confidence, i);
      components.emplace_back(Fields{{"mean", s.components[i].mean},
                                     {"standard_error", s.components[i].standard_error},
                                     {"low", interval.low},
                                     {"high", interval.high}});
    }
    f.push_back({"components", std::move(components)});
  }
  if (!s.name.empty()) f.push_back({"name", s.name});
  append(f, {{"bias_bound", Fields{{"size", s.bias_bound.size}, {"sentence", s.bias_bound.sentence}}},
             {"samples", s.samples},
             {"blocks", s.blocks},
             {"work", s.work},
             {"seconds", s.seconds},
             {"pilot_work", s.pilot_work},
             {"pilot_seconds", s.pilot_seconds},
             {"efficiency", s.efficiency()},
             {"seed", s.seed},
             {"truth", run.problem->truth},
             {"z", run.z},
             {"verdict", Fields{{"finite_variance", run.verdict.finite_variance},
                                {"finite_work", run.verdict.finite_work},
                                {"tail_index", run.verdict.tail_index},
                                {"sentence", run.verdict.sentence}}}});
  if (s.nonfinite == 0 && s.blocks > 1) f.push_back({"evidence", describe(run.evidence)});
  append(f, {{"coupling", describe(s.coupling)},
             {"warnings", s.warnings},
             {"nonfinite", s.nonfinite},
             {"goal", describe_goal(s)},
             {"recipe", run.advice ? Node(describe(*run.advice)) : Node(nullptr)},
             {"status", status_of(s)},
             {"levels", list_of(s.levels, [](const LevelRow& row) { return describe(row); })},
             {"largest", list_of(s.largest, [](const LargeSample& l) {
                return Fields{{"index", l.index}, {"level", l.level}, {"value", l.value}};
              })}});
  append(f, versions());
  return f;
}

}  // namespace debias::commands

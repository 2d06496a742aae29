// run --checkpoint, resume and merge: the same run as ever, with its finished chunks on disk; resume also calls the
// other commands that keep their parts.

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "../core/checkpoint.hpp"
#include "../core/ranks.hpp"
#include "../core/text.hpp"
#include "commands.hpp"
#include "output.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

const std::string part = "run";
constexpr std::string_view multilevel = "multilevel";

struct KeptRun {
  Arguments words;
  std::optional<RunState> state;
};

Parts parts_of(const RunState& state) { return {{part, encode(state)}}; }

// True for a command whose parts are as long as its words say: any but the run of one estimator.
bool has_parts(const Loaded& file) { return file.command != "run" || file.arguments.estimator == multilevel; }

std::string command_of(const Loaded& file) {
  return "`debias " + file.command + (file.command == "run" && has_parts(file) ? " --estimator multilevel" : "") + "`";
}

KeptRun run_in(const std::string& path, Loaded file) {
  if (has_parts(file))
    throw FileError("'" + path + "': of " + command_of(file) + "; only the shards of a run can be merged");
  KeptRun run{std::move(file.arguments), std::nullopt};
  const auto contents = file.parts.find(part);
  if (contents == file.parts.end()) return run;
  try {
    run.state = decode(contents->second);
  } catch (const std::invalid_argument& e) {
    throw FileError("'" + path + "': " + e.what());
  }
  return run;
}

std::string text_of(const Arguments& a) { return text_of("run", a); }

// The estimator, with nothing left to what is declared or to a pilot.
void spell_out(Arguments& words, const catalog::Choice& choice) {
  words.estimator = std::string(name_of(choice));
  if (!choice.special.empty()) return;
  if (!law_text(choice).empty()) words.law = law_text(choice);
  words.base_level = std::to_string(choice.base_level);
  words.block = std::to_string(choice.block);
}

bool has_goal(const Arguments& a) { return a.error != "none" || a.relative_error != "none" || a.time != "none"; }

// The samples of a shard, "2/5": whole chunks of any estimator, the end of the run to the last one.
RunState::Range range_of(const Arguments& a, std::int64_t samples) {
  if (a.shard.empty()) return {0, samples};
  const std::size_t slash = a.shard.find('/');
  if (slash == std::string::npos) {
    throw std::invalid_argument("--shard = '" + a.shard + "' (must be I/N); write 1/4 for the first of four");
  }
  const auto n = static_cast<std::int64_t>(parse_count(a.shard.substr(slash + 1), "--shard, N", 1, 1 << 20));
  const auto i =
      static_cast<std::int64_t>(parse_count(a.shard.substr(0, slash), "--shard, I", 1, static_cast<std::uint64_t>(n)));
  constexpr std::int64_t chunk = default_chunk;
  const std::int64_t chunks = (samples - 1) / chunk + 1;
  const auto cut = [&](std::int64_t k) {
    return k == n ? samples : (chunks / n * k + std::min(chunks % n, k)) * chunk;
  };
  if (cut(i - 1) < cut(i)) return {cut(i - 1), cut(i)};
  throw std::invalid_argument("--shard = '" + a.shard + "' (" + std::to_string(samples) + " samples are only " +
                              std::to_string(chunks) + " chunks of " + std::to_string(chunk) + "); take fewer shards");
}

// True on the one process that touches files.
bool leads(const Arguments& a) { return a.ranks == nullptr || a.ranks->leads(); }

// A file is written over by its own run only.
void refuse_existing(const Arguments& a) {
  struct stat status = {};
  if (!leads(a) || stat(a.checkpoint.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return;
  load(a.checkpoint);  // says what is wrong with it
  throw FileError("--checkpoint '" + a.checkpoint + "': holds a run already; go on with `debias resume " +
                  a.checkpoint + "`, or choose another name");
}

// Runs what the words say from the state on. `path` may be empty. A `pilot` fixes the samples. The text on disk is the one
// given until the first samples are there, and then that of the very run: its law and its samples.
int go_on(KeptRun run, const Arguments& how, const std::string& path, const std::string& text, bool pilot,
          std::int64_t least_samples) {
  const catalog::Problem& problem = catalog::find(run.words.problem);
  keep_apart(how.output, path);
  Output out(how.output);
  Progress progress(how.quiet);
  Arguments asked = run.words;
  asked.threads = how.threads;
  asked.ranks = how.ranks;
  std::optional<Goal> goal;
  if (!pilot && has_goal(asked)) {  // its samples are known
    Arguments wish = asked;
    wish.samples = "auto";
    goal = read_plan(wish).goal;
    asked.error = asked.relative_error = asked.time = "none";
  } else if (pilot) {
    asked.samples = "auto";
  }
  std::optional<CheckpointWriter> writer;
  if (!path.empty() && leads(how)) writer.emplace(path, text, run.state ? parts_of(*run.state) : Parts());
  bool named = false;
  const bool asks_anew = text != text_of(run.words);
  const auto prepare = [&](const catalog::Choice& choice, const Advice* advice, Plan& plan) {
    if (run.state) {
      plan.earlier = std::make_shared<RunState>(*run.state);
      if (pilot) plan.samples = least_samples;
    }
    const std::int64_t samples = plan.samples;
    if (!pilot) {
      const auto [first, last] = range_of(asked, samples);
      plan.first = first;
      plan.samples = last - first;
      plan.whole = samples;
    }
    if (advice != nullptr) spell_out(run.words, choice);
    if (!writer) return;
    named = !pilot && advice == nullptr;
    plan.save = [&, samples](const RunState& state, const Plan& now) {
      if (named) return writer->save(parts_of(state));
      run.words.samples = std::to_string(pilot ? now.samples : samples);
      writer->restart(text_of(run.words), parts_of(state));
      named = true;
    };
  };
  try {
    Run result = prepared_run_of(problem, asked, watch_on(progress), prepare);
    progress.erase();
    if (goal) result.statistics.goal = *goal;
    return finish(result, how, out);
  } catch (const Interrupted&) {
    if (writer) {
      complain("what is finished is on disk; go on with `debias resume " + path + "`" +
               (asks_anew && !named ? ", and ask for the new goal again" : ""));
    }
    throw;
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

int run_with_checkpoint(const Arguments& arguments) {
  const std::string& path = arguments.checkpoint;
  if (path.empty()) {
    throw std::invalid_argument("--shard (its part is of use only in a file); write --checkpoint FILE");
  }
  if (!arguments.shard.empty() && has_goal(arguments)) {
    throw std::invalid_argument("--shard (a goal fixes the samples late, and shards share them); write --samples");
  }
  const catalog::Problem& problem = catalog::find(arguments.problem);
  const Plan plan = read_plan(arguments);
  Arguments w = arguments;
  w.output.clear();
  w.problem = problem.id;
  wants_recipe(arguments) ? void(read_recipe(arguments, problem)) : spell_out(w, read_choice(arguments, problem));
  w.seed = std::to_string(plan.seed);
  if (!plan.goal.asked()) w.samples = std::to_string(plan.samples);
  range_of(w, plan.samples);
  refuse_existing(arguments);
  try {
    return go_on({w, std::nullopt}, arguments, path, text_of(w), plan.goal.asked(), 0);
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

struct Kept {
  const char* name;
  int (*execute)(const Arguments&);
};
constexpr std::array<Kept, 5> commands = {{{"run", run_multilevel},
                                           {"validate", validate},
                                           {"tradeoff", tradeoff},
                                           {"render transmittance", render_transmittance},
                                           {"render photons", render_photons}}};

int resume_parts(const Loaded& file, const Arguments& arguments) {
  if (arguments.ranks != nullptr) {
    throw std::invalid_argument("resume: (ranks can share a run of one estimator only, '" + arguments.file +
                                "' is of " + command_of(file) + "); start it without mpirun");
  }
  if (has_goal(arguments) || arguments.samples != "auto") {
    throw std::invalid_argument("resume: (only a run can be made longer, '" + arguments.file + "' is of " +
                                command_of(file) + "); leave the wish out");
  }
  for (const Kept& command : commands) {
    if (file.command != command.name) continue;
    Arguments a = file.arguments;
    a.checkpoint = arguments.file;
    a.resumed = &file;
    a.threads = arguments.threads;
    a.json = arguments.json;
    if (a.json) a.csv = false;
    a.quiet = arguments.quiet;
    if (!arguments.output.empty()) a.output = arguments.output;
    return command.execute(a);
  }
  throw FileError("'" + arguments.file + "': no command '" + file.command + "'");
}

}  // namespace

int run(const Arguments& arguments) {
  if (arguments.estimator == multilevel) return run_multilevel(arguments);
  return arguments.checkpoint.empty() && arguments.shard.empty() ? run_at_once(arguments)
                                                                 : run_with_checkpoint(arguments);
}

int resume(const Arguments& arguments) {
  Loaded loaded = load(arguments.file, arguments.ranks);
  if (has_parts(loaded)) return resume_parts(loaded, arguments);
  KeptRun file = run_in(arguments.file, std::move(loaded));
  Arguments w = file.words;
  const bool new_goal = has_goal(arguments);
  const bool new_samples = arguments.samples != "auto";
  if ((new_goal || new_samples) && !w.shard.empty()) {
    throw std::invalid_argument(
        "resume: a shard ends where the next one begins; merge the shards, then extend the union");
  }
  if (new_goal && new_samples) read_plan(arguments);  // says what is wrong
  bool pilot = w.samples == "auto";                   // killed before its pilot had ended
  if (new_goal) {
    w.error = arguments.error;
    w.relative_error = arguments.relative_error;
    w.time = arguments.time;
    pilot = true;
  } else if (new_samples) {
    w.error = w.relative_error = w.time = "none";
    w.samples = std::to_string(read_plan(arguments).samples);
    pilot = false;
    const std::int64_t held = file.state ? file.state->last() : 0;
    if (read_plan(w).samples < held) {
      throw std::invalid_argument("--samples = '" + arguments.samples + "' (the file holds " + std::to_string(held) +
                                  " samples already, and none is thrown away); ask for more");
    }
  }
  std::int64_t least = 0;
  if (file.words.samples != "auto") {
    least = static_cast<std::int64_t>(
        parse_count(file.words.samples, "samples", 1, std::numeric_limits<std::int64_t>::max()));
  }
  const std::string text = text_of(new_goal ? file.words : w);  // no goal whose samples are not known
  file.words = std::move(w);
  try {
    return go_on(std::move(file), arguments, arguments.file, text, pilot, least);
  } catch (const std::system_error& e) {
    throw FileError(e.what());
  }
}

int merge(const Arguments& arguments) {
  KeptRun whole;
  std::string text;
  for (const std::string& path : arguments.problems) {
    keep_apart(arguments.output, path);
    KeptRun shard = run_in(path, load(path));
    shard.words.shard.clear();
    if (text.empty()) {
      whole.words = shard.words;
      text = text_of(whole.words);
    } else if (text != text_of(shard.words)) {
      throw FileError("'" + path + "': of another run than '" + arguments.problems.front() +
                      "': " + "problem, options, seed and samples must be the same");
    }
    if (!shard.state) continue;
    if (!whole.state) {
      whole.state = std::move(shard.state);
      continue;
    }
    try {
      whole.state->merge(*shard.state);
    } catch (const std::invalid_argument& e) {
      throw FileError("'" + path + "': " + e.what());
    }
  }
  if (whole.words.samples == "auto" || !whole.state) throw FileError("merge: none of the files has a finished sample");
  Arguments asked = whole.words;
  asked.error = asked.relative_error = asked.time = "none";
  const std::int64_t samples = read_plan(asked).samples;
  const auto gaps = whole.state->missing({0, samples});
  if (!gaps.empty()) {
    std::string missing;
    for (std::size_t i = 0; i < gaps.size() && i < 4; ++i) {
      missing += (i > 0 ? ", [" : "[") + std::to_string(gaps[i].first) + ", " + std::to_string(gaps[i].second) + ")";
    }
    throw FileError("merge: of " + std::to_string(samples) + " samples " + missing +
                    (gaps.size() > 4 ? " and more" : "") +
                    " are missing; add the other shards, or finish them with `debias resume`");
  }
  refuse_existing(arguments);
  try {
    return go_on(std::move(whole), arguments, arguments.checkpoint, text, false, 0);
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

}  // namespace debias::cli

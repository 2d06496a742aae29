// run --checkpoint, resume and merge: the same run as ever, with its finished chunks on disk.

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
#include "../core/text.hpp"
#include "commands.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

constexpr std::array<std::pair<const char*, std::string Arguments::*>, 11> words = {{
    {"problem", &Arguments::problem},
    {"estimator", &Arguments::estimator},
    {"law", &Arguments::law},
    {"base_level", &Arguments::base_level},
    {"block", &Arguments::block},
    {"seed", &Arguments::seed},
    {"samples", &Arguments::samples},
    {"error", &Arguments::error},
    {"relative_error", &Arguments::relative_error},
    {"time", &Arguments::time},
    {"confidence", &Arguments::confidence},
}};

std::string text_of(const Arguments& a) {
  std::string text = std::string("version=") + DEBIAS_VERSION + "\n";
  for (const auto& [name, member] : words) text += std::string(name) + "=" + a.*member + "\n";
  return text + "shard=" + a.shard + "\n";
}

// The words of a file; throws std::invalid_argument where they are not those of text_of.
Arguments arguments_of(const std::string& text) {
  Arguments a;
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  const auto value = [&](std::size_t i, const std::string& name) {
    if (i < lines.size() && lines[i].compare(0, name.size() + 1, name + "=") == 0) return lines[i].substr(name.size() + 1);
    throw std::invalid_argument("no checkpoint of `debias run`: no " + name);
  };
  const std::string version = value(0, "version");
  if (version != DEBIAS_VERSION) {
    throw std::invalid_argument("written by debias " + version + ", this is " DEBIAS_VERSION +
                                " (another version may draw other samples)");
  }
  for (std::size_t i = 0; i < words.size(); ++i) a.*words[i].second = value(i + 1, words[i].first);
  a.shard = value(words.size() + 1, "shard");
  return a;
}

struct Loaded {
  Arguments arguments;
  std::optional<RunState> state;
};

Loaded load(const std::string& path) {
  try {
    Checkpoint file = read_checkpoint(path);
    if (file.dropped > 0) {
      complain("warning: '" + path + "': its last " + std::to_string(file.dropped) +
               " bytes are no whole record and are left out");
    }
    return {arguments_of(file.text), std::move(file.state)};
  } catch (const std::invalid_argument& e) {
    throw FileError("'" + path + "': " + e.what());
  } catch (const std::system_error& e) {
    throw FileError(e.what());
  }
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
  const auto i = static_cast<std::int64_t>(
      parse_count(a.shard.substr(0, slash), "--shard, I", 1, static_cast<std::uint64_t>(n)));
  constexpr std::int64_t chunk = default_chunk;
  const std::int64_t chunks = (samples - 1) / chunk + 1;
  const auto cut = [&](std::int64_t k) {
    return k == n ? samples : (chunks / n * k + std::min(chunks % n, k)) * chunk;
  };
  if (cut(i - 1) < cut(i)) return {cut(i - 1), cut(i)};
  throw std::invalid_argument("--shard = '" + a.shard + "' (" + std::to_string(samples) + " samples are only " +
                              std::to_string(chunks) + " chunks of " + std::to_string(chunk) + "); take fewer shards");
}

// Runs what the words say from `earlier` on. `path` may be empty.
int go_on(Arguments words_of_run, const Arguments& how, const std::string& path, std::optional<RunState> earlier,
          bool pilot, std::int64_t least_samples) {
  const catalog::Problem& problem = catalog::find(words_of_run.problem);
  Output out(how.output);
  Progress progress(how.quiet);
  Arguments asked = words_of_run;
  asked.threads = how.threads;
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
  if (!path.empty()) writer.emplace(path, text_of(words_of_run), earlier ? &*earlier : nullptr);
  const auto prepare = [&](Plan& plan) {
    if (earlier) {
      plan.earlier = std::make_shared<RunState>(*earlier);
      if (pilot) plan.samples = least_samples;
    }
    if (!pilot) {
      const auto [first, last] = range_of(asked, plan.samples);
      plan.first = first;
      plan.samples = last - first;
    }
    if (!writer) return;
    plan.save = [&, named = !pilot](const RunState& state, const Plan& now) mutable {
      if (named) return writer->save(state);
      words_of_run.samples = std::to_string(now.samples);
      writer.emplace(path, text_of(words_of_run), &state);
      named = true;
    };
  };
  try {
    Run result = prepared_run_of(problem, asked, watch_on(progress), prepare);
    progress.erase();
    if (goal) result.statistics.goal = *goal;
    return finish(result, how, out);
  } catch (const Interrupted&) {
    if (writer) complain("what is finished is on disk; go on with `debias resume " + path + "`");
    throw;
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

}  // namespace

int run_with_checkpoint(const Arguments& arguments) {
  const std::string& path = arguments.checkpoint;
  if (path.empty()) {
    throw std::invalid_argument("--shard (its part is of use only in a file); write --checkpoint FILE");
  }
  if (wants_recipe(arguments) || arguments.estimator == "multilevel") {
    throw std::invalid_argument(
        "--checkpoint: (a run with --law auto or multilevel has stages that it does not keep); run with the law that "
        "`debias run --law auto` prints");
  }
  if (!arguments.shard.empty() && has_goal(arguments)) {
    throw std::invalid_argument("--shard (a goal fixes the samples late, and shards share them); write --samples");
  }
  const catalog::Problem& problem = catalog::find(arguments.problem);
  const catalog::Choice choice = read_choice(arguments, problem);
  const Plan plan = read_plan(arguments);
  Arguments w = arguments;
  w.problem = problem.id;
  w.estimator = std::string(name_of(choice));
  if (!law_text(choice).empty()) w.law = law_text(choice);
  if (choice.special.empty()) w.base_level = std::to_string(choice.base_level);
  w.seed = std::to_string(plan.seed);
  if (!plan.goal.asked()) w.samples = std::to_string(plan.samples);
  range_of(w, plan.samples);
  struct stat status = {};
  if (stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode)) {
    const std::string there = text_of(load(path).arguments);
    throw FileError("--checkpoint '" + path + "': " +
                    (there == text_of(w) ? "holds this run already; go on with `debias resume " + path + "`"
                                         : "holds another run; choose another name"));
  }
  try {
    return go_on(w, arguments, path, std::nullopt, plan.goal.asked(), 0);
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

int resume(const Arguments& arguments) {
  Loaded file = load(arguments.file);
  Arguments w = file.arguments;
  const bool new_goal = has_goal(arguments);
  const bool new_samples = arguments.samples != "auto";
  if ((new_goal || new_samples) && !w.shard.empty()) {
    throw std::invalid_argument("resume: a shard ends where the next one begins; merge the shards, then extend the union");
  }
  if (new_goal && new_samples) read_plan(arguments);  // says what is wrong
  bool pilot = w.samples == "auto";  // killed before its pilot had ended
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
  if (file.arguments.samples != "auto") {
    least = static_cast<std::int64_t>(parse_count(file.arguments.samples, "samples", 1, std::numeric_limits<std::int64_t>::max()));
  }
  try {
    return go_on(w, arguments, arguments.file, std::move(file.state), pilot, least);
  } catch (const std::system_error& e) {
    throw FileError(e.what());
  }
}

int merge(const Arguments& arguments) {
  std::optional<RunState> whole;
  Arguments w;
  std::string text;
  for (const std::string& path : arguments.problems) {
    Loaded part = load(path);
    part.arguments.shard.clear();
    if (text.empty()) {
      w = part.arguments;
      text = text_of(w);
    } else if (text != text_of(part.arguments)) {
      throw FileError("'" + path + "': of another run than '" + arguments.problems.front() + "': " +
                      "problem, options, seed and samples must be the same");
    }
    if (!part.state) continue;
    if (!whole) {
      whole = std::move(part.state);
      continue;
    }
    try {
      whole->merge(*part.state);
    } catch (const std::invalid_argument& e) {
      throw FileError("'" + path + "': " + e.what());
    }
  }
  if (w.samples == "auto" || !whole) throw FileError("merge: none of the files has a finished sample");
  Arguments asked = w;
  asked.error = asked.relative_error = asked.time = "none";
  const std::int64_t samples = read_plan(asked).samples;
  const auto gaps = whole->missing({0, samples});
  if (!gaps.empty()) {
    std::string missing;
    for (std::size_t i = 0; i < gaps.size() && i < 4; ++i) {
      missing += (i > 0 ? ", [" : "[") + std::to_string(gaps[i].first) + ", " + std::to_string(gaps[i].second) + ")";
    }
    throw FileError("merge: of " + std::to_string(samples) + " samples " + missing + (gaps.size() > 4 ? " and more" : "") +
                    " are missing; add the other shards, or finish them with `debias resume`");
  }
  try {
    return go_on(w, arguments, arguments.checkpoint, std::move(whole), false, 0);
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

}  // namespace debias::cli

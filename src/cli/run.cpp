// run, resume and merge: the same run as ever, with its finished chunks on disk; resume also calls the other commands that
// keep their parts.

#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "commands/pictures.hpp"
#include "commands/text.hpp"
#include "core/run_state_bytes.hpp"
#include "core/text.hpp"
#include "execute.hpp"
#include "session.hpp"

namespace debias::cli {
namespace {

using commands::KeptRun;
using commands::RunReport;
using commands::RunRequest;

const std::string part = "run";

Parts parts_of(const RunState& sums) { return {{part, encode(sums)}}; }

std::string text_of(const RunRequest& request, const Delivery& delivery = {}) {
  return text_of(saved(request), delivery);
}

// Prints the result; the exit code.
int finish(const RunReport& report, const Delivery& delivery, Output& out) {
  if (!report.verdict.finite_work && !delivery.quiet) complain("warning: " + report.verdict.sentence);
  deliver(report, delivery, out);
  const Statistics& s = report.statistics;
  if (out.is_file() && !delivery.quiet) {
    Output summary;
    const ComponentEstimate& c = s.components.front();
    summary.stream() << report.problem->id << ' ' << report.problem->name << ": "
                     << with_error(c.mean, c.standard_error) << ", z = " << commands::rounded(report.z, 3) << ", "
                     << counted(s.samples, "sample") << ", seed " << std::to_string(s.seed) << '\n';
    summary.flush();
  }
  if (s.nonfinite == 0 && s.goal_met()) return done;
  if (s.nonfinite == 0) {
    complain(s.goal.seconds == 0 && s.total_error() <= s.goal_error() / 2
                 ? "the goal is missed: the stated bias is most of the error, and more samples do not change it"
                 : "the goal is missed: the pilot saw less variance, or faster samples, than the run");
    return goal_missed;
  }
  complain(std::to_string(s.nonfinite) + " of " +
           (s.block > 1 ? counted(s.blocks, "block") + " of " + std::to_string(s.block) + " samples"
                        : counted(s.samples, "sample")) +
           are(s.nonfinite) + " not finite; replay the first with --seed " + std::to_string(s.seed) + " --sample " +
           std::to_string(s.first_nonfinite));
  return nonfinite_samples;
}

// ---- files

// True for a command whose parts are as long as its words say: any but the run of one estimator.
bool is_multilevel(const Loaded& file) {
  const auto at = file.saved.words.values.find("estimator");
  return file.saved.command == "run" && at != file.saved.words.values.end() && at->second == "multilevel";
}
bool has_parts(const Loaded& file) { return file.saved.command != "run" || is_multilevel(file); }

std::string command_of(const Loaded& file) {
  return "`debias " + file.saved.command + (is_multilevel(file) ? " --estimator multilevel" : "") + "`";
}

// What the disk refuses, as a complaint about this path or option.
template <class F>
auto on_disk(const std::string& where, const F& f) {
  try {
    return f();
  } catch (const std::system_error& e) {
    throw FileError(where + e.what());
  }
}

KeptRun run_in(const std::string& path, const Loaded& file) {
  if (has_parts(file)) {
    throw FileError("'" + path + "': of " + command_of(file) + "; only the shards of a run can be merged");
  }
  try {
    KeptRun run{std::get<RunRequest>(read_request(file.saved.command, file.saved.words))};
    const auto contents = file.parts.find(part);
    if (contents != file.parts.end()) run.sums = std::make_shared<RunState>(decode(contents->second));
    return run;
  } catch (const std::invalid_argument& e) {
    throw FileError("'" + path + "': " + e.what());
  }
}

// True on the one process that touches files.
bool leads(const RunRequest& request) { return request.sampling.ranks.leads(); }

// A file is written over by its own run only.
void refuse_existing(const RunRequest& request, const std::string& path) {
  if (!leads(request) || !is_regular_file(path)) return;
  load(path);  // says what is wrong with it
  throw FileError("--checkpoint '" + path + "': holds a run already; go on with `debias resume " + path +
                  "`, or choose another name");
}

// Runs a request from what is there, and keeps it at `path`, if there is one. The text on disk is the one given until the
// first samples are there, and then that of the very run: its PMF and its samples.
int run_and_keep(const RunRequest& request, const commands::Earlier& earlier, const std::string& path, std::string text,
                 const Delivery& delivery) {
  keep_apart(delivery.output, path);
  keep_apart(delivery.plot, path, "--plot");
  Output out(delivery.output);
  Picture plot(delivery.plot, delivery.output);
  Progress progress(delivery.quiet);
  std::optional<PartWriter> writer;
  if (!path.empty() && leads(request)) writer.emplace(path, text, earlier.sums ? parts_of(*earlier.sums) : Parts());
  bool named = text == text_of(request, delivery);
  const auto save = [&](const RunRequest& now, const RunState& sums) {
    std::string latest = text_of(now, delivery);
    if (latest == text) return writer->save(parts_of(sums));
    text = std::move(latest);
    writer->restart(text, parts_of(sums));
    named = true;
  };
  try {
    const RunReport report =
        commands::run(request, watch_samples(progress), earlier, writer ? commands::SaveRun(save) : nullptr);
    if (!delivery.plot.empty()) {  // ranks draw together, and one of them writes
      const auto prefixes = commands::prefixes(request, report, watch_samples(progress));
      if (plot) plot.write(commands::picture(report, prefixes));
    }
    progress.erase();
    return finish(report, delivery, out);
  } catch (const Interrupted&) {
    if (writer) {
      complain("what is finished is on disk; go on with `debias resume " + path + "`" +
               (named ? "" : ", and ask for the new goal again"));
    }
    throw;
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
}

// Where the report goes in which form: as the command was asked for, unless `resume` is.
Delivery wanted(const Loaded& file, Delivery delivery) {
  const Delivery& before = file.delivery;
  if (delivery.output.empty()) delivery.output = before.output;
  delivery.plot = before.plot;
  delivery.csv = before.csv && !delivery.json;
  delivery.json = delivery.json || (before.json && !delivery.full);
  delivery.full = delivery.full || before.full;
  return delivery;
}

// Another command than the run of one estimator: its words again, through the same door.
int resume_parts(const Loaded& file, const Resume& request, const Delivery& delivery) {
  if (request.ranks.size() > 1) {
    throw std::invalid_argument("resume: (ranks can share a run of one estimator only, '" + request.file + "' is of " +
                                command_of(file) + "); start it without mpirun");
  }
  if (request.longer()) {
    throw std::invalid_argument("resume: (only a run can be made longer, '" + request.file + "' is of " +
                                command_of(file) + "); leave the wish out");
  }
  Command command;
  command.delivery = delivery;
  command.delivery.checkpoint = request.file;
  command.delivery.held = std::make_shared<Parts>(file.parts);
  Words words = file.saved.words;
  words.values["threads"] = std::to_string(request.threads);
  try {
    command.request = read_request(file.saved.command, words);
  } catch (const std::invalid_argument& e) {
    throw FileError("'" + request.file + "': " + e.what());
  }
  return execute(command);
}

}  // namespace

int execute(const RunRequest& request, const Delivery& delivery) {
  const std::string& path = delivery.checkpoint;
  if (request.shard && path.empty()) {
    throw std::invalid_argument("--shard (its part is of use only in a file); write --checkpoint FILE");
  }
  if (path.empty()) return run_and_keep(request, {}, path, "", delivery);
  const RunRequest whole = commands::settled(request);
  refuse_existing(request, path);
  return on_disk("--checkpoint: ", [&] { return run_and_keep(whole, {}, path, text_of(whole, delivery), delivery); });
}

int execute(const commands::MultilevelRequest& request, const Delivery& delivery) {
  if (request.ranks.size() > 1 && !delivery.checkpoint.empty()) {
    throw std::invalid_argument(
        "--checkpoint (ranks keep the run of one estimator, not the levels of multilevel); start it without mpirun");
  }
  if (!delivery.plot.empty()) {
    throw std::invalid_argument("--plot (multilevel has no samples to draw the mean of); write `debias survey " +
                                request.problem->id + " --plot` for its levels");
  }
  Session session(saved(request), delivery);
  Output out(delivery.output);
  Progress progress(delivery.quiet);
  const commands::Caller caller = session.caller(watch_samples(progress));
  const commands::MultilevelReport report = session.guard([&] { return commands::multilevel(request, caller); });
  progress.erase();
  session.flush();
  deliver(report, delivery, out);
  if (report.statistics.goal_met()) return done;
  complain(report.statistics.converged ? "the goal is missed: the error as measured is larger"
                                       : "the goal is missed: the levels are not enough");
  return goal_missed;
}

int execute(const Resume& request, const Delivery& typed) {
  const Loaded file = load(request.file, request.ranks);
  const Delivery delivery = wanted(file, typed);
  if (has_parts(file)) return resume_parts(file, request, delivery);
  const KeptRun kept = run_in(request.file, file);
  const auto [run, earlier] = commands::extended({kept, request.samples, request.goal, request.threads, request.ranks});
  // No goal whose samples are not known.
  const std::string text = text_of(request.goal.asked() ? kept.request : run, delivery);
  return on_disk(
      "", [&, &run = run, &earlier = earlier] { return run_and_keep(run, earlier, request.file, text, delivery); });
}

int execute(const Merge& request, const Delivery& delivery) {
  commands::MergeRequest shards;
  for (const std::string& path : request.files) {
    keep_apart(delivery.output, path);
    shards.shards.emplace_back(path, run_in(path, load(path)));
  }
  shards.same = [](const RunRequest& a, const RunRequest& b) { return text_of(a) == text_of(b); };
  const KeptRun whole = commands::merged(shards);
  if (!delivery.checkpoint.empty()) refuse_existing(whole.request, delivery.checkpoint);
  return on_disk("--checkpoint: ", [&] {
    return run_and_keep(whole.request, {whole.sums}, delivery.checkpoint, text_of(whole.request, delivery), delivery);
  });
}

}  // namespace debias::cli

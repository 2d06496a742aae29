#include "command_line.hpp"

#include <deque>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <CLI/CLI.hpp>
#include <debias/core/estimate.hpp>
#include <debias/core/no_pmf.hpp>

#include "commands/describe.hpp"
#include "commands/renamed.hpp"
#include "commands/text.hpp"
#include "core/communicator.hpp"
#include "core/text.hpp"
#include "manual.hpp"

namespace debias::cli {
namespace {

struct Subcommand : Typed {
  CLI::App* app = nullptr;

  CLI::Option* value(const char* field, const char* type, const char* help) {
    return app->add_option(option(field), words.values[field], help)->type_name(type);
  }
  void flag(const char* field, const char* help) { app->add_flag(option(field), words.flags[field], help); }
  void problem() { app->add_option("PROBLEM", words.values["problem"], "Id or name, see `debias list`")->required(); }
};

void add_choice(Subcommand& c) {
  c.problem();
  c.value("estimator", "NAME", "See `debias list estimators`; single_term when there is none");
  c.value("pmf", "PMF", "PMF of the random level, see `debias list pmfs`");
  c.value("block", "N", "Samples of a block of systematic strata; --samples is rounded up to whole blocks");
  c.value("base_level", "M", "Lowest level m; auto is the lowest that behaves");
  c.value("points", "NAME", "Members of a level in a block: plain, or points of nets; a recipe chooses (auto)");
}

void add_plan(Subcommand& c) {
  c.value("samples", "N", "Samples, of each cell for validate, of each level for survey; 1e6 for run");
  c.value("seed", "S", "Any number of 64 bits, or random");
  c.value("threads", "T", "0 takes all cores; the result does not depend on it");
}

void add_goal(Subcommand& c) {
  c.value("error", "X", "As many samples as this standard error takes");
  c.value("relative_error", "X", "The same, in units of the mean");
  c.value("seconds", "T", "As many samples as this many seconds take, 10 or 10s");
}

std::string is_file_name(const std::string& path) {
  if (!path.empty() && path[0] == '=') {
    return "'" + path + "' (a short option takes no =); leave it out, or write ./ before a name that starts with =";
  }
  if (!path.empty() && path[0] != '-') return "";
  return "'" + path + "' (no file name); write one, or ./ before a name that starts with -";
}

void add_checkpoint(
    Subcommand& c, const char* help = "Write what is finished to this file, about once a second, for `debias resume`") {
  c.app->add_option("--checkpoint", c.delivery.checkpoint, help)->type_name("FILE")->check(is_file_name);
}

void add_output(Subcommand& c) {
  c.app->add_option("-o,--output", c.delivery.output, "Write the result to this file")
      ->type_name("FILE")
      ->check(is_file_name);
  c.app->add_flag("-q,--quiet", c.delivery.quiet, "Nothing but the result and errors");
}

void add_plot(Subcommand& c, const std::string& help) {
  c.app->add_option("--plot", c.delivery.plot, "Draw " + help + " into this file")
      ->type_name("FILE.svg")
      ->check(is_file_name);
}

// `debias run`, or `debias` before a command.
std::string typed_so_far(const CLI::App& app) {
  std::string typed = "debias";
  for (const CLI::App* at = &app; !at->get_subcommands().empty();) {
    at = at->get_subcommands().front();
    typed += " " + at->get_name();
  }
  return typed;
}

// CLI11 leaves words that it does not know to us, so that we can name the nearest one.
[[noreturn]] void refuse_words(const CLI::App& app, const std::vector<std::string>& words, const std::string& where) {
  const std::string& word = words.front();
  const std::string name = word.substr(0, word.find('='));
  const std::string value = word != name ? word.substr(name.size() + 1) : words.size() > 1 ? words[1] : "";
  for (const std::string& typed : {name + " " + value, name}) commands::refuse_if_renamed(typed);
  const bool is_option = word.size() > 1 && word[0] == '-';
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    if (is_option && !option->get_lnames().empty()) names.push_back("--" + option->get_lnames().front());
  }
  for (const CLI::App* command : app.get_subcommands({})) {
    if (!is_option) names.push_back(command->get_name());
  }
  const std::string meant = suggestion(name, std::vector<std::string_view>(names.begin(), names.end()));
  throw std::invalid_argument("'" + word + "' (no " + (is_option ? "option" : "argument") + " of `" + where + "`)" +
                              (meant.empty() ? "; see `" + where + " --help`" : meant));
}

// The first option whose value is empty.
std::string empty_option(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional() || option->count() == 0) continue;
    for (const std::string& value : option->results()) {
      if (value.empty()) return option->get_name();
    }
  }
  return "";
}

const Subcommand& chosen(const CLI::App& app, const std::deque<Subcommand>& commands) {
  for (const Subcommand& command : commands) {
    if (!command.app->parsed()) continue;
    const std::vector<std::string> unknown = command.app->remaining();
    if (!unknown.empty()) refuse_words(*command.app, unknown, typed_so_far(app));
    for (const auto& [field, value] : command.words.values) {
      for (const std::string& before : {option(field), command.command})
        commands::refuse_if_renamed(before + " " + value);
    }
  }
  const std::vector<std::string> unknown = app.remaining();
  if (!unknown.empty()) refuse_words(app, unknown, "debias");
  for (const Subcommand& command : commands) {
    if (command.app->parsed()) return command;
  }
  throw std::invalid_argument(
      "no command; write list, run, resume, merge, replay, validate, survey, tradeoff, diagnose or render, or see "
      "`debias --help`");
}

// A PMF or a base level that asks for the impossible is found out in the middle of a run.
int report_sample(const SampleError& error) {
  const std::string which = "--seed " + std::to_string(error.seed()) + " --sample " + std::to_string(error.index());
  try {
    std::rethrow_if_nested(error);
    complain(error.what());
  } catch (const std::logic_error& e) {
    complain(which + ": " + e.what());
    return bad_usage;
  } catch (const std::exception& e) {
    complain(which + ": " + e.what());
  } catch (...) {
    complain(error.what());
  }
  return internal_error;
}

// For a program that called this one: no PMF, and why.
commands::Fields refusal(const NoPmfError& e) {
  commands::Fields f = {{"kind", "no_pmf"}, {"message", e.what()}};
  commands::append(f, commands::describe(e));
  return f;
}

// Ranks share the samples of this request, and its seed, which each may have drawn for itself.
void share(Request& request, const Ranks& ranks) {
  const auto one_seed = [&ranks](std::uint64_t& seed) {
    seed = debias::detail::share<std::uint64_t>(ranks, [&seed] { return seed; });
  };
  if (auto* run = std::get_if<commands::RunRequest>(&request)) {
    run->sampling.ranks = ranks;
    one_seed(run->sampling.seed);
  } else if (auto* multilevel = std::get_if<commands::MultilevelRequest>(&request)) {
    multilevel->ranks = ranks;
    one_seed(multilevel->seed);
  } else if (auto* resume = std::get_if<Resume>(&request)) {
    resume->ranks = ranks;
  } else if (ranks.size() > 1) {
    throw std::invalid_argument(
        "mpirun: (ranks can share the samples of `debias run` and `debias resume` only); start it without mpirun");
  }
}

}  // namespace

std::optional<Typed> read_command_line(int argc, const char* const* argv) {
  CLI::App app("Unbiased estimates from biased sequences: problems with known answers, run and validated.", "debias");
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", commands::version_text(),
                       "Print the versions of program and stream layout, and the compiler");
  bool man = false;
  bool complete = false;
  app.add_flag("--man", man, "Print the man page: debias --man | man -l -");
  app.add_flag("--completion", complete, "Print the completion for bash: eval \"$(debias --completion)\"");
  app.footer(
      "Exit codes: 0 done, 1 internal error, 2 bad usage, 3 goal missed, 4 validation failed,\n"
      "5 file error, 6 non-finite samples, 130 interrupted.\n\nSee `debias COMMAND --help`.");

  std::deque<Subcommand> all;  // options point into it
  const auto add_to = [&](CLI::App& parent, const char* command, const char* description,
                          const char* examples) -> Subcommand& {
    Subcommand& added = all.emplace_back();
    const std::string name = command;
    added.command = name;
    added.words = usual_words(name);
    added.app = parent.add_subcommand(name.substr(name.find(' ') + 1), description);  // npos + 1 is 0
    added.app->footer(std::string("Examples:\n") + examples);
    return added;
  };
  const auto add = [&](const char* name, const char* description, const char* examples) -> Subcommand& {
    return add_to(app, name, description, examples);
  };

  Subcommand& list = add("list", "What there is: problems, estimators, PMFs",
                         "  debias list\n"
                         "  debias list pmfs --json");
  list.app->add_option("TOPIC", list.words.values["topic"], "problems, estimators or pmfs");

  Subcommand& run =
      add("run", "Estimate one problem",
          "  debias run A01\n"
          "  debias run A01 --samples 1e7 --seed random --confidence 0.99\n"
          "  debias run A01 --estimator recipe --error 2e-4      a pilot chooses PMF, base level and strata\n"
          "  debias run A01 --estimator independent_sum --pmf geometric:r=0.6 --json -o result.json");
  add_choice(run);
  add_plan(run);
  add_goal(run);
  run.value("confidence", "C", "Of the interval");
  add_checkpoint(run);
  run.value("shard", "I/N", "The i-th of n parts of the samples, for `debias merge`; needs --checkpoint");
  add_output(run);
  add_plot(run, "mean and standard error over the samples; half of them are drawn again");

  Subcommand& resume = add("resume", "Go on from a checkpoint, or tighten a run",
                           "  debias resume run.checkpoint\n"
                           "  debias resume run.checkpoint --error 1e-5");
  resume.app->add_option("FILE", resume.words.values["file"], "What --checkpoint FILE wrote")->required();
  resume.value("samples", "N", "Samples in all, those of the file included");
  add_goal(resume);
  resume.value("threads", "T", "0 takes all cores; the result does not depend on it");
  add_output(resume);

  Subcommand& merge = add("merge", "Join the checkpoints of shards into the result of one run",
                          "  debias merge part-1 part-2 part-3\n"
                          "  debias merge part-* --checkpoint whole --json");
  merge.app->add_option("FILE", merge.words.names, "Checkpoints of one run, in any order")->required();
  add_checkpoint(merge, "Write the union to this file");
  add_output(merge);

  Subcommand& replay = add("replay", "Draw one sample of a run again, with every level it touched",
                           "  debias replay A01 --seed 1 --sample 123456\n"
                           "  debias replay A01 --pmf geometric:r=0.6 --seed 7 --sample 0 --json");
  for (const char* field : {"seed", "sample"}) replay.words.values[field].clear();  // neither has a usual value
  add_choice(replay);
  replay.value("seed", "S", "The seed of the run")->required();
  replay.value("sample", "I", "The index of the sample; of a block, all of it is drawn")->required();

  Subcommand& validate = add("validate", "Hold every estimator against the exact answers",
                             "  debias validate\n"
                             "  debias validate A01 A03 --samples 1e6\n"
                             "  debias validate --hard\n"
                             "  debias validate --unseen 7 --samples 65536\n"
                             "  debias validate --report --samples 1e6 -o report.md\n"
                             "  debias validate --json -o cells.jsonl");
  validate.app->add_option("PROBLEM", validate.words.names, "Ids or names; all when there is none");
  validate.flag("hard", "Instead: thick media, cancellation, deep levels, huge values, and what results say of them");
  validate.value("unseen", "SEED",
                 "Instead: 40 families of problems drawn by this seed, and what a recipe says of them");
  validate.flag("report",
                "Instead: every figure of reliability as a page of Markdown, with intervals over N / 100 "
                "replications (at most 1e4); -o FILE.md brings FILE.json");
  add_plan(validate);
  add_checkpoint(validate);
  add_output(validate);

  Subcommand& survey = add("survey", "Measure the levels of a problem: decay, growth, and whether a PMF exists",
                           "  debias survey A01\n"
                           "  debias survey A01 --levels 12 --samples 1e5 --json\n"
                           "  debias survey A01 --plot levels.svg");
  survey.problem();
  survey.value("levels", "L", "How many levels; 10 by default");
  survey.value("first", "K", "The first of them, 0 by default: above those without finite moments, say");
  add_plan(survey);
  add_output(survey);
  add_plot(survey, "variance, mean, kurtosis, consistency and work of the levels");

  Subcommand& tradeoff = add("tradeoff", "Sweep the PMF of a problem: variance against work",
                             "  debias tradeoff A10\n"
                             "  debias tradeoff A10 --points 31 --estimator single_term_outcome --csv -o sweep.csv\n"
                             "  debias tradeoff A10 --plot sweep.svg");
  tradeoff.problem();
  tradeoff.value("family", "NAME", "geometric, zeta or poisson");
  tradeoff.value("points", "K", "PMFs to try");
  tradeoff.value("estimator", "NAME", "single_term or single_term_outcome");
  tradeoff.value("base_level", "M", "Lowest level m; auto is the lowest that behaves");
  tradeoff.value("block", "N", "Samples of a block of systematic strata");
  tradeoff.app->add_flag("--csv", tradeoff.delivery.csv, "Comma-separated values instead of a text");
  add_plan(tradeoff);
  add_checkpoint(tradeoff);
  add_output(tradeoff);
  add_plot(tradeoff, "variance x work over the exponents, and where they are infinite,");

  Subcommand& diagnose = add("diagnose", "Mean, error, tails and a verdict on the variance of numbers from a file",
                             "  debias diagnose samples.txt\n"
                             "  debias diagnose table.csv --column flux --json\n"
                             "  debias diagnose tabelle.csv --decimal , --column Wert\n"
                             "  debias diagnose array.npy --column 2\n"
                             "  simulation | debias diagnose - --format f64");
  diagnose.app
      ->add_option("FILE", diagnose.words.values["file"],
                   "One number a row, a table, or .npy of NumPy; rows that begin with # are comments; - is standard "
                   "input")
      ->required();
  diagnose.value("column", "C", "Name, or number from 1");
  diagnose.value("format", "F",
                 "text or npy, or raw numbers: f64, f32 (little-endian), f64be, f32be (big-endian); auto is npy by its "
                 "first bytes, else text");
  diagnose.value("separator", "S",
                 "Between fields: comma, semicolon, tab, space (any run of blanks), or a character; auto looks");
  diagnose.value("decimal", "D", "The decimal mark: . or ,");
  diagnose.flag("header", "The first row is names, whatever it looks like");
  diagnose.flag("no_header", "The first row is values, whatever it looks like");
  diagnose.flag("strict", "Refuse a file of which a row would be left out, or of which something is in doubt");
  add_output(diagnose);

  CLI::App& render = *app.add_subcommand("render", "Images that show bias, noise and heavy tails");
  render.require_subcommand(1);
  const auto add_picture = [](Subcommand& scene) {
    scene.value("size", "WxH", "Pixels");
    scene.value("exposure", "X", "Factor of the PNG, before the sRGB curve");
    scene.flag("compare", "All estimators and the reference, into the folder -o; see README for the sheet");
    scene.value("seed", "S", "Any number of 64 bits, or random");
    scene.value("threads", "T", "0 takes all cores; the image does not depend on it");
    add_checkpoint(scene);
    add_output(scene);
    scene.app->get_option("--output")->required();
  };
  Subcommand& cloud =
      add_to(render, "render transmittance", "A cloud in a box: one transmittance estimate per sample and pixel",
             "  debias render transmittance -o cloud.png\n"
             "  debias render transmittance --estimator ratio_tracking --spp 256 -o cloud.pfm\n"
             "  debias render transmittance --volume smoke.raw --dims 64x64x64 -o smoke.png\n"
             "  debias render transmittance --compare --equal-time 4s -o folder");
  cloud.value("estimator", "NAME", "telescoping_2 when there is none");
  cloud.value("spp", "N", "Samples per pixel");
  cloud.value("equal_time", "T", "As many samples per pixel as take this time; a pilot fixes them before the run");
  cloud.value("volume", "FILE", "Raw 32-bit floats, x fastest, in place of the cloud");
  cloud.value("dims", "XxYxZ", "Of the volume");
  cloud.value("density", "X", "Extinction: the largest of the cloud, of a 1 in the volume");
  add_picture(cloud);
  Subcommand& photons = add_to(render, "render photons",
                               "A lamp, a glass sphere and a floor: the caustic, from photons in a shrinking radius",
                               "  debias render photons -o caustic.png\n"
                               "  debias render photons --estimator progressive --photons 1e7 -o caustic.pfm\n"
                               "  debias render photons --compare --allow-infinite-mean -o folder");
  photons.value("estimator", "NAME", "balanced when there is none");
  photons.value("photons", "N", "Expected, of the whole image");
  photons.value("scene", "NAME", "sphere, or direct: the lamp alone");
  photons.flag("allow_infinite_mean", "Run the alpha schedule, whose mean does not converge");
  add_picture(photons);

  for (Subcommand* c : {&run, &resume, &merge, &survey, &diagnose}) {
    c->app->add_flag("--full", c->delivery.full,
                     "All of the text: levels, tails, largest values, reasons; --json has it always");
  }
  for (Subcommand& c : all) {
    c.app->add_flag(
        "--json", c.delivery.json,
        &c == &validate ? "One JSON object per line, the last one a summary" : "One JSON value instead of a text");
    c.app->allow_extras();
  }
  app.allow_extras();
  app.require_subcommand(0, 1);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() != static_cast<int>(CLI::ExitCodes::Success)) {
      throw std::invalid_argument(std::string(e.what()) + "; see `" + typed_so_far(app) + " --help`");
    }
    Output out;  // --help or --version
    app.exit(e, out.stream(), out.stream());
    out.flush();
    return std::nullopt;
  }
  if (man || complete) {
    Output out;
    out.stream() << (man ? man_page(app) : completion(app));
    out.flush();
    return std::nullopt;
  }
  const Subcommand& command = chosen(app, all);
  Typed typed = command;
  typed.empty = empty_option(*command.app);
  return typed;
}

int execute(const Command& command) {
  return std::visit([&command](const auto& request) { return execute(request, command.delivery); }, command.request);
}

int dispatch(int argc, const char* const* argv, const Ranks& ranks) {
  const auto typed = read_command_line(argc, argv);
  if (!typed) return done;
  Command command{read_request(typed->command, typed->words), typed->delivery};
  if (!typed->empty.empty()) {  // of a variable that is not set, and no wish for what is usual
    throw std::invalid_argument(typed->empty + " = '' (empty); write a value, or leave the option out");
  }
  share(command.request, ranks);
  try {
    return execute(command);
  } catch (const NoPmfError& e) {
    if (command.delivery.json) {
      Output out;
      out.stream() << commands::pretty_json(commands::Fields{{"status", "no_pmf"}, {"error", refusal(e)}}) << '\n';
      out.flush();
    }
    throw;
  }
}

int exit_code_of_current_exception() {
  const auto report = [](int code, const std::string& message) {
    complain(message);
    return code;
  };
  try {
    throw;
  } catch (const FileError& e) {
    return report(file_error, e.what());
  } catch (const Interrupted&) {
    return say_interrupted();
  } catch (const SampleError& e) {
    return report_sample(e);
  } catch (const commands::BadPart& e) {
    return report(file_error, e.what());
  } catch (const commands::BadRequest& e) {
    return report(bad_usage, e.spelled(option));
  } catch (const std::invalid_argument& e) {
    return report(bad_usage, e.what());
  } catch (const std::length_error& e) {
    return report(bad_usage, e.what());
  } catch (const std::bad_alloc&) {
    return report(internal_error, "out of memory");
  } catch (const std::exception& e) {
    return report(internal_error, std::string("internal error: ") + e.what());
  } catch (...) {
    return report(internal_error, "internal error");
  }
}

}  // namespace debias::cli

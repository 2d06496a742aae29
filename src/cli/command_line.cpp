#include "command_line.hpp"

#include <array>
#include <exception>
#include <iostream>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <debias/core/estimate.hpp>

#include "../core/ranks.hpp"
#include "../core/text.hpp"
#include "commands.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

struct Subcommand : Command {
  CLI::App* app = nullptr;
};

void add_choice(CLI::App& app, Arguments& a) {
  app.add_option("PROBLEM", a.problem, "Id or name, see `debias list`")->required();
  app.add_option("--estimator", a.estimator,
                 "See `debias list estimators`; single_term when there is none, multilevel with --error")
      ->type_name("NAME");
  app.add_option("--law", a.law, "Law of the random level, see `debias list laws`")->type_name("LAW");
  app.add_option("--block", a.block, "Members of a block of systematic strata, which is one sample")->type_name("N");
  app.add_option("--base-level", a.base_level, "Lowest level m; auto is the lowest that behaves")->type_name("M");
}

void add_plan(CLI::App& app, Arguments& a) {
  app.add_option("--samples", a.samples, "Samples, of each cell for validate, of each level for survey; 1e6 for run")
      ->type_name("N");
  app.add_option("--seed", a.seed, "Any number of 64 bits, or random")->type_name("S");
  app.add_option("--threads", a.threads, "0 takes all cores; the result does not depend on it")->type_name("T");
}

void add_goal(CLI::App& app, Arguments& a) {
  app.add_option("--error", a.error, "As many samples as this standard error takes")->type_name("X");
  app.add_option("--relative-error", a.relative_error, "The same, in units of the mean")->type_name("X");
  app.add_option("--time", a.time, "As many samples as this time takes, 10s")->type_name("T");
}

void add_checkpoint(CLI::App& app, Arguments& a) {
  app.add_option("--checkpoint", a.checkpoint,
                 "Write what is finished to this file, about once a second, for `debias resume`")
      ->type_name("FILE");
}

void add_output(CLI::App& app, Arguments& a) {
  const auto is_file_name = [](const std::string& path) -> std::string {
    if (!path.empty() && path[0] != '-') return "";
    return "'" + path + "' (no file name); write -o result.json, or ./ before a name that starts with -";
  };
  app.add_option("-o,--output", a.output, "Write the result to this file")->type_name("FILE")->check(is_file_name);
  app.add_flag("-q,--quiet", a.quiet, "Nothing but the result and errors");
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
[[noreturn]] void refuse_word(const CLI::App& app, const std::string& word, const std::string& where) {
  const bool is_option = word.size() > 1 && word[0] == '-';
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    if (is_option && !option->get_lnames().empty()) names.push_back("--" + option->get_lnames().front());
  }
  for (const CLI::App* command : app.get_subcommands({})) {
    if (!is_option) names.push_back(command->get_name());
  }
  const std::string meant =
      suggestion(word.substr(0, word.find('=')), std::vector<std::string_view>(names.begin(), names.end()));
  throw std::invalid_argument("'" + word + "' (no " + (is_option ? "option" : "argument") + " of `" + where + "`)" +
                              (meant.empty() ? "; see `" + where + " --help`" : meant));
}

const Subcommand& chosen(const CLI::App& app, const std::vector<Subcommand>& commands) {
  for (const Subcommand& command : commands) {
    if (!command.app->parsed()) continue;
    for (const std::string& word : command.app->remaining()) refuse_word(*command.app, word, typed_so_far(app));
  }
  for (const std::string& word : app.remaining()) refuse_word(app, word, "debias");
  for (const Subcommand& command : commands) {
    if (command.app->parsed()) return command;
  }
  throw std::invalid_argument(
      "no command; write list, run, resume, merge, replay, validate, survey, tradeoff, diagnose or render, or see "
      "`debias --help`");
}

// A law or a base level that asks for the impossible is found out in the middle of a run.
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
}  // namespace

std::optional<Command> read_command_line(int argc, const char* const* argv) {
  CLI::App app("Unbiased estimates from biased sequences: problems with known answers, run and validated.", "debias");
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", version_text(),
                       "Print the versions of program and stream layout, and the compiler");
  app.footer(
      "Exit codes: 0 done, 1 internal error, 2 bad usage, 3 goal missed, 4 validation failed,\n"
      "5 file error, 6 non-finite samples, 130 interrupted.\n\nSee `debias COMMAND --help`.");

  std::vector<Subcommand> commands(11);  // options point into it
  const auto add_to = [&](CLI::App& parent, std::size_t i, const char* name, int (*execute)(const Arguments&),
                          const char* description, const char* examples) -> CLI::App& {
    commands[i].app = parent.add_subcommand(name, description);
    commands[i].app->footer(std::string("Examples:\n") + examples);
    commands[i].execute = execute;
    return *commands[i].app;
  };
  const auto add = [&](std::size_t i, const char* name, int (*execute)(const Arguments&), const char* description,
                       const char* examples) -> CLI::App& {
    return add_to(app, i, name, execute, description, examples);
  };

  CLI::App& list_app = add(0, "list", list, "What there is: problems, estimators, laws",
                           "  debias list\n"
                           "  debias list laws --json");
  list_app.add_option("TOPIC", commands[0].arguments.topic, "problems, estimators or laws");

  CLI::App& run_app = add(1, "run", run, "Estimate one problem",
                          "  debias run A01\n"
                          "  debias run A01 --samples 1e7 --seed random --confidence 0.99\n"
                          "  debias run A01 --law auto --error 1e-4      a pilot chooses law, base and strata\n"
                          "  debias run A01 --estimator independent_sum --law geometric:r=0.6 --json -o result.json");
  add_choice(run_app, commands[1].arguments);
  add_plan(run_app, commands[1].arguments);
  add_goal(run_app, commands[1].arguments);
  run_app.add_option("--confidence", commands[1].arguments.confidence, "Of the interval")->type_name("C");
  add_checkpoint(run_app, commands[1].arguments);
  run_app
      .add_option("--shard", commands[1].arguments.shard,
                  "The i-th of n parts of the samples, for `debias merge`; needs --checkpoint")
      ->type_name("I/N");
  add_output(run_app, commands[1].arguments);

  CLI::App& resume_app = add(9, "resume", resume, "Go on from a checkpoint, or tighten a run",
                             "  debias resume run.checkpoint\n"
                             "  debias resume run.checkpoint --error 1e-5");
  Arguments& resumed = commands[9].arguments;
  resume_app.add_option("FILE", resumed.file, "What --checkpoint FILE wrote")->required();
  resume_app.add_option("--samples", resumed.samples, "Samples in all, those of the file included")->type_name("N");
  add_goal(resume_app, resumed);
  resume_app.add_option("--threads", resumed.threads, "0 takes all cores; the result does not depend on it")
      ->type_name("T");
  add_output(resume_app, resumed);

  CLI::App& merge_app = add(10, "merge", merge, "Join the checkpoints of shards into the result of one run",
                            "  debias merge part-1 part-2 part-3\n"
                            "  debias merge part-* --checkpoint whole --json");
  merge_app.add_option("FILE", commands[10].arguments.problems, "Checkpoints of one run, in any order")->required();
  merge_app.add_option("--checkpoint", commands[10].arguments.checkpoint, "Write the union to this file")
      ->type_name("FILE");
  add_output(merge_app, commands[10].arguments);

  CLI::App& replay_app = add(2, "replay", replay, "Draw one sample of a run again, with every level it touched",
                             "  debias replay A01 --seed 1 --sample 123456\n"
                             "  debias replay A01 --law geometric:r=0.6 --seed 7 --sample 0 --json");
  Arguments& replayed = commands[2].arguments;
  replayed.seed.clear();
  add_choice(replay_app, replayed);
  replay_app.add_option("--seed", replayed.seed, "The seed of the run")->type_name("S")->required();
  replay_app.add_option("--sample", replayed.sample, "The index of the sample")->type_name("I")->required();

  CLI::App& validate_app = add(3, "validate", validate, "Hold every estimator against the exact answers",
                               "  debias validate\n"
                               "  debias validate A01 A02 --samples 1e6\n"
                               "  debias validate --hard\n"
                               "  debias validate --report --samples 1e6 -o report.md\n"
                               "  debias validate --json -o cells.jsonl");
  commands[3].arguments.samples = "1e5";
  validate_app.add_option("PROBLEM", commands[3].arguments.problems, "Ids or names; all when there is none");
  validate_app.add_flag("--hard", commands[3].arguments.hard,
                        "Instead: thick media, cancellation, deep levels, huge values, and what results say of them");
  validate_app.add_flag("--report", commands[3].arguments.report,
                        "Instead: every figure of reliability as a page of Markdown, with intervals over N / 100 "
                        "replications (at most 1e4); -o FILE.md brings FILE.json");
  add_plan(validate_app, commands[3].arguments);
  add_checkpoint(validate_app, commands[3].arguments);
  add_output(validate_app, commands[3].arguments);

  CLI::App& survey_app =
      add(4, "survey", debias::cli::survey, "Measure the levels of a problem: decay, growth, and whether a law exists",
          "  debias survey A01\n"
          "  debias survey A01 --levels 12 --samples 1e5 --json");
  Arguments& surveyed = commands[4].arguments;
  surveyed.samples = "1e4";
  surveyed.levels = "10";
  survey_app.add_option("PROBLEM", surveyed.problem, "Id or name, see `debias list`")->required();
  survey_app.add_option("--levels", surveyed.levels, "Levels 0 to L - 1")->type_name("L");
  add_plan(survey_app, surveyed);
  add_output(survey_app, surveyed);

  CLI::App& tradeoff_app = add(5, "tradeoff", tradeoff, "Sweep the law of a problem: variance against work",
                               "  debias tradeoff A10\n"
                               "  debias tradeoff A10 --points 31 --estimator single_term_drawn --csv -o sweep.csv");
  Arguments& swept = commands[5].arguments;
  swept.samples = "1e5";
  tradeoff_app.add_option("PROBLEM", swept.problem, "Id or name, see `debias list`")->required();
  tradeoff_app.add_option("--family", swept.family, "geometric, zeta or poisson")->type_name("NAME");
  tradeoff_app.add_option("--points", swept.points, "Laws to try")->type_name("K");
  tradeoff_app.add_option("--estimator", swept.estimator, "single_term or single_term_drawn")->type_name("NAME");
  tradeoff_app.add_option("--base-level", swept.base_level, "Lowest level m; auto is the lowest that behaves")
      ->type_name("M");
  tradeoff_app.add_option("--block", swept.block, "Members of a block of systematic strata")->type_name("N");
  tradeoff_app.add_flag("--csv", swept.csv, "Comma-separated values instead of a text");
  add_plan(tradeoff_app, swept);
  add_checkpoint(tradeoff_app, swept);
  add_output(tradeoff_app, swept);

  CLI::App& diagnose_app =
      add(6, "diagnose", diagnose, "Mean, error, tails and a verdict on the variance of numbers from a file",
          "  debias diagnose samples.txt\n"
          "  debias diagnose table.csv --column flux --json\n"
          "  debias diagnose tabelle.csv --decimal , --column Wert\n"
          "  debias diagnose array.npy --column 2\n"
          "  simulation | debias diagnose - --format f64");
  Arguments& diagnosed = commands[6].arguments;
  diagnose_app
      .add_option("FILE", diagnosed.file,
                  "One number a row, a table, or .npy of NumPy; rows that begin with # are comments; - is standard "
                  "input")
      ->required();
  diagnose_app.add_option("--column", diagnosed.column, "Name, or number from 1")->type_name("C");
  diagnose_app
      .add_option(
          "--format", diagnosed.format,
          "text or npy, or raw numbers: f64, f32 (little-endian), f64be, f32be (big-endian); auto is npy by its "
          "first bytes, else text")
      ->type_name("F");
  diagnose_app
      .add_option("--separator", diagnosed.separator,
                  "Between fields: comma, semicolon, tab, space (any run of blanks), or a character; auto looks")
      ->type_name("S");
  diagnose_app.add_option("--decimal", diagnosed.decimal, "The decimal mark: . or ,")->type_name("D");
  diagnose_app.add_flag("--header", diagnosed.header, "The first row is names, whatever it looks like");
  diagnose_app.add_flag("--no-header", diagnosed.no_header, "The first row is values, whatever it looks like");
  diagnose_app.add_flag("--strict", diagnosed.strict,
                        "Refuse a file of which a row would be left out, or of which something is in doubt");
  add_output(diagnose_app, diagnosed);

  CLI::App& render_app = *app.add_subcommand("render", "Images that show bias, noise and heavy tails");
  render_app.require_subcommand(1);
  const auto add_picture = [&](Arguments& a, CLI::App& scene) {
    scene.add_option("--size", a.size, "Pixels")->type_name("WxH");
    scene.add_option("--exposure", a.exposure, "Factor of the PNG, before the sRGB curve")->type_name("X");
    scene.add_flag("--compare", a.compare,
                   "All estimators and the reference, into the folder -o; see README for the sheet");
    scene.add_option("--seed", a.seed, "Any number of 64 bits, or random")->type_name("S");
    scene.add_option("--threads", a.threads, "0 takes all cores; the image does not depend on it")->type_name("T");
    add_checkpoint(scene, a);
    add_output(scene, a);
    scene.get_option("--output")->required();
  };
  CLI::App& cloud_app = add_to(render_app, 7, "transmittance", render_transmittance,
                               "A cloud in a box: one transmittance estimate per sample and pixel",
                               "  debias render transmittance -o cloud.png\n"
                               "  debias render transmittance --estimator ratio_tracking --spp 256 -o cloud.pfm\n"
                               "  debias render transmittance --volume smoke.raw --dims 64x64x64 -o smoke.png\n"
                               "  debias render transmittance --compare --equal-time 4s -o folder");
  Arguments& clouded = commands[7].arguments;
  cloud_app.add_option("--estimator", clouded.estimator, "telescoping_2 when there is none")->type_name("NAME");
  cloud_app.add_option("--spp", clouded.spp, "Samples per pixel")->type_name("N");
  cloud_app
      .add_option("--equal-time", clouded.equal_time,
                  "As many samples per pixel as take this time; a pilot fixes them before the run")
      ->type_name("T");
  cloud_app.add_option("--volume", clouded.volume, "Raw 32-bit floats, x fastest, in place of the cloud")
      ->type_name("FILE");
  cloud_app.add_option("--dims", clouded.dimensions, "Of the volume")->type_name("XxYxZ");
  cloud_app.add_option("--density", clouded.density, "Extinction: the largest of the cloud, of a 1 in the volume")
      ->type_name("X");
  add_picture(clouded, cloud_app);
  CLI::App& photon_app = add_to(render_app, 8, "photons", render_photons,
                                "A lamp, a glass sphere and a floor: the caustic, from photons in a shrinking radius",
                                "  debias render photons -o caustic.png\n"
                                "  debias render photons --estimator progressive --photons 1e7 -o caustic.pfm\n"
                                "  debias render photons --compare --allow-infinite-mean -o folder");
  Arguments& lit = commands[8].arguments;
  photon_app.add_option("--estimator", lit.estimator, "balanced when there is none")->type_name("NAME");
  photon_app.add_option("--photons", lit.photons, "Expected, of the whole image")->type_name("N");
  photon_app.add_option("--scene", lit.scene, "sphere, or direct: the lamp alone")->type_name("NAME");
  photon_app.add_flag("--allow-infinite-mean", lit.allow_infinite_mean,
                      "Run the alpha schedule, whose mean does not converge");
  add_picture(lit, photon_app);

  for (Subcommand& command : commands) {
    if (command.execute != validate) {
      command.app->add_flag("--json", command.arguments.json, "One JSON value instead of a text");
    } else {
      command.app->add_flag("--json", command.arguments.json, "One JSON object per line, the last one a summary");
    }
    command.app->allow_extras();
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
  return chosen(app, commands);
}

int dispatch(int argc, const char* const* argv, debias::detail::Ranks* ranks) {
  auto command = read_command_line(argc, argv);
  if (!command) return done;
  Arguments& arguments = command->arguments;
  if (ranks != nullptr) {
    if (command->execute != run && command->execute != resume) {
      throw std::invalid_argument(
          "mpirun: (ranks can share the samples of `debias run` and `debias resume` only); start "
          "it without mpirun");
    }
    arguments.ranks = ranks;
    if (arguments.seed == "random") {
      const auto draw = [&] { return read_plan(arguments).seed; };
      arguments.seed = std::to_string(debias::detail::share<std::uint64_t>(ranks, draw));
    }
  }
  return command->execute(arguments);
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

// The command line: one argument a line (or up to a zero byte, if there is one), through the real parser, every reader
// of values, and the command itself where that is little work. Files are names in a scratch folder. What is printed
// must fit the exit code, and none is an internal error.

#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/command_line.hpp"
#include "cli/commands.hpp"
#include "cli/output.hpp"
#include "core/text.hpp"

namespace {

namespace fs = std::filesystem;
using namespace debias;
using namespace debias::cli;

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::abort();
}

// Standard output and error of the program, as text.
struct Streams {
  Streams() {
    std::cout.rdbuf(out.rdbuf());
    std::cerr.rdbuf(err.rdbuf());
  }
  Streams(const Streams&) = delete;
  Streams& operator=(const Streams&) = delete;
  ~Streams() {
    std::cout.rdbuf(out_before);
    std::cerr.rdbuf(err_before);
  }
  std::streambuf* out_before = std::cout.rdbuf();
  std::streambuf* err_before = std::cerr.rdbuf();
  std::ostringstream out;
  std::ostringstream err;
};

// A folder with one file of each kind that a command reads: the working directory until the end.
class Scratch {
 public:
  Scratch() : path_(fs::temp_directory_path() / ("debias_fuzz." + std::to_string(getpid()))) {
    fs::create_directories(path_);
    fs::current_path(path_);
    if (std::freopen("/dev/null", "r", stdin) == nullptr) fail("no /dev/null");
    fill();
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    fs::current_path("/");
    fs::remove_all(path_);
  }
  // After a command that may have written.
  static void restore() {
    for (const auto& entry : fs::directory_iterator(".")) fs::remove_all(entry);
    fill();
  }

 private:
  static void fill() {
    static const std::vector<std::pair<std::string, std::string>> files = [] {
      const Streams quiet;
      for (const char* shard : {"", "1/2", "2/2"}) {
        Arguments a;
        a.problem = "A01";
        a.samples = "4100";
        a.threads = "1";
        a.shard = shard;
        a.checkpoint = std::string("run") + shard[0];
        if (run(a) != done) fail("no checkpoint");
      }
      std::vector<std::pair<std::string, std::string>> made = {{"numbers", "flux,x\n1,2\n3,nan\n0.5,4\n"},
                                                               {"volume", std::string("\0\0\x80\x3f\0\0\0\x3f", 8)}};
      for (const char* name : {"run", "run1", "run2"}) {
        std::ostringstream bytes;
        bytes << std::ifstream(name, std::ios::binary).rdbuf();
        made.emplace_back(name, bytes.str());
      }
      return made;
    }();
    for (const auto& [name, bytes] : files) std::ofstream(name, std::ios::binary) << bytes;
  }
  fs::path path_;
};

// Whether the text is a count of at most so many.
bool at_most(const std::string& text, std::uint64_t most) {
  try {
    parse_count(text, "", 0, most);
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

// Refused, or read, whatever it is.
template <class Read>
void read(const Read& value) {
  try {
    value();
  } catch (const std::invalid_argument& e) {
    if (*e.what() == '\0') fail("an error without a word");
  } catch (const std::length_error& e) {
    if (*e.what() == '\0') fail("an error without a word");
  }
}

void read_all(const Arguments& a) {
  read([&] { read_plan(a); });
  read([&] { read_levels(a.levels); });
  read([&] { read_points(a.points); });
  read([&] { read_sample(a.sample); });
  read([&] { read_confidence(a.confidence); });
  read([&] {
    const catalog::Problem& problem = catalog::find(a.problem);
    read([&] { read_choice(a, problem); });
    read([&] { read_shape(a, problem); });
    read([&] { read_recipe(a, problem); });
  });
}

// Levels as deep as a few samples can go through.
bool shallow(const Arguments& a) {
  if (!wants_recipe(a) && a.base_level != "auto" && !at_most(a.base_level, 4)) return false;
  if (!at_most(a.block, 16)) return false;
  try {
    const catalog::Choice choice = read_choice(a, catalog::find(a.problem));
    return choice.base_level <= 6 && (choice.method == catalog::Method::truncated || choice.law.tail(14) < 1e-4);
  } catch (const std::exception&) {
    return true;  // it will be refused
  }
}

// Samples, not hours.
bool modest_goal(const Arguments& a) {
  try {
    return (a.error == "none" || read_positive(a.error, "") >= 0.1) &&
           (a.relative_error == "none" || read_positive(a.relative_error, "") >= 0.1) &&
           (a.time == "none" || read_seconds(a.time, "") <= 0.05);
  } catch (const std::invalid_argument&) {
    return true;  // it will be refused
  }
}

// `rare` is true for few inputs: those may take a tenth of a second.
bool little_work(const Command& command, bool rare) {
  const Arguments& a = command.arguments;
  if (!modest_goal(a)) return false;
  const bool few = a.samples == "auto" || at_most(a.samples, 16);
  const bool goal = a.error != "none" || a.relative_error != "none" || a.time != "none";
  if (command.execute == list || command.execute == diagnose) return true;
  if (command.execute == replay) return shallow(a);
  if (command.execute == run) {
    if (a.samples == "auto" && !goal) return false;
    return few && shallow(a) && (rare || (!goal && !wants_recipe(a)));
  }
  if (command.execute == resume) return (few || at_most(a.samples, 10'000)) && (rare || !goal);
  if (command.execute == cli::merge) return a.problems.size() <= 8;
  if (command.execute == cli::survey) return at_most(a.levels, 6) && few && a.samples != "auto";
  if (command.execute == tradeoff) return rare && at_most(a.points, 3) && few && a.samples != "auto";
  if (command.execute == validate) {
    return (rare || a.problems.size() == 1) && a.problems.size() <= 2 && few && !a.hard && !a.report;
  }
  // a picture
  const bool small = a.size.size() <= 3 && at_most(a.spp, 4) && at_most(a.photons, 1000) && a.equal_time == "none";
  return small && a.density.size() <= 2 && (rare || !a.compare);
}

void check(int code, const Arguments& a, bool lines, const Streams& said) {
  const std::string out = said.out.str();
  const std::string err = said.err.str();
  if (code != done && err.empty()) fail("an exit code without a word");
  for (std::istringstream text(err); text.peek() != EOF;) {
    std::string line;
    std::getline(text, line);
    if (line.rfind("debias: ", 0) != 0) fail("on standard error: " + line);
  }
  switch (code) {
    case bad_usage:
      if (!out.empty() || std::count(err.begin(), err.end(), '\n') != 1) fail("bad usage: " + err + out);
      return;
    case done:
    case goal_missed:
    case validation_failed:
    case file_error:
    case nonfinite_samples:
      break;
    default:
      fail("exit code " + std::to_string(code) + ": " + err);
  }
  if (!a.json || !a.output.empty() || out.empty()) return;
  std::istringstream text(out);
  for (std::string line; lines && std::getline(text, line);) {
    if (!nlohmann::json::accept(line)) fail("no JSON: " + line);
  }
  if (!lines && !nlohmann::json::accept(out)) fail("no JSON: " + out);
}

// A name in the scratch folder.
void tame(std::string& name) {
  std::replace(name.begin(), name.end(), '/', '_');
  if (name == ".." || name == ".") name = "numbers";
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Scratch scratch;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const char separator = text.find('\0') == std::string::npos ? '\n' : '\0';
  std::vector<std::string> words = {"debias"};
  std::istringstream rest(text);
  for (std::string word; std::getline(rest, word, separator);) words.push_back(word);
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());

  const Streams said;
  std::optional<Command> command;
  int code = done;
  try {
    command = read_command_line(static_cast<int>(argv.size()), argv.data());
    if (!command) return said.out.str().empty() ? (fail("no help"), 0) : 0;
    Arguments& a = command->arguments;
    read_all(a);
    for (std::string* name : {&a.output, &a.checkpoint, &a.volume, &a.file}) tame(*name);
    for (std::string& name : a.problems) tame(name);
    if (a.seed == "random") a.seed = "1";
    if (!at_most(a.threads, 2)) {
      read([&] { read_threads(a.threads); });
      a.threads = "2";
    }
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < size; ++i) sum = 31 * sum + data[i];
    if (!little_work(*command, sum % 64 == 0)) return 0;
    code = command->execute(a);
  } catch (...) {
    code = exit_code_of_current_exception();
  }
  const Arguments a = command ? command->arguments : Arguments();
  check(code, a, command && command->execute == validate, said);
  if (!a.output.empty() || !a.checkpoint.empty() || (command && command->execute == resume)) Scratch::restore();
  return 0;
}

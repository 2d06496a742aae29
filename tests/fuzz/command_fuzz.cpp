// The command line: one argument a line (or up to a zero byte, if there is one), through the real parser, the door of its
// command, and the command itself where that is little work. Files are names in a scratch folder. What is printed
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
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <nlohmann/json.hpp>

#include "cli/command_line.hpp"
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
        Words words = usual_words("run");
        for (const auto& [field, word] : {std::pair("problem", "A01"), {"samples", "4100"}, {"shard", shard}}) {
          words.values[field] = word;
        }
        const std::string name = std::string("run") + shard[0];
        if (execute({read_request("run", words), {.checkpoint = name}}) != done) fail("no checkpoint");
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

// Levels as deep as a few samples can go through.
bool shallow(const commands::Shape& shape, const catalog::Problem& problem) {
  if (shape.block > 16 || (!shape.by_recipe() && shape.base_level.value_or(0) > 4)) return false;
  try {
    const catalog::Choice choice = commands::choice_of(shape, problem);
    return choice.base_level <= 6 && (choice.method == catalog::Method::truncated || choice.pmf.tail(14) < 1e-4);
  } catch (const std::exception&) {
    return true;  // it will be refused
  }
}

// Samples, not hours.
bool modest(const Goal& goal) {
  return (goal.error == 0 || goal.error >= 0.1) && (goal.relative_error == 0 || goal.relative_error >= 0.1) &&
         goal.seconds <= 0.05;
}

constexpr std::int64_t few = 16;

// Whether a request is little work; `rare` is true for few inputs: those may take a tenth of a second.
struct LittleWork {
  bool rare;

  bool operator()(const commands::ListRequest&) const { return true; }
  bool operator()(const Diagnose&) const { return true; }
  bool operator()(const commands::ReplayRequest& r) const { return shallow(r.shape, *r.problem); }
  bool operator()(const commands::RunRequest& r) const {
    const commands::Sampling& s = r.sampling;
    if (!s.samples && !s.goal.asked()) return false;
    return modest(s.goal) && s.samples.value_or(0) <= few && shallow(r.shape, *r.problem) &&
           (rare || (!s.goal.asked() && !r.shape.by_recipe()));
  }
  bool operator()(const commands::MultilevelRequest& r) const { return rare && r.error >= 0.1; }
  bool operator()(const Resume& r) const {
    return modest(r.goal) && r.samples.value_or(0) <= 10'000 && (rare || !r.goal.asked());
  }
  bool operator()(const Merge& r) const { return r.files.size() <= 8; }
  bool operator()(const commands::SurveyRequest& r) const { return r.levels <= 6 && r.samples <= few; }
  bool operator()(const commands::TradeoffRequest& r) const { return rare && r.points <= 3 && r.samples <= few; }
  bool operator()(const commands::ValidateRequest& r) const {
    return !r.problems.empty() && r.problems.size() <= (rare ? 2 : 1) && r.samples <= few;
  }
  bool operator()(const commands::HardRequest&) const { return false; }
  bool operator()(const commands::UnseenRequest&) const { return false; }
  bool operator()(const commands::ReliabilityRequest&) const { return false; }
  bool operator()(const RenderTransmittance& r) const {
    return small(r.request) && r.density < 100 && r.request.samples <= 4 && r.request.equal_time == 0;
  }
  bool operator()(const RenderPhotons& r) const { return small(r.request) && r.request.photons <= 1000; }

 private:
  [[nodiscard]] bool small(const commands::PictureRequest& r) const {
    return r.width <= 9 && r.height <= 9 && (rare || !r.compare);
  }
};

// Two threads at most, and files in the scratch folder.
struct Tame {
  template <class R>
  void operator()(R& r) const {
    if constexpr (requires { r.threads; }) r.threads = std::min(r.threads, 2);
    if constexpr (requires { r.sampling; }) r.sampling.threads = std::min(r.sampling.threads, 2);
    if constexpr (requires { r.request; }) r.request.threads = std::min(r.request.threads, 2);
    if constexpr (requires { r.file; }) name(r.file);
    if constexpr (requires { r.volume; }) name(r.volume);
    if constexpr (requires { r.files; }) std::for_each(r.files.begin(), r.files.end(), name);
  }
  static void name(std::string& name) {
    std::replace(name.begin(), name.end(), '/', '_');
    if (name == ".." || name == ".") name = "numbers";
  }
};

void check(int code, const Delivery& a, bool lines, const Streams& said) {
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
  Delivery delivery;
  std::string command;
  int code = done;
  try {
    const auto typed = read_command_line(static_cast<int>(argv.size()), argv.data());
    if (!typed) return said.out.str().empty() ? (fail("no help"), 0) : 0;
    command = typed->command;
    delivery = typed->delivery;
    for (std::string* name : {&delivery.output, &delivery.checkpoint}) Tame::name(*name);
    Words typed_words = typed->words;
    const auto seed = typed_words.values.find("seed");
    if (seed != typed_words.values.end() && seed->second == "random") seed->second = "1";
    Request request = read_request(command, typed_words);
    std::visit(Tame(), request);
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < size; ++i) sum = 31 * sum + data[i];
    if (!std::visit(LittleWork{sum % 64 == 0}, request)) return 0;
    code = execute({request, delivery});
  } catch (...) {
    code = exit_code_of_current_exception();
  }
  check(code, delivery, command == "validate", said);
  if (!delivery.output.empty() || !delivery.checkpoint.empty() || command == "resume") Scratch::restore();
  return 0;
}

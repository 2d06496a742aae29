#include "session.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "../core/ranks.hpp"
#include "output.hpp"

namespace debias::cli {
namespace {

constexpr std::array<std::pair<const char*, std::string Arguments::*>, 24> words = {{
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
    {"shard", &Arguments::shard},
    {"family", &Arguments::family},
    {"points", &Arguments::points},
    {"spp", &Arguments::spp},
    {"equal_time", &Arguments::equal_time},
    {"size", &Arguments::size},
    {"volume", &Arguments::volume},
    {"dims", &Arguments::dimensions},
    {"density", &Arguments::density},
    {"exposure", &Arguments::exposure},
    {"photons", &Arguments::photons},
    {"scene", &Arguments::scene},
    {"output", &Arguments::output},
}};

constexpr std::array<std::pair<const char*, bool Arguments::*>, 3> flags = {{
    {"csv", &Arguments::csv},
    {"compare", &Arguments::compare},
    {"allow_infinite_mean", &Arguments::allow_infinite_mean},
}};

constexpr double save_interval = 1;  // seconds
constexpr double save_cost = 100;    // times what a save takes

bool is_file(const std::string& path) {
  struct stat status = {};
  return stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

// "A01 B02"
std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

std::vector<std::string> split_at(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    pieces.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return pieces;
}

// The words of a file; throws std::invalid_argument where they are not those of text_of.
std::pair<std::string, Arguments> words_of(const std::string& text) {
  const std::vector<std::string> lines = split_at(text, '\n');
  std::size_t at = 0;
  const auto value = [&](const std::string& name) {
    if (at < lines.size() && lines[at].compare(0, name.size() + 1, name + "=") == 0)
      return lines[at++].substr(name.size() + 1);
    throw std::invalid_argument("no checkpoint of a command: no " + name);
  };
  const std::string version = value("version");
  if (version != DEBIAS_VERSION) {
    throw std::invalid_argument("written by debias " + version + ", this is " DEBIAS_VERSION +
                                " (another version may draw other samples)");
  }
  std::string command = value("command");
  Arguments a;
  a.problems = split_at(value("problems"), ' ');
  for (const auto& [name, member] : words) a.*member = value(name);
  for (const auto& [name, member] : flags) a.*member = value(name) == "yes";
  return {std::move(command), std::move(a)};
}

}  // namespace

std::string text_of(const std::string& command, const Arguments& a) {
  std::string text;
  const auto add = [&](const std::string& name, const std::string& value) {
    if (value.find('\n') != std::string::npos) {
      throw std::invalid_argument("--checkpoint: (a line break in " + name +
                                  " has no place in the file); write another " + name);
    }
    text += name + "=" + value + "\n";
  };
  add("version", DEBIAS_VERSION);
  add("command", command);
  add("problems", joined(a.problems));
  for (const auto& [name, member] : words) add(name, a.*member);
  for (const auto& [name, member] : flags) add(name, a.*member ? "yes" : "no");
  return text;
}

Loaded load(const std::string& path, debias::detail::Ranks* ranks) {
  try {
    const auto read = [&] {
      Checkpoint file = read_checkpoint(path);
      if (file.dropped > 0) {
        complain("warning: '" + path + "': its last " + std::to_string(file.dropped) +
                 " bytes are no whole record and are left out");
      }
      return file;
    };
    Checkpoint file = ranks == nullptr ? read() : parse_checkpoint(ranks->share([&] {
      const Checkpoint whole = read();
      return encode(whole.text, whole.parts);
    }));
    auto [command, arguments] = words_of(file.text);
    return {std::move(command), std::move(arguments), std::move(file.parts)};
  } catch (const std::invalid_argument& e) {
    throw FileError("'" + path + "': " + e.what());
  } catch (const std::system_error& e) {
    throw FileError(e.what());
  }
}

Session::Session(const std::string& command, const Arguments& arguments) : path_(arguments.checkpoint) {
  if (path_.empty()) return;
  keep_apart(arguments.output, path_);
  const std::string text = text_of(command, arguments);
  if (arguments.resumed != nullptr) {
    held_ = arguments.resumed->parts;
  } else if (is_file(path_)) {
    const Loaded there = load(path_);
    throw FileError("--checkpoint '" + path_ + "': " +
                    (text_of(there.command, there.arguments) == text
                         ? "holds this " + command + " already; go on with `debias resume " + path_ + "`"
                         : "holds another command; choose another name"));
  }
  try {
    writer_.emplace(path_, text, held_);
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
  due_ = Clock::now();
}

const Bytes* Session::held(const std::string& part) const {
  const auto at = held_.find(part);
  return at == held_.end() ? nullptr : &at->second;
}

bool Session::due() const { return writer_ && Clock::now() >= due_; }

void Session::keep(const std::string& part, Bytes contents) {
  if (!writer_) return;
  fresh_[part] = std::move(contents);
  if (due()) flush();
}

void Session::flush() {
  if (!writer_ || fresh_.empty()) return;
  const auto began = Clock::now();
  try {
    writer_->save(fresh_);
  } catch (const std::system_error& e) {
    throw FileError(std::string("--checkpoint: ") + e.what());
  }
  fresh_.clear();
  const auto ended = Clock::now();
  const std::chrono::duration<double> wait(
      std::max(save_interval, save_cost * std::chrono::duration<double>(ended - began).count()));
  due_ = ended + std::chrono::duration_cast<Clock::duration>(wait);
}

void Session::attach(Plan& plan, const std::string& part) {
  if (!writer_) return;
  plan.earlier = nullptr;
  if (const Bytes* contents = held(part)) {
    try {
      plan.earlier = std::make_shared<RunState>(decode(*contents));
    } catch (const std::invalid_argument& e) {
      throw FileError("'" + path_ + "': " + e.what());
    }
  }
  plan.save = [this, part](const RunState& state, const Plan&) { keep(part, encode(state)); };
}

void Session::suspend() {
  if (!writer_) return;
  flush();
  complain("what is finished is on disk; go on with `debias resume " + path_ + "`");
}

}  // namespace debias::cli

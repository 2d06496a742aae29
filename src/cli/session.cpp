#include "session.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "core/communicator.hpp"
#include "core/text.hpp"

namespace debias::cli {
namespace {

constexpr double save_interval = 1;  // seconds
constexpr double save_cost = 100;    // times what a save takes

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
Loaded words_of(const std::string& text) {
  Loaded file;
  Words& words = file.saved.words;
  for (const std::string& line : split_at(text, '\n')) {
    const std::size_t end = line.find_first_of("=:");
    if (end == std::string::npos) throw std::invalid_argument("no checkpoint of a command: '" + line + "'");
    const std::string name = line.substr(0, end);
    const std::string value = line.substr(end + 1);
    line[end] == '=' ? void(words.values[name] = value) : void(words.flags[name] = value == "yes");
  }
  const auto take = [&words](const std::string& name) {
    auto word = words.values.extract(name);
    if (word.empty()) throw std::invalid_argument("no checkpoint of a command: no " + name);
    return word.mapped();
  };
  const std::string version = take("version");
  if (version != DEBIAS_VERSION) {
    throw std::invalid_argument("written by debias " + version + ", this is " DEBIAS_VERSION +
                                " (another version may draw other samples)");
  }
  file.saved.command = take("command");
  words.names = split_at(take("names"), ' ');
  file.delivery.output = take("output");
  if (words.values.count("plot") > 0) file.delivery.plot = take("plot");  // checkpoints of before have none
  const auto take_flag = [&words](const std::string& name) {
    const auto flag = words.flags.extract(name);
    return !flag.empty() && flag.mapped();
  };
  file.delivery.csv = take_flag("csv");
  file.delivery.full = take_flag("full");
  file.delivery.json = take_flag("json");
  return file;
}

}  // namespace

bool is_regular_file(const std::string& path) {
  struct stat status = {};
  return stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
}

std::string text_of(const Saved& saved, const Delivery& delivery) {
  std::string text;
  const auto add = [&text](const std::string& name, char sign, const std::string& value) {
    if (value.find('\n') != std::string::npos) {
      throw std::invalid_argument("--checkpoint: (a line break in " + name +
                                  " has no place in the file); write another " + name);
    }
    text += name + sign + value + "\n";
  };
  const auto add_flag = [&add](const std::string& name, bool is) { add(name, ':', is ? "yes" : "no"); };
  add("version", '=', DEBIAS_VERSION);
  add("command", '=', saved.command);
  add("names", '=', joined(saved.words.names));
  for (const auto& [name, value] : saved.words.values) add(name, '=', value);
  add("output", '=', delivery.output);
  add("plot", '=', delivery.plot);
  for (const auto& [name, value] : saved.words.flags) add_flag(name, value);
  add_flag("csv", delivery.csv);
  add_flag("full", delivery.full);
  add_flag("json", delivery.json);
  return text;
}

Loaded load(const std::string& path, const Ranks& ranks) {
  try {
    const auto read = [&] {
      PartFile file = read_parts(path);
      if (const auto n = static_cast<std::int64_t>(file.dropped); n > 0) {
        complain("warning: '" + path + "': its last " + counted(n, "byte") + are(n) + " no whole record and" + are(n) +
                 " left out");
      }
      return encode(file.text, file.parts);
    };
    PartFile file = parse_parts(ranks.communicator().share(read));
    Loaded loaded = words_of(file.text);
    loaded.parts = std::move(file.parts);
    return loaded;
  } catch (const std::invalid_argument& e) {
    throw FileError("'" + path + "': " + e.what());
  } catch (const std::system_error& e) {
    throw FileError(e.what());
  }
}

Session::Session(const Saved& saved, const Delivery& delivery) : path_(delivery.checkpoint) {
  if (path_.empty()) return;
  keep_apart(delivery.output, path_);
  const std::string text = text_of(saved, delivery);
  if (delivery.held) {
    held_ = *delivery.held;
  } else if (is_regular_file(path_)) {
    const Loaded there = load(path_);
    throw FileError("--checkpoint '" + path_ + "': " +
                    (text_of(there.saved, there.delivery) == text
                         ? "holds this " + saved.command + " already; go on with `debias resume " + path_ + "`"
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

void Session::suspend() {
  if (!writer_) return;
  flush();
  complain("what is finished is on disk; go on with `debias resume " + path_ + "`");
}

}  // namespace debias::cli

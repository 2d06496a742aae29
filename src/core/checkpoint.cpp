#include <debias/core/checkpoint.hpp>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "core/part_file.hpp"
#include "core/run_state_bytes.hpp"

namespace debias {
namespace {

constexpr std::string_view part = "run";
constexpr std::string_view version_line = "version=";

}  // namespace

void save_run(const std::string& path, const RunState& state) {
  const PartWriter file(path, std::string(version_line) + DEBIAS_VERSION + "\n", {{std::string(part), encode(state)}});
}

RunState read_run(const std::string& path) {
  try {
    const PartFile file = read_parts(path);
    const std::string_view text = file.text;
    if (!text.starts_with(version_line)) throw std::invalid_argument("no checkpoint of a run: it names no version");
    const std::string_view version =
        text.substr(version_line.size(), std::min(text.find('\n'), text.size()) - version_line.size());
    if (version != DEBIAS_VERSION) {
      throw std::invalid_argument("written by debias " + std::string(version) + ", this is " DEBIAS_VERSION +
                                  " (another version may draw other samples); go on with that one");
    }
    const auto run = file.parts.find(std::string(part));
    if (run == file.parts.end()) {
      throw std::invalid_argument(file.dropped > 0
                                      ? "no checkpoint of a run: its record is damaged, or cut short"
                                      : "no checkpoint of a run: it holds other parts, of another command");
    }
    return decode(run->second);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument("'" + path + "': " + e.what());
  }
}

}  // namespace debias

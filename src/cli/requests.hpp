#pragma once

// The door: words become a request here and nowhere else, and a request becomes words again for a checkpoint. One layout a
// request serves both ways. Strict, and never through the conversions of CLI11, which take nan for a positive number, -1
// for 2^64 - 1 and 010 for 8.

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "commands/diagnose.hpp"
#include "commands/list.hpp"
#include "commands/multilevel.hpp"
#include "commands/render.hpp"
#include "commands/replay.hpp"
#include "commands/run.hpp"
#include "commands/survey.hpp"
#include "commands/tradeoff.hpp"
#include "commands/validate.hpp"

namespace debias::cli {

/// What was typed for a command, or stands in a checkpoint, by the names of fields: base_level is --base-level.
struct Words {
  std::map<std::string, std::string> values;
  std::map<std::string, bool> flags;
  std::vector<std::string> names;  ///< problems or files, as many as one likes
};

// Requests that name files.

struct Resume {
  std::string file;
  std::optional<std::int64_t> samples = {};
  Goal goal = {};
  int threads = 0;
  Ranks ranks = {};

  [[nodiscard]] bool longer() const { return samples || goal.asked(); }
};

struct Merge {
  std::vector<std::string> files;
};

struct Diagnose {
  std::string file;
  numbers::Request reading = {};
};

/// A cloud of one's own, or the usual one.
struct RenderTransmittance {
  commands::TransmittanceRequest request = {};
  double density = 8;
  std::string volume = {};
  std::optional<std::array<int, 3>> dims = {};
  double exposure = 1;
};

struct RenderPhotons {
  commands::PhotonRequest request = {};
  double exposure = 1;
};

using Request = std::variant<commands::ListRequest, commands::RunRequest, commands::MultilevelRequest, Resume, Merge,
                             commands::ReplayRequest, commands::ValidateRequest, commands::HardRequest,
                             commands::UnseenRequest, commands::ReliabilityRequest, commands::SurveyRequest,
                             commands::TradeoffRequest, Diagnose, RenderTransmittance, RenderPhotons>;

/// The request of a command ("run", "render photons") from all of its words. Throws std::invalid_argument that names the
/// option, what is wrong with it and a near miss. The seed `random` is drawn here.
Request read_request(const std::string& command, const Words& words);

/// The words of a command when nothing is typed.
Words usual_words(const std::string& command);

/// A command that a checkpoint can redo, and its words: what read_request turns into the same request.
struct Saved {
  std::string command;
  Words words;
};
Saved saved(const commands::RunRequest& request);
Saved saved(const commands::MultilevelRequest& request);
Saved saved(const commands::ValidateRequest& request);
Saved saved(const commands::TradeoffRequest& request);
Saved saved(const RenderTransmittance& request);
Saved saved(const RenderPhotons& request);

/// base_level as --base-level.
std::string option(std::string_view field);

}  // namespace debias::cli

#pragma once

// A command as it was typed: its request, and where its report goes. Executing it gives an exit code; what it throws is
// turned into one by exit_code_of_current_exception (command_line.hpp).

#include <memory>
#include <string>

#include "core/part_file.hpp"
#include "output.hpp"
#include "requests.hpp"

namespace debias::cli {

struct Delivery {
  std::string output = {};      ///< a file, else standard output
  std::string checkpoint = {};  ///< what is finished is kept in this file
  std::string plot = {};        ///< a picture of the report is drawn into this file
  bool json = false;
  bool csv = false;
  bool full = false;  ///< all of a text that is brief by itself
  bool quiet = false;
  std::shared_ptr<const Parts> held = {};  ///< not typed: what `resume` has read from `checkpoint`
};

struct Command {
  Request request;
  Delivery delivery;
};
int execute(const Command& command);

int execute(const commands::ListRequest& request, const Delivery& delivery);
int execute(const commands::RunRequest& request, const Delivery& delivery);
int execute(const commands::MultilevelRequest& request, const Delivery& delivery);
int execute(const Resume& request, const Delivery& delivery);
int execute(const Merge& request, const Delivery& delivery);
int execute(const commands::ReplayRequest& request, const Delivery& delivery);
int execute(const commands::ValidateRequest& request, const Delivery& delivery);
int execute(const commands::HardRequest& request, const Delivery& delivery);
int execute(const commands::UnseenRequest& request, const Delivery& delivery);
int execute(const commands::ReliabilityRequest& request, const Delivery& delivery);
int execute(const commands::SurveyRequest& request, const Delivery& delivery);
int execute(const commands::TradeoffRequest& request, const Delivery& delivery);
int execute(const Diagnose& request, const Delivery& delivery);
int execute(const RenderTransmittance& request, const Delivery& delivery);
int execute(const RenderPhotons& request, const Delivery& delivery);

/// Writes a report as text, or as JSON.
template <class Report>
void deliver(const Report& report, const Delivery& delivery, Output& out) {
  using commands::print;
  if (delivery.json) {
    out.stream() << commands::to_json(report) << '\n';
  } else {
    if constexpr (requires { print(out.stream(), report, true); }) {
      print(out.stream(), report, delivery.full);
    } else {
      print(out.stream(), report);
    }
  }
  out.flush();
}

}  // namespace debias::cli

#pragma once

// The door of Python: keyword arguments become requests here. None, and what is left out, is the default of the request.

#include <pybind11/pybind11.h>

#include <cstdint>
#include <string>
#include <vector>

#include "commands/advise.hpp"
#include "commands/multilevel.hpp"
#include "commands/replay.hpp"
#include "commands/run.hpp"
#include "commands/survey.hpp"
#include "commands/tradeoff.hpp"

namespace debias::python {

/// Keyword arguments: numbers, or texts that stand for one ("1e6"), as __init__.py has let them pass.
class Options {
 public:
  explicit Options(pybind11::dict given) : given_(std::move(given)) {}

  [[nodiscard]] bool has(const char* name) const { return given_.contains(name); }
  [[nodiscard]] std::string text(const char* name) const { return pybind11::str(given_[name]); }
  /// Each throws std::invalid_argument that names the argument, what is wrong with it and a near miss.
  [[nodiscard]] std::uint64_t whole(const char* name, std::uint64_t low, std::uint64_t high) const;
  [[nodiscard]] double positive(const char* name) const;
  [[nodiscard]] double seconds(const char* name) const;
  [[nodiscard]] double share(const char* name) const;
  /// From pairs of code and text.
  [[nodiscard]] std::vector<Warning> warnings(const char* name) const;

 private:
  [[nodiscard]] bool is_number(const char* name) const;
  pybind11::dict given_;
};

commands::Shape shape_of(const Options& options, bool with_points = true);
std::uint64_t seed_of(const Options& options);

commands::RunRequest run_request(const catalog::Problem& problem, const Options& options);
commands::MultilevelRequest multilevel_request(const catalog::Problem& problem, const Options& options);
commands::AdviseRequest advise_request(const catalog::Problem& problem, const Options& options);
commands::SurveyRequest survey_request(const catalog::Problem& problem, const Options& options);
commands::TradeoffRequest tradeoff_request(const catalog::Problem& problem, const Options& options);
commands::ReplayRequest replay_request(const catalog::Problem& problem, const Options& options);

}  // namespace debias::python

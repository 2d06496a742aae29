#pragma once

// Which words the command line has, and what an exception exits with.

#include <optional>

#include "execute.hpp"

namespace debias::cli {

/// The words that were typed: of the command that is named, with where its report goes.
struct Typed {
  std::string command;
  Words words;
  Delivery delivery;
  std::string empty = {};  ///< an option that was given an empty value
};

/// None, where that was --help or --version, which is printed. Throws std::invalid_argument for words that no command has;
/// their values are not read.
std::optional<Typed> read_command_line(int argc, const char* const* argv);

/// Reads and executes; the exit code. Ranks share what a run draws.
int dispatch(int argc, const char* const* argv, const Ranks& ranks = {});

/// Says on standard error what is wrong; the exit code. Within a catch block.
int exit_code_of_current_exception();

}  // namespace debias::cli

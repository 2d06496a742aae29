#pragma once

// Which words the command line has, which function reads them, and what an exception exits with.

#include <optional>

#include "arguments.hpp"

namespace debias::cli {

struct Command {
  Arguments arguments;
  int (*execute)(const Arguments&) = nullptr;
};

/// The command that was typed; none, where that was --help or --version, which is printed. Throws
/// std::invalid_argument for words that it does not have; their values are read by the command.
std::optional<Command> read_command_line(int argc, const char* const* argv);

/// Reads and executes; the exit code. Ranks share what a run draws.
int dispatch(int argc, const char* const* argv, debias::detail::Ranks* ranks = nullptr);

/// Says on standard error what is wrong; the exit code. Within a catch block.
int exit_code_of_current_exception();

}  // namespace debias::cli

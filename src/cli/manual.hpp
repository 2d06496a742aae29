#pragma once

// The man page and the shell completion of the program, made from the description that its command line is read by, so that
// they cannot say anything else: `debias --man | man -l -`, `eval "$(debias --completion)"` in bash, and in zsh after
// bashcompinit.

#include <string>

namespace CLI {
class App;
}

namespace debias::cli {

/// In the macros of man(7).
std::string man_page(const CLI::App& app);

/// A function of bash that completes commands, their options and, elsewhere, file names.
std::string completion(const CLI::App& app);

}  // namespace debias::cli

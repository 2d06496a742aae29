#include <exception>

#include "command_line.hpp"
#include "launch.hpp"
#include "output.hpp"

int main(int argc, char** argv) {
  using namespace debias::cli;
  keep_standard_streams();
  watch_signals();
  try {
    Launch launch(&argc, &argv);
    try {
      return launch.leave(dispatch(argc, argv, launch.ranks()), nullptr);
    } catch (...) {
      return launch.leave(exit_code_of_current_exception(), std::current_exception());
    }
  } catch (...) {
    return exit_code_of_current_exception();
  }
}

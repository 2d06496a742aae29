#include "command_line.hpp"
#include "output.hpp"

int main(int argc, char** argv) {
  debias::cli::keep_standard_streams();
  debias::cli::watch_signals();
  try {
    return debias::cli::dispatch(argc, argv);
  } catch (...) {
    return debias::cli::exit_code_of_current_exception();
  }
}

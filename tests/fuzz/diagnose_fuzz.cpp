// `debias diagnose` on any file: the first byte chooses format, column, separator and output, the rest is the file.

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <stdexcept>
#include <string>

#include "cli/commands.hpp"
#include "cli/output.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace debias::cli;
  if (size == 0) return 0;
  std::cerr.setstate(std::ios::failbit);  // complaints are not read
  const int file = memfd_create("fuzz", 0);
  if (file < 0 || write(file, data + 1, size - 1) != static_cast<ssize_t>(size - 1)) std::abort();
  Arguments arguments;
  arguments.file = "/proc/self/fd/" + std::to_string(file);
  arguments.output = "/dev/null";
  const unsigned choice = data[0];
  if ((choice & 1U) != 0) arguments.format = (choice & 16U) != 0 ? "f32be" : "f64";
  if ((choice & 2U) != 0) arguments.json = true;
  if ((choice & 4U) != 0) arguments.column = (choice & 8U) != 0 ? "2" : "flux";
  if ((choice & 1U) == 0) {
    if ((choice & 16U) != 0) arguments.decimal = ",";
    if ((choice & 32U) != 0) arguments.separator = (choice & 64U) != 0 ? "semicolon" : "space";
    if ((choice & 128U) != 0) arguments.header = true;
  }
  try {
    const int code = diagnose(arguments);
    if (code != done && code != file_error && code != nonfinite_samples) std::abort();
  } catch (const std::invalid_argument&) {
  } catch (const FileError&) {
  }
  close(file);
  return 0;
}

#pragma once

// The functions of functions.hpp by name: both forms behind a pointer, so that a sequence is compiled once for all of them.

#include <string>

namespace debias::python {

struct NamedFunction {
  double parameter;
  double (*value)(double m, double parameter);
  double (*gap_form)(double m, double d, double parameter);

  double operator()(double m) const { return value(m, parameter); }
  [[nodiscard]] double gap(double m, double d) const { return gap_form(m, d, parameter); }
};

/// "log", or "power:1.5". Throws std::invalid_argument, with the nearest name.
NamedFunction function_of(const std::string& text);

}  // namespace debias::python

// Anyone's numbers: what they say, intervals, and quantiles.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "binding.hpp"
#include "commands/diagnose.hpp"

namespace debias::python {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Flags = py::array_t<bool, py::array::c_style | py::array::forcecast>;

/// Takes pieces of numbers in order.
class Diagnostician {
 public:
  void add(const Doubles& piece, const Flags& left_out) {
    const auto size = static_cast<std::size_t>(piece.size());
    if (left_out.size() != piece.size()) throw std::invalid_argument("diagnose: not one flag for each value");
    const std::span values(piece.data(), size);
    const std::span flags(left_out.data(), size);
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < size; ++i) {
      ++count_;  // the program counts from 1, and what is left out has a place too
      if (!flags[i]) {
        sums_.add(values[i], count_);
      } else if (++missing_ == 1) {
        first_missing_ = count_;
      }
    }
  }
  /// The report, and of what its interval is made: standard error and degrees of freedom, 0 where there is none.
  py::tuple finish(const std::string& name) {
    const commands::Diagnosis d = diagnosis(name);
    return py::make_tuple(as_objects(d), py::make_tuple(d.standard_error, d.interval_degrees));
  }

 private:
  commands::Diagnosis diagnosis(const std::string& name) {
    const py::gil_scoped_release release;
    commands::Diagnosis d;
    d.file = name;
    d.unit = "value";
    sums_.finish(d);
    if (d.moments.count == 0) {
      throw std::invalid_argument(
          "diagnose: no value (" +
          (missing_ > 0 ? "all " + std::to_string(missing_) + " are masked or missing" : std::string("one at least")) +
          ")");
    }
    judge(d);
    if (missing_ > 0) {
      d.warnings.push_back({WarningCode::missing_values, std::to_string(missing_) + " of " + std::to_string(count_) +
                                                             " values are masked or missing, the first is value " +
                                                             std::to_string(first_missing_) +
                                                             ": they are left out of everything here."});
    }
    return d;
  }

  commands::Sums sums_;
  std::int64_t count_ = 0;
  std::int64_t missing_ = 0;
  std::int64_t first_missing_ = 0;
};

}  // namespace

void bind_numbers(py::module_& m) {
  m.def("interval", [](double mean, double error, double degrees, const py::dict& confidence) {
    return translated([&] {
      const Interval found = commands::interval_at(Options(confidence).share("confidence"), mean, error, degrees);
      return std::pair(found.low, found.high);
    });
  });
  m.def("seconds", [](const std::string& name, const py::dict& options) {
    return translated([&] { return Options(options).seconds(name.c_str()); });
  });
  m.def("normal_quantile", py::vectorize([](double u) { return normal_quantile(u); }));

  py::class_<Diagnostician>(m, "Diagnostician")
      .def(py::init<>())
      .def("add", &Diagnostician::add)
      .def("finish", &Diagnostician::finish);
}

}  // namespace debias::python

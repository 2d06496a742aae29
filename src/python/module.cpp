// debias._debias: the commands for Python. Each takes a problem (a name of the catalogue, or one of the user's own), keyword
// arguments, and whoever wants to see the progress; it returns its report as text, as JSON and as a dict. What belongs to
// Python alone lives in debias/__init__.py.

#include <pybind11/pybind11.h>

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "binding.hpp"
#include "commands/describe.hpp"
#include "commands/list.hpp"
#include "commands/renamed.hpp"

namespace py = pybind11;

namespace debias::python {

py::object object_of(const commands::Node& node) {
  return std::visit(
      [](const auto& x) -> py::object {
        using T = std::decay_t<decltype(x)>;
        if constexpr (std::is_same_v<T, std::nullptr_t>) {
          return py::none();
        } else if constexpr (std::is_same_v<T, double>) {
          return std::isfinite(x) ? py::object(py::float_(x)) : py::none();
        } else if constexpr (std::is_same_v<T, std::string>) {
          const auto size = static_cast<py::ssize_t>(x.size());
          return py::reinterpret_steal<py::object>(PyUnicode_DecodeUTF8(x.data(), size, "replace"));
        } else if constexpr (std::is_same_v<T, commands::List>) {
          py::list list;
          for (const commands::Node& n : x) list.append(object_of(n));
          return list;
        } else if constexpr (std::is_same_v<T, commands::Fields>) {
          py::dict dict;
          for (const commands::Entry& e : x) dict[py::str(e.name)] = object_of(e.value);
          return dict;
        } else {
          return py::cast(x);
        }
      },
      node.value);
}

void add_note(const py::error_already_set& e, const std::string& note) {
  if (py::hasattr(e.value(), "add_note")) e.value().attr("add_note")(note);
}

void raise(const NoPmfError& e) {
  const py::object refusal = py::module_::import("debias").attr("NoPmfError")(e.what());
  for (const commands::Entry& field : commands::describe(e)) {
    refusal.attr(field.name.c_str()) = object_of(field.value);
  }
  PyErr_SetObject(py::type::of(refusal).ptr(), refusal.ptr());
  throw py::error_already_set();
}

std::shared_ptr<py::function> kept(const py::function& f) {
  return {new py::function(f), [](const py::function* owned) {
            const py::gil_scoped_acquire acquire;
            delete owned;
          }};
}

namespace {

// Before 2.12 pybind11 reads the descriptors of NumPy 2 in the places of NumPy 1: every array that it makes has strides
// of 0, so that `samples` was one number n times.
void refuse_numpy_beyond_pybind11() {
#if PYBIND11_VERSION_HEX < 0x020C0000
  const auto version = py::module_::import("numpy").attr("__version__").cast<std::string>();
  if (std::atoi(version.c_str()) < 2) return;
  const std::string mine = std::to_string(PYBIND11_VERSION_MAJOR) + "." + std::to_string(PYBIND11_VERSION_MINOR);
  throw py::import_error("debias: built with pybind11 " + mine + ", which reads arrays of NumPy " + version +
                         " wrongly; take a NumPy below 2, or build debias with pybind11 2.12 or newer");
#endif
}

}  // namespace
}  // namespace debias::python

PYBIND11_MODULE(_debias, m) {
  using namespace debias;
  using namespace debias::python;
  refuse_numpy_beyond_pybind11();
  m.attr("version") = DEBIAS_VERSION;
  m.def("refuse_if_renamed", commands::refuse_if_renamed);
  m.attr("stream_version") = static_cast<int>(Stream::layout_version);
  for (const auto& [name, topic] : {std::pair("problems", commands::Topic::problems),
                                    {"estimators", commands::Topic::estimators},
                                    {"pmfs", commands::Topic::pmfs}}) {
    m.def(name, [topic = topic] { return object_of(fields(commands::list({topic}))); });
  }
  bind_runs(m);
  bind_problems(m);
  bind_chains(m);
  bind_numbers(m);
}

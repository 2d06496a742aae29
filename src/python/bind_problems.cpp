// Problems of the user's own: levels, terms and means that Python answers, or compiled functions.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "compiled.hpp"

namespace debias::python {

Facts facts_of(const py::dict& d) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto number = [&](const char* key) { return d[key].is_none() ? nan : d[key].cast<double>(); };
  Facts facts;
  facts.name = d["name"].cast<std::string>();
  facts.formula = d["formula"].cast<std::string>();
  facts.truth = number("truth");
  facts.rates = {number("variance_decay"), number("work_growth"),
                 d["polynomial"].cast<bool>() ? Decay::polynomial : Decay::geometric};
  facts.lowest_base = d["lowest_base"].cast<std::int64_t>();
  if (d.contains("deepest_level") && !d["deepest_level"].is_none()) {
    facts.deepest_level = d["deepest_level"].cast<std::int64_t>();
  }
  if (d.contains("last_level")) facts.last_level = d["last_level"].cast<std::int64_t>();
  if (d.contains("rounding")) facts.rounding = d["rounding"].cast<double>();
  return facts;
}

namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Look-ups that Python answers: answer(level, questions) returns a checked array of rows of numbers, and
/// answer(level, questions, base_level) those with a shared base; size(level) gives the numbers of a row of questions, at
/// most `widest`, and the work of a draw. What Python throws says at which level, unless all levels ask together.
std::shared_ptr<Lookups> lookups_of(const py::function& answer, const py::function& size, double widest,
                                    bool shares = false, bool by_level = true) {
  const auto is_shared = [shares](std::int64_t key) { return shares && key >= shared_key(0, 0); };
  const auto answer_of = [f = kept(answer), is_shared, by_level](std::int64_t key, std::span<const double> questions,
                                                                 std::size_t rows, std::vector<double>& answers) {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const auto n = static_cast<py::ssize_t>(rows);
    py::array_t<double> asked({n, static_cast<py::ssize_t>(questions.size() / rows)});
    std::memcpy(asked.mutable_data(), questions.data(), questions.size_bytes());
    const std::int64_t level = is_shared(key) ? level_of_key(key) : key;
    const py::object answered = [&] {
      try {
        return is_shared(key) ? (*f)(level, asked, base_of_key(key)) : (*f)(level, asked);
      } catch (const py::error_already_set& e) {
        if (by_level)
          add_note(e,
                   "debias: at level " + std::to_string(level) + ", of an array of " + std::to_string(rows) + " rows");
        throw;
      }
    }();
    const auto given = answered.template cast<Doubles>();
    if (given.ndim() != 2 || given.shape(0) != n) throw std::logic_error("answers: not one row for each question");
    answers.insert(answers.end(), given.data(), given.data() + given.size());
    return static_cast<std::size_t>(given.shape(1));
  };
  const auto size_of = [f = kept(size), widest, is_shared](std::int64_t key) -> Lookups::Size {
    const py::gil_scoped_acquire acquire;
    const std::int64_t level = is_shared(key) ? level_of_key(key) : key;
    const py::object size = [&] {
      try {
        return (*f)(level);
      } catch (const py::error_already_set& e) {
        if (e.matches(PyExc_KeyboardInterrupt)) PyErr_SetInterrupt();  // whoever takes this for a refusal
        throw;
      }
    }();
    const auto [width, work] = size.template cast<std::pair<double, double>>();
    if (width > widest) {
      throw std::length_error("dimension: level " + std::to_string(level) + " asks for more than 2^" +
                              std::to_string(std::ilogb(widest)) + " uniforms a draw");
    }
    return {static_cast<std::size_t>(width), work};
  };
  return std::make_shared<Lookups>(answer_of, size_of);
}

}  // namespace

void bind_problems(py::module_& m) {
  py::class_<UserProblem>(m, "UserProblem")
      .def_readonly("components", &UserProblem::components)
      .def_property_readonly("compiled", [](const UserProblem& u) { return u.compiled != nullptr; })
      .def_property_readonly("name", [](const UserProblem& u) { return u.problem.name; })
      .def_property_readonly(
          "special",
          [](const UserProblem& u) { return u.problem.specials.empty() ? "" : u.problem.specials.front().name; })
      .def_property_readonly("declares_rates",
                             [](const UserProblem& u) { return !std::isnan(u.problem.rates.variance_decay); });
  m.def("levels", [](const py::dict& facts, const py::function& answer, const py::function& size,
                     std::size_t components, bool shares, double widest) {
    return translated(
        [&] { return levels_problem(facts_of(facts), lookups_of(answer, size, widest, shares), components, shares); });
  });
  m.def("terms",
        [](const py::dict& facts, const py::function& answer, const py::function& size, bool path, double widest) {
          return translated([&] { return terms_problem(facts_of(facts), lookups_of(answer, size, widest), path); });
        });
  m.def("compiled_mean",
        [](const py::dict& facts, std::uintptr_t f, std::optional<std::uintptr_t> user, std::size_t dimension,
           const std::string& g, const std::string& points, double from, double to) {
          return translated([&] {
            return compiled_mean(facts_of(facts), CIntegrand{f, user}, dimension, g, points, from, to);
          });
        });
  m.def("compiled_levels", [](const py::dict& facts, std::uintptr_t f, std::optional<std::uintptr_t> user,
                              const std::vector<std::pair<double, double>>& sizes) {
    return translated([&] {
      std::vector<Lookups::Size> of_levels;
      for (const auto& [width, work] : sizes) of_levels.push_back({static_cast<std::size_t>(width), work});
      return compiled_levels(facts_of(facts), CLevels{f, user}, std::move(of_levels));
    });
  });
  m.def("mean", [](const py::dict& facts, const py::function& answer, const py::function& size, const std::string& g,
                   const std::string& points, double from, double to) {
    return translated([&] {
      return mean_problem(facts_of(facts), lookups_of(answer, size, 0x1p24, false, false), g, points, from, to);
    });
  });
}

}  // namespace debias::python

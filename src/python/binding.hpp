#pragma once

// What all bindings of debias._debias share: reports as Python objects, exceptions as Python expects them, and the thread that a
// command runs on.
//
//   translated(f)                 f(), whose exceptions become those of Python
//   with_problem(problem, ...)    f(request, watch) for a name of the catalogue or a problem of the user's own

#include <pybind11/pybind11.h>

#include <unistd.h>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <future>
#include <memory>
#include <mutex>
#include <new>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <type_traits>
#include <utility>

#include <debias/core/estimate.hpp>

#include "catalog.hpp"
#include "catalog/unknown_name.hpp"
#include "commands/fields.hpp"
#include "options.hpp"
#include "problem.hpp"

namespace debias::python {

namespace py = pybind11;
using commands::Watch;
using namespace std::chrono_literals;

void bind_runs(py::module_& m);
void bind_problems(py::module_& m);
void bind_chains(py::module_& m);
void bind_numbers(py::module_& m);

/// A report's fields as Python objects; what is not finite is None.
py::object object_of(const commands::Node& node);

/// Says where an exception of the user's function came from, where Python can hold notes (3.11).
void add_note(const py::error_already_set& e, const std::string& note);

/// As debias.NoPmfError, with what led to it.
[[noreturn]] void raise(const NoPmfError& e);

/// References go while Python holds its lock, wherever the last owner is.
std::shared_ptr<py::function> kept(const py::function& f);

Facts facts_of(const py::dict& d);

/// As a brief text, as a full one, as JSON and as a dict.
template <class R>
py::tuple as_objects(const R& report) {
  std::ostringstream text;  // only texts
  std::ostringstream full;  // only texts
  print(text, report);
  if constexpr (requires { print(full, report, true); }) {
    print(full, report, true);
  } else {
    print(full, report);
  }
  return py::make_tuple(text.str(), full.str(), commands::to_json(report), object_of(fields(report)));
}

/// Calls f; what it throws becomes what a Python user expects: the user's own exceptions as they were raised.
template <class F>
auto translated(const F& f) {
  try {
    return f();
  } catch (const SampleError& e) {
    const std::string where = "seed " + std::to_string(e.seed()) + ", sample " + std::to_string(e.index());
    try {
      std::rethrow_if_nested(e);
    } catch (py::error_already_set& inner) {
      add_note(inner, "debias: in the block that begins with " + where);
      throw;
    } catch (const std::logic_error& inner) {
      throw py::value_error(where + ": " + inner.what());
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& inner) {
      throw std::runtime_error(where + ": " + inner.what());
    }
    throw;
  } catch (const NoPmfError& e) {
    raise(e);
  } catch (const catalog::UnknownName& e) {
    throw py::value_error(e.seen_in("debias." + e.topic() + "()"));
  } catch (const std::logic_error& e) {
    throw py::value_error(e.what());
  }
}

/// Runs f(watch) here: Python functions answer on the thread that their user called from.
template <class F>
auto on_this_thread(const F& f, const py::object& progress) {
  auto next = std::chrono::steady_clock::now();
  const Watch watch = [&](std::string_view, double done, double total) {
    if (std::chrono::steady_clock::now() < next) return true;
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!progress.is_none()) progress(done, total);
    next = std::chrono::steady_clock::now() + 50ms;
    return true;
  };
  const py::gil_scoped_release release;
  return f(watch);
}

/// Runs f(watch) on a thread of its own, while this one answers Ctrl-C and shows the progress. A run that does not
/// end within 0.35 s of Ctrl-C (deep in a level of 2^60 draws nobody looks) is left behind, and ends with the program.
template <class F>
auto on_worker(const F& f, const py::object& progress) {
  struct Shared {
    std::atomic<double> done = 0;
    std::atomic<double> total = 0;
    std::atomic<bool> stop = false;
  };
  const auto shared = std::make_shared<Shared>();
  std::packaged_task<std::invoke_result_t<F, const Watch&>()> task([f, shared] {
    return f([&shared](std::string_view, double done, double total) {
      shared->done = done;
      shared->total = total;
      return !shared->stop;
    });
  });
  auto future = task.get_future();
  std::thread worker;
  try {
    worker = std::thread(std::move(task));
  } catch (const std::system_error&) {  // the machine has no more threads
    return on_this_thread(f, progress);
  }
  const auto ends_within = [&future](std::chrono::milliseconds time) {
    const py::gil_scoped_release release;
    return future.wait_for(time) == std::future_status::ready;
  };
  try {
    while (!ends_within(50ms)) {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (!progress.is_none()) progress(shared->done.load(), shared->total.load());
    }
  } catch (...) {
    shared->stop = true;
    if (ends_within(350ms)) {
      worker.join();
    } else {
      worker.detach();
      // Its tables must outlive it: leave without destroying them.
      static const int registered = on_exit(
          [](int status, void*) {
            std::fflush(nullptr);
            _exit(status);
          },
          nullptr);
      static_cast<void>(registered);
    }
    throw;
  }
  worker.join();
  return future.get();
}

/// f(request, watch) for a problem of either kind, with request = request_of(problem, options).
template <class RequestOf, class F>
auto with_problem(const py::object& problem, const py::dict& options, const py::object& progress,
                  const RequestOf& request_of, const F& f) {
  return translated([&] {
    if (py::isinstance<UserProblem>(problem)) {
      const auto& user = problem.cast<const UserProblem&>();
      const std::unique_lock lock(*user.in_use, std::try_to_lock);
      if (!lock)
        throw std::invalid_argument("problem: '" + user.problem.name + "' (is in use by another run); make two");
      if (user.compiled) {
        const auto own = user.compiled;
        const auto request = request_of(*own, Options(options));
        return on_worker([request, f, own](const Watch& watch) { return f(request, watch); }, progress);
      }
      const auto request = request_of(user.problem, Options(options));
      return on_this_thread([&](const Watch& watch) { return f(request, watch); }, progress);
    }
    const auto request = request_of(catalog::find(problem.cast<std::string>()), Options(options));
    return on_worker([request, f](const Watch& watch) { return f(request, watch); }, progress);
  });
}

}  // namespace debias::python

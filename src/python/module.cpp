// debias._debias: the commands for Python. Each takes a problem (a name of the catalogue, or one of the user's own), keyword
// arguments, and whoever wants to see the progress; it returns its report as text, as JSON and as a dict. What belongs to
// Python alone lives in debias/__init__.py.

#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <unistd.h>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <future>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "catalog.hpp"
#include "chains.hpp"
#include "commands/describe.hpp"
#include "commands/diagnose.hpp"
#include "commands/list.hpp"
#include "commands/renamed.hpp"
#include "compiled.hpp"
#include "core/run_state_bytes.hpp"
#include "options.hpp"
#include "problem.hpp"

namespace py = pybind11;

namespace debias::python {
namespace {

using commands::Watch;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Flags = py::array_t<bool, py::array::c_style | py::array::forcecast>;
using namespace std::chrono_literals;

// A report's fields as Python objects; what is not finite is None.
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

// As a brief text, as a full one, as JSON and as a dict.
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

// Says where an exception of the user's function came from, where Python can hold notes (3.11).
void add_note(const py::error_already_set& e, const std::string& note) {
  if (py::hasattr(e.value(), "add_note")) e.value().attr("add_note")(note);
}

// As debias.NoPmfError, with what led to it.
[[noreturn]] void raise(const NoPmfError& e) {
  const py::object refusal = py::module_::import("debias").attr("NoPmfError")(e.what());
  for (const commands::Entry& field : commands::describe(e)) {
    refusal.attr(field.name.c_str()) = object_of(field.value);
  }
  PyErr_SetObject(py::type::of(refusal).ptr(), refusal.ptr());
  throw py::error_already_set();
}

// Calls f; what it throws becomes what a Python user expects: the user's own exceptions as they were raised.
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

// f(request, watch) for a problem of either kind, with request = request_of(problem, options).
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

auto executed(const commands::RunRequest& r, const Watch& watch) { return commands::run(r, watch); }
auto executed(const commands::MultilevelRequest& r, const Watch& watch) { return commands::multilevel(r, {watch}); }
auto executed(const commands::AdviseRequest& r, const Watch& watch) { return commands::advise(r, watch); }
auto executed(const commands::SurveyRequest& r, const Watch& watch) { return commands::survey(r, watch); }
auto executed(const commands::TradeoffRequest& r, const Watch& watch) { return commands::tradeoff(r, {watch}); }
auto executed(const commands::ReplayRequest& r, const Watch& /*watch*/) { return commands::replay(r); }

template <auto request_of>
py::tuple run_command(const py::object& problem, const py::dict& options, const py::object& progress) {
  const auto command = [](const auto& request, const Watch& watch) { return executed(request, watch); };
  return as_objects(with_problem(problem, options, progress, request_of, command));
}

// References go while Python holds its lock, wherever the last owner is.
std::shared_ptr<py::function> kept(const py::function& f) {
  return {new py::function(f), [](const py::function* owned) {
            const py::gil_scoped_acquire acquire;
            delete owned;
          }};
}

/// The sums of a run, which go on or merge.
struct State {
  std::shared_ptr<const RunState> sums;

  [[nodiscard]] py::bytes bytes() const {
    const Bytes all = encode(*sums);
    return {reinterpret_cast<const char*>(all.data()), all.size()};
  }
  static State of(const py::bytes& contents) {
    const auto text = static_cast<std::string_view>(contents);
    return translated([&] {
      return State{std::make_shared<const RunState>(decode(std::as_bytes(std::span(text.data(), text.size()))))};
    });
  }
  [[nodiscard]] State merged(const State& other) const {
    return translated([&] {
      RunState both = *sums;
      both.merge(*other.sums);
      return State{std::make_shared<const RunState>(std::move(both))};
    });
  }
  /// With what another one has spent before its run.
  [[nodiscard]] State with_pilot_of(const State& other) const {
    RunState mine = *sums;
    mine.pilot = other.sums->pilot;
    return State{std::make_shared<const RunState>(std::move(mine))};
  }
};

/// What a run had settled when it saved: arguments that draw the same samples without a pilot.
py::dict settled_of(const commands::RunRequest& now) {
  py::dict d;
  const commands::Shape& s = now.shape;
  if (s.estimator) d[s.estimator->special.empty() ? "estimator" : "special"] = commands::name_of(*s.estimator);
  if (const auto* pmf = std::get_if<AnyPmf>(&s.pmf)) d["pmf"] = pmf->spec();
  if (s.base_level) d["base_level"] = *s.base_level;
  if (s.block != 1) d["block"] = s.block;
  if (s.points == Points::nets) d["points"] = commands::name_of(s.points);
  if (now.sampling.samples) d["samples"] = *now.sampling.samples;
  d["seed"] = now.sampling.seed;
  d["confidence"] = now.confidence;
  if (now.served.error > 0) d["served_error"] = now.served.error;
  if (now.served.relative_error > 0) d["served_relative_error"] = now.served.relative_error;
  if (now.served.seconds > 0) d["served_seconds"] = now.served.seconds;
  return d;
}

/// What `run` says. Its texts are made when they are asked for: each judges the run anew, which takes longer than a short run.
struct Said {
  commands::RunReport report;
  py::object problem;  // that the report points at

  [[nodiscard]] py::object data() const { return object_of(fields(report)); }
  [[nodiscard]] py::tuple texts() const {
    std::ostringstream text;  // only texts
    std::ostringstream full;  // only texts
    print(text, report);
    print(full, report, true);
    return py::make_tuple(text.str(), full.str(), commands::to_json(report));
  }
};

/// A run that is kept: (report, its sums, what it had settled). It goes on from `earlier`; draws only shard (i, n) of its
/// samples; calls save(sums, settled) about once a second. With `settle` it ends as soon as its pilots have, without a report.
py::tuple run_kept(const py::object& problem, const py::dict& options, const py::object& progress,
                   const py::object& earlier, const py::object& shard, const py::object& save, bool settle) {
  struct Kept {
    std::optional<commands::RunReport> report = {};
    std::shared_ptr<const RunState> sums = {};
    std::optional<commands::RunRequest> now = {};
  };
  const auto request_of = [&shard](const catalog::Problem& p, const Options& o) {
    commands::RunRequest r = run_request(p, o);
    if (!shard.is_none()) {
      const auto [i, n] = shard.cast<std::pair<std::int64_t, std::int64_t>>();
      r.shard = commands::Shard{i, n};
    }
    return r;
  };
  commands::Earlier held;
  if (!earlier.is_none()) {
    held.sums = earlier.cast<const State&>().sums;
    held.samples = held.sums->last();
  }
  std::shared_ptr<py::function> told;
  if (!save.is_none()) told = kept(save.cast<py::function>());
  const auto draw = [held, told, settle](const commands::RunRequest& request, const Watch& watch) {
    Kept result;
    const auto keep = [&](const commands::RunRequest& now, const RunState& sums) {
      result.now = now;
      result.sums = std::make_shared<const RunState>(sums);
      if (!told) return;
      const py::gil_scoped_acquire acquire;
      (*told)(State{result.sums}, settled_of(now));
    };
    const Watch look = [&](std::string_view what, double done, double total) {
      return watch(what, done, total) && !(settle && (total > 0 || result.now));
    };
    try {
      result.report = commands::run(request, look, held, keep);
    } catch (const Interrupted&) {
      if (!settle) throw;
    }
    return result;
  };
  const Kept result = with_problem(problem, options, progress, request_of, draw);
  return py::make_tuple(result.report ? py::cast(Said{*result.report, problem}) : py::object(py::none()),
                        result.sums ? py::cast(State{result.sums}) : py::object(py::none()),
                        result.now ? py::object(settled_of(*result.now)) : py::object(py::none()));
}

/// Samples first, first + 1, ..., n of them; the means of whole blocks, where they come in blocks.
py::object samples(const py::object& problem, const py::dict& options, std::int64_t n, std::int64_t first,
                   const py::object& progress) {
  struct Asked {
    const catalog::Problem* problem;
    catalog::Choice choice;
    std::uint64_t seed;
  };
  const auto request_of = [n, first](const catalog::Problem& p, const Options& o) {
    Asked asked{&p, commands::choice_of(shape_of(o), p), seed_of(o)};
    const std::int64_t block = asked.choice.block;
    for (const auto& [name, x] : {std::pair("n", n), {"first", first}}) {
      if (x % block == 0) continue;
      throw std::invalid_argument(std::string(name) + " = " + std::to_string(x) + " (samples come in whole blocks of " +
                                  std::to_string(block) + ", whose means are returned); take a multiple of " +
                                  std::to_string(block));
    }
    return asked;
  };
  const bool own = py::isinstance<UserProblem>(problem) && !problem.cast<const UserProblem&>().compiled;
  const UserProblem* user = own ? &problem.cast<const UserProblem&>() : nullptr;
  const std::size_t components = own ? user->components : 1;
  const auto values = std::make_shared<std::vector<double>>();
  with_problem(problem, options, progress, request_of, [=](const Asked& asked, const Watch& watch) {
    const std::int64_t block = asked.choice.block;
    const std::int64_t blocks = n / block;
    values->resize(static_cast<std::size_t>(blocks) * components);
    for (std::int64_t i = 0; i < blocks;) {
      const std::int64_t size = std::min<std::int64_t>(own ? 4096 : 64, blocks - i);
      const auto begin = static_cast<std::size_t>(i) * components;
      const auto out = std::span(*values).subspan(begin, static_cast<std::size_t>(size) * components);
      if (own) {
        user->samples(asked.choice, asked.seed, first / block + i, out);
      } else {
        for (std::int64_t j = 0; j < size; ++j) {
          out[static_cast<std::size_t>(j)] =
              asked.problem->trace(asked.choice, asked.seed, first + (i + j) * block).sample.value;
        }
      }
      i += size;
      if (!watch("samples", static_cast<double>(i * block), static_cast<double>(n))) break;
    }
    return true;
  });
  py::array_t<double> result(static_cast<py::ssize_t>(values->size()));
  std::memcpy(result.mutable_data(), values->data(), values->size() * sizeof(double));
  return result;
}

/// Look-ups that Python answers: answer(level, questions) returns a checked array of rows of numbers, and
/// answer(level, questions, base_level) those with a shared base; size(level) gives the numbers of a row of questions, at
/// most `widest`, and the work of a draw.
std::shared_ptr<Lookups> lookups_of(const py::function& answer, const py::function& size, double widest,
                                    bool shares = false) {
  const auto is_shared = [shares](std::int64_t key) { return shares && key >= shared_key(0, 0); };
  const auto answer_of = [f = kept(answer), is_shared](std::int64_t key, std::span<const double> questions,
                                                       std::size_t rows, std::vector<double>& answers) {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const auto n = static_cast<py::ssize_t>(rows);
    py::array_t<double> asked({n, static_cast<py::ssize_t>(questions.size() / rows)});
    std::memcpy(asked.mutable_data(), questions.data(), questions.size_bytes());
    const py::object answered = is_shared(key) ? (*f)(level_of_key(key), asked, base_of_key(key)) : (*f)(key, asked);
    const auto given = answered.template cast<Doubles>();
    if (given.ndim() != 2 || given.shape(0) != n) throw std::logic_error("answers: not one row for each question");
    answers.insert(answers.end(), given.data(), given.data() + given.size());
    return static_cast<std::size_t>(given.shape(1));
  };
  const auto size_of = [f = kept(size), widest, is_shared](std::int64_t key) -> Lookups::Size {
    const py::gil_scoped_acquire acquire;
    const std::int64_t level = is_shared(key) ? level_of_key(key) : key;
    const auto [width, work] = (*f)(level).template cast<std::pair<double, double>>();
    if (width > widest) {
      throw std::length_error("dimension: level " + std::to_string(level) + " asks for more than 2^" +
                              std::to_string(std::ilogb(widest)) + " uniforms a draw");
    }
    return {static_cast<std::size_t>(width), work};
  };
  return std::make_shared<Lookups>(answer_of, size_of);
}

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

ChainOptions chain_options_of(const py::dict& d) {
  const auto number = [&](const char* key) { return d[key].cast<std::int64_t>(); };
  return {.burn_in = number("burn_in"), .length = number("length"), .lag = number("lag"), .limit = number("limit")};
}

py::dict as_dict(const ChainOptions& o) {
  using py::literals::operator""_a;
  return py::dict("burn_in"_a = o.burn_in, "length"_a = o.length, "lag"_a = o.lag, "limit"_a = o.limit);
}

/// Chains that Python runs: run(streams, options) returns a row of numbers for each of the streams.
std::shared_ptr<ChainBlocks> chain_blocks_of(const py::function& run, std::size_t components,
                                             const ChainOptions& options) {
  const auto rows_of = [f = kept(run)](StreamBlock streams, const ChainOptions& of) {
    const py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const auto rows = (*f)(py::cast(std::move(streams)), as_dict(of)).cast<Doubles>();
    return std::vector<double>(rows.data(), rows.data() + rows.size());
  };
  return std::make_shared<ChainBlocks>(rows_of, std::max<std::size_t>(components, 1), options);
}

py::array_t<double> uniforms_of(StreamBlock& streams,
                                const py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>& rows,
                                std::size_t width) {
  py::array_t<double> out({rows.size(), static_cast<py::ssize_t>(width)});
  streams.uniforms({rows.data(), static_cast<std::size_t>(rows.size())}, width,
                   {out.mutable_data(), static_cast<std::size_t>(out.size())});
  return out;
}

py::tuple advise_chains_as_objects(const py::function& run, std::size_t components, const py::dict& d) {
  using py::literals::operator""_a;
  return translated([&] {
    ChainAdviceOptions options;
    options.chains = d["chains"].cast<std::int64_t>();
    options.seed = d["seed"].cast<std::uint64_t>();
    options.limit = d["limit"].cast<std::int64_t>();
    options.multiple = d["multiple"].cast<std::int64_t>();
    const ChainAdvice advice = advise_chains(*chain_blocks_of(run, components, {}), options);
    std::ostringstream text;  // only texts
    text << advice;
    const auto number = [](double x) { return std::isfinite(x) ? py::object(py::float_(x)) : py::object(py::none()); };
    py::list meetings;
    for (const MeetingInterval& m : advice.meetings) {
      meetings.append(py::dict("first"_a = m.first, "last"_a = m.last, "chains"_a = m.chains));
    }
    py::list distance;
    for (const DistanceBound& b : advice.distance) {
      distance.append(py::dict("time"_a = b.time, "bound"_a = b.bound));
    }
    const MeetingTail& tail = advice.tail;
    py::dict fields("options"_a = advice.available() ? py::object(as_dict(advice.options)) : py::object(py::none()),
                    "meeting"_a = py::dict("tail"_a = name_of(tail.kind), "chains"_a = tail.chains, "cut"_a = tail.cut,
                                           "exponent"_a = number(tail.exponent), "error"_a = number(tail.error),
                                           "median"_a = tail.median, "late"_a = tail.late, "last"_a = tail.last,
                                           "sentence"_a = tail.sentence()),
                    "meetings"_a = meetings, "inefficiency"_a = number(advice.inefficiency),
                    "inefficiency_error"_a = number(advice.inefficiency_error), "work"_a = advice.work,
                    "pilot_work"_a = advice.pilot_work, "distance"_a = distance, "seed"_a = options.seed);
    return py::make_tuple(text.str(), fields);
  });
}

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
  py::tuple finish(const std::string& name) { return as_objects(diagnosis(name)); }

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

  m.def("run", run_command<run_request>);
  m.def("multilevel", run_command<multilevel_request>);
  m.def("advise", run_command<advise_request>);
  m.def("survey", run_command<survey_request>);
  m.def("tradeoff", run_command<tradeoff_request>);
  m.def("replay", run_command<replay_request>);
  m.def("samples", samples);
  py::class_<State>(m, "State")
      .def(py::init(&State::of))
      .def("bytes", &State::bytes)
      .def("merged", &State::merged)
      .def("with_pilot_of", &State::with_pilot_of)
      .def_property_readonly("first", [](const State& s) { return s.sums->first(); })
      .def_property_readonly("last", [](const State& s) { return s.sums->last(); })
      .def_property_readonly("contiguous", [](const State& s) { return s.sums->contiguous(); })
      .def_property_readonly("blocks_in_chunk", [](const State& s) { return s.sums->chunk() / s.sums->block(); });
  py::class_<Said>(m, "Said").def("data", &Said::data).def("texts", &Said::texts);
  m.def("run_kept", run_kept);
  m.def("normal_quantile", py::vectorize([](double u) { return normal_quantile(u); }));
  for (const auto& [name, topic] : {std::pair("problems", commands::Topic::problems),
                                    {"estimators", commands::Topic::estimators},
                                    {"pmfs", commands::Topic::pmfs}}) {
    m.def(name, [topic = topic] { return object_of(fields(commands::list({topic}))); });
  }

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
    return translated(
        [&] { return mean_problem(facts_of(facts), lookups_of(answer, size, 0x1p24), g, points, from, to); });
  });

  py::class_<StreamBlock>(m, "StreamBlock").def("__len__", &StreamBlock::size).def("uniforms", uniforms_of);
  m.def("coupled_chain",
        [](const py::dict& facts, const py::function& run, std::size_t components, const py::dict& options) {
          return translated([&] {
            return coupled_chain_problem(facts_of(facts), chain_blocks_of(run, components, chain_options_of(options)),
                                         components);
          });
        });
  m.def("sampler", [](const py::dict& facts, const py::function& run, std::size_t components, const std::string& name,
                      const std::string& description) {
    return translated([&] {
      return sampler_problem(facts_of(facts), chain_blocks_of(run, components, {}), components, name, description);
    });
  });
  m.def("advise_chains", advise_chains_as_objects);
  m.def("streams", [](std::uint64_t seed, std::uint64_t first, std::size_t n) {
    std::vector<Stream> streams;
    for (std::size_t i = 0; i < n; ++i) streams.emplace_back(seed, first + i);
    return StreamBlock(std::move(streams));
  });

  py::class_<Diagnostician>(m, "Diagnostician")
      .def(py::init<>())
      .def("add", &Diagnostician::add)
      .def("finish", &Diagnostician::finish);
}

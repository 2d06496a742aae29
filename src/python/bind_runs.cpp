// Commands on a problem: runs, those that are kept and go on, samples alone.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "binding.hpp"
#include "core/run_state_bytes.hpp"

namespace debias::python {
namespace {

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
  /// With what another one has spent before its run, too.
  [[nodiscard]] State with_pilot_of(const State& other) const { return with_pilot(other.sums->pilot); }
  /// With so many seconds of draws that count for nothing else. What their work was nobody knows: as much as that of a pilot
  /// in the same time, where there was one.
  [[nodiscard]] State with_lost_seconds(double seconds) const {
    const PilotRun& spent = sums->pilot;
    const double a_second = spent.seconds > 0 ? spent.work / spent.seconds : 0;
    PilotRun lost;
    lost.work = a_second * seconds;
    lost.seconds = seconds;
    return with_pilot(lost);
  }

 private:
  [[nodiscard]] State with_pilot(const PilotRun& more) const {
    RunState mine = *sums;
    mine.pilot += more;
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
  py::list doubts;
  for (const Warning& doubt : now.doubts) doubts.append(py::make_tuple(name_of(doubt.code), doubt.text));
  if (!now.doubts.empty()) d["doubts"] = doubts;
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

}  // namespace

void bind_runs(py::module_& m) {
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
      .def("with_lost_seconds", &State::with_lost_seconds)
      .def_property_readonly("seconds", [](const State& s) { return s.sums->seconds; })
      .def_property_readonly("pilot_seconds", [](const State& s) { return s.sums->pilot.seconds; })
      .def_property_readonly("first", [](const State& s) { return s.sums->first(); })
      .def_property_readonly("last", [](const State& s) { return s.sums->last(); })
      .def_property_readonly("contiguous", [](const State& s) { return s.sums->contiguous(); })
      .def_property_readonly("blocks_in_chunk", [](const State& s) { return s.sums->chunk() / s.sums->block(); });
  py::class_<Said>(m, "Said").def("data", &Said::data).def("texts", &Said::texts);
  m.def("run_kept", run_kept);
}

}  // namespace debias::python

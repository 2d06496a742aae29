// Coupled chains and samplers that Python runs.

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "chains.hpp"

namespace debias::python {
namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

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

}  // namespace

void bind_chains(py::module_& m) {
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
}

}  // namespace debias::python

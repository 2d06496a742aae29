#include "options.hpp"

#include <pybind11/stl.h>

#include <cmath>
#include <limits>
#include <utility>

#include "core/text.hpp"

namespace py = pybind11;

namespace debias::python {
namespace {

constexpr std::uint64_t most_index = std::numeric_limits<std::int64_t>::max();

// Takes a whole number where it is given.
template <class T>
void take(const Options& options, const char* name, T& x, std::uint64_t low, std::uint64_t high = most_index) {
  if (options.has(name)) x = static_cast<T>(options.whole(name, low, high));
}

void take_threads(const Options& options, int& threads) {
  take(options, "threads", threads, 0, static_cast<std::uint64_t>(commands::most_threads));
}

commands::Sampling sampling_of(const Options& options) {
  commands::Sampling s;
  if (options.has("samples")) take(options, "samples", s.samples.emplace(), 1);
  if (options.has("error")) s.goal.error = options.positive("error");
  if (options.has("relative_error")) s.goal.relative_error = options.positive("relative_error");
  if (options.has("seconds")) s.goal.seconds = options.seconds("seconds");
  s.seed = seed_of(options);
  take_threads(options, s.threads);
  return s;
}

}  // namespace

bool Options::is_number(const char* name) const {
  return py::isinstance<py::float_>(given_[name]) || py::isinstance<py::int_>(given_[name]);
}

// What is no number in range goes on as a text: the program's word for a number, or a complaint.

std::uint64_t Options::whole(const char* name, std::uint64_t low, std::uint64_t high) const {
  const py::object value = given_[name];
  if (py::isinstance<py::int_>(value)) {
    const unsigned long long n = PyLong_AsUnsignedLongLong(value.ptr());
    if (PyErr_Occurred() != nullptr) {
      PyErr_Clear();
    } else if (low <= n && n <= high) {
      return n;
    }
  } else if (py::isinstance<py::float_>(value)) {
    const auto x = value.cast<double>();
    const bool exact = x >= 0 && x < 0x1p63 && x == std::floor(x);
    if (exact && low <= static_cast<std::uint64_t>(x) && static_cast<std::uint64_t>(x) <= high) {
      return static_cast<std::uint64_t>(x);
    }
  }
  return parse_count(text(name), name, low, high);
}

double Options::positive(const char* name) const {
  if (is_number(name)) {
    const auto x = given_[name].cast<double>();
    if (x > 0 && std::isfinite(x)) return x;
  }
  return parse_positive(text(name), name);
}

double Options::seconds(const char* name) const {
  return is_number(name) ? positive(name) : parse_seconds(text(name), name);
}

double Options::share(const char* name) const {
  if (is_number(name)) {
    const auto x = given_[name].cast<double>();
    if (x > 0 && x < 1) return x;
  }
  return parse_share(text(name), name);
}

std::vector<Warning> Options::warnings(const char* name) const {
  std::vector<Warning> all;
  for (auto& [code, text] : given_[name].cast<std::vector<std::pair<std::string, std::string>>>()) {
    all.push_back({warning_named(code), std::move(text)});
  }
  return all;
}

// The points of a sweep are something else.
commands::Shape shape_of(const Options& options, bool with_points) {
  commands::Shape s;
  if (options.has("special")) s.estimator = commands::Estimator{.special = options.text("special")};
  if (options.has("estimator")) s.estimator = commands::estimator_of(options.text("estimator"));
  if (options.has("pmf")) s.pmf = commands::pmf_of(options.text("pmf"));
  if (options.has("base_level")) take(options, "base_level", s.base_level.emplace(), 0);
  take(options, "block", s.block, 1);
  if (with_points && options.has("points")) s.points = commands::points_of(options.text("points"));
  return s;
}

std::uint64_t seed_of(const Options& options) {
  return options.has("seed") ? options.whole("seed", 0, std::numeric_limits<std::uint64_t>::max()) : 1;
}

commands::RunRequest run_request(const catalog::Problem& problem, const Options& options) {
  commands::RunRequest r{.problem = &problem, .shape = shape_of(options), .sampling = sampling_of(options)};
  if (options.has("confidence")) r.confidence = options.share("confidence");
  if (options.has("served_error")) r.served.error = options.positive("served_error");
  if (options.has("served_relative_error")) r.served.relative_error = options.positive("served_relative_error");
  if (options.has("served_seconds")) r.served.seconds = options.positive("served_seconds");
  if (options.has("doubts")) r.doubts = options.warnings("doubts");
  return r;
}

commands::MultilevelRequest multilevel_request(const catalog::Problem& problem, const Options& options) {
  return commands::multilevel_of(run_request(problem, options));
}

commands::AdviseRequest advise_request(const catalog::Problem& problem, const Options& options) {
  return {.problem = &problem, .shape = shape_of(options), .sampling = sampling_of(options)};
}

commands::SurveyRequest survey_request(const catalog::Problem& problem, const Options& options) {
  commands::SurveyRequest r{.problem = &problem, .seed = seed_of(options)};
  take(options, "levels", r.levels, 2, static_cast<std::uint64_t>(commands::most_levels));
  take(options, "first", r.first, 0);
  take(options, "samples", r.samples, 1);
  take_threads(options, r.threads);
  return r;
}

commands::TradeoffRequest tradeoff_request(const catalog::Problem& problem, const Options& options) {
  commands::TradeoffRequest r{.problem = &problem, .shape = shape_of(options, false), .seed = seed_of(options)};
  if (options.has("family")) r.family = commands::family_of(options.text("family"));
  take(options, "points", r.points, 1, static_cast<std::uint64_t>(commands::most_points));
  take(options, "samples", r.samples, 1);
  take_threads(options, r.threads);
  return r;
}

commands::ReplayRequest replay_request(const catalog::Problem& problem, const Options& options) {
  commands::ReplayRequest r{.problem = &problem, .shape = shape_of(options), .seed = seed_of(options)};
  take(options, "sample", r.sample, 0);
  return r;
}

}  // namespace debias::python

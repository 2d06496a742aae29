#pragma once

// A run on disk: what it has so far, for another day, another process, or another machine like this one.
//
//   plan.save = [](const RunState& state, const Plan&) { save_run("run.checkpoint", state); };  // about once a second
//   auto result = extend(estimator, read_run("run.checkpoint"), {.samples = 2'000'000});        // later: the rest
//
// The result has the bits of one run. Parts of a run, [0, n) here and [n, 2 n) there (Plan::first), merge before that:
// `RunState both = read_run("a"); both.merge(read_run("b"));`.
// At any moment one whole file has the name: a save writes another one, and puts it in its place.
// Refused with a sentence: a file that is damaged, or cut short; one of another version of debias or of its streams, whose
// samples would be others; by `extend`, the run of another estimator. Equal estimators over different data look the same
// unless they have names (`named`). `debias resume` reads its own files only; read_run reads those of `debias run`, too.

#include <string>

#include <debias/core/run_state.hpp>

namespace debias {

/// Throws std::system_error where the disk refuses: a full one, a path that is no regular file.
void save_run(const std::string& path, const RunState& state);

/// Throws std::system_error where the file cannot be read, std::invalid_argument where it holds no run of this version.
RunState read_run(const std::string& path);

}  // namespace debias

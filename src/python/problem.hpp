#pragma once

// Problems of the user's own: Python functions in batches, as an entry of the catalogue that every command takes.

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <stdexcept>
#include <string>

#include <debias/core/rates.hpp>

#include "../catalog.hpp"
#include "lookups.hpp"

namespace debias::python {

/// What is known of a problem beside its functions.
struct Facts {
  std::string name;
  std::string formula;
  double truth = 0;  ///< NaN: not known
  Rates rates{};     ///< variance NaN: not known
  std::int64_t lowest_base = 0;
  std::int64_t deepest_level = deepest_of_all;  ///< that the user says can be drawn
  std::int64_t last_level =
      -1;               ///< with a difference of its own: deeper ones are zero, which is a bias; -1: all have one
  double rounding = 0;  ///< what it may do to the estimate of that level
};

struct UserProblem {
  catalog::Problem problem;
  /// Of functions that need no lock: the same, to run like a problem of the catalogue, on threads that may outlive this.
  std::shared_ptr<const catalog::Problem> compiled = {};
  /// Its look-ups belong to one run at a time.
  std::unique_ptr<std::mutex> in_use = std::make_unique<std::mutex>();
  std::size_t components = 1;
  /// What streams first, first + 1, ... give, a sample or the mean of a block each, with all its components.
  std::function<void(const catalog::Choice&, std::uint64_t seed, std::int64_t first, std::span<double> out)> samples;
};

/// With what is known of it, and no runs yet.
UserProblem problem_of(const Facts& facts);

/// The key of the look-ups for D_level beside a base made of the same draws; below 2^32 a key is a level.
/// Throws std::length_error for levels beyond.
inline std::int64_t shared_key(std::int64_t level, std::int64_t base_level) {
  if (std::max(level, base_level) >= (std::int64_t{1} << 30)) {
    throw std::length_error("shared: level " + std::to_string(level) + " (must lie below 2^30)");
  }
  return ((base_level + 1) << 32) + level;
}
inline std::int64_t level_of_key(std::int64_t key) { return key & 0xffffffff; }
inline std::int64_t base_of_key(std::int64_t key) { return (key >> 32) - 1; }

/// Levels: an answer is D_k, or I_k and D_k, of `components` numbers each (0: of a number that is no array). Where levels
/// share their base, an answer to shared_key(k, m) is I_m and D_k.
UserProblem levels_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, std::size_t components, bool shares);

/// Terms in order. A level asks for one term, each from a stream of its own; of a path for the terms 0 ... k from one.
UserProblem terms_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, bool path);

/// g of the mean of an integrand. Points: "independent" draws of uniforms in the unit cube; "comb" and "jittered"
/// on [from, to].
UserProblem mean_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, const std::string& g,
                         const std::string& points, double from, double to);

}  // namespace debias::python

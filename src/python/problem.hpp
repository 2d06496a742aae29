#pragma once

// Problems of the user's own: Python functions in batches, as an entry of the catalogue that every command takes.

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
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
};

struct UserProblem {
  catalog::Problem problem;
  /// Its look-ups belong to one run at a time.
  std::unique_ptr<std::mutex> in_use = std::make_unique<std::mutex>();
  std::size_t components = 1;
  /// What streams first, first + 1, ... give, a sample or the mean of a block each, with all its components.
  std::function<void(const catalog::Choice&, std::uint64_t seed, std::int64_t first, std::span<double> out)> samples;
};

/// With what is known of it, and no runs yet.
UserProblem problem_of(const Facts& facts);

/// Levels: an answer is D_k, or I_k and D_k, of `components` numbers each (0: of a number that is no array).
UserProblem levels_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, std::size_t components);

/// g of the mean of an integrand. Points: "independent" draws of uniforms in the unit cube; "comb" and "jittered"
/// on [from, to].
UserProblem mean_problem(const Facts& facts, std::shared_ptr<Lookups> lookups, const std::string& g,
                         const std::string& points, double from, double to);

}  // namespace debias::python

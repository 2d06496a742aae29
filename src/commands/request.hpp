#pragma once

// What requests are made of, and how one that cannot be done is refused. See README.md for the shape of this folder.

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <debias/core/result.hpp>
#include <debias/pmf/any.hpp>
#include <debias/recipe.hpp>

#include "catalog.hpp"

namespace debias::commands {

/// The name of a field of a request, within a message.
struct Field {
  std::string name;
};

/// A request that cannot be done: "problem (why) suggestion". what() names fields as they are called here.
class BadRequest : public std::invalid_argument {
 public:
  using Pieces = std::vector<std::variant<std::string, Field>>;
  explicit BadRequest(Pieces pieces);
  /// The message for people who write fields in another way: base_level as --base-level.
  [[nodiscard]] std::string spelled(const std::function<std::string(std::string_view field)>& spell) const;

 private:
  Pieces pieces_;
};

/// Sees what is being done and how much of how much (0: unknown); false ends it.
using Watch = std::function<bool(std::string_view what, double done, double total)>;

/// The largest numbers that fields take.
inline constexpr int most_threads = 1024;
inline constexpr std::int64_t most_points = 10'000;
inline constexpr std::int64_t most_levels = 1 << 16;

/// One of catalog::methods(), a special method of some problems, or what a recipe finds.
struct Estimator {
  catalog::Method method = catalog::Method::single_term;
  std::string special = {};  ///< its name: the method does not matter then
  bool recipe = false;       ///< a pilot chooses the single term, its PMF, base level and block: nor does it then
};
/// By its name. Throws std::invalid_argument, with the nearest one, for a name that no estimator has.
Estimator estimator_of(const std::string& name);
std::string name_of(const Estimator& estimator);

/// The PMF that the declared rates ask for.
struct Declared {};
using PmfChoice = std::variant<Declared, AnyPmf>;
/// From "declared" or the text of a PMF. Throws BadRequest.
PmfChoice pmf_of(const std::string& text);

/// What one sample is.
struct Shape {
  std::optional<Estimator> estimator = {};      ///< single_term
  PmfChoice pmf = Declared{};                   ///< of the random level
  std::optional<std::int64_t> base_level = {};  ///< the lowest that behaves
  std::int64_t block = 1;                       ///< samples of a block of systematic strata
  std::optional<Points> points = {};            ///< none: of a recipe, what it finds better; else plain

  [[nodiscard]] bool by_recipe() const { return estimator && estimator->recipe; }
};

/// "auto" (none), "nets" or "plain". Throws BadRequest.
std::optional<Points> points_of(const std::string& text);
std::string name_of(const std::optional<Points>& points);

/// The shape with nothing left open, for a problem. Throws BadRequest where its fields do not go together, and for a recipe.
catalog::Choice choice_of(const Shape& shape, const catalog::Problem& problem);
/// The same for a sweep over PMFs: single terms only, and no PMF.
catalog::Choice sweep_of(const Shape& shape, const catalog::Problem& problem);
/// What a shape leaves to a recipe: all but a base level, and single_term or single_term_outcome. Throws BadRequest.
RecipeOptions recipe_of(const Shape& shape, const catalog::Problem& problem);

/// What a pilot, a survey and multilevel draw. Throws BadRequest for a problem of whole samples, which has none.
const LevelRuns& levels_of(const catalog::Problem& problem);

/// How many samples, and which.
struct Sampling {
  std::optional<std::int64_t> samples = {};  ///< 1e6, or what the goal asks for
  Goal goal = {};
  std::uint64_t seed = 1;
  int threads = 0;   ///< 0: as many as the machine has
  Ranks ranks = {};  ///< processes that share the samples

  static constexpr std::int64_t usual = 1'000'000;
};
/// Throws BadRequest for two goals, or for a goal and samples.
Plan plan_of(const Sampling& sampling);
/// Throws BadRequest for a block that is asked for and holds more than all the samples, which would be rounded up to it.
void check_block(const Shape& shape, std::int64_t samples);

}  // namespace debias::commands

#include "request.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <type_traits>
#include <utility>

#include <debias/core/no_pmf.hpp>

#include "core/text.hpp"

namespace debias::commands {
namespace {

const Field estimator_field{"estimator"};
const Field pmf_field{"pmf"};
const Field block_field{"block"};
const Field samples_field{"samples"};
const Field points_field{"points"};
constexpr std::string_view recipe_name = "recipe";

std::string joined(const BadRequest::Pieces& pieces, const std::function<std::string(std::string_view)>& spell) {
  std::string text;
  for (const auto& piece : pieces) {
    const Field* field = std::get_if<Field>(&piece);
    text += field != nullptr ? spell(field->name) : std::get<std::string>(piece);
  }
  return text;
}

bool is_single_term(catalog::Method method) {
  return method == catalog::Method::single_term || method == catalog::Method::single_term_outcome;
}

// The method of a shape, if the problem has it.
catalog::Method method_of(const Shape& shape, const catalog::Problem& problem) {
  const Estimator wanted = shape.estimator.value_or(Estimator{});
  const bool has = std::find(problem.methods.begin(), problem.methods.end(), wanted.method) != problem.methods.end();
  if (wanted.special.empty() && has) return wanted.method;
  std::string names;
  for (const catalog::Method m : problem.methods) {
    names += (names.empty() ? "" : ", ") + std::string(catalog::name_of(m));
  }
  for (const catalog::Special& s : problem.specials) names += ", " + s.name;
  names += ", recipe, multilevel";
  throw BadRequest({estimator_field, " = '" + name_of(wanted) + "' (does not apply to " +
                                         (problem.id.empty() ? problem.name : problem.id) + "); it has " + names});
}

AnyPmf pmf_of(const PmfChoice& pmf, const catalog::Problem& problem, catalog::Method method) {
  if (const AnyPmf* given = std::get_if<AnyPmf>(&pmf)) return *given;
  try {
    return catalog::default_pmf(problem, method);
  } catch (const NoPmfError&) {  // no mistake of who asks
    throw;
  } catch (const std::invalid_argument& e) {
    throw BadRequest({pmf_field, std::string(" declared: ") + e.what()});
  }
}

std::int64_t block_of(const Shape& shape, catalog::Method method) {
  if (shape.block == 1 || is_single_term(method)) return shape.block;
  throw BadRequest({block_field, " = '" + std::to_string(shape.block) + "' (strata need a single term); leave it out"});
}

// The base level of a shape, where the problem can draw the first level of the PMF behind it.
std::optional<std::int64_t> base_of(const Shape& shape, const catalog::Problem& problem, catalog::Method method) {
  const std::int64_t deepest = problem.levels.draw ? problem.levels.deepest_level : deepest_of_all;
  const unsigned before = method == catalog::Method::single_term ? 1 : 0;
  if (!shape.base_level || *shape.base_level <= deepest - before) return shape.base_level;
  throw BadRequest({Field{"base_level"}, " = '" + std::to_string(*shape.base_level) + "' (levels are drawn from " +
                                             std::to_string(static_cast<std::uint64_t>(*shape.base_level) + before) +
                                             " on, and the deepest that can be drawn is " + std::to_string(deepest) +
                                             "); take a lower one"});
}

// The block that a method draws with the points that are asked for.
std::int64_t block_of(const Shape& shape, catalog::Method method, const AnyPmf& pmf) {
  if (shape.points != Points::nets) return block_of(shape, method);
  if (method != catalog::Method::single_term_outcome) {
    throw BadRequest({points_field,
                      " = 'nets' (a point has the numbers of one stream, and a sample of " +
                          std::string(catalog::name_of(method)) + " takes several); take ",
                      estimator_field, " single_term_outcome"});
  }
  const std::int64_t own = pmf.block();
  if (own > 0 && shape.block != 1 && shape.block != own) {
    throw BadRequest({block_field, " = '" + std::to_string(shape.block) + "' (" + pmf.spec() +
                                       " is made for blocks of " + std::to_string(own) + "); leave it out"});
  }
  if (own == 0 && shape.block == 1) {
    throw BadRequest({points_field,
                      " = 'nets' (there is no block whose members could be points of a net); take a PMF such as "
                      "dyadic:10,8,5;theta=1.25, or a ",
                      block_field});
  }
  return own > 0 ? own : shape.block;
}

}  // namespace

BadRequest::BadRequest(Pieces pieces)
    : std::invalid_argument(joined(pieces, [](std::string_view field) { return std::string(field); })),
      pieces_(std::move(pieces)) {}

std::string BadRequest::spelled(const std::function<std::string(std::string_view)>& spell) const {
  return joined(pieces_, spell);
}

Estimator estimator_of(const std::string& name) {
  if (name == recipe_name) return {.recipe = true};
  const auto& all = catalog::problems();
  const bool special = std::any_of(
      all.begin(), all.end(), [&name](const catalog::Problem& p) { return catalog::find_special(p, name) != nullptr; });
  if (special) return {.special = name};
  return {.method = catalog::method_of(name)};
}

std::string name_of(const Estimator& estimator) {
  if (estimator.recipe) return std::string(recipe_name);
  return estimator.special.empty() ? std::string(catalog::name_of(estimator.method)) : estimator.special;
}

PmfChoice pmf_of(const std::string& text) {
  if (text == "declared") return Declared{};
  try {
    return AnyPmf::parse(text);
  } catch (const std::invalid_argument& e) {
    throw BadRequest({pmf_field, std::string(": ") + e.what()});
  }
}

catalog::Choice choice_of(const Shape& shape, const catalog::Problem& problem) {
  const bool declared = std::holds_alternative<Declared>(shape.pmf);
  const std::string special = shape.estimator ? shape.estimator->special : "";
  if (catalog::find_special(problem, special) != nullptr) {
    if (!declared || shape.base_level || shape.block != 1 || shape.points == Points::nets) {
      throw BadRequest({estimator_field,
                        " = '" + special + "' (has no PMF, base level, block or points to choose); leave them out"});
    }
    return {catalog::Method::single_term, AnyPmf(Geometric(0.5)), problem.lowest_base, special};
  }
  if (shape.by_recipe()) {
    throw BadRequest(
        {estimator_field,
         " = 'recipe' (a pilot chooses it, and here the choice is asked for); give the estimator, PMF, base "
         "level and block that the run has printed"});
  }
  const catalog::Method method = method_of(shape, problem);
  const bool takes_pmf = method != catalog::Method::truncated;
  if (!takes_pmf && !declared) {
    throw BadRequest(
        {pmf_field, " = '" + std::get<AnyPmf>(shape.pmf).spec() + "' (truncated draws no level); leave it out"});
  }
  const AnyPmf pmf = takes_pmf ? pmf_of(shape.pmf, problem, method) : AnyPmf(Geometric(0.5));
  return {method,
          pmf,
          base_of(shape, problem, method).value_or(problem.lowest_base),
          "",
          block_of(shape, method, pmf),
          shape.points.value_or(Points::plain)};
}

std::optional<Points> points_of(const std::string& text) {
  if (text == "auto") return {};
  for (const Points points : {Points::nets, Points::plain}) {
    if (text == name_of(points)) return points;
  }
  constexpr std::array<std::string_view, 3> names = {"nets", "plain", "auto"};
  const std::string meant = suggestion(text, names);
  throw BadRequest({points_field, " = '" + text +
                                      "' (the members of a level are points of nets, or have plain numbers)" +
                                      (meant.empty() ? "; write nets, plain or auto" : meant)});
}

std::string name_of(const std::optional<Points>& points) { return points ? name_of(*points) : "auto"; }

catalog::Choice sweep_of(const Shape& shape, const catalog::Problem& problem) {
  const catalog::Method method = method_of(shape, problem);
  if (shape.by_recipe() || !is_single_term(method)) {
    throw BadRequest({estimator_field, " = '" + name_of(*shape.estimator) +
                                           "' (a sweep is for single_term and single_term_outcome); leave it out"});
  }
  return {method, AnyPmf(Geometric(0.5)), base_of(shape, problem, method).value_or(problem.lowest_base), "",
          block_of(shape, method)};
}

RecipeOptions recipe_of(const Shape& shape, const catalog::Problem& problem) {
  RecipeOptions options;
  options.lowest_base = problem.lowest_base;
  options.base_level = base_of(shape, problem, catalog::Method::single_term_outcome);
  options.points = shape.points;
  if (const AnyPmf* pmf = std::get_if<AnyPmf>(&shape.pmf)) {
    throw BadRequest({pmf_field, " = '" + pmf->spec() + "' (a recipe chooses it); leave it out"});
  }
  if (shape.block != 1) {
    throw BadRequest({block_field, " = '" + std::to_string(shape.block) + "' (a recipe chooses it); leave it out"});
  }
  if (!shape.estimator || shape.estimator->recipe) return options;
  if (catalog::find_special(problem, shape.estimator->special) != nullptr ||
      !is_single_term(method_of(shape, problem))) {
    throw BadRequest({estimator_field, " = '" + name_of(*shape.estimator) +
                                           "' (a recipe is for single_term and single_term_outcome); leave it out"});
  }
  options.base = shape.estimator->method == catalog::Method::single_term ? Base::every_sample : Base::one_outcome;
  if (options.base == Base::every_sample && shape.points == Points::nets) {
    throw BadRequest({points_field,
                      " = 'nets' (a point has the numbers of one stream, and a sample of single_term takes several); "
                      "take ",
                      estimator_field, " single_term_outcome"});
  }
  return options;
}

const LevelRuns& levels_of(const catalog::Problem& problem) {
  if (problem.levels.draw) return problem.levels;
  throw BadRequest({"'" + problem.name + "' (has no levels to draw one by one, only whole samples); run it without ",
                    estimator_field});
}

Plan plan_of(const Sampling& sampling) {
  const Goal& goal = sampling.goal;
  if ((goal.error > 0) + (goal.relative_error > 0) + (goal.seconds > 0) > 1) {
    throw BadRequest({Field{"error"}, ", ", Field{"relative_error"}, ", ", Field{"seconds"},
                      ": more than one (each fixes the samples); keep one"});
  }
  if (goal.asked() && sampling.samples) {
    throw BadRequest(
        {samples_field, " = '" + std::to_string(*sampling.samples) + "' (a goal fixes the samples); leave one out"});
  }
  Plan plan;
  plan.goal = goal;
  plan.samples = sampling.samples.value_or(Sampling::usual);
  plan.seed = sampling.seed;
  plan.threads = sampling.threads;
  plan.ranks = sampling.ranks;
  return plan;
}

void check_block(const Shape& shape, std::int64_t samples) {
  if (shape.block <= samples) return;
  throw BadRequest({block_field,
                    " = '" + std::to_string(shape.block) + "' (samples come in whole blocks, and are only " +
                        std::to_string(samples) + "); take a smaller one, or more ",
                    samples_field});
}

}  // namespace debias::commands

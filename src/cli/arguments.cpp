#include "arguments.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <stdexcept>
#include <string_view>

#include "../core/text.hpp"

namespace debias::cli {
namespace {

constexpr auto largest_index = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
constexpr std::uint64_t most_threads = 1024;
constexpr std::int64_t default_samples = 1'000'000;
constexpr std::uint64_t most_points = 10'000;
constexpr std::uint64_t most_levels = 1 << 16;

std::int64_t read_int64(const std::string& text, std::string_view name, std::uint64_t low) {
  return static_cast<std::int64_t>(parse_count(text, name, low, largest_index));
}

catalog::Method read_method(const std::string& text, const catalog::Problem& problem) {
  const auto& all = catalog::problems();
  const bool special = std::any_of(
      all.begin(), all.end(), [&text](const catalog::Problem& p) { return catalog::find_special(p, text) != nullptr; });
  const catalog::Method method = special ? catalog::Method::truncated : catalog::method_of(text);
  if (!special && std::find(problem.methods.begin(), problem.methods.end(), method) != problem.methods.end())
    return method;
  std::string names;
  for (const catalog::Method m : problem.methods) {
    names += (names.empty() ? "" : ", ") + std::string(catalog::name_of(m));
  }
  for (const catalog::Special& s : problem.specials) names += ", " + s.name;
  throw std::invalid_argument("--estimator = '" + text + "' (does not apply to " + problem.id + "); it has " + names);
}

AnyPmf read_law(const std::string& text, const catalog::Problem& problem, catalog::Method method) {
  try {
    return text == "declared" ? catalog::default_law(problem, method) : AnyPmf::parse(text);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument((text == "declared" ? "--law declared: " : "--law: ") + std::string(e.what()));
  }
}

bool is_single_term(catalog::Method method) {
  return method == catalog::Method::single_term || method == catalog::Method::single_term_drawn;
}

std::int64_t read_base_level(const Arguments& arguments, const catalog::Problem& problem) {
  return arguments.base_level == "auto" ? problem.lowest_base : read_int64(arguments.base_level, "--base-level", 0);
}

std::int64_t read_block(const Arguments& arguments, catalog::Method method) {
  const std::int64_t block = read_int64(arguments.block, "--block", 1);
  if (block == 1 || is_single_term(method)) return block;
  throw std::invalid_argument("--block = '" + arguments.block + "' (strata need a single term); leave it out");
}

Goal read_goal(const Arguments& arguments) {
  Goal goal;
  if (arguments.error != "none") goal.error = read_positive(arguments.error, "--error");
  if (arguments.relative_error != "none") {
    goal.relative_error = read_positive(arguments.relative_error, "--relative-error");
  }
  if (arguments.time != "none") goal.seconds = read_seconds(arguments.time, "--time");
  if ((goal.error > 0) + (goal.relative_error > 0) + (goal.seconds > 0) > 1) {
    throw std::invalid_argument("--error, --relative-error, --time: more than one (each fixes the samples); keep one");
  }
  return goal;
}

}  // namespace

catalog::Choice read_choice(const Arguments& arguments, const catalog::Problem& problem) {
  const std::string estimator = arguments.estimator.empty() ? "single_term" : arguments.estimator;
  if (catalog::find_special(problem, estimator) != nullptr) {
    if (arguments.law != "declared" || arguments.base_level != "auto" || arguments.block != "1") {
      throw std::invalid_argument("--estimator = '" + estimator +
                                  "' (has no law, base level or block to choose); leave them out");
    }
    return {catalog::Method::single_term, AnyPmf(Geometric(0.5)), problem.lowest_base, estimator};
  }
  const catalog::Method method = read_method(estimator, problem);
  const bool takes_law = method != catalog::Method::truncated;
  if (!takes_law && arguments.law != "declared") {
    throw std::invalid_argument("--law = '" + arguments.law + "' (truncated draws no level); leave it out");
  }
  return {method, takes_law ? read_law(arguments.law, problem, method) : AnyPmf(Geometric(0.5)),
          read_base_level(arguments, problem), "", read_block(arguments, method)};
}

catalog::Choice read_shape(const Arguments& arguments, const catalog::Problem& problem) {
  const catalog::Method method =
      read_method(arguments.estimator.empty() ? "single_term" : arguments.estimator, problem);
  if (!is_single_term(method)) {
    throw std::invalid_argument("--estimator = '" + arguments.estimator +
                                "' (a sweep is for single_term and single_term_drawn); leave it out");
  }
  return {method, AnyPmf(Geometric(0.5)), read_base_level(arguments, problem), "", read_block(arguments, method)};
}

bool wants_recipe(const Arguments& arguments) { return arguments.law == "auto"; }

RecipeOptions read_recipe(const Arguments& arguments, const catalog::Problem& problem) {
  RecipeOptions options;
  options.lowest_base = problem.lowest_base;
  if (arguments.base_level != "auto") options.base_level = read_int64(arguments.base_level, "--base-level", 0);
  if (arguments.block != "1") {
    throw std::invalid_argument("--block = '" + arguments.block + "' (--law auto chooses it); leave it out");
  }
  if (arguments.estimator.empty()) return options;
  if (catalog::find_special(problem, arguments.estimator) != nullptr ||
      !is_single_term(read_method(arguments.estimator, problem))) {
    throw std::invalid_argument("--law auto: '" + arguments.estimator +
                                "' (a recipe is for single_term and single_term_drawn); leave --estimator out");
  }
  options.base = read_method(arguments.estimator, problem) == catalog::Method::single_term ? Base::always : Base::drawn;
  return options;
}

Plan read_plan(const Arguments& arguments) {
  Plan plan;
  plan.goal = read_goal(arguments);
  if (plan.goal.asked() && arguments.samples != "auto") {
    throw std::invalid_argument("--samples = '" + arguments.samples + "' (a goal fixes the samples); leave one out");
  }
  plan.samples = arguments.samples == "auto" ? default_samples : read_int64(arguments.samples, "--samples", 1);
  plan.seed = read_seed_or_random(arguments.seed);
  plan.threads = read_threads(arguments.threads);
  plan.ranks = arguments.ranks;
  return plan;
}

Plan read_validation_plan(const Arguments& arguments) {
  Plan plan = read_plan(arguments);
  if (plan.samples > 1) return plan;
  throw std::invalid_argument("--samples = '1' (has no standard error); did you mean '1e5'?");
}

std::uint64_t read_seed_or_random(const std::string& text) {
  static constexpr std::array<std::string_view, 1> words = {"random"};
  if (text == words[0]) {
    std::random_device device;
    const std::uint64_t high = device();
    const std::uint64_t low = device();
    return high << 32 | low;
  }
  const std::string meant = suggestion(text, words);
  if (!meant.empty()) throw std::invalid_argument("--seed = '" + text + "' (not a number)" + meant);
  return read_seed(text);
}

int read_threads(const std::string& text) { return static_cast<int>(parse_count(text, "--threads", 0, most_threads)); }

double read_positive(const std::string& text, const char* name) {
  const double x = parse_double(text, name);
  if (x > 0) return x;
  throw std::invalid_argument(std::string(name) + " = '" + text + "' (must be positive)");
}

double read_seconds(const std::string& text, const char* name) {
  const bool unit = !text.empty() && text.back() == 's';
  return read_positive(unit ? text.substr(0, text.size() - 1) : text, name);
}

std::uint64_t read_seed(const std::string& text) {
  return parse_count(text, "--seed", 0, std::numeric_limits<std::uint64_t>::max());
}

std::int64_t read_levels(const std::string& text) {
  return static_cast<std::int64_t>(parse_count(text, "--levels", 2, most_levels));
}

std::int64_t read_points(const std::string& text) {
  return static_cast<std::int64_t>(parse_count(text, "--points", 1, most_points));
}

std::int64_t read_sample(const std::string& text) { return read_int64(text, "--sample", 0); }

double read_confidence(const std::string& text) {
  const double x = parse_double(text, "--confidence");
  if (x > 0 && x < 1) return x;
  const double meant = x >= 1 && x < 100 ? x / 100 : 0.95;
  throw std::invalid_argument("--confidence = '" + text + "' (must lie in (0, 1)); did you mean '" + to_text(meant) +
                              "'?");
}

}  // namespace debias::cli

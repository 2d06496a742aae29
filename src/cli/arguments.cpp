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

std::int64_t read_int64(const std::string& text, std::string_view name, std::uint64_t low) {
  return static_cast<std::int64_t>(parse_count(text, name, low, largest_index));
}

catalog::Method read_method(const std::string& text, const catalog::Problem& problem) {
  const auto& all = catalog::problems();
  const bool special = std::any_of(all.begin(), all.end(), [&text](const catalog::Problem& p) {
    return catalog::find_special(p, text) != nullptr;
  });
  const catalog::Method method = special ? catalog::Method::truncated : catalog::method_of(text);
  if (!special && std::find(problem.methods.begin(), problem.methods.end(), method) != problem.methods.end())
    return method;
  std::string names;
  for (const catalog::Method m : problem.methods) {
    names += (names.empty() ? "" : ", ") + std::string(catalog::name_of(m));
  }
  for (const catalog::Special& s : problem.specials) names += ", " + s.name;
  throw std::invalid_argument("--estimator = '" + text + "' (does not apply to " + problem.id + "); it has " +
                              names);
}

AnyPmf read_law(const std::string& text, const catalog::Problem& problem, catalog::Method method) {
  try {
    return text == "auto" ? catalog::default_law(problem, method) : AnyPmf::parse(text);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument((text == "auto" ? "--law auto: " : "--law: ") + std::string(e.what()));
  }
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

}  // namespace

catalog::Choice read_choice(const Arguments& arguments, const catalog::Problem& problem) {
  if (catalog::find_special(problem, arguments.estimator) != nullptr) {
    if (arguments.law != "auto" || arguments.base_level != "auto") {
      throw std::invalid_argument("--estimator = '" + arguments.estimator +
                                  "' (has no law and no base level to choose); leave --law and --base-level out");
    }
    return {catalog::Method::single_term, AnyPmf(Geometric(0.5)), problem.lowest_base, arguments.estimator};
  }
  const catalog::Method method = read_method(arguments.estimator, problem);
  const bool takes_law = method != catalog::Method::truncated;
  if (!takes_law && arguments.law != "auto") {
    throw std::invalid_argument("--law = '" + arguments.law + "' (truncated draws no level); leave it out");
  }
  const std::int64_t base_level = arguments.base_level == "auto"
                                      ? problem.lowest_base
                                      : read_int64(arguments.base_level, "--base-level", 0);
  return {method, takes_law ? read_law(arguments.law, problem, method) : AnyPmf(Geometric(0.5)), base_level};
}

Plan read_plan(const Arguments& arguments) {
  Plan plan;
  plan.samples = read_int64(arguments.samples, "--samples", 1);
  plan.seed = read_seed_or_random(arguments.seed);
  plan.threads = static_cast<int>(parse_count(arguments.threads, "--threads", 0, most_threads));
  return plan;
}

std::uint64_t read_seed(const std::string& text) {
  return parse_count(text, "--seed", 0, std::numeric_limits<std::uint64_t>::max());
}

std::int64_t read_sample(const std::string& text) { return read_int64(text, "--sample", 0); }

double read_confidence(const std::string& text) {
  const double x = parse_double(text, "--confidence");
  if (x > 0 && x < 1) return x;
  const double meant = x >= 1 && x < 100 ? x / 100 : 0.95;
  throw std::invalid_argument("--confidence = '" + text + "' (must lie in (0, 1)); did you mean '" +
                              to_text(meant) + "'?");
}

}  // namespace debias::cli

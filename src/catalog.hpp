#pragma once

// The catalogue: problems with a closed-form answer, each a sequence of biased estimates with declared rates.
//
// One explicit table (catalog.cpp), one function per problem (catalog/<group>.cpp). The type of a sequence is
// erased here, once a run: the sample loops behind `run` are compiled for the sequence itself.
// Ids and values: catalogue of closed forms, groups A (functions of a mean), B (functions of an integral),
// C (finite differences), D (series), E (stochastic differential equations), F (nested expectations),
// H (steady states), I (functions of an integral over a cube), K (chains that meet),
// M (deterministic limits, and matrices of known determinant).

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <debias/core/accumulator.hpp>
#include <debias/core/estimate.hpp>
#include <debias/core/rates.hpp>
#include <debias/core/result.hpp>
#include <debias/estimators/stratified.hpp>
#include <debias/pmf/any.hpp>
#include <debias/survey/levels.hpp>

namespace debias::catalog {

enum class Method { single_term, single_term_outcome, independent_sum, roulette, truncated };

/// single_term, single_term_outcome, ... as the command line spells them.
std::string_view name_of(Method method);
std::string_view describe(Method method);
/// Throws std::invalid_argument, with the nearest name, for a word that is no estimator.
Method method_of(std::string_view name);
const std::vector<Method>& methods();

/// A method that some problems have for themselves, without a PMF or a level to choose: p_series_cumulative.
struct Special {
  std::string name;
  std::string description;
  double kurtosis = 0;      ///< of a sample, where it is known: how many samples see the answer
  std::string reason = {};  ///< what that kurtosis comes from
};

/// One way to run a problem.
struct Choice {
  Method method = Method::single_term;
  AnyPmf pmf = AnyPmf(Geometric(0.5));  ///< not used by Method::truncated
  std::int64_t base_level = 0;
  std::string special = {};  ///< the name of a special method: the rest does not matter then
  std::int64_t block = 1;  ///< samples of a systematically stratified block; of a Dyadic PMF with nets, residual strata
  Points points = Points::plain;
};

/// The method, or the special one.
std::string_view name_of(const Choice& choice);

struct Problem {
  std::string id;      ///< A10
  std::string name;    ///< square-of-mean
  std::string module;  ///< the header that the sequence comes from
  double truth = 0;
  std::string formula;  ///< the estimand and its exact value, in words or symbols
  Rates rates{};
  std::int64_t lowest_base = 0;  ///< below it a level has no finite fourth moment
  std::optional<AnyPmf> pmf;     ///< where the rates alone would choose badly
  std::int64_t sample_cost = 1;  ///< validation draws that many times fewer samples

  std::vector<Method> methods;
  std::vector<Special> specials;
  std::function<Statistics(const Choice&, const Plan&)> run;
  std::function<Trace<double>(const Choice&, std::uint64_t seed, std::int64_t index)> trace;
  /// Sums of D_level over `draws` draws of the pilot streams of `seed`.
  std::function<LevelSums(std::int64_t level, std::int64_t draws, std::uint64_t seed)> pilot;
  LevelRuns levels;  ///< for a survey, a recipe, or multilevel
};

/// The rates that count for a method: a sum pays for all levels up to its last one.
Rates rates_of(const Problem& problem, Method method);

/// The PMF of the problem, or the one that its declared rates ask for.
/// Throws NoPmfError where no PMF has finite variance and finite work.
AnyPmf default_pmf(const Problem& problem, Method method = Method::single_term);

/// All problems, in the order of their ids.
const std::vector<Problem>& problems();

/// The special method of that name; null when the problem has none.
const Special* find_special(const Problem& problem, std::string_view name);

/// The special methods of all problems, each once.
std::vector<Special> specials();

/// By id or name; throws std::invalid_argument, with the nearest name, when there is none.
const Problem& find(std::string_view id_or_name);

}  // namespace debias::catalog

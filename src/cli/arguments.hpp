#pragma once

// The command line as it was typed, and the one way to read it: strict, and never through the conversions of
// CLI11, which take nan for a positive number, -1 for 2^64 - 1 and 010 for 8.

#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/estimate.hpp>
#include <debias/recipe.hpp>

#include "../catalog.hpp"

namespace debias::cli {

/// The words of one command; each command reads those that it has.
struct Arguments {
  std::string topic = "problems";
  std::string problem;
  std::vector<std::string> problems;
  std::string estimator;
  std::string law = "declared";
  std::string base_level = "auto";
  std::string block = "1";
  std::string samples = "auto";
  std::string error = "none";
  std::string relative_error = "none";
  std::string time = "none";
  std::string levels;
  std::string family = "geometric";
  std::string points = "15";
  std::string sample;
  std::string seed = "1";
  std::string threads = "0";
  std::string confidence = "0.95";
  std::string output;
  std::string checkpoint;
  std::string shard;
  std::string spp = "64";
  std::string equal_time = "none";
  std::string size = "512x512";
  std::string volume;
  std::string dimensions;
  std::string density = "8";
  std::string exposure = "1";
  std::string photons = "4e6";
  std::string scene = "sphere";
  std::string file;
  std::string column;
  std::string format = "auto";
  std::string separator = "auto";
  std::string decimal = ".";
  bool header = false;
  bool no_header = false;
  bool strict = false;
  bool json = false;
  bool csv = false;
  bool compare = false;
  bool hard = false;
  bool report = false;
  bool allow_infinite_mean = false;
  bool quiet = false;
  debias::detail::Ranks* ranks = nullptr;  ///< that mpirun started, for run and resume
  const struct Loaded* resumed = nullptr;  ///< not typed: what `resume` has read from `checkpoint`
};

// All of these throw std::invalid_argument that names the argument, what is wrong with it and a near miss.

/// The estimator, law, base level and block for a problem. The law `declared` is the one that its declared rates ask
/// for; `auto` is none yet, see read_recipe.
catalog::Choice read_choice(const Arguments& arguments, const catalog::Problem& problem);

/// The same for a sweep over laws: single terms only, and no law.
catalog::Choice read_shape(const Arguments& arguments, const catalog::Problem& problem);

/// What the words leave to a recipe: `--law auto`.
bool wants_recipe(const Arguments& arguments);
RecipeOptions read_recipe(const Arguments& arguments, const catalog::Problem& problem);

/// Samples or a goal, seed and threads. The seed `random` is drawn here; every result names the seed that it used.
Plan read_plan(const Arguments& arguments);

/// The same, for cells that are judged: two samples at least.
Plan read_validation_plan(const Arguments& arguments);

std::int64_t read_levels(const std::string& text);
std::int64_t read_points(const std::string& text);
std::uint64_t read_seed(const std::string& text);
std::uint64_t read_seed_or_random(const std::string& text);
int read_threads(const std::string& text);
double read_positive(const std::string& text, const char* name);
/// "10s" or "10".
double read_seconds(const std::string& text, const char* name);
std::int64_t read_sample(const std::string& text);
double read_confidence(const std::string& text);

}  // namespace debias::cli

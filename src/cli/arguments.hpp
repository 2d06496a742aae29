#pragma once

// The command line as it was typed, and the one way to read it: strict, and never through the conversions of
// CLI11, which take nan for a positive number, -1 for 2^64 - 1 and 010 for 8.

#include <cstdint>
#include <string>
#include <vector>

#include <debias/core/estimate.hpp>

#include "../catalog.hpp"

namespace debias::cli {

/// The words of one command; each command reads those that it has.
struct Arguments {
  std::string topic = "problems";
  std::string problem;
  std::vector<std::string> problems;
  std::string estimator = "single_term";
  std::string law = "auto";
  std::string base_level = "auto";
  std::string samples;
  std::string sample;
  std::string seed = "1";
  std::string threads = "0";
  std::string confidence = "0.95";
  std::string output;
  bool json = false;
  bool quiet = false;
};

// All of these throw std::invalid_argument that names the argument, what is wrong with it and a near miss.

/// The estimator, law and base level for a problem. The law `auto` is the one that its rates ask for.
catalog::Choice read_choice(const Arguments& arguments, const catalog::Problem& problem);

/// Samples, seed and threads. The seed `random` is drawn here; every result names the seed that it used.
Plan read_plan(const Arguments& arguments);

std::uint64_t read_seed(const std::string& text);
std::int64_t read_sample(const std::string& text);
double read_confidence(const std::string& text);

}  // namespace debias::cli
